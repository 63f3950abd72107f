"""The notebooks of examples/ run from top to bottom, and are stored without their outputs."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.ipynb"))
SIZE = "SIZE = 192"
"""The line of each notebook that sets the working size; the test takes fewer pixels."""
PICTURES = {
    "edit_a_photo": ("green.png",),
    "relight_and_insert": ("sunny.png", "ball.png", "both.png"),
}


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return request.param


def code_cells(path):
    book = json.loads(path.read_text("utf-8"))
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def test_outputs_are_stripped(notebook):
    for cell in code_cells(notebook):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None


@pytest.mark.slow
def test_notebook_runs(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = "\n".join("".join(cell["source"]) for cell in code_cells(notebook))
    assert SIZE in source
    exec(compile(source.replace(SIZE, "SIZE = 96"), notebook.name, "exec"), {})
    photo = None
    for name in PICTURES[notebook.stem]:
        picture = np.asarray(Image.open(tmp_path / "out" / name), np.float32)
        # Each step changes the photo, and each in its own way.
        assert picture.shape == (400, 600, 3)
        assert photo is None or np.abs(picture - photo).max() > 20
        photo = picture
