"""Selecting and changing by requests: what they answer, and what they refuse."""

import base64
import gc
import io
import json
import os
import re
import signal
import time
import weakref
from functools import partial

import made_tasks
import numpy as np
import pytest
from PIL import Image
from studio_scenes import HEIGHT, WIDTH, block, package, zipped_package

from materialist.darkroom.state import outline
from materialist.errors import InputError
from materialist.io.image import write_png
from materialist.io.package import load_scene


def select_block(client):
    answer = client.post("/api/pick", json={"tool": "click", "at": [25, 24]})
    assert answer.status_code == 200, answer.text
    return answer.json()


def change(client, kind="edit", **options):
    return client.post("/api/set", json={"kind": kind, "options": options})


def pixels(state):
    """[H, W, 3] uint8 of the picture in an answer."""
    data = state["stage"]["picture"].partition(",")[2]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))


def test_select_change_undo(client):
    before = pixels(client.get("/api/state").json())
    state = select_block(client)
    assert state["stage"]["region"].startswith("M") and state["fitted"]["colour"].startswith("#")
    state = change(client, hue=120).json()
    assert state["steps"][0]["options"]["hue"] == "120" and state["undo"] and not state["redo"]
    after = pixels(state)
    assert after[24, 25, 1] > after[24, 25, 0] + 40
    assert np.abs(after[40, 55].astype(int) - before[40, 55]).max() < 6
    state = client.post("/api/undo", json={}).json()
    assert state["steps"] == [] and state["redo"]
    state = client.post("/api/undo", json={"again": True}).json()
    assert len(state["steps"]) == 1


def test_the_selection_of_a_click_grows_and_its_edit_with_it(client, monkeypatch):
    assert not client.get("/api/state").json()["stage"]["clicked"]
    session = client.studio.page("b" * 32, "me").session
    grown = block().copy()
    grown[:, :20] = True
    extents = {"auto": block(), "small": block(), "medium": block(), "large": grown}

    def choose(click, extent="auto", sharpen=True):
        return extents[extent].copy()

    monkeypatch.setattr(session.live, "select", choose)
    assert select_block(client)["stage"]["clicked"]
    change(client, hue=120)
    before = client.get("/api/state").json()
    after = client.post("/api/resize", json={"larger": True}).json()
    assert after["stage"]["region"] != before["stage"]["region"]
    assert len(after["steps"]) == 1 and after["steps"][0]["options"]["hue"] == "120"
    assert after["steps"][0]["options"]["mask"] != before["steps"][0]["options"]["mask"]
    answer = client.post("/api/resize", json={"larger": True})
    assert answer.status_code == 400 and "Nothing larger" in answer.json()["error"]
    undone = client.post("/api/undo", json={}).json()
    assert undone["steps"] == before["steps"]


def test_the_selection_of_a_click_keeps_its_material_and_so_does_its_edit(client, monkeypatch):
    session = client.studio.page("b" * 32, "me").session
    wider = block() | (np.indices(block().shape)[1] > 58)
    monkeypatch.setattr(session.live, "select", lambda click, extent="auto": wider.copy())
    client.post("/api/pick", json={"tool": "click", "at": [24, 25]})
    change(client, hue=120)
    before = client.get("/api/state").json()
    after = client.post("/api/material", json={}).json()
    assert after["stage"]["region"] != before["stage"]["region"] and len(after["steps"]) == 1
    assert after["steps"][0]["options"]["mask"] != before["steps"][0]["options"]["mask"]


def test_a_default_is_left_out_of_the_list_and_none_clears(client):
    select_block(client)
    change(client, hue=30, saturation=0.5)
    assert "hue" not in change(client, hue=0).json()["steps"][0]["options"]
    assert "saturation" not in change(client, saturation=None).json()["steps"][0]["options"]


def test_what_is_outlined_under_the_pointer_is_what_a_click_takes(client):
    pointed = client.post("/api/point", json={"at": [25, 24]}).json()["region"]
    assert pointed and select_block(client)["stage"]["region"] == pointed
    assert client.post("/api/point", json={"at": [5, 1]}).status_code == 400  # the sky


def test_an_outline_follows_a_region():
    assert outline(None) == ""
    numbers = [
        tuple(map(float, pair.split(" ")))
        for pair in outline(block()).removeprefix("M").removesuffix("Z").split("L")
    ]
    xs, ys = zip(*numbers, strict=True)
    assert min(xs) == pytest.approx(16, abs=0.7) and max(xs) == pytest.approx(34, abs=0.7)
    assert min(ys) == pytest.approx(16, abs=0.7) and max(ys) == pytest.approx(32, abs=0.7)
    ring = block()
    ring[20:28, 20:30] = False
    assert outline(ring).count("M") == 2


