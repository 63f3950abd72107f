"""`bench studio`: what a person at the page waits for, measured in a real browser, and what the server holds."""

from __future__ import annotations

import contextlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.errors import InputError, MaterialistError, SetupError

READY = "text=Ready: click an object"
COLUMNS = (
    Column("load_s", "page load s", "lower", 2),
    Column("drop_s", "drop to first slider s", "lower", 1),
    Column("reopen_s", "reopen to slider s", "lower", 1),
    Column("median_ms", "slider to preview ms", "lower", 0),
    Column("p95_ms", "p95 ms", "lower", 0),
    Column("cpu_ms", "processor ms a move", "lower", 0),
    Column("light_ms", "other light ms", "lower", 0),
    Column("body_s", "glass, first picture s", "lower", 1),
    Column("glass_s", "glass slider to picture s", "lower", 2),
    Column("glass_worst_s", "worst s", "lower", 2),
    Column("glass_cpu_s", "processor s a picture", "lower", 2),
    Column("beside_ms", "p95 ms beside glass", "lower", 0),
    Column("idle_mb", "idle MB", "lower", 0),
    Column("scene_mb", "MB more with a scene", "lower", 0),
    Column("after_mb", "MB more after it was left", "lower", 0),
)
NOTE = """A studio in a process of its own, and Chromium through Playwright on the same machine. Page load is the median
of five fresh pages, from the address to a stage that can be seen. Drop to first slider runs from handing the photo to
the page to the first live picture of a moved slider: reading, fit, preview, a click that selects, a move. Slider to
preview is the time in the browser from the event of a slider (hue, saturation, brightness, roughness and metallic in
turn) to the decoded picture on the page; processor milliseconds are the server's for one move, which other work on the
machine hardly changes. Glass: from the button to the first traced picture, which includes its process, its body and the
background behind it; then the time from the event of a slider (index of refraction, roughness) to the decoded picture
of that value, median and worst, and the processor seconds of all processes; then sliders of an edit
elsewhere, with the glass in the picture. Memory is the resident set of the server."""

_MOVE = """([name, value]) => new Promise((done, fail) => {
  const picture = document.querySelector('#stage .photo'), before = picture.src;
  const slider = document.querySelector(`#${name} input[type=range]`), start = performance.now();
  slider.value = value; slider.dispatchEvent(new Event('input', {bubbles: true}));
  const look = () => {
    if (picture.src !== before && picture.complete) picture.decode().then(() => done(performance.now() - start), fail);
    else if (performance.now() - start > 60000) fail(new Error('no picture'));
    else requestAnimationFrame(look);
  };
  look();
})"""
_GLASS_MOVE = """([name, value]) => new Promise((done, fail) => {
  const view = document.querySelector('#stage .view'), picture = view.querySelector('.photo');
  const slider = document.querySelector(`#${name} input[type=range]`), start = performance.now();
  let asked = false;
  slider.value = value; slider.dispatchEvent(new Event('input', {bubbles: true}));
  const look = () => {
    asked = asked || view.dataset.waiting === 'yes';
    if (asked && view.dataset.waiting !== 'yes')
      picture.decode().then(() => done((performance.now() - start) / 1000), fail);
    else if (performance.now() - start > 300000) fail(new Error('no picture'));
    else requestAnimationFrame(look);
  };
  look();
})"""
_GLASS_VALUES = (
    ("glass_ior", 1.3), ("glass_ior", 1.7), ("glass_ior", 1.15), ("glass_roughness", 0.2), ("glass_roughness", 0.4),
    ("glass_roughness", 0.1), ("glass_roughness", 0.0), ("glass_ior", 1.45),
)  # fmt: skip
_RANGES = {"hue": (-170, 170), "saturation": (-0.8, 1), "value": (-0.8, 0.8), "roughness": (0, 1), "metallic": (0, 1)}


