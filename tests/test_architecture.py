"""The import table of docs/architecture.md, modules without circles, and the modules that load heavy libraries."""

import ast
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = {
    "materialist": ROOT / "src" / "materialist",
    "materialist_lab": ROOT / "lab" / "src" / "materialist_lab",
}
"""The product and the laboratory, whose packages are called `lab.NAME` below."""

BASE_MODULES = {
    "types",
    "errors",
    "color",
    "camera",
    "envmap",
    "metrics",
    "buffers",
    "forks",
    "threads",
    "memory",
    "install",
    "records",
    "residual",
    "stopping",
}
BASE_MODULES |= {"option_kinds", "options", "keywords", "plain", "spelling"}
SCENE = {"io", "bsdf", "geometry", "transport", "render"}
KINDS = ("select", "material", "light", "remove", "glass", "insert", "drop", "core", "composite")
EDITING = {"edits", *(f"edits.{kind}" for kind in KINDS)}
MAY_IMPORT: dict[str, set[str]] = {
    "io": set(),
    "bsdf": set(),
    "geometry": set(),
    "solids": {"geometry"},
    "transport": {"bsdf", "geometry"},
    "render": {"bsdf", "geometry", "transport"},
    "predict": {"io", "geometry", "solids"},
    "fit": {"io", "bsdf", "geometry", "transport", "render"},
    "edits.core": SCENE,
    "edits.select": SCENE | {"edits.core", "predict"},
    "edits.material": SCENE | {"edits.core", "solids"},
    "edits.composite": SCENE | {"edits.core"},
    "edits.light": SCENE | {"edits.core", "edits.composite"},
    "edits.remove": SCENE | {"edits.core", "edits.composite", "edits.select", "predict"},
    "edits.glass": SCENE | {"edits.core", "edits.composite", "edits.remove", "predict", "solids"},
    "edits.insert": SCENE | {"edits.core", "edits.composite"},
    "edits.drop": SCENE | {"edits.core", "edits.insert"},
    "edits": SCENE | EDITING | {"fit"},
    "exporters": SCENE | {"edits.core"},
    "pipeline": SCENE | {"predict", "fit", "edits.core"},
    "jobs": set(),
    "batches": SCENE | EDITING | {"jobs", "pipeline", "predict"},
    "studio": SCENE | EDITING | {"exporters", "jobs", "pipeline"},
    "darkroom": {
        "io",
        "edits",
        "edits.core",
        "edits.light",
        "edits.remove",
        "edits.select",
        "jobs",
        "studio",
    },
    "doctor": {"predict", "render"},
    "cli": SCENE
    | EDITING
    | {
        "batches",
        "darkroom",
        "doctor",
        "exporters",
        "pipeline",
        "predict",
        "studio",
    },
    "__main__": {"cli"},
    "lab": set(),
    "lab.data": {"io"},
    "lab.metrics": set(),
    "lab.procedural": SCENE | {"predict", "lab.data"},
    "lab.train": {"io", "render", "predict", "lab.data", "lab.metrics", "lab.procedural"},
    "lab.bench": SCENE
    | EDITING
    | {"batches", "exporters", "fit", "pipeline", "predict", "solids"}
    | {"lab.data", "lab.metrics", "lab.procedural"},
    "lab.cli": {"cli", "io", "predict", "lab.bench", "lab.data", "lab.procedural", "lab.train"},
}
"""Package -> the packages it may import beside the base modules; docs/architecture.md has the same table."""

HEAVY = {"torch", "mitsuba", "drjit"}
MAY_BE_HEAVY = ("bsdf", "render", "transport", "fit")
MAY_BE_HEAVY += ("lab.train", "lab.procedural", "lab.bench")
NETWORKS = tuple(
    f"predict.{name}"
    for name in (
        "bundled.",
        "matnet.",
        "refraction.",
        "clicks.",
        "efficientnet",
        "network",
        "patches",
    )
)
"""Networks need torch at their top; whoever calls them imports them late."""
LIGHT_START = (
    *(
        "",
        "types",
        "errors",
        "records",
        "color",
        "camera",
        "option_kinds",
        "options",
        "keywords",
        "spelling",
        "plain",
        "cli",
        "lab",
        "lab.cli",
    ),
)
"""Modules that load at every start and so may import nothing slow at the top."""
SLOW = HEAVY | {
    "cv2",
    "OpenEXR",
    "scipy",
    "skimage",
    "matplotlib",
    "PIL",
    "rawpy",
    "pillow_heif",
    "transformers",
}


@cache
def _trees() -> dict[str, ast.Module]:
    """Short name of a module (see `_short`) -> its syntax tree."""
    trees = {}
    for distribution, folder in SOURCES.items():
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            name = ".".join([distribution, *(part for part in parts if part != "__init__")])
            trees[_short(name)] = ast.parse(path.read_text("utf-8"))
    return trees