def test_the_light_lamps_and_sun(client):
    state = client.post("/api/light", json={"name": "Sunset"}).json()
    assert state["steps"][0]["options"]["envmap"] == "light-sunset.exr"
    assert "sun" in change(client, "relight", sun=[45, 40]).json()["steps"][0]["options"]
    state = client.post("/api/lamp", json={"at": [40, 40], "kelvin": 4000}).json()
    lamp = [float(value) for value in state["steps"][0]["options"]["lamps"][0]]
    assert lamp[:2] == [40, 40] and lamp[3] == 4000
    # Each is moved by itself: of two tabs that move one each, neither puts the other's back.
    client.post("/api/lamp", json={"at": [50, 40]})
    client.post("/api/lamps", json={"index": 0, "lamp": [10, 40, *lamp[2:]], "quiet": True})
    state = client.post("/api/lamps", json={"index": 1, "lamp": [52, 40, *lamp[2:]]}).json()
    assert state["stage"]["lamps"] == [[10, 40], [52, 40]]
    for wrong in ({"index": 0, "lamp": [900, 4, 1, 1, 1]}, {"index": 2, "lamp": None}):
        assert client.post("/api/lamps", json=wrong).status_code == 400
    state = client.post("/api/lamps", json={"index": 0, "lamp": None}).json()
    assert state["stage"]["lamps"] == [[52, 40]]
    state = change(client, "relight", lamps=None).json()
    assert "lamps" not in state["steps"][0]["options"]
    assert client.post("/api/light", json={"name": "Moon"}).status_code == 400


def test_a_page_gets_what_it_draws_itself_and_its_key_stays(client):
    def key(kind):
        return client.get("/api/state").json()["drawn"].get(kind)

    def header(kind):
        content = client.get(f"/api/drawn/{kind}").content
        return json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])

    assert client.get("/api/drawn/material").status_code == 204
    assert client.get("/api/drawn/all").status_code == 400
    select_block(client)
    before = key("material")
    assert header("material")["key"] == before and header("material")["count"] > 100
    # A slider changes nothing of it, and asks for no picture; another edit does.
    body = {"kind": "edit", "options": {"hue": 40}, "quiet": True}
    state = client.post("/api/set", json=body).json()
    assert "picture" not in state["stage"] and state["stage"]["coarse"]
    assert key("material") == before
    change(client, grow=0.01)
    assert key("material") not in (None, before)
    client.post("/api/lamp", json={"at": [40, 40]})
    before = key("lamps")
    assert header("lamps")["key"] == before
    client.post("/api/lamps", json={"index": 0, "lamp": [10, 40, 2, 2700, 1]})
    assert key("lamps") == before


def test_an_object_is_placed_moved_and_changed(client):
    assert client.post("/api/place", json={"at": [40, 40]}).status_code == 400
    client.post("/api/object", json={"name": "Ball"})
    state = client.post("/api/place", json={"at": [40, 40]}).json()
    assert state["steps"][0]["options"]["at"] == ["40", "40"]
    state = client.post("/api/place", json={"at": [20, 42]}).json()
    assert state["steps"][0]["options"]["at"] == ["20", "42"] and len(state["steps"]) == 1
    state = change(client, "insert", material="mirror", scale=2).json()
    assert state["steps"][0]["options"]["material"] == "mirror"
    assert client.post("/api/object", json={"name": "../x"}).status_code == 400


def test_the_list_is_switched_ordered_and_shortened(client):
    select_block(client)
    change(client, hue=30)
    client.post("/api/light", json={"name": "Overcast"})
    state = client.post("/api/act", json={"action": "up", "index": 1}).json()
    assert [step["kind"] for step in state["steps"]] == ["relight", "edit"]
    assert not client.post("/api/act", json={"action": "toggle", "index": 0}).json()["steps"][0][
        "on"
    ]
    state = client.post("/api/act", json={"action": "choose", "index": 1}).json()
    assert state["current"] == 1 and state["stage"]["region"]
    assert len(client.post("/api/act", json={"action": "remove", "index": 0}).json()["steps"]) == 1
    assert client.post("/api/act", json={"action": "remove", "index": 7}).status_code == 400


