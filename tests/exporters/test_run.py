"""The public function and the command."""

import pytest
from export_scenes import room

import materialist as mt
from materialist.io.package import save_scene


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "room"
    save_scene(room(), path)
    return path


@pytest.mark.parametrize(
    ("name", "to", "message"),
    [
        ("room", None, "does not say its format"),
        ("room.obj", None, "does not say its format"),
        ("room.glb", "stl", "format is 'stl'"),
        ("room.html", "glb", r"does not fit the format glb; give NAME\.glb"),
        ("room", "html", r"give NAME\.html"),
        ("room.usda", "usd", r"give NAME\.usdz or a folder name"),
        ("room.xml", "mitsuba", "give a folder name"),
    ],
)
def test_formats(tmp_path, name, to, message):
    with pytest.raises(mt.InputError, match=message):
        mt.export(room(), tmp_path / name, to=to)
    assert list(tmp_path.iterdir()) == []


def test_only_an_earlier_export_is_replaced(tmp_path):
    target = tmp_path / "out"
    mt.export(room(), target, to="mitsuba")
    with pytest.raises(mt.OutputError, match="give `force=True`"):
        mt.export(room(), target, to="usd")
    (target / "work").mkdir()
    (target / "work" / "comp.nk").touch()
    with pytest.raises(
        mt.OutputError, match=r"holds work/comp\.nk, which does not belong to an export"
    ):
        mt.export(room(), target, to="blend", force=True)
    (target / "work" / "comp.nk").unlink()
    (target / ".DS_Store").touch()
    mt.export(room(), target, to="blend", force=True)
    assert (target / "build.py").is_file() and not (target / "scene.xml").exists()
    (target / "materialist-export.json").unlink()
    with pytest.raises(mt.OutputError, match="is not an export"):
        mt.export(room(), target, to="blend", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_command(done, refused, package, tmp_path):
    target = tmp_path / "room.glb"
    arguments = ["export", package, "--to", "glb", "-o", target]
    told = done(*arguments)
    assert told["output"] == str(target) and told["beside"] == [str(tmp_path / "room.light.hdr")]
    before = target.read_bytes()
    assert "give --force" in refused(*arguments) and target.read_bytes() == before
    done(*arguments, "--force", "--max-triangles", 1000)
    assert len(target.read_bytes()) < len(before) / 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["room.glb", "room.light.hdr"]
    html = ("export", package, "--to", "html", "-o", tmp_path / "a.html", "--shadow-catcher")
    assert "options for Blender" in refused(*html) and not (tmp_path / "a.html").exists()
