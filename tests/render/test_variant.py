"""LLVM is found and judged without being loaded, and one process keeps one variant."""

import subprocess
import sys

import pytest

from materialist.errors import InputError, SetupError
from materialist.render import variant
from materialist.render.variant import find_llvm, setup


@pytest.fixture
def libraries(tmp_path, monkeypatch):
    """Make empty files of these names the only libraries of the machine."""
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)

    def make(*names):
        for name in names:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes(b"")
        monkeypatch.setattr(
            variant,
            "_PLACES",
            [str(tmp_path / f"{below}*LLVM*") for below in ("", "*/lib/", "*/*/lib/")],
        )
        return tmp_path

    return make


@pytest.mark.parametrize(
    ("names", "best"),
    [
        (["libLLVM-14.so.1", "libLLVM-17.so.1", "libLLVM.so.19.1"], 19),
        (["libLLVM-17.so.1", "libLLVM-18.so.1", "libLLVM.so.22.1"], 18),
        (["libLLVM.so.21.1", "libLLVM.20.dylib", "libLLVM-15.so.1"], 20),
        (["libLLVM-14.0.6.so.1", "libLLVM-18.dylib", "libLLVM.so"], 18),
        (["llvm/19.1.7/lib/libLLVM.dylib", "llvm@16/lib/libLLVM.dylib"], 19),
    ],
)
def test_the_best_library_is_taken(libraries, names, best):
    libraries(*names)
    assert find_llvm().version == best


@pytest.mark.parametrize(
    ("name", "says"), [("libLLVM-15.so.1", "LLVM 15"), ("libLLVM.so", "no LLVM library")]
)
def test_a_wrong_choice_of_the_user_is_explained(libraries, monkeypatch, name, says):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(libraries(name) / name))
    with pytest.raises(SetupError, match=says):
        find_llvm()


def test_a_wrong_library_never_aborts(libraries, tmp_path):
    """The whole start in a process of its own, with a library that Dr.Jit could not use."""
    name = libraries("libLLVM-15.so.1") / "libLLVM-15.so.1"
    program = (
        "import sys\nfrom materialist.errors import SetupError\nfrom materialist.render.variant import setup\n"
        "try: setup('cpu')\nexcept SetupError as error: sys.exit('SetupError: ' + str(error))"
    )
    for start in ("", "import drjit\n"):
        result = subprocess.run(
            [sys.executable, "-c", start + program],
            env={"DRJIT_LIBLLVM_PATH": str(name), "PATH": "/usr/bin"},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert result.returncode == 1 and "SetupError: " in result.stderr, result.stderr


def test_setup_again_is_the_same_and_another_device_is_refused():
    mi = setup("cpu")
    assert setup("auto") is mi and setup("cpu") is mi and mi.variant() == "llvm_ad_rgb"
    with pytest.raises(SetupError, match="llvm_ad_rgb"):
        setup("cuda")
    with pytest.raises(InputError, match="tpu"):
        setup("tpu")
