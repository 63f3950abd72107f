"""Attacks on the darkroom's server: what gets past its door, and what does not."""

import json
import re
from contextlib import ExitStack

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from materialist.darkroom.app import STATIC, application
from materialist.studio import StudioSettings
from materialist.studio.access import gate, quota

PAGE = "a" * 32
SOCKET = f"ws://studio.example/api/channel?page={PAGE}"


def test_the_policy_lets_nothing_in_from_outside(visit):
    answer = visit().get("/")
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy and "http" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    text = (STATIC / "index.html").read_text("utf-8")
    assert not re.search(r"https?://|<style|\son\w+=|<script(?![^>]*src=)", text)


@pytest.mark.parametrize(
    ("method", "place", "status"),
    [
        ("GET", "/", 200),
        ("GET", "/api/state", 200),
        ("GET", "/assets/darkroom.js", 200),
        ("GET", "/assets/%2e%2e/%2e%2e/app.py", 404),
        ("GET", "/assets/..%2f..%2fapp.py", 404),
        ("GET", "/index.html", 404),
        ("GET", "/gradio_api/info", 404),
        ("POST", "/", 404),
        ("PUT", "/api/state", 404),
        ("DELETE", "/api/state", 404),
        ("POST", "/api/state", 405),
        ("GET", "/api/set", 405),
        ("POST", "/api/nothing", 404),
        ("GET", "/api/file/etc", 400),
        ("GET", "/api/file/..%2f..%2fetc%2fpasswd", 404),
        ("GET", "/api/file//etc/passwd", 404),
        ("GET", "/api/picture/..%2f..%2fx/photo", 404),
        ("GET", "/api/picture/photo-001/..%2f..%2fproject", 404),
        ("GET", "/api/picture/photo-002/photo", 400),
        ("GET", "/api/map/²", 400),  # a digit, and no number
        ("GET", "/api/map/" + "9" * 5000, 400),
    ],
)
def test_only_what_the_page_asks_for_is_answered(visit, method, place, status):
    assert visit().request(method, place).status_code == status


def test_a_change_must_name_its_page_and_come_from_it(visit):
    browser = visit()
    body = {"tool": "click", "at": [25, 24]}
    del browser.headers["x-materialist-page"]
    # What a form of another site can send: no header of ours.
    assert browser.post("/api/pick", json=body).status_code == 403
    for name in ("", "abc", "../" * 10, "A" * 32):
        answer = browser.post("/api/deselect", json={}, headers={"x-materialist-page": name})
        assert answer.status_code in (400, 403), name
    for origin in ("http://evil.example", "null", "https://studio.example.evil"):
        headers = {"x-materialist-page": PAGE, "origin": origin}
        assert browser.post("/api/deselect", json={}, headers=headers).status_code == 403, origin


def test_a_page_and_its_files_belong_to_one_person(visit, shared):
    anna = visit()
    bert = visit("b" * 32, "5.6.7.8")
    sent = anna.post("/api/upload?name=a.png", content=b"secret").json()["file"]
    theirs = {"x-materialist-page": PAGE}
    # Another's page, by its name.
    for answer in (bert.get("/api/state", headers=theirs), bert.get(f"/api/state?page={PAGE}")):
        assert answer.status_code in (200, 400)
    assert bert.get("/api/state", headers=theirs).status_code == 400
    # Another's upload, by its id.
    for place, body in (
        ("use", {"option": "texture", "file": sent}),
        ("start", {"file": sent}),
        ("load", {"file": sent}),
    ):
        assert "not here any more" in bert.post(f"/api/{place}", json=body).json()["error"]
    assert bert.get(f"/api/file/{sent}").status_code == 400
    assert anna.get(f"/api/file/{sent}").content == b"secret"
    # Another's photo, by its name.
    mine = shared.work.new("Mine", shared.person(anna.cookies["materialist_person"]))
    (mine.folder / "found-photo.jpg").write_bytes(b"x")
    for place in ("open", "discard"):
        assert bert.post(f"/api/{place}", json={"project": mine.name}).status_code == 400
    rename = {"project": mine.name, "title": "Yours"}
    assert bert.post("/api/rename", json=rename).status_code == 400
    assert bert.get(f"/api/picture/{mine.name}/photo").status_code == 400
    assert mine.folder.is_dir()


def test_what_was_started_with_is_seen_by_all_and_kept_by_all(visit, shared):
    answer = visit().post("/api/discard", json={"project": shared.start.name})
    assert "somebody else" in answer.json()["error"] and shared.start.folder.is_dir()