@pytest.mark.parametrize(
    ("place", "body", "words"),
    [
        ("set", {"kind": "edit", "options": {"texture": "/etc/passwd"}}, "cannot be set"),
        ("set", {"kind": "edit", "options": {"mask": "mask-1.png"}}, "cannot be set"),
        ("set", {"kind": "relight", "options": {"envmap": "light.exr"}}, "cannot be set"),
        ("set", {"kind": "insert", "options": {"mesh": "../../x.ply"}}, "cannot be set"),
        ("set", {"kind": "glass", "options": {"thickness": "x.exr"}}, "cannot be set"),
        ("set", {"kind": "remove", "options": {"inpaint": "sd:evil"}}, "cannot be set"),
        ("set", {"kind": "remove", "options": {"background": "a.png"}}, "cannot be set"),
        ("set", {"kind": "edit", "options": {"hue": "x"}}, "hue"),
        ("set", {"kind": "edit", "options": {"roughness": 2}}, "must lie in"),
        ("set", {"kind": "edit", "options": {"nothing": 2}}, "cannot be set"),
        ("set", {"kind": "edit", "options": {"hue": [1] * 17}}, "options.hue"),
        ("set", {"kind": "edit", "options": {"hue": {}}}, "options.hue"),
        ("set", {"kind": "edit", "options": {"hue": 1}, "more": 1}, "more"),
        ("set", {"kind": "sudo", "options": {}}, "kind"),
        ("set", [], "its body"),
        ("pick", {"tool": "click", "at": [25]}, "could not be read"),
        ("pick", {"tool": "click", "at": [-1, 3]}, "could not be read"),
        ("pick", {"tool": "box", "at": [1, 2, 3]}, "could not be read"),
        ("pick", {"tool": "rm", "at": []}, "tool"),
        ("pick", {"tool": "click", "at": [1, 2], "mode": "x"}, "mode"),
        ("pick", {"tool": "click", "at": [1e9, 3]}, "at"),
        ("pick", {"tool": "brush", "points": [[1, 2, 3]], "radius": 2}, "points"),
        ("point", {"at": [-5, 2]}, "outside"),
        ("resize", {"larger": True}, "Click an object first"),
        ("resize", {"larger": "x"}, "larger"),
        ("act", {"action": "explode", "index": 0}, "action"),
        ("act", {"action": "up", "index": -1}, "index"),
        ("take", {"kind": "../x"}, "choose one"),
        ("final", {}, "change something first"),
        ("lamp", {"at": [5, 1]}, "no surface"),
        ("start", {}, "Drop a photo"),
        ("start", {"example": "../../etc/passwd"}, "no example"),
        ("start", {"example": "cat", "size": 100000}, "size"),
        ("start", {"example": "cat", "predictor": "maps:/etc"}, "listed ways"),
        ("open", {"project": "../x"}, "no longer in the work folder"),
        ("stop", {"number": 99}, "not there any more"),
    ],
)
def test_what_is_wrong_is_said_and_changes_nothing(client, place, body, words):
    if place == "set":
        select_block(client)
    answer = client.post(f"/api/{place}", json=body)
    assert answer.status_code in (400, 422) and words in answer.json()["error"], answer.text
    assert client.get("/api/state").json()["steps"] == []


def test_json_that_is_none_is_said(client):
    for raw in (b"{", b"\xff\xfe", b'{"at": [NaN, 1]}', b"[" * 5000):
        answer = client.post("/api/point", content=raw)
        assert answer.status_code == 422 and "cannot be read" in answer.json()["error"]


def test_a_texture_is_uploaded_and_taken_off(client, tmp_path):
    write_png(tmp_path / "wood.png", np.full((8, 8, 3), 90, np.uint8))
    content = (tmp_path / "wood.png").read_bytes()
    sent = client.post("/api/upload?name=wood.png", content=content).json()
    select_block(client)
    state = client.post("/api/use", json={"option": "texture", "file": sent["file"]}).json()
    assert state["steps"][0]["options"]["texture"].startswith("texture-")
    assert "texture" not in change(client, texture=None).json()["steps"][0]["options"]


def test_pictures_maps_and_what_there_is_to_choose_from(client):
    about = client.get("/api/about").json()
    assert about["options"]["edit"]["roughness"]["high"] == 1 and "Ball" in about["objects"]
    titles = client.get("/api/report").json()["maps"]
    places = [f"map/{place}" for place in range(len(titles))]
    places += ["photo", "photo?working=1", "picture/photo-001/photo", "light/Sunset", "example/cat"]
    for place in places:
        answer = client.get(f"/api/{place}")
        assert answer.headers["content-type"] == "image/jpeg", place
    picture = Image.open(io.BytesIO(client.get("/api/photo?working=1").content))
    assert picture.size == (WIDTH, HEIGHT)
    for place in ("map/99", "map/x", "light/x", "example/x", "picture/photo-001/x"):
        assert client.get(f"/api/{place}").status_code == 400, place


