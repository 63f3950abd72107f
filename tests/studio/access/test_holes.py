"""Ways to hurt other people at one studio that once worked."""

import json
import math
import threading
import time
from contextlib import ExitStack

import cv2
import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the studio extra")
import io
import zipfile

from made_meshes import box_file
from made_tasks import wait
from studio_scenes import zipped_package

from materialist.errors import InputError
from materialist.io.decode import image_size
from materialist.io.exr import read_exr, write_exr
from materialist.io.image import write_png
from materialist.io.photo import example_path
from materialist.studio import SETTINGS, StudioSettings, archives, uploads
from materialist.studio.access import quota
from materialist.studio.workspace import WorkFolder, person_of

COOKIE = "0123456789abcdef" * 2


def test_a_folder_of_the_user_is_never_swept(tmp_path):
    own = tmp_path / "materialist-cache-of-mine"
    own.mkdir()
    (own / "thesis.txt").write_text("years of work")
    WorkFolder(tmp_path)
    assert (own / "thesis.txt").is_file()


def test_a_work_folder_that_two_versions_used_opens(tmp_path):
    project = tmp_path / "photo-001"
    for name in (COOKIE, person_of(COOKIE)):
        (project / f"edits-{name}").mkdir(parents=True)
        (project / f"edits-{name}" / "edits.yaml").write_text(
            "- edit: {box: [1, 1, 5, 5], hue: 3}\n"
        )
    card = {"title": "One", "owner": COOKIE, "scene": "photo.scene"}
    (project / "project.json").write_text(json.dumps(card))
    (project,) = WorkFolder(tmp_path).projects(person_of(COOKIE))
    lists = sorted(file.parent.name for file in project.folder.glob("*/edits.yaml"))
    assert lists == [f"edits-{person_of(COOKIE)}", f"former-1-edits-{person_of(COOKIE)}"]


def test_files_of_a_loaded_zip_count_as_stored(session, tmp_path, opens_here, monkeypatch):
    """What a zip of edits unpacks to stays in the workspace; its bytes must be claimed, or refused."""
    claims = []
    monkeypatch.setattr(quota.Quota, "claim", lambda self, sender, size: claims.append(size))
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("edits.yaml", "- edit: {box: [2, 2, 30, 30], texture: wood.png}\n")
        archive.write(example_path("example:cat"), "wood.png")
    (tmp_path / "edits.zip").write_bytes(made.getvalue())
    monkeypatch.setattr(session, "allowance", quota.Allowance(quota.Quota(), str))
    session.read_edits(tmp_path / "edits.zip")
    assert sum(claims) >= example_path("example:cat").stat().st_size


def test_copies_that_are_handed_over_are_not_made_on_a_full_disk(shared, monkeypatch, tmp_path):
    monkeypatch.setattr(quota, "SETTINGS", StudioSettings(disk_left=10**18))
    file = tmp_path / "result.zip"
    file.write_bytes(b"x" * 100)
    with pytest.raises(InputError, match="full"):
        shared.public_copy("anna", file)


def test_ids_of_files_that_were_swept_are_forgotten(shared, tmp_path):
    file = shared.work.cache / "a.png"
    file.write_bytes(b"x")
    shared.files.add("anna", file)
    file.unlink()
    for _ in range(600):
        shared.files.add("bert", shared.work.cache / "b.png")
    assert not shared.files._files.keys() & {
        name for name, (who, _) in shared.files._files.items() if who == "anna"
    }


