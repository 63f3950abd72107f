"""A box to put into scenes."""

import pytest
from made_meshes import box_file

from materialist.edits.insert.meshes import read_model


@pytest.fixture(scope="session")
def box_path(tmp_path_factory):
    return box_file(tmp_path_factory.mktemp("mesh") / "box.ply")


@pytest.fixture(scope="session")
def box(box_path):
    return read_model(box_path)
