"""Who a page belongs to, and what the server refuses."""

import os
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import pytest
from made_tasks import until, wait
from studio_scenes import HEIGHT, WIDTH, package, zipped_package
from studio_server import free_port

from materialist.errors import InputError
from materialist.io.photo import example_path
from materialist.jobs.queue import QUEUED, STOPPED, Job, JobQueue
from materialist.studio import SETTINGS, StudioSettings, archives, stage, tasks
from materialist.studio import studio as module
from materialist.studio.access import quota
from materialist.studio.access.quota import Allowance
from materialist.studio.reporting import quality
from materialist.studio.server import check_host
from materialist.studio.studio import LOCAL_PERSON, Studio
from materialist.studio.workspace import WorkFolder


def test_people_are_kept_apart(shared):
    anna, bert = (shared.person(cookie * 32) for cookie in "ab")
    project = shared.work.new("Anna's", anna)
    (project.scene).mkdir()
    page = shared.page("page", bert)
    assert shared.projects(bert) == [] and shared.projects(anna) == [project]
    shared.start = shared.work.new("For all", LOCAL_PERSON)
    assert (
        shared.projects(bert) == [shared.start]
        and shared.project(shared.start.name, bert) == shared.start
    )
    with pytest.raises(InputError, match="no longer"):
        shared.open(page, project.name)
    for name, person in ((None, bert), ("page", anna)):
        with pytest.raises(InputError, match="reload"):
            shared.page(name, person)
    assert shared.page("page", bert) is page
    shared.leave("page")
    shared.leave("page")
    assert shared.page("page", bert) is not page


@pytest.mark.parametrize("token", [None, "", "../../x", "A" * 32, "a" * 40, 5])
def test_tokens_are_checked(shared, token):
    with pytest.raises(InputError):
        shared.person(token)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "example.org", "::"])
def test_others_need_leave(host):
    with pytest.raises(InputError, match="--password"):
        check_host(host, None, False)
    assert not check_host(host, "word", False) and not check_host(host, None, True)


def test_a_port_in_use_is_one_sentence(refused, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"Port {port}" in refused("studio", "--port", port, "--work", tmp_path / "w")
    assert not (tmp_path / "w").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["--port", "0"],
        ["--port", "99999"],
        ["--work", "/proc/nowhere"],
        ["--workers", "0"],
        ["/no/such/scene"],
        ["x" * 300],
    ],
)
def test_bad_options_end_with_2_and_make_no_folder(refused, arguments, tmp_path):
    work = [] if "--work" in arguments else ["--work", tmp_path / "w"]
    port = [] if "--port" in arguments else ["--port", "47391"]
    refused("studio", *arguments, *work, *port)
    assert not (tmp_path / "w").exists()


def test_files_are_handed_over_under_names_nobody_guesses(shared):
    file = shared.work.root / "result.png"
    file.write_bytes(b"x")
    first = shared.public_copy("anna", file)
    second = shared.public_copy("anna", file)
    assert first != second and first.startswith(str(shared.work.cache))
    assert len(first.split("/")[-2]) == 32
    assert str(shared.files.path("anna", first)) == first
    for person, name in (("bert", first), ("anna", str(file)), ("anna", "/etc/passwd")):
        with pytest.raises(InputError, match="not here any more"):
            shared.files.path(person, name)


def test_what_is_made_for_a_page_ends_with_it_and_the_rest_goes_on(shared, tmp_path):
    session = shared.page("page", shared.person("a" * 32)).session
    jobs = {
        kind: Job(kind, session.person, tmp_path, print)
        for kind in ("take", "removal", "final", "invert")
    }
    for job in jobs.values():
        session.note_job(job)
    shared.leave("page")
    assert [job.state for job in jobs.values()] == [STOPPED] * 2 + [QUEUED] * 2


def test_strangers_see_no_folders_of_this_machine(shared, tmp_path):
    text = f"/srv/a b.txt: {tmp_path}/photo-001/x.png and '/home/me/y.exr' are damaged; see https://a.example/b (1/2)"
    assert (
        shared.without_folders(text)
        == "a b.txt: x.png and 'y.exr' are damaged; see https://a.example/b (1/2)"
    )
    session = shared.page("page", "a" * 32).session
    session.project = shared.work.new("One", session.person)
    assert str(tmp_path) not in stage.commands(session) and "photo-001" in stage.commands(session)
    session.local = True
    assert f"cd {tmp_path}" in stage.commands(session)


