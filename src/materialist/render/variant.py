"""LLVM and the Mitsuba variant: the only place that chooses either."""

import gc
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from glob import glob

from materialist import memory
from materialist.errors import InputError, SetupError
from materialist.forks import check_process
from materialist.install import install_command

MINIMUM_LLVM = 17
"""Dr.Jit refuses 14; 15 and 16 start, but abort the process in a path-tracing kernel (they cannot select fminimum)."""

PREFERRED_LLVM = 19
"""The version this package is tested with: later ones are used only where no version up to this one is found."""

_PLACES = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
    f"{sys.prefix}/lib/libLLVM*.so*",
    f"{sys.prefix}/lib/libLLVM*.dylib",
)


@dataclass(frozen=True)
class LLVM:
    """A usable LLVM shared library."""

    path: str
    version: int
    """Major version."""


def find_llvm() -> LLVM:
    """The LLVM library to use: DRJIT_LIBLLVM_PATH if set, else the best of the usual places, which is the newest up to
    `PREFERRED_LLVM`, else the oldest beyond. Nothing is loaded. Raises SetupError that names the package to install.
    """
    # --- Candidates: the user's choice alone, else every library in the usual places ---
    chosen = os.environ.get("DRJIT_LIBLLVM_PATH")
    paths = (
        [chosen]
        if chosen
        else {os.path.realpath(path) for place in _PLACES for path in glob(place)}
    )
    versions = {path: llvm_version(path) for path in paths}
    # --- The newest up to the version that is tested, else the oldest beyond it ---
    usable = [
        LLVM(path, version)
        for path, version in versions.items()
        if version and version >= MINIMUM_LLVM
    ]
    if usable:
        return min(
            usable,
            key=lambda f: (f.version > PREFERRED_LLVM, abs(f.version - PREFERRED_LLVM), f.path),
        )
    # --- None: say what is there, and how to install one ---
    seen = ", ".join(map(str, sorted({version for version in versions.values() if version})))
    if chosen:
        described = f"LLVM {seen}" if seen else "no LLVM library"
        raise SetupError(
            f"DRJIT_LIBLLVM_PATH is {chosen}, {described}; LLVM {MINIMUM_LLVM} or later is needed: "
            f"unset it, or {_remedy()}"
        )
    raise SetupError(
        f"No LLVM {MINIMUM_LLVM} or later found{f' (only {seen})' if seen else ''}; {_remedy()}"
    )


INSTALL_LLVM = (
    "brew install llvm@19" if sys.platform == "darwin" else "sudo apt-get install -y libllvm19"
)


def _remedy() -> str:
    other = "" if sys.platform == "darwin" else " (Fedora: sudo dnf install llvm-libs)"
    return f"install one with: {INSTALL_LLVM}{other}"


def llvm_version(path: str) -> int | None:
    """Major version of an LLVM library by its name, its folders' or those of what it links to; None without any."""
    if not os.path.exists(path):
        return None
    match = re.search(
        r"(?:libLLVM(?:-|\.so\.|\.)|llvm[-@/])(\d+)\b", f"{path} {os.path.realpath(path)}"
    )
    return int(match[1]) if match else None


def unloaded(error: BaseException) -> str:
    """What kept Mitsuba's extension from loading, in one sentence; the first cause in the chain says it."""
    while error.__context__ is not None:
        error = error.__context__
    match = re.search(r"(\S+\.so\S*): cannot open shared object", str(error))
    if match is None:
        return f"{error}; install it again with: {install_command('--force-reinstall', 'mitsuba')}"
    return f"the library {match[1]} is missing; install it with: sudo apt-get install -y {package_of(match[1])}"


def package_of(library: str) -> str:
    """Debian's package of a shared library: libatomic.so.1 is in libatomic1."""
    return library.replace(".so.", "").replace(".so", "").lower()


def usable_gpus() -> int:
    """How many GPUs an NVIDIA driver offers; 0 without OptiX, which traces Mitsuba's rays. Mitsuba is not started."""
    import ctypes

    try:
        # The driver alone, without Mitsuba: whoever asks may want to stay on the CPU.
        driver = ctypes.CDLL("libcuda.so.1")
        ctypes.CDLL(os.environ.get("DRJIT_LIBOPTIX_PATH", "libnvoptix.so.1"))
    except OSError:
        return 0
    count = ctypes.c_int()
    answers = driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0
    return count.value if answers else 0


