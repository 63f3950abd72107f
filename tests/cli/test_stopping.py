"""A fit of the paper's is ended by a signal and written; everything else is ended and not written."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest

from materialist.io.image import write_png
from materialist.io.package import load_scene

SCRIPT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
from contextlib import contextmanager
from materialist.cli import app, scenes
from materialist.cli.outcome import run_to_exit_code

@contextmanager
def to_stderr(quiet):
    yield lambda *words: print(*words, file=sys.stderr, flush=True)

scenes.stage_progress = to_stderr
sys.exit(run_to_exit_code(app, sys.argv[1:]))
"""


def signalled(arguments, line, number):
    """(exit code, stdout, stderr lines) of the command, which gets the signal when its progress says the line."""
    child = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    lines = []
    while not lines or lines[-1] != line:
        assert child.poll() is None, lines
        lines.append(child.stderr.readline().rstrip("\n"))
    child.send_signal(number)
    out, err = child.communicate(timeout=600)
    return child.returncode, out, [*lines, *err.splitlines()]


@pytest.fixture
def photo(tmp_path):
    rows, columns = np.indices((18, 24)) / 24
    write_png(tmp_path / "a.png", np.stack([rows, columns, 0.5 + 0 * rows], -1).astype(np.float32))
    return tmp_path / "a.png"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_papers_engine_says_where_it_is_and_stops_with_what_it_has(photo, number):
    scene = photo.with_name("a.scene")
    options = ("--engine", "path", "--size", 24, "--steps", 20, "--predictor", "constant", "--json")
    code, out, lines = signalled(
        ("invert", photo, "-o", scene, *options), "roughness+metallic 1 20", number
    )
    assert code == 0 and json.loads(out.splitlines()[-1])["ok"]
    assert [f"light {k} 20" for k in range(21)] == [w for w in lines if w.startswith("light ")]
    loaded = load_scene(scene)
    fit = [stage for stage in loaded.report.stages if "steps" in stage]
    assert [stage["name"] for stage in fit] == ["light", "roughness+metallic"]
    assert fit[0]["steps"] == 20 and fit[1]["steps"] < 20
    assert any("was stopped in its stage 'roughness+metallic'" in note for note in loaded.warnings)
    assert loaded.provenance["engine"] == "path" and loaded.provenance["steps"] == 20
    assert np.isfinite(loaded.rerender).all()


@pytest.mark.slow
def test_our_schedule_of_seconds_ends_at_once(photo):
    code, _, lines = signalled(
        (
            "invert",
            photo,
            "-o",
            photo.with_name("a.scene"),
            "--size",
            24,
            "--predictor",
            "constant",
        ),
        "light 1 240",
        signal.SIGINT,
    )
    assert code == 130 and "nothing was written" in lines[-1]
    assert [path.name for path in photo.parent.iterdir()] == ["a.png"]
