"""A box to put into scenes, and holes that are filled once."""

import pytest
from made_meshes import box_file

from materialist.edits.insert.meshes import read_model
from materialist.edits.remove.filling import remembered


@pytest.fixture(scope="session")
def box_path(tmp_path_factory):
    return box_file(tmp_path_factory.mktemp("mesh") / "box.ply")


@pytest.fixture(scope="session")
def box(box_path):
    return read_model(box_path)


@pytest.fixture(scope="session")
def _filled(tmp_path_factory):
    return tmp_path_factory.mktemp("filled")


@pytest.fixture(scope="module")
def filled_once(_filled):
    """Equal holes of a file's tests are filled once: the network takes seconds, and tests of removal try it."""
    with remembered(_filled):
        yield
