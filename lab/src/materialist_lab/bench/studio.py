"""`bench studio`: what a person at the page waits for, measured in a real browser, and what the server holds.

A studio in a process of its own, and Chromium through Playwright on the same machine. Page load is the median of five
fresh pages, from the address to a stage that can be seen. Drop to first slider runs from handing the photo to the page
to the first live picture of a moved slider: reading, fit, preview, a click that selects, a move. Slider to preview is
the time in the browser from the event of a slider (hue, saturation, brightness, roughness and metallic in turn) to the
decoded picture on the page. Glass: from the button to the first traced picture, which includes its process, its body
and the background behind it; then the median time from the event of a slider (index of refraction, roughness) to the
decoded picture of that value. Memory is the resident set of the server.
Kept is by how much it has grown, from one page that was opened on the scene and closed to 20 more.
"""

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

from materialist.errors import InputError, MaterialistError, SetupError
from materialist.install import install_command
from materialist.io.photo import PREFIX, example_path
from materialist.option_kinds import option
from materialist_lab.bench.benchmark import SIZE, Benchmark, Row
from materialist_lab.bench.report import Column, Report

_MOVE = """([name, value, waits]) => new Promise((done, fail) => {
  const view = document.querySelector('#stage .view'), picture = view.querySelector('.photo'), before = picture.src;
  const slider = document.querySelector(`#${name} input[type=range]`), start = performance.now();
  let asked = false;
  slider.value = value; slider.dispatchEvent(new Event('input', {bubbles: true}));
  const look = () => {
    const waiting = view.dataset.waiting === 'yes';
    asked = asked || waiting;
    if (waits ? asked && !waiting : picture.src !== before && picture.complete)
      picture.decode().then(() => done(performance.now() - start), fail);
    else if (performance.now() - start > 300000) fail(new Error('no picture'));
    else requestAnimationFrame(look);
  };
  look();
})"""
"""Moves a slider; milliseconds until its picture is decoded. `waits`: the page says when the picture is traced."""
_GLASS_MOVES = (
    ("glass_ior", 1.3),
    ("glass_ior", 1.7),
    ("glass_ior", 1.15),
    ("glass_roughness", 0.2),
    ("glass_roughness", 0.4),
    ("glass_roughness", 0.1),
    ("glass_roughness", 0.0),
    ("glass_ior", 1.45),
)
CYCLES = 20
"""Pages that are opened and closed again before the memory is measured that is kept."""
_RANGES = {
    "hue": (-170, 170),
    "saturation": (-0.8, 1),
    "value": (-0.8, 0.8),
    "roughness": (0, 1),
    "metallic": (0, 1),
}


