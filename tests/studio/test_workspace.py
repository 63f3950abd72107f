"""The work folder: names of ours, people apart, nothing lost."""

import pytest

from materialist.studio.workspace import CARD, WorkFolder


def test_a_project_survives_a_restart(tmp_path):
    work = WorkFolder(tmp_path / "work")
    first = work.new("Kitchen.JPG", "me")
    again = WorkFolder(tmp_path / "work").projects()[0]
    assert again == first and again.folder.name == "photo-001" and again.title == "Kitchen.JPG"
    assert not again.ready
    again.scene.mkdir()
    (again.scene / "scene.json").write_text("{}")
    assert again.ready


@pytest.mark.parametrize("title", ["../../etc/passwd", "/abs", "a\0b\n\n<script>", "CON", "x" * 500, ""])
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


def test_a_damaged_card_hides_its_project_alone(tmp_path):
    work = WorkFolder(tmp_path)
    broken, good = work.new("a", "me"), work.new("b", "me")
    (broken.folder / CARD).write_text("{")
    assert [p.name for p in work.projects()] == [good.name]