_VARIANTS = {"cpu": "llvm_ad_rgb", "cuda": "cuda_ad_rgb"}


def setup(device: str = "auto"):
    """Choose the variant (`llvm_ad_rgb` or `cuda_ad_rgb`) and return the `mitsuba` module, with our plugins registered.

    The first call decides for the whole process; later calls with the same device, or `auto`, return at once. The CPU
    variant runs on the processors this process may use, or on OMP_NUM_THREADS of them, as torch does.

    device: `auto` (CUDA where a driver answers), `cpu` or `cuda`. Raises InputError for an unknown one, SetupError
    where LLVM or CUDA is missing, another device was chosen before, or this process is a fork of one that computes.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise InputError(f"Device is '{device}'; choose auto, cpu or cuda.")
    # LLVM must be chosen before Dr.Jit is imported, which `import mitsuba` does.
    check_process()
    _point_to_llvm(device)
    try:
        import mitsuba as mi
    except (ImportError, NameError) as error:  # Dr.Jit hides a loader's error behind a NameError
        raise SetupError(f"Mitsuba does not start: {unloaded(error)}") from error

    # --- Which variant; one process has one ---
    running_variant = mi.variant()
    if device == "auto":
        devices = {variant_name: name for name, variant_name in _VARIANTS.items()}
        running = devices.get(running_variant or "")
        device = running or ("cuda" if usable_gpus() else "cpu")
    variant = _VARIANTS[device]
    if running_variant != variant:
        if running_variant in _VARIANTS.values():
            raise SetupError(
                f'This process already renders with {running_variant}; start a new one for `device="{device}"`.'
            )
        _start(mi, device)
    _register_plugins(variant)
    return mi


def _point_to_llvm(device: str) -> None:
    """Dr.Jit loads LLVM when it is first imported, whatever device is used later: choose before that."""
    if "drjit" in sys.modules:
        return
    try:
        os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm().path
    except SetupError:
        if device == "cpu" or not usable_gpus():
            raise


def _start(mi, device: str) -> None:
    import drjit as dr

    if device == "cuda" and not usable_gpus():
        raise SetupError(
            'No CUDA driver with OptiX answers; use `device="cpu"`, or install the NVIDIA driver.'
        )
    # An unusable LLVM aborts the process in its first kernel: refuse it before.
    if device == "cpu":
        loaded = dr.detail.llvm_version()[0] if dr.has_backend(dr.JitBackend.LLVM) else 0
        if loaded < MINIMUM_LLVM:
            raise SetupError(
                f"Dr.Jit was imported before materialist could choose its LLVM, and found {loaded or 'none'}; "
                f"set DRJIT_LIBLLVM_PATH to LLVM {MINIMUM_LLVM} or later, or {_remedy()}"
            )
    try:
        mi.set_variant(_VARIANTS[device])
    except ImportError as error:
        raise SetupError(f"Mitsuba's {_VARIANTS[device]} did not start ({error}).") from error
    # Dr.Jit does not read OpenMP's variable; the user means both.
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    if device == "cpu" and asked.isdigit() and 0 < int(asked) < dr.thread_count():
        dr.set_thread_count(int(asked))


@contextmanager
def recording() -> Iterator[None]:
    """No garbage is collected while Mitsuba records a rendering.

    It records the materials of all scenes there are, partly by Python: to free one of them meanwhile ends the process.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@lru_cache(maxsize=2)
def _register_plugins(variant: str) -> None:
    """Once for each variant: Mitsuba keeps plugins by variant."""
    from materialist.bsdf import disney_plugin as bsdf
    from materialist.bsdf import rough_dielectric as frosted
    from materialist.render import bodies

    bsdf.register_disney()
    bodies.register_outside()
    frosted.register_frosted()


def give_back() -> None:
    """Give back what renderings have used; the renderer would keep it for more of them."""
    import drjit

    drjit.sync_thread()  # what is being freed is not in its cache yet
    drjit.flush_malloc_cache()
    memory.give_back()
