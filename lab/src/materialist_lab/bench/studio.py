"""`bench studio`: what a person at the page waits for, measured in a real browser, and what the server holds.

A studio in a process of its own, and Chromium through Playwright on the same machine. Page load is the median of five
fresh pages, from the address to a stage that can be seen. A photo is then dropped: first map and ready run from handing
it to the page to the first picture of a map, and to a picture that can be clicked with its preview built. What a
change takes is the time in the browser from the event of a control to another picture on the canvas: a slider of the
material (hue, saturation, brightness, roughness and metallic in turn), the light turned. A drag moves the handle of an
object, or a lamp, for three seconds: pictures a second. Glass: from the button to the first traced picture, which
includes its process, its body and the background behind it; then the median from a slider's event (index of refraction,
roughness) to the traced picture. Final: from the button to the path-traced picture, with a changed material, then with
glass. Memory is the resident set of the server alone: without a photo, with one, and a while after the page was closed;
with a photo also of the server and the processes that it keeps for it, each with its share of what they share.
"""

import base64
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
from PIL import Image

from materialist.errors import InputError, MaterialistError, SetupError
from materialist.install import install_command
from materialist.io.photo import PREFIX, example_path
from materialist.option_kinds import option
from materialist_lab.bench.benchmark import SIZE, Benchmark, Row
from materialist_lab.bench.report import Column, Report

_WATCH = """() => {
  // A small copy of the picture, sixty times a second: when it last changed, and how often.
  const small = document.createElement('canvas'); small.width = small.height = 64;
  const paper = small.getContext('2d', {willReadFrequently: true});
  const seen = window.seen = {changes: 0, at: 0};
  let before = 0;
  const look = () => {
    const canvas = document.querySelector('#stage canvas');
    paper.drawImage(canvas, 0, 0, 64, 64);
    let now = 0;
    for (const pixel of new Uint32Array(paper.getImageData(0, 0, 64, 64).data.buffer))
      now = (Math.imul(now, 31) + pixel) | 0;
    if (now !== before) { seen.changes += 1; seen.at = performance.now(); before = now; }
    requestAnimationFrame(look);
  };
  look();
}"""
_MOVE = """([name, value, traced]) => new Promise((done, fail) => {
  const slider = document.querySelector(`#${name} input[type=range]`), start = performance.now();
  const badge = () => document.querySelector('#stage .badge')?.textContent ?? '';
  const changes = window.seen.changes;
  let asked = false;
  slider.value = value; slider.dispatchEvent(new Event('input', {bubbles: true}));
  const look = () => {
    asked = asked || badge().startsWith('Glass: tracing');
    const changed = window.seen.changes > changes;
    if (changed && (!traced || (asked && badge().startsWith('Glass traced')))) done(window.seen.at - start);
    else if (performance.now() - start > 120000) fail(new Error(`no picture of ${name} ${value}: ${badge()}`));
    else requestAnimationFrame(look);
  };
  look();
})"""
"""Moves a slider; milliseconds until its picture is on the canvas. `traced`: that of the glass, not its sketch."""
_GLASS_MOVES = (
    ("glass_ior", 1.3),
    ("glass_ior", 1.7),
    ("glass_roughness", 0.2),
    ("glass_roughness", 0.0),
    ("glass_ior", 1.45),
)
_CLEAR = """async () => {
  const headers = {'x-materialist-page': sessionStorage.getItem('page')};
  const post = (place, body) =>
    fetch(`/api/${place}`, {method: 'POST', headers, body: JSON.stringify(body)}).then((a) => a.json());
  let state = await post('deselect', {});
  while (state.steps.length) state = await post('act', {action: 'remove', index: 0});
}"""
"""Takes all edits, and the selection, away."""
_DROP = """([name, data]) => {
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0)), carried = new DataTransfer();
  carried.items.add(new File([bytes], name));
  for (const kind of ['dragenter', 'dragover', 'drop'])
    document.body.dispatchEvent(new DragEvent(kind, {bubbles: true, cancelable: true, dataTransfer: carried}));
}"""
_DRAG = """([kind, x, y, far, seconds]) => new Promise((done) => {
  // From within: each event of the driver would wait for a frame, and for its way to and fro.
  const handle = document.querySelector(`.handle.${kind}`), start = performance.now();
  const step = () => {
    const spent = (performance.now() - start) / 1000;
    if (spent > seconds) return done();
    const at = {clientX: x + far * Math.sin(3 * spent), clientY: y};
    handle.dispatchEvent(new PointerEvent('pointermove', {bubbles: true, pointerId: 1, buttons: 1, ...at}));
    requestAnimationFrame(step);
  };
  step();
})"""
"""Moves a handle that is held to and fro, once a frame."""
DRAG = 3.0
"""Seconds of a drag."""
_RANGES = {
    "hue": (-170, 170),
    "saturation": (-0.8, 1),
    "value": (-0.8, 0.8),
    "roughness": (0, 1),
    "metallic": (0, 1),
}
FORGOTTEN = 85.0
"""Seconds after which the server has forgotten a closed page: `StudioSettings.page_seconds`, and its sweeps."""


