"""What works on this machine, what does not, and the one command that mends each thing.

Nothing here loads Mitsuba or LLVM into this process: a wrong LLVM aborts the process that loads it, so the renderer
is tried in a child.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from materialist.errors import MaterialistError
from materialist.install import extra_command, install_command
from materialist.render.variant import INSTALL_LLVM, find_llvm, package_of, usable_gpus

_PROBE = """
import os, sys
if len(sys.argv) > 1: os.environ["DRJIT_LIBLLVM_PATH"] = sys.argv[1]
import mitsuba as mi
names = [n for n in ("llvm_ad_rgb", "cuda_ad_rgb") if n in mi.variants()]
mi.set_variant("llvm_ad_rgb")
import drjit as dr
assert float(dr.sum(mi.Float([1.0, 2.0]) * 2)[0]) == 6
sys.stdout.write(" ".join(names))
"""
"""Loads the CPU variant and runs one kernel: the step that a wrong LLVM does not survive."""

_EXTRAS = {
    "rawpy": ("raw", "camera RAW photos"),
    "pyoidn": ("denoise", "denoised pictures"),
    "starlette": ("studio", "the studio"),
    "uvicorn": ("studio", "the studio"),
    "websockets": ("studio", "the studio"),
    "pydantic": ("studio", "the studio"),
    "mujoco": ("physics", "things that fall"),
    "coacd": ("physics", "their convex parts"),
    "imageio-ffmpeg": ("video", "films"),
    "usd-core": ("usd", "export to USD"),
    "ray": ("ray", "batches on a cluster"),
    "aiohttp": ("http", "photos behind https"),
    "transformers": ("hub", "hub predictors"),
    "diffusers": ("hub", "Marigold predictor"),
}
"""Package -> the extra of ours that installs it, and what it is for."""


@dataclass(frozen=True)
class Finding:
    """One line of the examination."""

    name: str
    state: str
    """'ok', 'missing' (optional, absent) or 'broken' (the main job cannot run)."""
    detail: str
    remedy: str = ""
    """The one command that mends it; empty when there is nothing to mend."""


def examine(device: str = "auto") -> list[Finding]:
    """Look at everything the program needs; takes a few seconds and never raises.

    With `device` "cuda" a GPU is no option: where it is missing the main job cannot run.
    """
    llvm, path = _llvm()
    return [
        Finding("Python", "ok", platform.python_version()),
        *(_package(name) for name in ("torch", "mitsuba", "drjit")),
        llvm,
        _renderer(path),
        _cuda(needed=device == "cuda"),
        *(_package(name, *extra) for name, extra in _EXTRAS.items()),
        _weights(),
        _memory(),
        _disk(),
    ]


def _llvm() -> tuple[Finding, str | None]:
    try:
        llvm = find_llvm()
    except MaterialistError as error:
        return Finding("LLVM", "broken", str(error), INSTALL_LLVM), None
    return Finding("LLVM", "ok", f"{llvm.version} at {llvm.path}"), str(llvm.path)


def _renderer(llvm: str | None) -> Finding:
    broken = partial(Finding, "renderer (CPU)", "broken")
    command = [sys.executable, "-c", _PROBE, *([llvm] if llvm else [])]
    try:
        # In a child: an unusable LLVM aborts the process.
        child = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return broken(f"the probe did not finish: {error}", "materialist doctor")
    if child.returncode == 0:
        return Finding("renderer (CPU)", "ok", f"variants {child.stdout.strip()}")
    # The loader names the missing library; its Debian package follows from the name.
    absent = re.search(r"(lib\S+\.so\S*): cannot open shared object", child.stderr)
    if absent:
        return broken(f"{absent[1]} is missing", f"sudo apt-get install -y {package_of(absent[1])}")
    last = (child.stderr.strip().splitlines() or ["no message"])[-1]
    return broken(f"exit {child.returncode}: {last[:160]}", INSTALL_LLVM)


def _cuda(needed: bool = False) -> Finding:
    """Whether a driver with OptiX answers; broken where a GPU is `needed` and none does."""
    # The driver's own tool knows the card's name, which the library does not tell.
    tool = shutil.which("nvidia-smi")
    said = ""
    if tool is not None:
        query = [tool, "--query-gpu=name,driver_version", "--format=csv,noheader"]
        with suppress(OSError, subprocess.SubprocessError):
            said = subprocess.run(
                query, capture_output=True, text=True, timeout=20, check=True
            ).stdout.strip()
    name = said.partition("\n")[0]
    if usable_gpus():
        return Finding("GPU (CUDA)", "ok", name or "a driver with OptiX")
    lacking = f"{name}: no OptiX (libnvoptix.so.1)" if name else "no NVIDIA GPU answers"
    if needed:
        return Finding("GPU (CUDA)", "broken", lacking, "materialist doctor --device cpu")
    return Finding("GPU (CUDA)", "missing", f"{lacking}; everything runs on the CPU")


def _package(name: str, extra: str = "", purpose: str = "") -> Finding:
    """Whether a package is installed, which the main job needs unless it is of an extra."""
    try:
        return Finding(name, "ok", version(name) + (f" ({purpose})" if extra else ""))
    except PackageNotFoundError:
        if extra:
            return Finding(name, "missing", f"optional: {purpose}", extra_command(extra))
        return Finding(name, "broken", "not installed", install_command(name))


def _weights() -> Finding:
    """Networks fetched from a hub; none is needed for the main job."""
    from materialist.predict.models import KNOWN, is_complete, models_folder

    # Only complete downloads: an interrupted one cannot be used.
    here = [model.name for model in KNOWN if is_complete(model)]
    if here:
        return Finding("hub models", "ok", f"{', '.join(here)} in {models_folder()}")
    lacking = f"optional: none in {models_folder()}"
    return Finding("hub models", "missing", lacking, "materialist models download matnet")


def _memory() -> Finding:
    import psutil

    # What is available, not what is free: caches give way.
    free = psutil.virtual_memory().available / 2**30
    detail = f"{free:.1f} GB free (an inversion at 512 needs up to 4)"
    if free >= 4:
        return Finding("memory", "ok", detail)
    return Finding("memory", "missing", detail, "materialist invert PHOTO --size 256")


def _disk() -> Finding:
    where = Path.cwd()
    free = shutil.disk_usage(where).free / 2**30
    detail = f"{free:.1f} GB free in {where}"
    if free >= 0.5 and os.access(where, os.W_OK):
        return Finding("disk", "ok", detail)
    return Finding("disk", "missing", detail, f"df -h {where}")
