"""The pages name what exists: commands and options, functions, tests, files."""

import ast
import re
import shlex
from functools import cache
from pathlib import Path

import pytest
from typer.main import get_command

from materialist.cli import app

ROOT = Path(__file__).resolve().parents[1]
SOURCES = (ROOT / "src" / "materialist", ROOT / "lab" / "src" / "materialist_lab")
TESTS = (ROOT / "tests", ROOT / "lab" / "tests")
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "lab/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
PAPER_MAP = ROOT / "docs" / "paper_map.md"
PROGRAM = get_command(app)
FOREIGN = {
    "--factory-startup",
    "--python",
    "--python-exit-code",
    "--render",
    "--maps",
    "--no-install-recommends",
    "--index-url",
}
"""Options of Blender, the script for it, MoGe, apt-get and pip that the pages name."""


@pytest.fixture(params=PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def page(request):
    return request.param


@pytest.fixture
def text(page):
    return page.read_text("utf-8")


# Commands


def _code_lines(text):
    """Lines of fenced and of indented code."""
    fenced = False
    for line in text.splitlines():
        if line.startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith("    "):
            yield line.strip()


def _commands(text):
    """(words after `materialist`, whether the command stands in a block and so is whole) of every command line."""
    blocks = [line for line in _code_lines(text) if line.startswith("materialist ")]
    spans = re.findall(r"`(materialist [^`]+)`", text)
    for line in (*blocks, *spans):
        words = shlex.split(line.replace("[", " ").replace("]", " "), comments=True)[1:]
        whole = line in blocks and "..." not in words
        yield ["1" if word == "N" else word for word in words if word != "..."], whole


def _parsed(words, whole):
    """The command line as the program takes it apart, without running it; every one of a|b|c."""
    several = next((k for k, word in enumerate(words) if "|" in word), None)
    if several is not None:
        for choice in words[several].split("|"):
            _parsed([*words[:several], choice, *words[several + 1 :]], whole)
        return
    command = PROGRAM
    name = "materialist"
    while hasattr(command, "list_commands") and words and words[0] != "--help":
        assert words[0] in command.list_commands(None), f"there is no command {name} {words[0]}"
        command = command.get_command(None, words[0])
        name = f"{name} {words[0]}"
        words = words[1:]
    if hasattr(command, "list_commands"):
        return
    try:
        command.make_context(name, list(words))
    except Exception as error:
        if type(error).__name__ == "Exit" or (
            not whole and type(error).__name__ == "MissingParameter"
        ):  # --help
            return
        raise AssertionError(f"{name} {' '.join(words)}: {error}") from error


def test_every_command_line_parses(text):
    for words, whole in _commands(text):
        if words[0].startswith("--"):  # an option of the program itself
            assert words[0] in _options()
        else:
            _parsed(words, whole)


@cache
def _options():
    """Every option of every command, those of the benchmarks included."""
    found = {"--help"}
    waiting = [PROGRAM]
    while waiting:
        command = waiting.pop()
        found.update(
            name
            for parameter in command.params
            for name in (*parameter.opts, *parameter.secondary_opts)
        )
        if hasattr(command, "list_commands"):
            names = command.list_commands(None)
            waiting.extend(command.get_command(None, name) for name in names)
    return found


def test_every_option_in_the_text_exists(text):
    named = set(re.findall(r"(?<![\w-])--[a-z][\w-]+", text))
    assert not named - _options() - FOREIGN


# Functions and tests


@cache
def _names(module):
    """Names a module defines, and of its classes as Class.name; empty where there is no such module."""
    names = set()
    for source in SOURCES:
        path = source / Path(*module.split("."))
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path.is_file():
            names.update(_defined(ast.parse(path.read_text("utf-8"))))
    return frozenset(names)


def _defined(node, inside=""):
    for item in node.body:
        if isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield inside + item.name
            if isinstance(item, ast.ClassDef):
                yield from _defined(item, f"{inside}{item.name}.")
        for target in getattr(item, "targets", [getattr(item, "target", None)]):
            if isinstance(target, ast.Name):
                yield inside + target.id
        if isinstance(item, ast.ImportFrom):
            yield from (inside + (alias.asname or alias.name) for alias in item.names)


def _place(name):
    """Module of a dotted name, or None where nothing is called so: `fit.loop`, `fit.loop.Schedule.keep_best`."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        paths = [source / Path(*parts[:count]) for source in SOURCES]
        if any(path.is_dir() or path.with_suffix(".py").is_file() for path in paths):
            rest = ".".join(parts[count:])
            return module if not rest or rest in _names(module) else None
    return None


def _rows(text):
    """Cells of the table rows: what of the paper, function, test, deviation."""
    for line in text.splitlines():
        if line.startswith("|") and not line.startswith(("|---", "| paper ")):
            yield [cell.strip() for cell in line.strip("|").split(" | ")]


def test_paper_map_names_functions_that_exist():
    everything = {
        name
        for source in SOURCES
        for path in source.rglob("*.py")
        for name in _defined(ast.parse(path.read_text("utf-8")))
    }
    missing = []
    for _, functions, *_ in _rows(PAPER_MAP.read_text("utf-8")):
        here = ""
        for name in re.findall(r"`([A-Za-z_][\w.]*)(?:\([^`]*\))?`", functions):
            # A name without a module is one of the module just named, or of a module beside it.
            around = (
                [f"{here.rsplit('.', k)[0]}.{name}" if k else f"{here}.{name}" for k in (0, 1)]
                if here
                else []
            )
            found = next((place for place in map(_place, (name, *around)) if place), None)
            here = found or here
            if not found and name not in everything:
                missing.append(name)
    assert not missing


def test_pages_name_functions_that_exist(text):
    ours = {path.stem for source in SOURCES for path in source.iterdir()}
    dotted = re.findall(r"`(?:materialist(?:_lab)?\.)?([a-z_]+(?:\.\w+)+)(?:\([^`]*\))?`", text)
    files = (".py", ".jsonl", ".txt", ".exr", ".yaml")
    assert not [
        n for n in dotted if n.split(".")[0] in ours and not n.endswith(files) and not _place(n)
    ]


def test_paper_map_names_tests_that_exist():
    missing = []
    for _, _, tests, *_ in _rows(PAPER_MAP.read_text("utf-8")):
        folder = Path()
        for name in re.findall(r"`([\w/.:]*test_[\w/.:]*)`", tests):
            file, _, function = name.partition("::")
            places = [tests / part for tests in TESTS for part in (file, folder / file)]
            path = next((place for place in places if place.is_file()), None)
            if path is None or (
                function and function not in _defined(ast.parse(path.read_text("utf-8")))
            ):
                missing.append(name)
            folder = Path(file).parent if "/" in file else folder
    assert not missing


# Links


def test_links_lead_to_files(page, text):
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)(?:#[^)]*)?\)", text)
    assert not [target for target in targets if not (page.parent / target).exists()]