@dataclass(frozen=True, kw_only=True)
class StudioBench(Benchmark):
    """Measure the studio on one photo.

    Raises SetupError where Playwright or Chromium are missing. `data` and `device` are not used.
    """

    columns = (
        Column("size", "pixels", "", 0),
        Column("load_s", "page load s", "lower", 2),
        Column("map_s", "drop to first map s", "lower", 1),
        Column("ready_s", "drop to ready s", "lower", 1),
        Column("median_ms", "slider ms", "lower", 0),
        Column("p95_ms", "p95 ms", "lower", 0),
        Column("light_ms", "light turned ms", "lower", 0),
        Column("object_hz", "object dragged, pictures a s", "higher", 1),
        Column("lamp_hz", "lamp dragged", "higher", 1),
        Column("final_s", "final s", "lower", 1),
        Column("body_s", "glass, first picture s", "lower", 1),
        Column("glass_s", "glass slider s", "lower", 2),
        Column("final_glass_s", "final with glass s", "lower", 1),
        Column("idle_mb", "idle MB", "lower", 0),
        Column("scene_mb", "MB with a photo", "lower", 0),
        Column("all_mb", "MB with a photo, all processes", "lower", 0),
        Column("closed_mb", "MB after closing", "lower", 0),
    )

    photo: str = option("example:astronaut", "A file, or example:NAME.", kind="name")
    size: int = option(512, "Working size.", **SIZE)
    moves: int = option(60, "Moves of sliders.", kind="whole", low=5, high=10_000)
    click: tuple[float, float] = option(
        (0.3, 0.8),
        "Where an object is selected, as shares of width and height.",
        kind="numbers",
        count=2,
    )

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # Checked before the server and the browser start.
        photo = example_path(self.photo) if self.photo.startswith(PREFIX) else Path(self.photo)
        if not photo.is_file():
            raise InputError(f"There is no photo at {self.photo}.")
        with (
            tempfile.TemporaryDirectory() as folder,
            _browser() as browser,
            _server(Path(folder)) as (server, address),
        ):
            shown = _enlarged(photo, self.size, Path(folder))
            measured = self._measured(server, address, browser, shown)
        yield {"method": "studio", "sample": self.photo, "size": self.size, **measured}

    def _measured(
        self, server: psutil.Process, address: str, browser: Any, photo: Path
    ) -> dict[str, float]:
        # --- Page load, and memory without a photo ---
        row = {"load_s": float(np.median([_load(browser, address) for _ in range(5)]))}
        row["idle_mb"] = _resident(server)
        # --- From the photo to a picture that can be clicked ---
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(300_000)
        page.goto(address)
        row |= _dropped(page, photo, self.size)
        page.evaluate(_WATCH)
        self._select(page)
        # --- Sliders of the material, then of the light ---
        stand = {name: float(page.input_value(f"#{name} input[type=range]")) for name in _RANGES}
        times = [
            page.evaluate(_MOVE, [*move, False])
            for move in slider_moves(self.moves, self.seed, stand)
        ]
        row |= {"median_ms": float(np.median(times)), "p95_ms": float(np.quantile(times, 0.95))}
        page.locator("#tab-light").click()
        turned = [page.evaluate(_MOVE, ["rotate", 30 * k, False]) for k in (1, 2, 3)]
        row["light_ms"] = float(np.median(turned))
        row["final_s"] = _final(page)
        row["scene_mb"] = _resident(server)
        row["all_mb"] = _shared_out(server)
        # --- An object and a lamp, dragged ---
        row |= {"object_hz": self._dragged(page, "thing"), "lamp_hz": self._dragged(page, "lamp")}
        # --- Glass ---
        page.evaluate(_CLEAR)
        page.wait_for_selector("#stage:not([data-selected=yes])")
        self._select(page)
        row |= _glass(page)
        row["final_glass_s"] = _final(page)
        page.close()
        time.sleep(FORGOTTEN)
        row["closed_mb"] = _resident(server)
        return row

    def _place(self, page: Any, x: float, y: float) -> tuple[float, float]:
        """Where a share of the photo's width and height is on the page."""
        box = page.locator(".marks").bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def _select(self, page: Any) -> None:
        page.locator("#tab-material").click()
        page.mouse.click(*self._place(page, *self.click))
        page.wait_for_selector("#stage[data-selected=yes]")
        page.wait_for_selector("#hue")

    def _dragged(self, page: Any, kind: str) -> float:
        """Pictures a second while an object, or a lamp, that is put into the photo is dragged to and fro."""
        if kind == "thing":
            page.locator("#tab-object").click()
            page.get_by_role("button", name="Ball").click()
            page.wait_for_selector(".stage.place")
        else:
            page.locator("#stage").focus()
            page.keyboard.press("4")
            page.wait_for_selector(".stage.lamp")
        # Not on each other: the handle would take the click.
        start = self._place(page, 0.5, 0.8 if kind == "thing" else 0.4)
        page.mouse.click(*start)
        page.wait_for_selector(f".handle.{kind}")
        page.wait_for_timeout(1500)
        page.mouse.move(*start)
        page.mouse.down()
        width = page.locator(".marks").bounding_box()["width"]
        before = page.evaluate("window.seen.changes")
        page.evaluate(_DRAG, [kind, *start, 0.2 * width, DRAG])
        seen = page.evaluate("window.seen.changes") - before
        page.mouse.up()
        page.wait_for_timeout(1000)
        return seen / DRAG


