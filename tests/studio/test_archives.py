"""What is taken away, and lists of edits with their files loaded on the same photo or another."""

import threading
import zipfile

import numpy as np
import pytest
from studio_scenes import block, click, package, zipped

from materialist.edits.recipe import Step, apply, read_recipe
from materialist.errors import InputError, OutputError
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.studio import StudioSettings, objects, tasks, uploads
from materialist.studio.access.quota import Allowance
from materialist.studio.archives import pack_edits, unpack
from materialist.studio.edit_list import EditList
from materialist.studio.objects import library_file
from materialist.studio.session import Session

pytestmark = pytest.mark.usefixtures("opens_here")


@pytest.fixture
def packed(session, tmp_path):
    """A session with edits that name files of each kind, and the zip of them."""
    write_png(tmp_path / "wood.png", np.full((32, 32, 3), 90, np.uint8))
    write_exr(tmp_path / "sky.exr", np.ones((32, 64, 3), np.float32))
    click(session)

    def upload(name, option, use):
        uploads.used(session.workspace, tmp_path / name, option, Allowance(), use)

    upload("wood.png", "texture", lambda name: session.set("edit", texture=name, roughness="0.3"))
    upload("sky.exr", "envmap", lambda name: session.light(envmap=name, gain="auto"))
    objects.set_object_option(session, "mesh", library_file(session, "Cube"))
    objects.place(session, 50, 40)
    session.edits = session.edits.add(
        Step("drop", {"mesh": ["thing-cube.ply"], "at": ["9", "9"], "skip": "true"})
    )
    session.save()
    pack_edits(session.edits.steps, session.workspace / "edits.yaml", tmp_path / "edits.zip")
    return session, tmp_path / "edits.zip"


def test_results_are_whole_files(tmp_path):
    def told(stage, done, total):
        return None

    scene = package(tmp_path)
    (tmp_path / "edits.yaml").write_text("- edit: {box: [12, 12, 40, 36], hue: 40}\n")
    tasks.take(
        told,
        str(scene),
        tuple(read_recipe(tmp_path / "edits.yaml")),
        str(tmp_path / "a.zip"),
        "glb",
    )
    tasks.take(told, str(scene), (), str(tmp_path / "a.html"), "html")
    tasks.mesh(told, str(scene), str(tmp_path / "a.glb"))
    names = zipfile.ZipFile(tmp_path / "a.zip").namelist()
    assert "a/scene.glb" in names and "a/scene.light.hdr" in names
    assert (tmp_path / "a.html").stat().st_size > 10_000 and (tmp_path / "a.glb").read_bytes()[
        :4
    ] == b"glTF"
    assert not list(tmp_path.glob(".partial*"))


def other_photo(studio, session) -> Session:
    """Another photo of the same shape, without edits."""
    other = Session("me")
    other.open(studio.work.new("Another", "me", scene=session.project.scene))
    return other


def test_what_was_taken_away_comes_back_on_another_photo(studio, packed):
    session, file = packed
    with zipfile.ZipFile(file) as made:
        assert (
            len(made.namelist()) == 5
        )  # the list, a mask, a texture, a light, a mesh: also one in a list of meshes
    other = other_photo(studio, session)
    other.read_edits(file)
    assert [step.kind for step in other.edits.steps] == ["edit", "relight", "insert", "drop"]
    ours, theirs = (apply(page.scene, list(page.edits.steps)) for page in (session, other))
    assert (
        np.array_equal(ours.materials.albedo, theirs.materials.albedo) and len(theirs.bodies) == 1
    )
    assert not list(other.workspace.glob("thing-*")) and not list(other.workspace.glob(".load-*"))
    assert len({*other.workspace.iterdir()} - {other.workspace / "history.json"}) == 5
    other.read_edits(file)  # again: the same files
    assert len({*other.workspace.iterdir()} - {other.workspace / "history.json"}) == 5
    other.close()
    options = [step.options for step in session.edits.steps]
    session.read_edits(file)  # where the files are still there
    assert [step.options for step in session.edits.steps] == options


def test_a_list_of_another_photo_does_not_take_this_one_s_files(studio, session, tmp_path):
    other = other_photo(studio, session)
    for page, at in ((session, (25, 24)), (other, (50, 40))):
        click(page, *at)
        page.set("edit", hue="40")
    masks = [page.edits.steps[0].options["mask"] for page in (session, other)]
    assert masks[0] != masks[1]
    before = other.edits
    with pytest.raises(InputError, match="is not here; load the zip"):
        other.read_edits(session.workspace / "edits.yaml")
    assert other.edits == before
    other.close()