def test_one_person_cannot_fill_the_queue(shared, tmp_path):
    session = shared.page("page", "a" * 32).session
    for _ in range(SETTINGS.jobs_a_person):
        shared.submit(session, wait, tmp_path)
    with pytest.raises(InputError, match="6 jobs waiting or running"):
        shared.submit(session, wait, tmp_path)
    assert shared.submit(shared.page("other", "b" * 32).session, wait, tmp_path)


def test_photos_that_were_not_taken_apart_to_the_end_are_swept(shared):
    folders = {}
    for name in ("old", "fresh", "elsewhere", "ready", "edited"):
        place = shared.work.root / "x.scene" if name == "elsewhere" else None
        project = shared.work.new(name, "a" * 32, scene=place)
        folders[name] = project.folder
        if name == "ready":
            project.scene.mkdir()
            (project.scene / "scene.json").touch()
        if name == "edited":
            project.workspace("me")
    for name in folders.keys() - {"fresh"}:
        os.utime(folders[name], (0, 0))
    shared.work.new("another", "a" * 32)
    assert [name for name, folder in folders.items() if not folder.exists()] == ["old"]


@pytest.mark.slow
def test_a_studio_that_is_terminated_leaves_no_cache_and_no_jobs(tmp_path):
    """Two jobs at work, two in the queue."""
    script = """if True:
        import sys
        from functools import partial
        from pathlib import Path

        from made_tasks import answer
        from materialist.cli import app
        from materialist.cli.outcome import run_to_exit_code
        from materialist.jobs.queue import Job
        from materialist.studio import server

        work, port = sys.argv[1:]
        made = server.new_studio(work, single_user=True, workers=2)
        server.new_studio = lambda *a, **k: made
        for _ in range(4):
            made.jobs.submit(Job("final", "me", Path(work), answer, {"how": "wait", "out": work}))
        sys.exit(run_to_exit_code(app, ["studio", "--port", port, "--work", work]))
    """
    port = free_port()
    command = [sys.executable, "-c", script, str(tmp_path / "work")]
    process = subprocess.Popen(
        [*command, str(port)], env={**os.environ, "TMPDIR": str(tmp_path)}, stdout=subprocess.PIPE
    )
    for line in process.stdout:
        if b"The studio is open" in line:
            break
    until(lambda: len(list((tmp_path / "work").glob(".partial-*"))) == 2, 60)
    process.terminate()
    assert process.wait(30) == -15
    until(lambda: not list((tmp_path / "work").glob(".partial-*")))
    assert [file.name for file in tmp_path.iterdir() if file.name != "work"] == []


def test_the_memory_of_many_closed_pages_is_given_back_once_and_not_by_who_closes_them(
    shared, monkeypatch
):
    freed = []
    begun = threading.Event()
    go_on = threading.Event()

    def give_back():
        freed.append(threading.current_thread())
        begun.set()
        assert go_on.wait(10)

    monkeypatch.setattr("materialist.studio.studio.give_back", give_back)
    for number in range(201):
        page = shared.page(f"page{number}", f"person{number}")
        page.session.live = SimpleNamespace(close=lambda: None, rest=lambda idle: None)
    shared.leave("page0")
    assert begun.wait(10)
    for number in range(1, 201):
        shared.leave(f"page{number}")
    go_on.set()
    shared._closer.shutdown(wait=True)
    assert len(freed) == 2
    assert threading.current_thread() not in freed


def test_a_page_that_is_not_heard_of_is_forgotten_after_a_while(shared, monkeypatch):
    monkeypatch.setattr("materialist.studio.studio.SETTINGS", StudioSettings(page_seconds=0))
    person = "a" * 32
    busy = shared.page("busy", person)
    with busy.at_work():
        silent = shared.page("silent", person)
        assert shared.page("other", person) and silent.left and not busy.left
    assert shared.page("silent", person) is not silent and busy.left


def test_a_job_that_is_refused_leaves_no_photo_behind(shared):
    session = shared.page("page", "a" * 32).session
    for _ in range(SETTINGS.jobs_a_person):
        shared.submit(session, wait, shared.work.root)
    with pytest.raises(InputError, match="6 jobs waiting"):
        shared.begin(session, example_path("example:cat"), "auto", 512, "auto")
    assert not shared.work.projects()


def test_little_is_remembered_of_people_who_are_gone(shared, monkeypatch):
    monkeypatch.setattr("materialist.studio.studio.SETTINGS", StudioSettings(people=2))
    for person in "abac":
        shared.note_last(person, "photo-001")
    assert [*shared.last] == ["a", "c"]
    shared.quota._claims["a"] = deque(
        [quota.Claim(time.monotonic() - 3601, SETTINGS.storage_quota)]
    )
    shared.claim("b", 10)
    assert [*shared.quota._claims] == ["b"]
    for person in "abac":
        shared.note_sender(person, "1.2.3.4")
    assert [*shared.senders] == ["a", "c"]


