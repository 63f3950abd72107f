"""Tasks for worker processes of tests."""

import os
import signal
import sys
import time
from pathlib import Path

from materialist.errors import InputError


def answer(report, how="fine", out=None, wait=0.0):
    """What `how` says, after a stage of progress; `out` gets a half-written file."""
    report("light", 1, 4)
    if out is not None:
        Path(out, f".partial-{os.getpid()}-host.png").touch()
    sys.stdout.write("not for the one who started it\n")
    if how == "fail":
        raise InputError("It is too dark.")
    if how == "bug":
        raise RuntimeError("three is not four")
    if how == "die":
        sys.stderr.write("first\nLLVM ERROR: Cannot select: fminimum\n")
        sys.stderr.flush()
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "found":
        report.intermediate(name="albedo", file="a.jpg")
    time.sleep(60 if how == "wait" else wait)
    return {
        "how": how,
        "pid": os.getpid(),
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "outdated": report.outdated,
    }


def until(done, seconds=15.0):
    """What `done` returns, once that is true."""
    end = time.monotonic() + seconds
    while not (intermediate := done()):
        assert time.monotonic() < end, "took too long"
        time.sleep(0.02)
    return intermediate


def wait(report):
    """Work for a minute."""
    time.sleep(60)


def invert(report, **arguments):
    """In place of an inversion: a minute, and nothing comes of it."""
    report("predict", 0, 1)
    time.sleep(60)


def invert_from(report, package, scene, **arguments):
    """In place of an inversion: the scene of a package, grey at first; re-rendered when `go` lies beside it."""
    from dataclasses import replace

    import materialist as mt
    from materialist.io.package import replace_rerender

    whole = mt.load_scene(package)
    early = replace(whole, provenance={**whole.provenance, "spp": 0})
    mt.save_scene(replace(early, rerender=0 * whole.rerender + 0.5), scene)
    report("rerender", 0, 1)
    until(Path(scene).with_name("go").exists, seconds=60)
    replace_rerender(whole, scene)


def surroundings(report):
    """What a task sees of the process that started it."""
    return {"pid": os.getpid(), "password": os.environ.get("MATERIALIST_PASSWORD")}


def allocate(report, count):
    """Bytes of so many numbers, in memory at once."""
    import numpy as np

    return int(np.ones(count).nbytes)


def numbers(report, count):
    import numpy as np

    return np.arange(count)


def open_without_pictures(report, package, file, device):
    """In place of `studio.live.process.open_preview`: a preview that applies edits, and shades nothing."""
    from concurrent.futures import ThreadPoolExecutor

    from materialist.io.package import load_scene
    from materialist.studio.live import preview, process

    preview._THREAD = ThreadPoolExecutor(1)
    preview._build = lambda scene, file: None
    process._OPENED.set_result(preview.LivePreview(load_scene(package), None, Path(package)))
    report.intermediate(fine=True)
