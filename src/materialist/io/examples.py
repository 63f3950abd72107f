"""Openly licensed photographs that scikit-image carries in its wheel, so that a first run downloads nothing."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from materialist.errors import InputError, SetupError

EXAMPLES = {
    "coffee": ("coffee.png", "Pikolo Espresso Bar, photo by Rachel Michetti, CC0"),
    "cat": ("chelsea.png", "Chelsea the cat, photo by Stefan van der Walt, CC0"),
    "astronaut": ("astronaut.png", "Eileen Collins, NASA, public domain"),
    "rocket": ("rocket.jpg", "Launch of DSCOVR, SpaceX, public domain"),
}
"""Name -> (file in skimage/data, credit). Only files with a stated free licence are listed."""

PREFIX = "example:"


def example_path(name: str) -> Path:
    """Where `example:NAME` lies on disk. Raises InputError for an unknown name, SetupError without scikit-image."""
    key = name.removeprefix(PREFIX)
    if key not in EXAMPLES:
        raise InputError(f"There is no example photo {key!r}; choose one of {', '.join(EXAMPLES)}.")
    spec = find_spec("skimage")  # the package is located, not imported: importing it takes a while
    path = Path(spec.origin).parent / "data" / EXAMPLES[key][0] if spec and spec.origin else None
    if path is None or not path.is_file():
        raise SetupError("The example photos come with scikit-image: pip install --force-reinstall scikit-image")
    return path
