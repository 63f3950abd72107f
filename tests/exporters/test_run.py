"""The public function and the command."""

import pytest
from export_scenes import document, room

import materialist as mt
from materialist.io.exr import read_exr
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


def test_light_scale_and_colour_are_said_in_the_file_and_beside_it(tmp_path):
    notes = " ".join(mt.export(room(), tmp_path / "a.glb", residual=False).notes)
    assert "-90 degrees about Z" in notes and "no metre" in notes and "Standard" in notes
    extras = document(room())["extras"]
    assert "-90 degrees about Z" in extras["light"] and "Standard" in extras["colour"]
    folder = mt.export(room(), tmp_path / "m", to="mitsuba", residual=False).path.parent
    for name in ("scene.xml", "scene_materialist.xml"):
        assert "<!-- A unit is no metre" in (folder / name).read_text()


def test_the_residual_is_carried_unless_it_is_not_asked_for(tmp_path):
    """The photo of the room is darker than its light makes it."""
    means = {}
    for carried in (True, False):
        done = mt.export(room(), tmp_path / f"{carried}", to="mitsuba", residual=carried)
        means[carried] = read_exr(done.path.with_name("surface_albedo.exr")).mean()
        assert any("residual=False" in note for note in done.notes) == carried
    assert abs(means[True] - means[False]) > 0.02
    assert means[False] == pytest.approx(room().materials.albedo.mean())


def test_what_exists_is_refused_before_the_work(tmp_path, monkeypatch):
    from materialist.exporters import run

    monkeypatch.setattr(run, "with_residual", lambda _: pytest.fail("the work was begun"))
    (tmp_path / "a.glb").touch()
    (tmp_path / "m").mkdir()
    for name, to in (("a.glb", "glb"), ("m", "mitsuba")):
        with pytest.raises(mt.OutputError):
            mt.export(room(), tmp_path / name, to=to)
