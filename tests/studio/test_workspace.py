"""The work folder: names of ours, people apart, nothing lost."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from materialist.errors import InputError, OutputError
from materialist.studio.workspace import CARD, LAST, WorkFolder, person_of


def test_a_project_survives_a_restart(tmp_path):
    work = WorkFolder(tmp_path / "work")
    first = work.new("Kitchen.JPG", "me")
    again = WorkFolder(tmp_path / "work").projects()[0]
    assert again == first and again.folder.name == "photo-001" and again.title == "Kitchen.JPG"
    assert not again.ready
    again.scene.mkdir()
    (again.scene / "scene.json").write_text("{}")
    assert again.ready


@pytest.mark.parametrize(
    "title", ["../../etc/passwd", "/abs", "a\0b\n\n<script>", "CON", "x" * 500, ""]
)
def test_a_title_is_never_a_path(tmp_path, title):
    work = WorkFolder(tmp_path / "work")
    project = work.new(title, "me")
    assert project.folder.parent == work.root and project.folder.name == "photo-001"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["work"]
    shown = work.projects()[0].title
    assert shown and len(shown) <= 60 and not set("<>\n\0") & set(shown)


@pytest.mark.parametrize(
    ("title", "stem"),
    [
        ("My kitchen.JPG", "My-kitchen"),
        ("Example: coffee", "coffee"),
        ("../../etc/passwd", "etc-passwd"),
        ("..", "photo"),
    ],
)
def test_downloads_carry_the_name_of_the_photo(tmp_path, title, stem):
    assert WorkFolder(tmp_path).new(title, "me").stem == stem


@pytest.mark.parametrize("card", ["{", "[" * 100_000])
def test_a_damaged_card_hides_its_project_alone(tmp_path, card):
    work = WorkFolder(tmp_path)
    broken = work.new("a", "me")
    good = work.new("b", "me")
    (broken.folder / CARD).write_text(card)
    (tmp_path / LAST).write_text(card)
    assert [p.name for p in work.projects()] == [good.name]
    assert work.read_last() == {}


def test_a_scene_whose_name_is_too_long_is_not_ready(tmp_path):
    project = WorkFolder(tmp_path).new("a", "me")
    assert not replace(project, scene=project.folder / ("x" * 5000)).ready


def test_a_photo_that_is_discarded_does_not_come_back(tmp_path):
    work = WorkFolder(tmp_path)
    project = work.new("a", "me")
    work.discard(project)
    with pytest.raises(OutputError, match="edits-me cannot be written"):
        project.workspace("me")
    with pytest.raises(InputError, match="no longer in the work folder"):
        work.rename(project, "b")
    assert not project.folder.exists()


def test_the_newest_photo_is_first_and_no_folder_is_two_studios(tmp_path, monkeypatch):
    one = WorkFolder(tmp_path)
    other = WorkFolder(tmp_path)
    for number in (999, 1000):
        monkeypatch.setattr(
            "materialist.studio.workspace.count", lambda _, number=number: iter([number])
        )
        one.new("a", "me")
    assert [project.name for project in one.projects()] == ["photo-1000", "photo-999"]
    monkeypatch.setattr("materialist.studio.workspace.count", lambda _: iter([999, 1000, 1001]))
    assert other.new("b", "me").name == "photo-1001"


def test_old_copies_go_and_fresh_ones_stay(tmp_path):
    work = WorkFolder(tmp_path)
    for name in ("old", "fresh"):
        (work.cache / name).mkdir()
    (work.cache / "old.png").touch()
    for name in ("old", "old.png"):
        os.utime(work.cache / name, (0, 0))
    work.sweep()
    left = {place.name for place in work.cache.iterdir()}
    assert left - {"cache-of-a-studio"} == {"fresh"}


def test_a_number_is_given_once_and_only_the_photo_itself_is_dropped(tmp_path):
    """An inversion that ends late must not remove the folder of a photo that came after it."""
    work = WorkFolder(tmp_path)
    first = work.new("a", "anna")
    work.drop(first)
    second = work.new("b", "bert")
    assert not first.folder.exists() and second.name == "photo-002"
    # Another studio on the same folder may give the number again.
    again = WorkFolder(tmp_path)
    again.drop(second)
    third = again.new("c", "cara")
    work.drop(replace(third, owner="bert", title="b"))
    assert third.folder.is_dir()


def test_the_cache_of_a_killed_studio_is_swept_and_that_of_another_stays(tmp_path):
    """A killed process cleans nothing up; its lock ends with it."""
    script = f"""if True:
        import os, signal
        from materialist.studio.workspace import WorkFolder
        work = WorkFolder({str(tmp_path)!r})
        (work.cache / "upload.png").write_bytes(b"x")
        os.kill(os.getpid(), signal.SIGKILL)
    """
    assert subprocess.run([sys.executable, "-c", script]).returncode == -9
    assert len(list(tmp_path.glob("materialist-cache-*/upload.png"))) == 1
    first = WorkFolder(tmp_path)
    assert list(tmp_path.glob("materialist-cache-*")) == [first.cache]
    second = WorkFolder(tmp_path)
    assert first.cache.is_dir() and second.cache.is_dir()


def test_folders_that_were_called_after_a_cookie_are_renamed(tmp_path):
    cookie = "a1" * 16
    work = WorkFolder(tmp_path)
    project = work.new("Anna's", cookie)
    edits = project.folder / f"edits-{cookie}"
    edits.mkdir()
    (edits / "edits.yaml").write_text("kept")
    person = person_of(cookie)
    (again,) = WorkFolder(tmp_path).projects(person)
    assert again.name == project.name
    assert (again.workspace(person) / "edits.yaml").read_text() == "kept"
    assert cookie not in "".join(str(path) for path in tmp_path.rglob("*"))
    assert WorkFolder(tmp_path).projects(person) == [again]  # once
