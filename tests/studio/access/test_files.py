"""No request names a file of the server: neither on the whole page, nor in any shape that Gradio knows."""

import json

import pytest

pytest.importorskip("gradio", reason="needs gradio")
from starlette.testclient import TestClient

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.io.photo import example_path
from materialist.studio import server
from materialist.studio.access.files import HandedFiles, with_known_files
from materialist.studio.edit_list import EditList
from materialist.studio.stage import commands
from materialist.studio.studio import PERSON

SECRET = b"the photo of somebody else"


@pytest.fixture
def page(shared):
    """The whole page, before which several people sit."""
    return server.application(shared, host="0.0.0.0", port=0)


def browser(page):
    client = TestClient(page, base_url="http://studio.example", client=("1.2.3.4", 1))
    assert client.get("/").status_code == 200
    return client


def upload(client, name="a.png", content=SECRET):
    answer = client.post("/gradio_api/upload", files={"files": (name, content)})
    assert answer.status_code == 200, answer.text
    return answer.json()


def shapes(path):
    """A file as Gradio takes it: alone, as older versions sent it, in a gallery, nested, by address."""
    file = {"path": path, "meta": {"_type": "gradio.FileData"}}
    return [
        file,
        {"path": path},
        {"path": path, "url": f"http://127.0.0.1/{path}", "orig_name": "a.png"},
        {"url": path, "meta": {"_type": "gradio.FileData"}},
        {"path": None, "url": path},
        [file],
        [{"image": file, "caption": None}],
        {"background": file, "layers": [file]},
        {**file, "is_stream": True},
    ]


def event(client, number, data, place="queue/join"):
    body = {"data": data, "fn_index": number, "session_hash": "page", "event_data": None}
    return client.post(f"/gradio_api/{place}", json=body)


def test_no_event_takes_a_file_of_the_server(page, shared):
    """Every event of the page, each of its inputs, each place, each shape."""
    anna = browser(page)
    bert = browser(page)
    (own,) = upload(anna)
    stored = shared.files.path(shared.person(anna.cookies[PERSON]), own)
    project = shared.work.new("Anna's", shared.person(anna.cookies[PERSON]))
    (project.folder / "original.png").write_bytes(SECRET)
    paths = [own, str(stored), str(project.folder / "original.png"), "/etc/hostname", "/dev/zero"]
    paths += ["/no/such/file", f"{shared.work.cache}/../project.json"]
    functions = anna.get("/config").json()["dependencies"]
    assert len(functions) > 40
    for function in functions:
        count = max(1, len(function["inputs"]))
        for place in ("queue/join", "run/predict"):
            answer = event(bert, function["id"], shapes(own)[:1] * count, place)
            assert answer.status_code == 403, function
            assert answer.text == "That file is not here any more; give it again.\n"
    for path in paths:
        for shape in shapes(path):
            answer = event(bert, 0, [shape])
            assert answer.status_code == 403
            assert answer.text == "That file is not here any more; give it again.\n"


def test_an_upload_is_an_id_for_its_owner_alone(page, shared):
    anna = browser(page)
    bert = browser(page)
    (name,) = upload(anna)
    assert name.startswith("upload-") and "/" not in name
    assert anna.get(f"/gradio_api/file={name}").content == SECRET
    for path in (name, "/etc/hostname", f"{shared.work.root}/photo-001/original.png"):
        assert bert.get(f"/gradio_api/file={path}").status_code == 403


def test_what_is_named_is_replaced_by_its_path(tmp_path):
    files = HandedFiles()
    photo = tmp_path / "a.png"
    photo.write_bytes(SECRET)
    name = files.add("anna", photo)
    body = {
        "data": [3, {"path": name, "orig_name": "mine.png", "url": "http://x/y"}, "text"],
        "fn_index": 4,
    }
    located = json.loads(with_known_files(json.dumps(body).encode(), "anna", files))
    assert located["fn_index"] == 4
    assert located["data"] == [
        3,
        {
            "path": str(photo),
            "orig_name": "mine.png",
            "size": len(SECRET),
            "meta": {"_type": "gradio.FileData"},
        },
        "text",
    ]
    with pytest.raises(InputError, match="not here any more"):
        with_known_files(json.dumps(body).encode(), "bert", files)
    photo.unlink()
    with pytest.raises(InputError, match="not here any more"):
        with_known_files(json.dumps(body).encode(), "anna", files)
    files.forget_missing()
    assert not files._files


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b"nonsense", b"[" * 100_000, b'{"data":' + b"[" * 5000 + b"]" * 5000 + b"}"],
)
def test_a_body_that_is_no_event_is_a_sentence(body):
    with pytest.raises(InputError, match="reload the page"):
        with_known_files(body, "anna", HandedFiles())


def test_an_event_tells_no_file_of_itself():
    chosen = {"index": 2, "value": {"image": {"path": "/etc/hostname"}, "caption": "x"}}
    body = json.dumps({"data": [], "event_data": chosen}).encode()
    located = json.loads(with_known_files(body, "anna", HandedFiles()))
    assert located["event_data"] == {"index": 2, "value": {"image": None, "caption": "x"}}


def test_an_example_photo_comes_back_by_the_name_under_which_it_was_handed_over(shared):
    copy = shared.public_copy("anna", example_path("example:cat"), "cat.png")
    body = json.dumps({"data": [{"path": copy}]}).encode()
    assert json.loads(with_known_files(body, "anna", shared.files))["data"][0]["path"] == copy
    with pytest.raises(InputError):
        with_known_files(body, "bert", shared.files)


def test_the_cookie_of_a_person_is_not_on_the_page(page, shared):
    anna = browser(page)
    cookie = anna.cookies[PERSON]
    person = shared.person(cookie)
    assert cookie not in person
    session = shared.session("page", person)
    session.project = shared.work.new("One", person)
    session.edits = EditList((Step("edit", {"hue": "3"}),))
    assert person in commands(session) and cookie not in commands(session)
    thief = TestClient(page, base_url="http://studio.example", cookies={PERSON: person})
    assert thief.get("/gradio_api/queue/data?session_hash=page").status_code == 403


def test_a_login_stays_with_its_person(shared):
    page = server.application(shared, host="0.0.0.0", port=0, password="open sesame")

    def log_in():
        client = TestClient(page, base_url="http://studio.example", follow_redirects=False)
        assert client.post("/login", data={"password": "open sesame"}).status_code == 303
        assert client.get("/").status_code == 200
        return client

    anna = log_in()
    bert = log_in()
    beat = "/gradio_api/queue/data?session_hash=annas"
    shared.session("annas", shared.person(anna.cookies[PERSON]))
    stolen = anna.cookies[PERSON]
    bert.cookies.set(PERSON, stolen)
    assert bert.get(beat).status_code == 403
