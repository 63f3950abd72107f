"""LLVM and the Mitsuba variant: the only place that chooses either."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import lru_cache
from glob import glob
from pathlib import Path

from materialist.errors import InputError, SetupError

MINIMUM_LLVM = 16
"""Dr.Jit aborts the process with LLVM 14 and 15."""

_PATTERNS = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
    str(Path(sys.prefix) / "lib" / "libLLVM*"),
)


@dataclass(frozen=True)
class LLVM:
    """A usable LLVM shared library."""

    path: str
    version: int
    """Major version."""


def find_llvm() -> LLVM:
    """The LLVM library to use: DRJIT_LIBLLVM_PATH if set, else the newest of the usual places.

    Raises:
        SetupError: none of version 16 or later is found; the message names the package to install.
    """
    chosen = os.environ.get("DRJIT_LIBLLVM_PATH")
    if chosen:
        version = llvm_version(chosen)
        if version is None:
            raise SetupError(f"DRJIT_LIBLLVM_PATH is {chosen}, which is no LLVM library; unset it, or {_remedy()}")
        if version < MINIMUM_LLVM:
            raise SetupError(
                f"DRJIT_LIBLLVM_PATH is LLVM {version}, and {MINIMUM_LLVM} or later is needed; unset it, or {_remedy()}"
            )
        return LLVM(chosen, version)
    found = []
    for path in {os.path.realpath(p) for pattern in _PATTERNS for p in glob(pattern)}:
        version = llvm_version(path)
        if version is not None:
            found.append(LLVM(path, version))
    usable = [f for f in found if f.version >= MINIMUM_LLVM]
    if usable:
        return max(usable, key=lambda f: (f.version, f.path))
    seen = ", ".join(sorted({str(f.version) for f in found}, key=int))
    raise SetupError(f"No LLVM {MINIMUM_LLVM} or later found{f' (only {seen})' if seen else ''}; {_remedy()}")


def _remedy() -> str:
    if sys.platform == "darwin":
        return "install it with: brew install llvm"
    if sys.platform == "win32":
        return "install it from https://github.com/llvm/llvm-project/releases"
    return "install it with: sudo apt install libllvm19 (Fedora: sudo dnf install llvm-libs)"


@lru_cache(maxsize=64)
def llvm_version(path: str) -> int | None:
    """Major version of an LLVM library by its file name, else by asking it in a process of its own; None if neither."""
    if not os.path.exists(path):
        return None
    for name in (os.path.basename(path), os.path.basename(os.path.realpath(path))):
        match = re.search(r"LLVM[-.](?:so\.)?(\d+)", name)
        if match:
            return int(match.group(1))
    probe = (
        "import ctypes,sys; l=ctypes.CDLL(sys.argv[1]); v=[ctypes.c_uint() for _ in range(3)];"
        "l.LLVMGetVersion(*map(ctypes.byref,v)); sys.stdout.write(str(v[0].value))"
    )
    result = subprocess.run([sys.executable, "-c", probe, path], capture_output=True, text=True, timeout=30)
    return int(result.stdout) if result.returncode == 0 and result.stdout.isdigit() else None


def cuda_usable() -> bool:
    """Whether an NVIDIA driver is present (asked of the driver library, without starting Mitsuba)."""
    import ctypes

    try:
        driver = ctypes.CDLL("libcuda.so.1" if sys.platform != "win32" else "nvcuda.dll")
        count = ctypes.c_int()
        return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0
    except OSError:
        return False


def setup(device: str = "auto"):
    """Choose the variant (`llvm_ad_rgb` or `cuda_ad_rgb`) and return the `mitsuba` module.

    Args:
        device: `auto` (CUDA where a driver answers), `cpu` or `cuda`.

    Raises:
        InputError: an unknown device. SetupError: LLVM or CUDA is missing, or another device was chosen before.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise InputError(f"Device is '{device}'; choose auto, cpu or cuda.")
    import mitsuba as mi

    current = mi.variant()
    if device == "auto":
        device = {"llvm_ad_rgb": "cpu", "cuda_ad_rgb": "cuda"}.get(current) or ("cuda" if cuda_usable() else "cpu")
    wanted = "cuda_ad_rgb" if device == "cuda" else "llvm_ad_rgb"
    if current == wanted:
        return mi
    if current in ("llvm_ad_rgb", "cuda_ad_rgb"):
        raise SetupError(f"This process already renders with {current}; start a new one for --device {device}.")
    if device == "cuda" and not cuda_usable():
        raise SetupError("No CUDA driver answers; use --device cpu, or install the NVIDIA driver.")
    if device == "cpu":
        os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm().path
    mi.set_variant(wanted)
    from materialist.render import bsdf

    bsdf.register()
    return mi