def test_few_uploads_are_opened_at_once_and_one_of_each_sender(monkeypatch, tmp_path):
    """Each may use 2 GB and one thread of the page: all at once they would freeze it for everybody."""
    opened_at_once = []
    running = []
    lock = threading.Lock()

    def slow(task, limits, **given):
        with lock:
            running.append(1)
            opened_at_once.append(len(running))
        time.sleep(0.2)
        with lock:
            running.pop()

    monkeypatch.setattr(uploads, "run_limited", slow)
    file = tmp_path / "a.png"
    file.write_bytes(b"x")
    shared_quota = quota.Quota()
    refusals = []

    def open_one(sender):
        allowance = quota.Allowance(shared_quota, lambda: sender)
        try:
            uploads.opened_upload(uploads.checked_upload, file, allowance, option="texture")
        except InputError as error:
            refusals.append(str(error))

    threads = [threading.Thread(target=open_one, args=(f"1.2.3.{k % 6}",)) for k in range(24)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert max(opened_at_once) <= SETTINGS.openings
    assert any("Another file from your address" in text for text in refusals)
    assert any("files of others" in text for text in refusals)
    # On one's own machine two photos that are dropped at once come one after the other.
    shared_quota = quota.Quota(patient=True)
    refusals.clear()
    opened_at_once.clear()
    threads = [threading.Thread(target=open_one, args=("127.0.0.1",)) for _ in range(3)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert opened_at_once == [1, 1, 1] and not refusals


def test_jobs_are_counted_by_address(shared, tmp_path):
    for number in range(SETTINGS.jobs_a_person):
        person = f"person{number}"
        shared.note_sender(person, "1.2.3.4")
        shared.submit(shared.page(f"page{number}", person).session, wait, tmp_path)
    shared.note_sender("another", "1.2.3.4")
    with pytest.raises(InputError, match="6 jobs waiting or running"):
        shared.submit(shared.page("page", "another").session, wait, tmp_path)


def test_pages_and_jobs_count_by_the_address_they_came_from(shared, tmp_path, monkeypatch):
    """Very many requests of new people make the studio forget which person has which address."""
    monkeypatch.setattr("materialist.studio.studio.SETTINGS", StudioSettings(people=2, pages=2))
    shared.note_sender("anna", "1.2.3.4")
    pages = [shared.page(name, "anna") for name in ("first", "second")]
    for _ in range(SETTINGS.jobs_a_person):
        shared.submit(pages[0].session, wait, tmp_path)
    for number in range(3):
        shared.note_sender(f"new{number}", "1.2.3.4")
    assert "anna" not in shared.senders
    with pytest.raises(InputError, match="2 pages open from your address"):
        shared.page("third", "new2")
    session = shared._new_session("new2")
    with pytest.raises(InputError, match="6 jobs waiting or running"):
        shared.submit(session, wait, tmp_path)


def test_a_promise_is_settled_with_the_address_that_made_it(shared):
    """A cookie that goes on from another address gets no credit there."""
    claim = shared.quota.claim("1.2.3.4", 50_000_000)
    shared.quota.settle(claim, 0)
    assert shared.quota._stored("1.2.3.4") == 0
    shared.quota.settle(claim, 90_000_000)
    assert shared.quota._stored("1.2.3.4") <= quota.MIN_BYTES
    assert shared.quota._stored("5.6.7.8") == 0


def test_pages_and_changes_of_one_address_are_limited(shared):
    for number in range(SETTINGS.pages):
        shared.page(f"page{number}", "anna")
    with pytest.raises(InputError, match="close some"):
        shared.page("one more", "anna")
    assert shared.page("another", "bert")
    with ExitStack() as held:
        for _ in range(SETTINGS.requests):
            held.enter_context(shared.quota.request("1.2.3.4"))
        with pytest.raises(InputError, match="Too many changes"), shared.quota.request("1.2.3.4"):
            pass
        with shared.quota.request("5.6.7.8"):
            pass
    assert not shared.quota._running


def test_those_who_wait_for_a_file_to_be_opened_leave_threads_to_others():
    """All requests of a sender may wait for one edit in which a thing falls."""
    threads_of_the_server = 40
    assert SETTINGS.openings * SETTINGS.requests < threads_of_the_server


def test_a_large_texture_is_shrunk_before_the_server_reads_it(tmp_path, monkeypatch):
    monkeypatch.setattr(uploads, "SETTINGS", StudioSettings(edit_pixels=1000))
    rng = np.random.default_rng(0)
    write_png(tmp_path / "wood.png", rng.integers(0, 255, (60, 80, 3)).astype(np.uint8))
    write_exr(tmp_path / "sky.exr", rng.random((40, 80, 3), np.float32) * 9)
    smaller = uploads.checked_upload(None, tmp_path / "wood.png", "texture")
    assert smaller.suffix == ".png" and math.prod(image_size(smaller)) <= 1000
    light = uploads.checked_upload(None, tmp_path / "sky.exr", "envmap")
    assert light.suffix == ".exr" and math.prod(image_size(light)) <= 1000
    assert read_exr(light).mean() == pytest.approx(4.5, rel=0.02)
    with pytest.raises(InputError, match="may have up to"):
        uploads.checked_upload(None, tmp_path / "wood.png", "mask")


def test_a_mesh_of_many_faces_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(uploads, "SETTINGS", StudioSettings(mesh_faces=10))
    box_file(tmp_path / "box.ply")
    with pytest.raises(InputError, match="12 faces; the studio takes up to 10"):
        uploads.checked_upload(None, tmp_path / "box.ply", uploads.MESH)


def test_the_thumbnail_of_a_scene_is_made_here(tmp_path):
    """The server itself opens it, and a few kilobytes of PNG can stand for gigabytes."""
    large = cv2.imencode(".png", np.zeros((4000, 4000, 3), np.uint8))[1].tobytes()
    file = zipped_package(tmp_path, **{"photo.png": large})
    archives.extract_scene(None, file, tmp_path / "target")
    made = (tmp_path / "target" / "photo.png").read_bytes()
    assert made == (tmp_path / "room.scene" / "photo.png").read_bytes()


def test_a_large_scene_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "SETTINGS", StudioSettings(scene_pixels=100))
    with pytest.raises(InputError, match="Invert its photo again"):
        archives.extract_scene(None, zipped_package(tmp_path), tmp_path / "target")


def test_a_scene_of_a_large_photo_is_refused(tmp_path, monkeypatch):
    """The server itself decodes it."""
    monkeypatch.setattr(archives, "SETTINGS", StudioSettings(upload_pixels=3000))
    with pytest.raises(InputError, match=r"a photo of 64 x 48 pixels.*up to 0\.003"):
        archives.extract_scene(None, zipped_package(tmp_path), tmp_path / "target")