LIST = "- edit: {mask: m.png, hue: 3}"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("- edit: {mask: /etc/hostname, hue: 3}", "plain file name"),
        ("- edit: {mask: ../x.png}", "plain file name"),
        ("- edit: {mask: nothere.png}", "not here"),
        ("- edit: {colour: red}", "says 'colour'"),
        ("- explode: {}", "must be one of"),
        ("!!python/object/apply:os.system ['true']", "must be one of"),
        ("- relight: {envmap: /etc/hostname}", "plain file name"),
        ("- drop: {mesh: [a.ply], at: [3, 4]}", "not here"),
        ("- drop: {mesh: [../a.ply], at: [3, 4]}", "plain file name"),
        ("- drop: {mesh: [[a.ply]], at: [3, 4]}", "plain file name"),
        ({"readme.txt": "x"}, "holds no edits.yaml"),
        ({"edits.yaml": LIST}, "lacks the file m.png"),
        ({"edits.yaml": "- edit: {mask: ../m.png}", "../m.png": "x"}, "plain file name"),
        ({"edits.yaml": "- edit: {mask: /etc/hostname}"}, "plain file name"),
        ({"edits.yaml": LIST, "m.png": "no picture"}, "not an image"),
        ({"edits.yaml": LIST, "a/m.png": "x"}, "lacks the file"),
        ({"edits.yaml": LIST, "m.png": "x" * 3_000_000}, "takes up to 2 MB"),
        ({"edits.yaml": "- drop: {mesh: [a.exe], at: [1, 2]}", "a.exe": "MZ"}, "not a mesh"),
        ({"edits.yaml": "- explode: {}"}, "must be one of"),
        ({"edits.yaml": LIST + " " * 1_000_000}, "edits.yaml in a.zip is larger than 1 MB"),
    ],
)
def test_lists_and_zips_that_are_refused_leave_nothing(
    studio, session, tmp_path, monkeypatch, given, words
):
    monkeypatch.setattr(uploads, "SETTINGS", StudioSettings(upload_megabytes=2))
    file = tmp_path / "edits.yaml"
    before = sorted(session.workspace.iterdir())
    if isinstance(given, dict):
        file = zipped(tmp_path / "a.zip", given)
    else:
        file.write_text(given)
    with pytest.raises(InputError, match=words) as error:
        session.read_edits(file)
    assert (
        str(tmp_path) not in studio.without_folders(str(error.value)) and session.edits.steps == ()
    )
    assert sorted(session.workspace.iterdir()) == before


def test_other_requests_go_on_while_a_list_is_opened(session, tmp_path, monkeypatch):
    opened_upload = uploads.opened_upload
    selected = []

    def opened(*given, **arguments):
        other = threading.Thread(target=session.deselect, daemon=True)
        other.start()
        other.join(5)
        selected.append(not other.is_alive())
        return opened_upload(*given, **arguments)

    monkeypatch.setattr(uploads, "opened_upload", opened)
    (tmp_path / "edits.yaml").write_text("- relight: {rotate: 45}\n")
    session.read_edits(tmp_path / "edits.yaml")
    session.read_edits(zipped(tmp_path / "a.zip", {"edits.yaml": "- relight: {rotate: 4}\n"}))
    assert selected == [True, True] and session.edits.steps[0].options == {"rotate": "4"}


def test_a_zip_is_unpacked_beside_the_upload(session, tmp_path, monkeypatch):
    """There a studio that is killed leaves nothing: uploads go when it starts again."""
    places = []

    def opened(*given, folder, **arguments):
        places.append(folder)
        raise InputError("no list")

    monkeypatch.setattr(uploads, "opened_upload", opened)
    with pytest.raises(InputError, match="no list"):
        session.read_edits(zipped(tmp_path / "a.zip", {}))
    assert places[0].parent == tmp_path and not places[0].exists()


def test_a_zip_that_has_no_room_is_refused_in_words(session, tmp_path, monkeypatch):
    def full(**given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryDirectory", full)
    with pytest.raises(OutputError, match="no space left"):
        session.read_edits(zipped(tmp_path / "a.zip", {}))


def test_only_what_the_list_names_is_unpacked_from_a_folder_in_the_zip(tmp_path):
    write_png(tmp_path / "m.png", block().astype(np.uint8) * 255)
    members = {
        "room/edits.yaml": LIST,
        "room/m.png": (tmp_path / "m.png").read_bytes(),
        "room/x.py": "x",
        "../e": "x",
    }
    desk = tmp_path / "desk"
    desk.mkdir()
    (step,) = unpack(desk, zipped(tmp_path / "a.zip", members), Allowance())
    assert [file.name for file in desk.iterdir()] == [step.options["mask"]] and step.folder == desk
    assert not (tmp_path / "e").exists() and EditList((step,)).active