def test_the_person_is_not_what_a_header_says(visit, shared):
    anna = visit()
    person = shared.person(anna.cookies["materialist_person"])
    forged = {"x-materialist-person": person}
    other = visit("c" * 32, arrive=False)
    assert other.get(f"/api/state?page={PAGE}", headers={**forged, "x-materialist-page": PAGE})
    answer = other.get("/api/state", headers={**forged, "x-materialist-page": PAGE})
    assert answer.status_code == 400


@pytest.mark.parametrize(
    "headers",
    [
        {},  # no origin: no browser
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://studio.example", "sec-fetch-site": "cross-site"},
    ],
)
def test_the_channel_is_for_pages_of_the_studio(visit, headers):
    browser = visit()
    del browser.headers["origin"]
    with pytest.raises(WebSocketDisconnect), browser.websocket_connect(SOCKET, headers=headers):
        pass


def test_the_channel_needs_a_known_browser_and_its_own_page(visit):
    visit()  # the page is somebody's
    stranger = visit("b" * 32, arrive=False)
    with pytest.raises(WebSocketDisconnect), stranger.websocket_connect(SOCKET):
        pass  # no cookie
    stranger.get("/api/arrive")
    with pytest.raises(WebSocketDisconnect), stranger.websocket_connect(SOCKET):
        pass  # another's page
    with (
        pytest.raises(WebSocketDisconnect),
        stranger.websocket_connect("ws://studio.example/api/state"),
    ):
        pass
    with stranger.websocket_connect(SOCKET.replace(PAGE, "b" * 32)) as channel:
        assert "jobs" in channel.receive_json()


def test_a_page_has_a_few_channels(visit):
    """Each is looked after ten times a second."""
    browser = visit()
    with ExitStack() as held:
        for _ in range(4):
            held.enter_context(browser.websocket_connect(SOCKET)).receive_json()
        with pytest.raises(WebSocketDisconnect), browser.websocket_connect(SOCKET):
            pass
    with browser.websocket_connect(SOCKET) as channel:
        channel.receive_json()


def test_a_link_of_another_site_leads_to_the_page_alone(visit):
    """Else it could open scenes, and use up the pages of its visitor."""
    browser = visit()
    led = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    del browser.headers["origin"]
    assert browser.get("/", headers=led).status_code == 200
    assert browser.get("/api/arrive?page=" + "9" * 32, headers=led).status_code == 403


def test_a_password_closes_every_door(shared):
    app = application(shared, host="0.0.0.0", port=0, password="open sesame")
    headers = {"x-materialist-page": PAGE, "origin": "http://studio.example"}
    page = TestClient(
        app, base_url="http://studio.example", headers=headers, follow_redirects=False
    )
    for place in ("/", "/api/state", "/assets/darkroom.js", "/api/about", "/favicon.svg"):
        assert page.get(place).status_code == 401, place
    assert page.post("/api/deselect", json={}).status_code == 401
    assert page.post("/api/upload?name=a.png", content=b"x").status_code == 401
    with pytest.raises(WebSocketDisconnect), page.websocket_connect(SOCKET):
        pass
    form = page.get("/")
    digest = re.search(r"'sha256-[\w+/=]+'", gate.policy())[0]
    assert digest in form.headers["content-security-policy"] and "<style>" in form.text
    assert page.post("/login", data={"password": "open sesame"}).status_code == 303
    assert page.get("/api/state").status_code == 200
    with page.websocket_connect(SOCKET) as channel:
        assert "jobs" in channel.receive_json()


def test_uploads_are_counted_and_not_believed(visit, monkeypatch):
    monkeypatch.setattr(
        gate, "SETTINGS", StudioSettings(request_bytes=1000, upload_megabytes=0.001)
    )
    browser = visit()

    def send(content, **headers):
        return browser.post("/api/upload?name=a.png", content=content, headers=headers)

    assert send(b"x" * 2000).status_code == 200
    assert "may have up to" in send(b"x" * 2001).json()["error"]
    assert send(iter([b"x" * 100])).status_code == 400  # does not say how long it is
    assert send(b"").status_code == 400
    answer = browser.post("/api/pick", content=b" " * 1001)
    assert answer.status_code == 413 and "not taken" in answer.json()["error"]


def test_a_promise_that_is_not_kept_costs_nothing_and_leaves_nothing(visit, shared):
    browser = visit()
    before = {*shared.work.cache.iterdir()}
    answer = browser.post(
        "/api/upload?name=a.png", content=b"x", headers={"content-length": "9999"}
    )
    assert answer.status_code == 400
    assert {*shared.work.cache.iterdir()} == before and shared.quota._stored("1.2.3.4") == 0


def test_an_upload_that_cannot_be_stored_counts_nothing(visit, shared, monkeypatch):
    browser = visit()
    monkeypatch.setattr(shared.work, "cache", shared.work.root / "missing")
    answer = browser.post("/api/upload?name=a.png", content=b"x")
    assert answer.status_code == 400 and "a.png cannot be written" in answer.json()["error"]
    assert shared.quota._stored("1.2.3.4") == 0