@dataclass(frozen=True, kw_only=True)
class StudioBench(Benchmark):
    """Measure the studio on one photo, or on a scene that is there, without the drop.

    Raises SetupError where Playwright or Chromium are missing. `data` and `device` are not used.
    """

    columns = (
        Column("load_s", "page load s", "lower", 2),
        Column("drop_s", "drop to first slider s", "lower", 1),
        Column("reopen_s", "reopen to slider s", "lower", 1),
        Column("median_ms", "slider to preview ms", "lower", 0),
        Column("p95_ms", "p95 ms", "lower", 0),
        Column("light_ms", "other light ms", "lower", 0),
        Column("body_s", "glass, first picture s", "lower", 1),
        Column("glass_s", "glass slider to picture s", "lower", 2),
        Column("idle_mb", "idle MB", "lower", 0),
        Column("scene_mb", "MB more with a scene", "lower", 0),
        Column("kept_mb", f"MB kept after {CYCLES} pages", "lower", 0),
    )
    plotted = ()

    photo: str = option("example:astronaut", "A file, or example:NAME.", kind="name")
    size: int = option(512, "Working size.", **SIZE)
    moves: int = option(60, "Moves of sliders.", kind="whole", low=5, high=10_000)
    click: tuple[float, float] = option(
        (0.3, 0.8),
        "Where an object is selected, as shares of width and height.",
        kind="numbers",
        count=2,
    )
    scene: str = option("", "A scene package that is opened in place of the photo.", kind="name")

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # Checked before the server and the browser start.
        photo = example_path(self.photo) if self.photo.startswith(PREFIX) else Path(self.photo)
        if not photo.is_file():
            raise InputError(f"There is no photo at {self.photo}.")
        with (
            tempfile.TemporaryDirectory() as folder,
            _browser() as browser,
            _server(Path(folder), self.scene) as (server, address),
        ):
            measured = self._measured(server, address, browser, photo)
        yield {"method": "studio", "sample": self.photo, **measured}

    def _measured(
        self, server: psutil.Process, address: str, browser: Any, photo: Path
    ) -> dict[str, float]:
        # --- Page load, and memory without a scene ---
        row = {"idle_mb": _resident(server)}
        if not self.scene:  # else every page would open the scene
            row["load_s"] = float(np.median([_load(browser, address) for _ in range(5)]))
            row["idle_mb"] = max(row["idle_mb"], _resident(server))
        # --- From the photo or the scene to the first slider ---
        page = browser.new_page(viewport={"width": 1280, "height": 1000})
        page.set_default_timeout(900_000)
        start = time.perf_counter()
        page.goto(address)
        if not self.scene:
            start = _dropped(page, photo, self.size)
        page.wait_for_selector("text=Ready: click an object")
        view = page.locator("#stage .view")
        box = view.bounding_box()
        view.click(position={"x": self.click[0] * box["width"], "y": self.click[1] * box["height"]})
        page.wait_for_selector("#stage .view[data-selected=yes]")
        page.evaluate(_MOVE, ["hue", 40, False])
        row["reopen_s" if self.scene else "drop_s"] = time.perf_counter() - start
        # --- Sliders of the material, then of the light ---
        stand = {name: float(page.input_value(f"#{name} input[type=range]")) for name in _RANGES}
        times = [
            page.evaluate(_MOVE, [*move, False])
            for move in slider_moves(self.moves, self.seed, stand)
        ]
        row |= {"median_ms": float(np.median(times)), "p95_ms": float(np.quantile(times, 0.95))}
        page.get_by_role("tab", name="Light").click()
        row["light_ms"] = float(
            np.median([page.evaluate(_MOVE, ["rotate", 30 * k, False]) for k in (1, 2, 3)])
        )
        page.evaluate(_MOVE, ["rotate", 0, False])
        # --- Memory with the scene; glass ---
        row["scene_mb"] = _resident(server) - row["idle_mb"]
        row |= _glass(page)
        page.close()
        # --- What closed pages leave behind; the first one may fill caches ---
        for k in range(CYCLES + 1):
            page = browser.new_page()
            page.goto(address)
            if not self.scene:
                page.click("#continue")
            page.wait_for_selector("text=Ready: click an object", timeout=300_000)
            page.close()
            if k in (0, CYCLES):
                # Until the server noticed that the page is gone.
                time.sleep(3)
                row["kept_mb"] = _resident(server) - row.get("kept_mb", 0.0)
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
    page.wait_for_selector("#facts >> text=is ready")
    page.click("#start")
    return start


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
    page.get_by_role("tab", name="Objects").click()
    page.get_by_role("button", name="Turn the selection to glass").click()
    start = time.perf_counter()
    page.click("#glass")
    for state in ("[data-waiting=yes]", ":not([data-waiting=yes])"):
        page.wait_for_selector(f"#stage .view{state}")
    body = time.perf_counter() - start
    page.evaluate(
        _MOVE, ["glass_roughness", 0.3, True]
    )  # kernels of another kind are compiled once
    times = [page.evaluate(_MOVE, [*move, True]) for move in _GLASS_MOVES]
    return {"body_s": body, "glass_s": float(np.median(times)) / 1000}


@contextlib.contextmanager
def _server(folder: Path, scene: str) -> Iterator[tuple[psutil.Process, str]]:
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
        *([scene] if scene else []),
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
