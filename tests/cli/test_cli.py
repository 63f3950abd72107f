"""The command line: options, exit codes, --json, and how fast it starts."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
from made_pipeline import install
from made_program import heavy_after, options_of
from PIL import Image

from materialist import __version__
from materialist.cli import app
from materialist.edits.drop.options import Drop
from materialist.edits.glass.options import Glass
from materialist.edits.light.options import Relight
from materialist.errors import InputError, OutputError, SetupError
from materialist.io.exr import read_exr
from materialist.io.package import load_scene
from materialist.option_kinds import declarations
from materialist.options import ExportOptions, InvertOptions


@pytest.fixture
def photo(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (32, 48, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "photo.png")
    return tmp_path / "photo.png"


def test_invert_passes_every_option_on_and_writes_the_scene(done, photo, tmp_path, monkeypatch):
    calls = install(monkeypatch)
    place = tmp_path / "a.scene"
    options = "--predictor maps:x --engine path --preset paper --fov 50 --size 24 --envmap-size 64x32 --completion none"
    more = "--tau 8 --mask mask.png --strategy white-light-first --seed 7 --device cpu --steps 9"
    done("invert", photo, "-o", place, *options.split(), *more.split())
    (call,) = calls
    assert call["options"] == InvertOptions(
        predictor="maps:x",
        engine="path",
        preset="paper",
        fov=50,
        size=24,
        envmap_size=(64, 32),
        completion="none",
        tau=8,
        mask=Path("mask.png"),
        strategy="white-light-first",
        seed=7,
        device="cpu",
        steps=9,
    )
    given = call["photo"]
    assert (
        given.camera.fov == 50 and given.linear.shape == (16, 24, 3) and callable(call["progress"])
    )
    assert load_scene(place).camera == given.camera


def test_defaults_are_those_of_python_and_json_is_the_last_line(
    run, done, photo, tmp_path, monkeypatch
):
    calls = install(monkeypatch)
    facts = done("invert", photo, "-o", tmp_path / "a.scene")
    assert calls[0]["options"] == InvertOptions()
    assert facts["ok"] is True and facts["scene"] == str(tmp_path / "a.scene")
    assert (
        str(tmp_path / "b.scene/overview.png")
        in run("invert", photo, "-o", tmp_path / "b.scene")[1]
    )
    assert facts["rerender_psnr_path"] == 31.25 and facts["warnings"] == ["no normals", "dim"]


def test_render_writes_what_the_pipeline_gives(run, photo, tmp_path, monkeypatch):
    calls = install(monkeypatch)
    run("invert", photo, "-o", tmp_path / "a.scene")
    code, out, err = run(
        "render",
        tmp_path / "a.scene",
        "-o",
        tmp_path / "o.exr",
        "--spp",
        4,
        "--denoise",
        "--seed",
        3,
    )
    assert code == 0, err
    assert calls[1].items() >= {"spp": 4, "denoise": True, "seed": 3, "device": "auto"}.items()
    np.testing.assert_array_equal(
        read_exr(tmp_path / "o.exr"), load_scene(tmp_path / "a.scene").rerender
    )
    assert "o.exr" in out


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (InputError("The photo is upside down."), 2),
        (SetupError("Install this."), 2),
        (OutputError("The disk is full."), 2),
        (KeyboardInterrupt(), 130),
        (ZeroDivisionError("division by zero"), 1),
    ],
)
def test_exit_codes(run, photo, tmp_path, monkeypatch, failure, code):
    install(monkeypatch, failure)
    got, out, err = run("invert", photo, "-o", tmp_path / "a.scene", "--json")
    last = json.loads(out.splitlines()[-1])
    assert got == code and last["ok"] is False and last["exit_code"] == code
    assert ("Traceback" in err) is (code == 1)
    if code == 2:
        assert err == f"Error: {failure}\n" and last["message"] == str(failure)
    if code == 1:
        assert "bug in Materialist" in err
    assert sorted(os.listdir(tmp_path)) == ["photo.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["invert"], "PHOTO"),
        (["bogus"], "bogus"),
        (["invert", "PHOTO", "-o", "OUT", "--engine", "steam"], "steam"),
        (["invert", "PHOTO", "-o", "OUT", "--size", "big"], "--size"),
        (["invert", "PHOTO", "-o", "OUT", "--size", "3"], "working size"),
        (["invert", "PHOTO", "-o", "OUT", "--envmap-size", "512"], "512x256"),
        (["invert", "nothing.jpg", "-o", "OUT"], "nothing.jpg"),
        (["invert", "PHOTO", "-o", "PHOTO"], "--force"),
        (["invert", "PHOTO", "-o", "/proc/x.scene"], "/proc/x.scene"),
        (["render", "nothing.scene", "-o", "OUT.png"], "nothing.scene"),
        (["render", "nothing.scene", "-o", "OUT.gif"], ".png"),
    ],
)
def test_bad_input_is_exit_2_before_any_work(
    refused, photo, tmp_path, monkeypatch, arguments, words
):
    calls = install(monkeypatch)
    filled = [
        a.replace("PHOTO", str(photo)).replace("OUT", str(tmp_path / "out")) for a in arguments
    ]
    assert words in refused(*filled)
    assert not calls and os.listdir(tmp_path) == ["photo.png"]


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        ("invert", InvertOptions),
        ("glass", Glass),
        ("relight", Relight),
        ("drop", Drop),
        ("export", ExportOptions),
    ],
)
def test_help_names_a_flag_for_every_option(run, command, kind):
    code, out, _ = run(command, "--help")
    assert code == 0 and "Usage: materialist" in out and run("--version")[1].strip() == __version__
    flags = {
        flag
        for name, (told, _) in declarations(kind).items()
        if told.flag is not None
        for spelled in told.spells(name)
        for flag in spelled.split("/")
    }
    assert all(flag in out for flag in flags | {"--seed", "--device", "--json", "--force"})


def test_starting_loads_nothing_heavy():
    assert not heavy_after("import materialist, materialist.cli")


def told_to_end(script, word, number):
    """(exit code, stderr) of a real process that gets a real signal when it has said `word`."""
    child = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True)
    while word not in child.stderr.readline():
        assert child.poll() is None
    child.send_signal(number)
    err = child.communicate(timeout=20)[1]
    return child.returncode, err


def test_an_interrupt_from_the_keyboard_is_130_and_leaves_nothing(photo, tmp_path):
    """In the middle of the fit."""
    script = (
        # A background job starts with the interrupt ignored.
        "import signal, sys, time\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import materialist\n"
        "from materialist.cli import app\nfrom materialist.cli.outcome import run_to_exit_code\n"
        "def invert(photo, *_, **options):\n    sys.stderr.write('fitting\\n'); sys.stderr.flush(); time.sleep(30)\n"
        "materialist.invert = invert\n"
        f"sys.exit(run_to_exit_code(app, ['invert', {str(photo)!r}, '-o', {str(tmp_path / 'a.scene')!r}]))"
    )
    code, err = told_to_end(script, "fitting", signal.SIGINT)
    assert code == 130 and "Interrupted" in err and "Traceback" not in err
    assert os.listdir(tmp_path) == ["photo.png"]


def test_a_terminated_command_takes_its_unfinished_files_away(tmp_path):
    """While it writes frames."""
    script = (
        "import os, sys, time\nimport numpy as np\nimport typer\n"
        "from materialist.cli.outcome import run_to_exit_code\n"
        "from materialist.io.video import write_frames\n"
        "app = typer.Typer()\n"
        "def pictures():\n    yield np.full((16, 16, 3), 0.5, np.float32)\n"
        f"    assert os.listdir({str(tmp_path)!r})\n"
        "    sys.stderr.write('writing\\n'); sys.stderr.flush(); time.sleep(30)\n"
        f"@app.command()\ndef go():\n    write_frames({str(tmp_path / 'frames')!r}, pictures())\n"
        "sys.exit(run_to_exit_code(app, []))"
    )
    code, err = told_to_end(script, "writing", signal.SIGTERM)
    assert code == -signal.SIGTERM and "Traceback" not in err and os.listdir(tmp_path) == []


def test_every_command_takes_seed_device_and_json():
    """What scripts pass to all of them, but for those that compute nothing."""
    lacking = {
        name: {"--seed", "--device", "--json"} - options
        for name, options in options_of(typer.main.get_command(app)).items()
    }
    assert {"invert", "studio", "doctor", "batch"} <= set(lacking)
    idle = {"models list", "models download", "models verify"}
    assert {name for name, options in lacking.items() if options} == idle