def _short(name: str) -> str:
    """`io.exr` for `materialist.io.exr`, and `lab.train.maps` for `materialist_lab.train.maps`."""
    distribution, _, rest = name.partition(".")
    if distribution == "materialist_lab":
        return f"lab.{rest}".rstrip(".")
    return rest


def _imports(tree: ast.AST, top_only: bool = False) -> Iterator[str]:
    """Full names of imported modules; `top_only` leaves out functions and TYPE_CHECKING blocks."""
    for node in ast.iter_child_nodes(tree):
        if top_only and (
            isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or _is_type_checking(node)
        ):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif not isinstance(node, ast.expr):  # no import is in an expression
            yield from _imports(node, top_only)


def _is_type_checking(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


@cache
def _arrows() -> dict[str, set[str]]:
    """Module -> the modules of this project that it imports, anywhere in its text."""
    modules = _trees()

    def home(name: str) -> str:
        while name not in modules:
            name = name.rpartition(".")[0]
        return name

    return {
        module: {home(_short(name)) for name in _imports(tree) if name.split(".")[0] in SOURCES}
        for module, tree in modules.items()
    }


def _package(module: str) -> str:
    parts = module.split(".")
    return ".".join(parts[:2]) if ".".join(parts[:2]) in MAY_IMPORT else parts[0]


def _refuse_circles(arrows: dict[str, set[str]]) -> None:
    """Raise CycleError, which names the modules, where some import each other."""
    TopologicalSorter({module: targets - {module} for module, targets in arrows.items()}).prepare()


def test_every_package_imports_only_what_its_row_allows():
    for module, targets in _arrows().items():
        here = _package(module)
        if not here:
            continue  # the public names
        assert here in BASE_MODULES or here in MAY_IMPORT, f"{module} has no row in MAY_IMPORT"
        for there in map(_package, targets):
            if there and there != here and there not in BASE_MODULES | MAY_IMPORT.get(here, set()):
                raise AssertionError(f"{module} imports {there}, which its row does not allow")


def test_the_product_does_not_know_the_laboratory():
    """Its commands come through entry points, so that the product is whole without it."""
    for path in SOURCES["materialist"].rglob("*.py"):
        assert "materialist_lab" not in path.read_text("utf-8"), path


def test_the_page_has_the_same_table():
    groups = {"scene packages": SCENE, "all edits": EDITING, "base modules only": set()}
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    table = page.partition("| package | imports |\n|---|---|\n")[2].partition("\n\n")[0]
    shown = {}
    for row in table.splitlines():
        left, right = (cell.split(", ") for cell in row.strip("| ").split(" | "))
        targets = set().union(*(groups.get(name, {name}) for name in right))
        shown |= {package: targets - {package} for package in left}
    without_rows = {"__main__", "lab"}
    expected = {
        package: targets - {package}
        for package, targets in MAY_IMPORT.items()
        if package not in without_rows
    }
    assert shown == expected


def test_the_table_itself_has_no_circle():
    _refuse_circles(MAY_IMPORT)


def test_no_modules_import_each_other_in_a_circle():
    """Late imports and imports for type checking count too; the public names of `materialist` do not."""
    _refuse_circles({module: targets - {""} for module, targets in _arrows().items() if module})


def test_heavy_libraries_load_late():
    for module, tree in _trees().items():
        roots = {name.split(".")[0] for name in _imports(tree, top_only=True)}
        package = _package(module)
        if package in LIGHT_START:
            assert not roots & SLOW, f"{module} imports {roots & SLOW} at every start"
        elif package not in MAY_BE_HEAVY and not module.startswith(NETWORKS):
            assert not roots & HEAVY, (
                f"{module} imports {roots & HEAVY} at its top; only {MAY_BE_HEAVY} may"
            )


def test_no_torchvision():
    for module, tree in _trees().items():
        assert "torchvision" not in {name.split(".")[0] for name in _imports(tree)}, module


def test_files_and_style_of_the_tree():
    files = [path for folder in SOURCES.values() for path in folder.rglob("*.py")]
    for path in files:
        assert len(path.read_text("utf-8").splitlines()) <= 450, f"{path} is too long"
        assert path.name != "utils.py"
    for folder, count in Counter(path.parent for path in files).items():
        assert count <= 25, f"{folder} holds too many files to keep in mind"
    for module, tree in _trees().items():
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        assert not any(isinstance(c.func, ast.Name) and c.func.id == "print" for c in calls), (
            f"{module} prints"
        )


def test_a_class_name_exists_once():
    homes: dict[str, list[str]] = {}
    for module, tree in _trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(module)
    assert not {name: found for name, found in homes.items() if len(found) > 1}