@pytest.mark.slow
def test_a_final_picture_is_kept_and_taken_away_in_every_format(client, heard):
    select_block(client)
    change(client, hue=90)
    revision = client.post("/api/final", json={}).json()["revision"]
    news = heard(lambda news: news["revision"] > revision and not working(news))
    assert news["jobs"][-1]["state"] == "done", news
    assert client.get("/api/state").json()["stage"]["badge"] == "Path traced"
    # The page is closed, and opened anew: the picture is there.
    name = client.get("/api/state").json()["project"]["name"]
    client.post("/api/close", json={})
    client.post("/api/open", json={"project": name})
    client.studio.page("b" * 32, "me").session.live.wait()
    state = client.get("/api/state").json()
    assert state["stage"]["badge"] == "Path traced" and state["steps"][0]["options"]["hue"] == "90"
    # --- Pictures: at once, or after a job that converts ---
    for kind, suffix in (("png", "png"), ("tif", "tif"), ("jpg", "jpg"), ("exr", "exr")):
        result = client.post("/api/take", json={"kind": kind}).json().get("result")
        if result is None:
            news = heard(lambda news: not working(news))
            result = news["jobs"][-1]["result"]
        answer = client.get(f"/api/file/{result['file']}")
        assert "attachment" in answer.headers["content-disposition"]
        assert result["name"] == f"Room-edited.{suffix}"
        if kind != "exr":
            assert Image.open(io.BytesIO(answer.content)).size == (WIDTH, HEIGHT)
    archive = client.post("/api/take", json={"kind": "edits"}).json()["result"]
    content = client.get(f"/api/file/{archive['file']}").content
    client.post("/api/act", json={"action": "remove", "index": 0})
    sent = client.post("/api/upload?name=edits.zip", content=content).json()
    state = client.post("/api/load", json={"file": sent["file"]}).json()
    assert state["steps"][0]["options"]["hue"] == "90"


def working(news):
    return [job for job in news["jobs"] if job["state"] in ("queued", "running")]


@pytest.mark.slow
def test_a_page_without_a_server_shows_the_edited_picture(client, heard):
    select_block(client)
    change(client, hue=120)
    assert client.post("/api/take", json={"kind": "html"}).json() == {}
    heard(working)
    result = heard(lambda news: not working(news))["jobs"][-1]["result"]
    page = client.get(f"/api/file/{result['file']}").text
    before, after = (
        np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))[24, 25].astype(int)
        for data in re.findall(r'<img [^>]*src="data:image/jpeg;base64,([^"]+)" alt="The', page)[:2]
    )
    assert before[0] > before[1] + 40 and after[1] > after[0] + 40


def test_a_removal_is_a_job_that_can_be_stopped(client, heard):
    select_block(client)
    state = change(client, "remove").json()
    assert state["steps"] == []  # not before what it hid is filled
    job = heard(working)["jobs"][-1]
    assert job["kind"] == "removal"
    begun = time.monotonic()
    client.post("/api/stop", json={"number": job["number"]})
    job = heard(lambda news: not working(news))["jobs"][-1]
    assert job["state"] == "stopped" and time.monotonic() - begun < 1
    change(client, "remove", shadow=0.2)
    change(client, hue=90)  # the page goes on meanwhile
    heard(lambda news: not working(news))
    state = client.get("/api/state").json()
    assert [step["kind"] for step in state["steps"]] == ["edit", "remove"]
    assert state["steps"][1]["options"]["shadow"] == "0.2"
    assert abs(pixels(state)[24, 25].astype(int) - pixels(state)[24, 50]).max() < 40
    begun = time.monotonic()
    change(client, "remove", shadow=0.2)  # the same again is nothing to do
    assert client.post("/api/act", json={"action": "remove", "index": 1}).status_code == 200
    client.post("/api/undo", json={})
    assert client.get("/api/state").json()["stage"]["badge"].startswith("Sketch")
    answer = change(client, "remove", shadow=5)
    assert answer.status_code == 400 and "must lie in" in answer.json()["error"]