def test_titles_that_are_no_unicode_are_answered(visit, shared, monkeypatch):
    browser = visit()
    card = json.loads((shared.start.folder / "project.json").read_text())
    (shared.start.folder / "project.json").write_text(json.dumps({**card, "title": "a\ud800"}))
    shared.start = shared.work.projects()[0]
    assert browser.get("/api/projects").json()[0]["title"] == "a\ud800"


def test_uploads_have_a_quota(visit, monkeypatch):
    monkeypatch.setattr(quota, "SETTINGS", StudioSettings(storage_quota=150_000))
    for count, status in enumerate((200, 200, 400)):
        browser = visit(f"{count}" * 32)  # a new cookie is no new sender
        answer = browser.post("/api/upload?name=a.png", content=b"x" * 10)
        assert answer.status_code == status, answer.text


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("..\\..\\boot.ini", "boot.ini"),
        (".hidden.png", "hidden.png"),
        ("/", "upload"),
        ("a\x00b\n.png", "a_b_.png"),
        ("x" * 300 + ".png", "x" * 76 + ".png"),
        ("<img onerror=1>.png", "_img onerror_1_.png"),
        ("\U00010000" * 80 + ".png", "\U00010000" * 19 + ".png"),  # four bytes each
    ],
)
def test_names_of_uploads_are_no_paths(visit, shared, name, kept):
    answer = visit().post("/api/upload", params={"name": name}, content=b"x")
    assert answer.json()["name"] == kept
    stored = [file for file in shared.work.cache.rglob("*") if file.name == kept]
    assert len(stored) == 1


def test_a_file_that_is_no_photo_is_refused_and_leaves_no_project(visit, shared):
    browser = visit()
    count = len(shared.work.projects())
    for name, content in (("a.png", b"no picture"), ("a.zip", b"PK no zip"), ("a.exe", b"MZ")):
        sent = browser.post(f"/api/upload?name={name}", content=content).json()["file"]
        answer = browser.post("/api/start", json={"file": sent})
        assert answer.status_code == 400 and name in answer.json()["error"]
    assert len(shared.work.projects()) == count


def test_pages_and_changes_of_one_address_are_limited(visit, shared):
    browser = visit()
    for number in range(39):
        assert browser.get("/api/state", headers={"x-materialist-page": f"{number:032x}"})
    answer = browser.get("/api/state", headers={"x-materialist-page": "f" * 32})
    assert "close some" in answer.json()["error"]
    # Refused before a byte of its body was read.
    body = (pytest.fail("read") for _ in range(1))
    headers = {"x-materialist-page": "f" * 32}
    answer = browser.post("/api/deselect", content=body, headers=headers)
    assert "close some" in answer.json()["error"]
    assert visit("e" * 32, "9.9.9.9").get("/api/state").status_code == 200


def test_a_photo_that_cannot_be_shown_does_not_lock_its_owner_out(visit, shared, monkeypatch):
    browser = visit(arrive=False)
    browser.get("/")
    person = shared.person(browser.cookies["materialist_person"])
    mine = shared.work.new("Mine", person, scene=shared.start.scene)
    shared.note_last(person, mine.name)

    def broken(scene):
        raise TypeError("three is not four")

    monkeypatch.setattr("materialist.darkroom.state.is_traced", broken)
    answer = browser.get("/api/arrive")
    assert answer.status_code == 200 and "TypeError" in answer.json()["notes"][0]
    assert answer.json()["project"] is None and person not in shared.last
    # One that was not taken apart to the end is not offered either.
    shared.note_last(person, shared.work.new("Unfinished", person).name)
    assert "notes" not in browser.get("/api/arrive").json()
    # A damaged one stays the last: its sentence says what to do.
    monkeypatch.undo()
    shared.note_last(person, mine.name)
    (mine.scene / "report.json").write_text("{")
    answer = browser.get("/api/arrive")
    assert answer.status_code == 200 and "damaged" in answer.json()["notes"][0]


def test_a_change_is_counted_while_its_body_comes(visit, shared):
    counts = []

    def body():
        counts.append(shared.quota._running["request", "1.2.3.4"])
        yield b"{}"

    assert visit().post("/api/deselect", content=body()).status_code == 200
    assert counts == [1] and not shared.quota._running


def test_answers_name_no_folder_of_this_machine(visit, shared):
    browser = visit()
    texts = [browser.get(f"/api/{place}").text for place in ("arrive", "state", "about", "report")]
    sent = browser.post("/api/upload?name=a.png", content=b"no picture").json()["file"]
    texts.append(browser.post("/api/start", json={"file": sent}).text)
    assert not [text for text in texts if str(shared.work.root) in text]
