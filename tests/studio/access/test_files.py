"""The files that requests may name."""

import pytest

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio.access.files import HandedFiles
from materialist.studio.edit_list import EditList
from materialist.studio.stage import commands


def test_a_file_is_an_id_for_its_owner_alone(tmp_path):
    files = HandedFiles()
    photo = tmp_path / "a.png"
    photo.write_bytes(b"the photo of somebody else")
    name = files.add("anna", photo)
    assert name.startswith("upload-") and "/" not in name
    assert files.path("anna", name) == photo
    for person, given in (("bert", name), ("anna", str(photo)), ("anna", None), ("anna", ["x"])):
        with pytest.raises(InputError, match="not here any more"):
            files.path(person, given)
    photo.unlink()
    with pytest.raises(InputError, match="not here any more"):
        files.path("anna", name)
    files.forget_missing()
    assert not files._files


def test_the_cookie_of_a_person_is_not_on_the_page(shared):
    cookie = "0123456789abcdef" * 2
    person = shared.person(cookie)
    session = shared.page("page", person).session
    session.project = shared.work.new("One", person)
    session.edits = EditList((Step("edit", {"hue": "3"}),))
    assert person in commands(session) and cookie not in commands(session)
    with pytest.raises(InputError):
        shared.person(person)  # what the page shows lets nobody in
