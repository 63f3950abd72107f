"""`bench studio`: what it refuses; a whole run takes minutes and a browser."""

import pytest

from materialist.bench import studio
from materialist.errors import InputError, SetupError


def test_options():
    with pytest.raises(InputError, match="moves is 1"):
        studio.run(output="x", moves=1)
    with pytest.raises(InputError, match="two shares"):
        studio._share("middle")
    assert studio._share("0.25,0.5") == (0.25, 0.5)
    assert studio._photo("example:coffee").name == "coffee.png"


def test_without_a_browser(monkeypatch):
    pytest.importorskip("playwright", reason="needs playwright")
    monkeypatch.setattr(studio.shutil, "which", lambda name: None)
    with pytest.raises(SetupError, match="apt-get install chromium"), studio._browser():
        pass
