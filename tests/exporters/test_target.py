"""Whole or not at all, and nothing replaced that is no export."""

import pytest

from materialist.errors import OutputError
from materialist.exporters.target import MARKER, whole_files, whole_folder


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_files_appear_together(tmp_path):
    paths = [tmp_path / "a.glb", tmp_path / "a.hdr"]
    with whole_files(paths) as temporaries:
        for temporary in temporaries:
            temporary.write_text("x")
        assert not any(path.exists() for path in paths)
        assert [path.suffix for path in temporaries] == [".glb", ".hdr"]
    assert names(tmp_path) == ["a.glb", "a.hdr"]


@pytest.mark.parametrize("failure", [RuntimeError("broken"), KeyboardInterrupt()])
def test_a_failure_leaves_nothing_and_keeps_the_old(tmp_path, failure):
    old = tmp_path / "a.glb"
    old.write_text("old")
    with pytest.raises(type(failure)), whole_files([old, tmp_path / "a.hdr"], force=True) as temporaries:
        temporaries[0].write_text("half")
        raise failure
    assert names(tmp_path) == ["a.glb"] and old.read_text() == "old"
    with pytest.raises(type(failure)), whole_folder(tmp_path / "f") as folder:
        (folder / "half").touch()
        raise failure
    assert names(tmp_path) == ["a.glb"]


def test_existing_files_need_force(tmp_path):
    (tmp_path / "a.hdr").write_text("mine")
    paths = [tmp_path / "a.glb", tmp_path / "a.hdr"]
    with pytest.raises(OutputError, match=r"a\.hdr exists; give --force"), whole_files(paths):
        pass
    assert names(tmp_path) == ["a.hdr"]


def test_a_folder_is_replaced_only_where_it_is_an_export(tmp_path):
    target = tmp_path / "out"
    for text in ("one", "two"):
        with whole_folder(target, force=text == "two", format="usd") as folder:
            (folder / text).touch()
    assert names(target) == [MARKER, "two"] and names(tmp_path) == ["out"]
    with pytest.raises(OutputError, match="exists"), whole_folder(target):
        pass
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").touch()
    with pytest.raises(OutputError, match="is no export"), whole_folder(mine, force=True):
        pass
    (target / "work").mkdir()
    (target / "work" / "comp.nk").touch()
    with (
        pytest.raises(OutputError, match=r"holds work/comp\.nk, which no export wrote"),
        whole_folder(target, force=True),
    ):
        pass
    assert names(target) == [MARKER, "two", "work"]
    (target / "work" / "comp.nk").unlink()
    (target / ".DS_Store").touch()
    with whole_folder(target, force=True, format="usd"):
        pass
    (target / MARKER).write_text("{}")
    with pytest.raises(OutputError, match="did not list its files"), whole_folder(target, force=True):
        pass
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(OutputError, match="is not a folder"), whole_folder(tmp_path / "link", force=True):
        pass
    with pytest.raises(OutputError, match="is not a file"), whole_files([target], force=True):
        pass
    assert names(mine) == ["thesis.txt"]


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"), whole_files([tmp_path / "file" / "a.glb"]):
        pass