@pytest.mark.slow
def test_removals_are_switched_by_a_job_and_at_once_when_that_was_done(client, heard):
    """The second hides something else without the first."""

    def take_away(*box):
        client.post("/api/deselect", json={})
        client.post("/api/pick", json={"tool": "brush", "points": box, "radius": 4})
        change(client, "remove")
        heard(lambda news: not working(news))

    def toggle():
        return client.post("/api/act", json={"action": "toggle", "index": 0}).json()

    take_away([20, 20], [30, 20])
    take_away([22, 28], [30, 28])
    state = client.get("/api/state").json()
    assert [step["kind"] for step in state["steps"]] == ["remove", "remove"]
    # --- Stopped, nothing changes; done, the list does ---
    assert toggle()["steps"][0]["on"]
    (job,) = heard(working)["jobs"][-1:]
    assert job["kind"] == "removal" and job["text"]
    client.post("/api/stop", json={"number": job["number"]})
    heard(lambda news: not working(news))
    assert client.get("/api/state").json()["steps"][0]["on"]
    toggle()
    heard(working)
    heard(lambda news: not working(news))
    assert not client.get("/api/state").json()["steps"][0]["on"]
    # --- Both pictures are known by now ---
    assert toggle()["steps"][0]["on"] and not toggle()["steps"][0]["on"]
    assert client.post("/api/undo", json={}).json()["steps"][0]["on"]


def test_two_tabs_on_one_photo_agree(client):
    """What one changes, the other shows and may change further; nothing is lost."""
    other = {"x-materialist-page": "c" * 32}
    select_block(client)
    before = client.get("/api/arrive", headers=other).json()
    assert before["project"]["title"] == "Room" and before["stage"]["region"]
    change(client, hue=30)
    state = client.get("/api/state", headers=other).json()
    assert state["revision"] > before["revision"] and state["steps"][0]["options"]["hue"] == "30"
    body = {"kind": "edit", "options": {"roughness": 0.2}}
    client.post("/api/set", json=body, headers=other)
    options = client.get("/api/state").json()["steps"][0]["options"]
    assert (options["hue"], options["roughness"]) == ("30", "0.2")
    client.post("/api/undo", json={})
    options = client.get("/api/state", headers=other).json()["steps"][0]["options"]
    assert "roughness" not in options
    client.post("/api/close", json={}, headers=other)
    assert client.get("/api/state").json()["project"]["title"] == "Room"


def test_a_closed_page_is_forgotten_with_the_scene_that_it_showed(client):
    page = "d" * 32
    client.post("/api/pick", json={"tool": "click", "at": [25, 24]})
    client.get("/api/arrive", headers={"x-materialist-page": page})
    known = weakref.ref(client.studio.page(page, "me").desk)
    assert known().selected is not None
    client.studio.leave(page)
    gc.collect()
    assert known() is None


def test_other_photos_are_safe_while_one_is_taken_apart(client, heard, monkeypatch):
    monkeypatch.setattr("materialist.studio.tasks.invert", made_tasks.invert)
    begun = client.post("/api/start", json={"example": "cat"}).json()
    assert begun["project"] is None and begun["expected"]["title"]
    job = heard(lambda news: [one for one in working(news) if one["text"].startswith("Guess")])
    folder = client.studio.work.root / begun["expected"]["name"]
    # Another photo is opened and changed meanwhile, and stays open at the end of the first.
    state = client.post("/api/open", json={"project": "photo-001"}).json()
    assert state["project"]["title"] == "Room" and state["expected"] is None
    client.studio.page("b" * 32, "me").session.live.wait()
    select_block(client)
    change(client, hue=60)
    client.post("/api/stop", json={"number": job["jobs"][-1]["number"]})
    heard(lambda news: not working(news))
    state = client.get("/api/state").json()
    assert state["project"]["title"] == "Room" and state["steps"][0]["options"]["hue"] == "60"
    assert not folder.exists()
    # The system ends the process of another, as where memory runs out.
    begun = client.post("/api/start", json={"example": "cat"}).json()
    assert begun["expected"]["name"] != folder.name
    heard(lambda news: [one for one in working(news) if one["text"].startswith("Guess")])
    (running,) = client.studio.jobs.unfinished("me", "invert")
    os.kill(running.worker.pid, signal.SIGKILL)
    news = heard(lambda news: not working(news))
    assert "SIGKILL" in news["jobs"][-1]["text"]
    state = client.get("/api/state").json()
    assert state["expected"] is None and state["project"] is None
    assert client.post("/api/open", json={"project": "photo-001"}).json()["project"]
    client.studio.page("b" * 32, "me").session.live.wait()


