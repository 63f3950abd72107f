"""Fixtures for all tests, of the product and of the laboratory."""

import gc
import json
import os
import shutil
import sys
from pathlib import Path

import pytest


def pytest_configure():
    """While tests are collected nothing becomes garbage, and looking for it takes a quarter of the time."""
    gc.disable()


def pytest_collection_finish():
    """What was imported stays: a search for garbage in a test looks at what tests made."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def children_find_the_helpers(monkeypatch):
    """Processes that tests start import what tests import."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


@pytest.fixture(scope="module")
def one_thread():
    """Small tensors: waking threads costs more than the work."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def models(monkeypatch, tmp_path):
    """The folder of downloaded models, where there are none."""
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path / "models"))
    return tmp_path / "models"


@pytest.fixture
def untrained(tmp_path):
    """Weights of a RefractionNet that has learnt nothing: it answers with the mirrored thickness and a bit."""
    import torch

    from materialist.predict.network import UNetArchitecture
    from materialist.predict.refraction.network import RefractionNet

    torch.manual_seed(0)
    RefractionNet(UNetArchitecture((8,) * 5, (1,) * 5)).save(
        tmp_path / "plain.safetensors", {"step": 0}
    )
    return tmp_path / "plain.safetensors"


@pytest.fixture(scope="session")
def real_data():
    """Finds real captures beside the project by their path there; skips where they are not."""

    def find(name):
        path = Path(__file__).resolve().parents[1] / "shared" / name
        return path if path.exists() else pytest.skip(f"needs ../shared/{name}")

    return find


@pytest.fixture(scope="session")
def mitsuba():
    """Mitsuba with the CPU variant chosen."""
    from materialist.render.variant import setup

    return setup("cpu")


@pytest.fixture(scope="session")
def sample(mitsuba):
    """A small synthetic sample: scene 0 (a table top under the sky), not square."""
    from materialist_lab.procedural.synthetic import make_sample

    return make_sample(0, 0, 0, size=(40, 56), seed=0, spp=64)


@pytest.fixture
def run(capsys):
    """Run a command line; returns (exit code, stdout, stderr)."""
    from materialist.cli import app
    from materialist.cli.outcome import run_to_exit_code

    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


@pytest.fixture
def done(run):
    """Run a command line that succeeds; returns what `--json` says."""

    def call(*arguments):
        code, out, err = run(*arguments, "--json")
        assert code == 0, err
        return json.loads(out.splitlines()[-1])

    return call


@pytest.fixture
def refused(run):
    """Run a command line whose input is bad; returns the sentence that says so, after how it is used if it is that."""

    def call(*arguments):
        code, out, err = run(*arguments)
        usage, _, sentence = err.rpartition("Error: ")
        assert (
            code == 2 and not out and usage[:7] in ("", "Usage: ") and sentence.count("\n") == 1
        ), err
        return err

    return call


@pytest.fixture
def filled_smoothly(monkeypatch):
    """Holes of a photo are spanned from their border: the network takes seconds, and `edits/remove` tests it."""
    from materialist.edits.remove import filling
    from materialist.geometry.membrane import membrane

    def spanned(levels, unknown):
        return membrane(levels, ~unknown).round().astype(levels.dtype)

    monkeypatch.setattr(filling, "_kept", spanned)


@pytest.fixture
def one_answer(monkeypatch):
    """The filling network answers once, where four answers, to mirror images too, take seconds."""
    from dataclasses import replace

    from materialist.edits.remove import filling

    monkeypatch.setattr(filling, "SETTINGS", replace(filling.SETTINGS, mirrored=((),)))


@pytest.fixture(scope="session")
def clicked():
    """The masks of `clicks_once`."""
    return {}


@pytest.fixture(scope="module")
def clicks_once(clicked):
    """The same click on the same scene is answered once, and MobileSAM, which takes seconds, by what has one colour.

    `edits/select` and `predict/sam` test the networks.
    """
    import numpy as np

    from materialist.edits.select import objects, select

    at_points = select.object_at_points

    def of_one_colour(rgb, clicks=(), *, box=None):
        def alike(x, y):
            return np.abs(rgb - rgb[int(y), int(x)]).max(-1) < 0.05

        if box is None:
            mask = np.any([alike(*click) for click in clicks], 0)
        else:
            # What is in the middle of the box, or at its corner, by which fits it.
            middle = alike((box[0] + box[2]) // 2, (box[1] + box[3]) // 2)
            mask = max(middle, alike(*box[:2]), key=lambda one: objects.box_overlap(one, box))
        return np.where(mask, 1, -1)[None].repeat(3, 0).astype(np.float32), np.ones(3)

    def known(scene, points, **options):
        key = (scene.photo.linear.tobytes(), scene.depth.tobytes(), repr((points, options)))
        if key not in clicked:
            clicked[key] = at_points(scene, points, **options)
        return clicked[key].copy()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(select, "object_at_points", known)
        patch.setattr(objects.sam, "masks", of_one_colour)
        yield


@pytest.fixture(scope="module")
def browser():
    """Chromium (skipped, with the reason, where it is not there), for one file: tests of a killed trainer end it."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("needs chromium")
    options = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=chromium, args=options)
        yield opened
        opened.close()