def _enlarged(photo: Path, size: int, folder: Path) -> Path:
    """The photo, enlarged where it is smaller than the working size: the page enlarges nothing."""
    with Image.open(photo) as image:
        scale = size / max(image.size)
        if scale <= 1:
            return photo
        large = image.convert("RGB").resize(
            (round(image.width * scale), round(image.height * scale))
        )
    large.save(folder / "photo.png")
    return folder / "photo.png"


def _load(browser: Any, address: str) -> float:
    page = browser.new_page()
    start = time.perf_counter()
    page.goto(address)
    page.wait_for_selector("#stage")
    seconds = time.perf_counter() - start
    page.close()
    return seconds


def _dropped(page: Any, photo: Path, size: int) -> dict[str, float]:
    """Drop a photo on the page; seconds to the first picture of a map, and until the picture can be clicked."""
    page.wait_for_selector("#stage")
    # The page asks for a working size in a list that is folded away; what it keeps of it is plain.
    page.evaluate("(size) => sessionStorage.setItem('view', JSON.stringify({size}))", size)
    page.reload()
    # Somebody drops on what they see; before that, the page may open its sheet over the photo.
    page.wait_for_selector(".veil.open")
    data = base64.b64encode(photo.read_bytes()).decode()
    start = time.perf_counter()
    page.evaluate(_DROP, [photo.name, data])
    page.wait_for_selector(".found img")
    first = time.perf_counter() - start
    page.wait_for_selector(".marks")
    page.wait_for_selector("#progress", state="hidden")
    return {"map_s": first, "ready_s": time.perf_counter() - start}


def _final(page: Any) -> float:
    """Seconds from the button to the path-traced picture."""
    start = time.perf_counter()
    page.locator("#final").click()
    page.wait_for_selector("#stage[data-kind=final]")
    return time.perf_counter() - start


def slider_moves(moves: int, seed: int, stand: dict[str, float]) -> Iterator[tuple[str, float]]:
    """Sliders in turn and where each goes: far enough from where it was (`stand`) that the picture must change."""
    rng = np.random.default_rng(seed)
    last = dict(stand)
    for k in range(moves):
        name = list(_RANGES)[k % len(_RANGES)]
        low, high = _RANGES[name]
        # A smaller move may leave the picture as it was, and the wait for another would not end.
        while abs((value := round(float(rng.uniform(low, high)), 2)) - last[name]) < 0.05 * (
            high - low
        ):
            pass
        last[name] = value
        yield name, value


def _glass(page: Any) -> dict[str, float]:
    """The selection as glass: its first picture, and its sliders."""
    # --- The first traced picture: the page waits, then no longer ---
    start = time.perf_counter()
    page.get_by_role("button", name="Glass", exact=True).click()
    page.wait_for_selector("#stage .badge >> text=/^Glass traced/")
    body = time.perf_counter() - start
    # Kernels of another kind are compiled once.
    page.evaluate(_MOVE, ["glass_roughness", 0.3, True])
    times = [page.evaluate(_MOVE, [*move, True]) for move in _GLASS_MOVES]
    return {"body_s": body, "glass_s": float(np.median(times)) / 1000}


@contextlib.contextmanager
def _server(folder: Path) -> Iterator[tuple[psutil.Process, str]]:
    """A studio, and its address once it answers."""
    # A port that is free now; the studio binds it a moment later.
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "materialist",
        "studio",
        "--port",
        str(port),
    ]
    process = subprocess.Popen(
        [*command, "--work", str(folder / "work")], stdout=subprocess.DEVNULL
    )
    address = f"http://127.0.0.1:{port}"
    try:
        # --- Until it answers ---
        end = time.monotonic() + 120
        while True:
            with contextlib.suppress(OSError):
                urllib.request.urlopen(address, timeout=10).close()
                break
            if process.poll() is not None or time.monotonic() > end:
                raise MaterialistError("The studio did not start; try: materialist studio")
            time.sleep(0.2)
        yield psutil.Process(process.pid), address
    finally:
        process.terminate()
        process.wait(30)


@contextlib.contextmanager
def _browser() -> Iterator[Any]:
    """Chromium without a window. Raises SetupError where it is missing."""
    # The browser of the system: Playwright's own is a large download.
    program = shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise SetupError(
            f"This benchmark needs a browser: {install_command('playwright')}"
        ) from error
    if program is None:
        raise SetupError("This benchmark needs Chromium: apt-get install chromium")
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


def _resident(process: psutil.Process) -> float:
    return process.memory_info().rss / 1e6


def _shared_out(process: psutil.Process) -> float:
    """MB of a process and of those that it started; a page that several of them have counts once."""
    together = [process, *process.children(recursive=True)]
    return sum(one.memory_full_info().pss for one in together) / 1e6