@dataclass(frozen=True, kw_only=True)
class StudioBench(Benchmark):
    """Measure the studio on one photo (a file, or example:NAME), or on a `scene` that is there, without the drop.

    `click` is where in the photo an object is selected, as shares of its width and height. Raises SetupError where
    Playwright or Chromium are missing. `data` and `device` are not used.
    """

    photo: str = "example:astronaut"
    size: int = 512
    moves: int = 60
    click: str = "0.3,0.8"
    scene: str = ""

    def run(self, data: Path | None, output: Path) -> None:
        if not 5 <= self.moves <= 10_000:
            raise InputError(f"moves is {self.moves}; give 5 to 10000.")
        photo, click = _photo(self.photo), _share(self.click)
        with (
            tempfile.TemporaryDirectory() as folder,
            _browser() as chromium,
            _server(Path(folder), self.scene) as (server, address),
        ):
            row = _measured(self, server, address, chromium, photo, click)
        row |= {"method": "studio", "sample": self.photo}
        write(Report("The studio", NOTE, self.settings(data), COLUMNS, [row]), output)


def _measured(
    bench: StudioBench, server: psutil.Process, address: str, browser: Any, photo: Path, click: tuple[float, float]
) -> dict[str, Any]:
    open_already = bool(bench.scene)
    row: dict[str, Any] = {"idle_mb": _resident(server)}
    if not open_already:  # else every page would open the scene
        row["load_s"] = float(np.median([_load(browser, address) for _ in range(5)]))
        row["idle_mb"] = max(row["idle_mb"], _resident(server))
    page = browser.new_page(viewport={"width": 1280, "height": 1000})
    page.set_default_timeout(900_000)
    start = time.perf_counter()
    page.goto(address)
    if not open_already:
        start = _dropped(page, photo, bench.size)
    page.wait_for_selector(READY)
    _select(page, click)
    page.evaluate(_MOVE, ["hue", 40])
    row["reopen_s" if open_already else "drop_s"] = time.perf_counter() - start
    row |= _moved(server, page, bench.moves, bench.seed)
    row["scene_mb"] = _resident(server) - row["idle_mb"]
    row |= _glass(server, page, bench.moves, click, bench.seed)
    page.close()
    time.sleep(5)
    row["after_mb"] = _resident(server) - row["idle_mb"]
    return row


def _load(browser: Any, address: str) -> float:
    page = browser.new_page()
    start = time.perf_counter()
    page.goto(address)
    page.wait_for_selector("#stage .view")
    seconds = time.perf_counter() - start
    page.close()
    return seconds


def _dropped(page: Any, photo: Path, size: int) -> float:
    """Hand a photo over and start; returns when that was."""
    page.wait_for_selector("#start")
    page.get_by_label("Working size").click()
    page.get_by_role("option", name=f"{size} pixels").click()
    start = time.perf_counter()
    page.set_input_files("#file input[type=file]", str(photo))
    page.wait_for_selector("#facts img")
    page.click("#start")
    return start


def _select(page: Any, click: tuple[float, float]) -> None:
    box = page.locator("#stage .view").bounding_box()
    page.locator("#stage .view").click(position={"x": click[0] * box["width"], "y": click[1] * box["height"]})
    page.wait_for_selector("#stage .view[data-selected=yes]")


def _moved(server: psutil.Process, page: Any, moves: int, seed: int) -> dict[str, float]:
    """Times of slider moves in milliseconds, one slider after the other, each to a random value."""
    before = sum(server.cpu_times()[:2])
    times = _material_moves(page, moves, seed)
    spent = sum(server.cpu_times()[:2]) - before
    page.get_by_role("tab", name="Light").click()
    light = [page.evaluate(_MOVE, ["rotate", 30 * k]) for k in (1, 2, 3)]
    page.evaluate(_MOVE, ["rotate", 0])
    return {
        "median_ms": float(np.median(times)), "p95_ms": float(np.quantile(times, 0.95)), "cpu_ms": 1000 * spent / moves,
        "light_ms": float(np.median(light)),
    }  # fmt: skip


def _material_moves(page: Any, moves: int, seed: int) -> list[float]:
    stand = {name: float(page.input_value(f"#{name} input[type=range]")) for name in _RANGES}
    return [page.evaluate(_MOVE, [name, value]) for name, value in values(moves, seed, stand)]


def values(moves: int, seed: int, stand: dict[str, float]) -> Iterator[tuple[str, float]]:
    """Sliders in turn and where each goes: far enough from where it was (`stand`) that the picture must change."""
    rng = np.random.default_rng(seed)
    last = dict(stand)
    for k in range(moves):
        name = list(_RANGES)[k % len(_RANGES)]
        low, high = _RANGES[name]
        while abs((value := round(float(rng.uniform(low, high)), 2)) - last[name]) < 0.05 * (high - low):
            pass
        last[name] = value
        yield name, value