def test_the_memory_of_a_scene_counts_its_photo_twice(shared, tmp_path):
    """Once in the studio, once in the process of the preview."""
    project = shared.work.new("Room", "me", scene=package(tmp_path))
    expected = SETTINGS.free_for_scene + (SETTINGS.free_a_pixel + 2 * 12) * WIDTH * HEIGHT
    assert module._memory_of(project) == expected
    (project.scene / "scene.json").write_text("[" * 100_000)
    assert module._memory_of(project) == SETTINGS.free_for_scene


def test_the_disk_of_the_photos_counts_too(shared, monkeypatch):
    free = {shared.work.cache: 10**12, shared.work.root: 10}
    monkeypatch.setattr("shutil.disk_usage", lambda place: SimpleNamespace(free=free[place]))
    with pytest.raises(InputError, match="disk of the studio is full"):
        shared.claim("a", 10)


def test_pages_of_one_person_on_one_photo_share_a_session(studio, opened):
    name = studio.start.name
    second = studio.page("second", "me")
    empty = second.session
    studio.open(second, name)
    assert second.session is opened and empty is not opened
    revision = opened.revision
    opened.deselect()
    assert second.session.revision > revision
    studio.put_away(second)  # back to the photos: the other page keeps its scene
    assert opened.live is not None and second.session.project is None
    studio.leave("second")
    assert studio.session_on(studio.start, "me") is opened


def test_a_photo_that_is_deleted_is_gone_from_every_page(shared, tmp_path):
    person = "a" * 32
    project = shared.work.new("One", person)
    archives.unpack_scene(zipped_package(tmp_path), project.scene, Allowance())
    pages = [shared.page(name, person) for name in ("first", "second")]
    for page in pages:
        shared.open(page, project.name)
    rendering = shared.submit(pages[0].session, wait, pages[0].session.workspace)
    shared.discard(project)
    assert [page.session.project for page in pages] == [None, None]
    assert rendering.state == STOPPED and shared.projects(person) == []
    # A late end of the old photo's work must never meet a new one of the same number.
    assert shared.work.new("Two", person).name != project.name


def test_who_opened_what_survives_the_studio(tmp_path):
    for _ in range(2):
        made = Studio(WorkFolder(tmp_path), JobQueue(1), single_user=False)
        made.jobs.close()
        if made.last:
            break
        made.note_last("anna", "photo-007")
    assert made.last == {"anna": "photo-007"}
    made.forget_last("anna")
    (tmp_path / "last.json").write_text("[]")
    assert WorkFolder(tmp_path).read_last() == {}


def test_the_report_carries_no_html_of_a_scene(opened):
    scene = opened.scene
    prior = replace(scene.prior, predictor="`<script>alert(1)</script>")
    photo = replace(scene.photo, fov_source="<img src=x onerror=alert(2)>")
    shown = quality(replace(scene, prior=prior, photo=photo))
    assert "<script" not in shown and "<img" not in shown
    assert "script>alert(1)" in shown


def test_a_scene_that_is_unpacked_counts_as_stored(studio, tmp_path, monkeypatch, opens_here):
    monkeypatch.setattr(quota, "SETTINGS", StudioSettings(storage_quota=1000))
    before = studio.work.projects()
    with pytest.raises(InputError, match="within an hour"):
        studio.unpack(studio._new_session("me"), zipped_package(tmp_path))
    assert studio.work.projects() == before


def test_a_process_that_gets_ready_leaves_it_to_a_job_that_waits(monkeypatch):
    done = []

    class Report:
        outdated = False

    def invert(photo, *, progress, on_stage, **options):
        progress("predict", 0, 1)
        done.append("first maps")
        Report.outdated = True
        on_stage("materials", None)
        done.append("second maps")

    monkeypatch.setattr(tasks.mt, "invert", invert)
    tasks.warm(Report())
    assert done == ["first maps"]


def test_the_preview_of_the_next_photo_gets_ready_and_does_not_wait_for_ever(shared, monkeypatch):
    class Process:
        running = True

        def close(self):
            self.running = False

    made = []
    monkeypatch.setattr(module, "warmed", lambda device: made.append(Process()) or made[-1])
    monkeypatch.setattr(shared.jobs, "warm", lambda task, seconds: None)
    shared.keeps_ready = True
    shared.get_ready()
    shared.get_ready()
    shared.leave_idle()
    assert len(made) == 1 and made[0].running
    shared._spare_until = 0.0
    shared.leave_idle()
    assert not made[0].running