@pytest.fixture
def whole(monkeypatch, tmp_path):
    """The package whose scene an inversion gives, grey at first (`made_tasks.invert_from`)."""
    path = package(tmp_path)
    fitted = partial(made_tasks.invert_from, package=str(path))
    monkeypatch.setattr(fitted, "__name__", "invert", raising=False)
    monkeypatch.setattr("materialist.studio.tasks.invert", fitted)
    return path


def test_a_photo_opens_before_its_rerendering_and_takes_it_later(client, heard, whole):
    begun = client.post("/api/start", json={"example": "cat"}).json()
    heard(lambda news: news["jobs"] and not working(news))
    state = client.get("/api/state").json()
    assert state["project"]["name"] == begun["expected"]["name"] and not state["traced"]
    (job,) = client.studio.jobs.unfinished("me", "invert")
    assert job.stage == "rerender"
    # It can be edited, closed, and opened again.
    select_block(client)
    assert change(client, hue=60).json()["steps"]
    client.post("/api/close", json={})
    client.post("/api/open", json={"project": begun["expected"]["name"]})
    live = client.studio.page("b" * 32, "me").session.live
    live.wait()
    assert live.call(rerender_of).max() == 0.5
    names = client.get("/api/report").json()["maps"]
    assert any("before its paths are traced" in name for name in names)
    # When the job ends, the preview has the path-traced picture, and the edit is still there.
    (job.folder / "go").touch()
    made_tasks.until(lambda: job.over)
    assert job.state == "done"
    made_tasks.until(lambda: client.get("/api/state").json()["traced"])
    np.testing.assert_array_equal(live.call(rerender_of), load_scene(whole).rerender)
    assert client.get("/api/state").json()["steps"][0]["options"]["hue"] == "60"


def test_a_rerendering_that_is_lost_leaves_the_photo_open(client, heard, whole):
    client.post("/api/start", json={"example": "cat"})
    heard(lambda news: news["jobs"] and not working(news))
    (job,) = client.studio.jobs.unfinished("me", "invert")
    os.kill(job.worker.pid, signal.SIGKILL)
    made_tasks.until(lambda: job.over)
    state = client.get("/api/state").json()
    assert state["project"]["name"] == job.folder.name and not state["traced"]


def test_a_photo_opens_after_its_rerendering_where_memory_is_short(
    client, heard, whole, monkeypatch
):
    studio = client.studio

    def check(project):
        if studio.jobs.unfinished("me", "invert"):
            raise InputError("No memory.")

    monkeypatch.setattr("materialist.studio.studio._check_memory", check)
    client.post("/api/start", json={"example": "cat"})
    made_tasks.until(lambda: studio.jobs.unfinished("me", "invert")[0].stage == "rerender")
    (job,) = studio.jobs.unfinished("me", "invert")
    assert client.get("/api/state").json()["project"] is None
    (job.folder / "go").touch()
    heard(lambda news: news["jobs"] and not working(news))
    state = client.get("/api/state").json()
    assert state["project"]["name"] == job.folder.name and state["traced"]


def rerender_of(preview):
    return preview.edited(()).rerender


def test_a_page_that_opens_an_edited_photo_asks_for_its_edits(client):
    before = pixels(client.get("/api/state").json())
    select_block(client)
    after = pixels(change(client, hue=120).json())
    name = client.get("/api/state").json()["project"]["name"]
    # The photo at once, and that its edits are not in it yet, although there is a preview.
    opened = client.post("/api/open", json={"project": name}).json()
    assert not opened["ready"]
    shown = client.get("/api/state").json()
    assert shown["ready"] and np.abs(pixels(shown).astype(int) - before).max() > 20
    np.testing.assert_array_equal(pixels(shown), after)


def test_photos_are_opened_renamed_and_deleted(client, tmp_path):
    content = zipped_package(tmp_path).read_bytes()
    sent = client.post("/api/upload?name=kitchen.zip", content=content).json()
    state = client.post("/api/start", json={"file": sent["file"]}).json()
    name = state["project"]["name"]
    assert state["project"]["title"] == "kitchen"
    renamed = client.post("/api/rename", json={"project": name, "title": "My <kitchen>"}).json()
    assert renamed[0]["title"] == "My kitchen"
    left = client.post("/api/discard", json={"project": name}).json()
    assert name not in [project["name"] for project in left]
    state = client.get("/api/state").json()
    assert state["project"] is None
    assert client.post("/api/open", json={"project": "photo-001"}).json()["project"]