def _glass(server: psutil.Process, page: Any, moves: int, click: tuple[float, float], seed: int) -> dict[str, float]:
    """The selection as glass: its first picture, its sliders, and those of an edit elsewhere, beside it."""
    page.get_by_role("tab", name="Objects").click()
    page.get_by_role("button", name="Turn the selection to glass").click()
    start = time.perf_counter()
    page.click("#glass")
    for state in ("[data-waiting=yes]", ":not([data-waiting=yes])"):
        page.wait_for_selector(f"#stage .view{state}")
    body = time.perf_counter() - start
    page.evaluate(_GLASS_MOVE, ["glass_roughness", 0.3])  # kernels of another kind are compiled once
    before = _all_spent(server)
    times = [page.evaluate(_GLASS_MOVE, list(move)) for move in _GLASS_VALUES]
    spent = (_all_spent(server) - before) / len(times)
    _paint(page, 1 - click[0], 1 - click[1])
    page.get_by_role("tab", name="Material").click()
    beside = _material_moves(page, max(5, moves // 2), seed + 1)
    return {
        "body_s": body, "glass_s": float(np.median(times)), "glass_worst_s": max(times), "glass_cpu_s": spent,
        "beside_ms": float(np.quantile(beside, 0.95)),
    }  # fmt: skip


def _paint(page: Any, x: float, y: float) -> None:
    """Select a strip with the brush around a share of the stage, and nothing else."""
    page.get_by_role("button", name="Select nothing").click()
    page.wait_for_selector("#stage .view:not([data-selected=yes])")
    page.get_by_role("radio", name="Brush", exact=True).check()
    page.locator("#stage .view").scroll_into_view_if_needed()
    box = page.locator("#stage .view").bounding_box()
    page.mouse.move(box["x"] + (x - 0.08) * box["width"], box["y"] + y * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + (x + 0.08) * box["width"], box["y"] + y * box["height"], steps=5)
    page.mouse.up()
    page.wait_for_selector("#stage .view[data-selected=yes]")


def _all_spent(server: psutil.Process) -> float:
    """Processor seconds of the server and of the processes that it runs."""
    return sum(sum(process.cpu_times()[:2]) for process in (server, *server.children(recursive=True)))


@contextlib.contextmanager
def _server(folder: Path, scene: str) -> Iterator[tuple[psutil.Process, str]]:
    """A studio, and its address once it answers."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "materialist", "studio", *([scene] if scene else []), "--port", str(port)]
    process = subprocess.Popen([*command, "--work", str(folder / "work")], stdout=subprocess.DEVNULL)
    address = f"http://127.0.0.1:{port}"
    try:
        end = time.monotonic() + 120
        while not _answers(address):
            if process.poll() is not None or time.monotonic() > end:
                raise MaterialistError("The studio did not start; try: materialist studio")
            time.sleep(0.2)
        yield psutil.Process(process.pid), address
    finally:
        process.terminate()
        process.wait(30)


def _answers(address: str) -> bool:
    try:
        urllib.request.urlopen(address, timeout=10).close()
    except OSError:
        return False
    return True


@contextlib.contextmanager
def _browser() -> Iterator[Any]:
    """Chromium without a window. Raises SetupError where it is missing."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise SetupError(f"This benchmark needs a browser: {sys.executable} -m pip install playwright") from error
    if program is None:
        raise SetupError("This benchmark needs Chromium: apt-get install chromium")
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


def _photo(photo: str) -> Path:
    from materialist.io.examples import PREFIX, example_path

    path = example_path(photo) if photo.startswith(PREFIX) else Path(photo)
    if not path.is_file():
        raise InputError(f"There is no photo at {photo}.")
    return path


def _share(text: str) -> tuple[float, float]:
    try:
        x, y = (float(part) for part in str(text).split(","))
    except ValueError as error:
        raise InputError(f"click is {text!r}; give two shares such as 0.3,0.8.") from error
    return x, y


def _resident(process: psutil.Process) -> float:
    return process.memory_info().rss / 1e6
