"""The import arrows of the design, and the modules that may load the heavy libraries."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "materialist"

LAYER = {
    **dict.fromkeys(("types", "errors", "color", "camera", "envmap", "metrics", "plain"), 0),
    **dict.fromkeys(("io", "predict", "geometry", "transport", "render"), 1),
    **dict.fromkeys(("fit", "edit", "export"), 2),
    "pipeline": 3,
    "doctor": 3,
    **dict.fromkeys(("__main__", "cli", "studio", "batch", "bench", "train"), 4),
}
"""Package or module -> layer; an import may go to the same or a lower one."""

PEERS_THAT_MEET = {("io", "render"), ("cli", "bench")}
"""Pairs of the same layer that may not touch, left to right (io must not need the renderer)."""

HEAVY = {"torch", "mitsuba", "drjit"}
MAY_BE_HEAVY = ("render", "transport", "fit", "train")
NETWORKS = (
    "predict.bundled.",
    "predict.matnet.",
    "predict.refraction.",
    "predict.clicks.",
    "predict.unet",
    "predict.lite",
)
"""Packages of networks: their own modules need torch at the top; whoever calls them imports them late."""
LIGHT_START = ("", "types", "errors", "color", "camera", "plain", "cli")
"""Modules that load at every start and so may import nothing slow at the top."""
SLOW = HEAVY | {"cv2", "OpenEXR", "scipy", "skimage", "matplotlib", "PIL", "rawpy", "pillow_heif", "transformers"}


def _modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        yield ".".join(part for part in parts if part != "__init__"), path


def _imports(tree: ast.AST, top_only: bool = False) -> Iterator[str]:
    """Full names of imported modules; `top_only` leaves out functions and TYPE_CHECKING blocks."""
    for node in ast.iter_child_nodes(tree):
        if top_only and (isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or _is_type_checking(node)):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        else:
            yield from _imports(node, top_only)


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _backward(module: str, imported: str) -> bool:
    """Whether `module` of this package may not import `imported` (dotted names without the package)."""
    here, there = module.split(".")[0], imported.split(".")[0]
    if not here or here not in LAYER or there not in LAYER:
        return False
    return LAYER[there] > LAYER[here] or (here, there) in PEERS_THAT_MEET


MODULES = list(_modules())


@pytest.mark.parametrize(("module", "path"), MODULES, ids=[module or "__init__" for module, _ in MODULES])
def test_imports_run_one_way(module, path):
    tree = ast.parse(path.read_text("utf-8"))
    ours = [name.removeprefix("materialist.") for name in _imports(tree) if name.startswith("materialist.")]
    lazy_dispatch = {("cli.bench", "bench")}
    wrong = [name for name in ours if _backward(module, name) and (module, name) not in lazy_dispatch]
    assert not wrong, f"{module} imports {wrong}, which lie above or beside it"
    if module:
        assert module.split(".")[0] in LAYER, f"{module} has no layer; add it to LAYER"


@pytest.mark.parametrize(("module", "path"), MODULES, ids=[module or "__init__" for module, _ in MODULES])
def test_heavy_libraries_load_late(module, path):
    roots = {name.split(".")[0] for name in _imports(ast.parse(path.read_text("utf-8")), top_only=True)}
    package = module.split(".")[0]
    if package in LIGHT_START:
        assert not roots & SLOW, f"{module} imports {roots & SLOW} at every start"
    elif package not in MAY_BE_HEAVY and not module.startswith(NETWORKS):
        assert not roots & HEAVY, f"{module} imports {roots & HEAVY} at its top; only {MAY_BE_HEAVY} may"


def test_no_torchvision():
    for module, path in MODULES:
        assert "torchvision" not in path.read_text("utf-8"), module


def test_files_and_style_of_the_tree():
    for module, path in MODULES:
        text = path.read_text("utf-8")
        assert len(text.splitlines()) <= 400, f"{module} is too long"
        assert path.name != "utils.py"
        calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
        assert not any(isinstance(c.func, ast.Name) and c.func.id == "print" for c in calls), f"{module} prints"


@pytest.mark.parametrize(
    ("module", "imported", "backward"),
    [
        ("types", "io.photo", True),
        ("geometry.build", "fit.loop", True),
        ("io.package", "render.scene", True),
        ("fit.loop", "pipeline", True),
        ("bench.light", "pipeline.invert", False),
        ("fit.loop", "render.trace", False),
        ("cli.bench", "io.exr", False),
    ],
)
def test_the_rule_itself(module, imported, backward):
    assert _backward(module, imported) is backward
