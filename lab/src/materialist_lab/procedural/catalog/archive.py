"""Catalogues of Sweet Home 3D (.sh3f): zip files of OBJ models, and a list of what each is, in centimetres."""

import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from materialist.errors import InputError

CATALOG = "PluginFurnitureCatalog.properties"
_LINE = re.compile(r"([A-Za-z]+)#(\d+)\s*=\s*(.*)")
_ESCAPE = re.compile(r"\\u([0-9a-fA-F]{4})")


@dataclass(frozen=True)
class CatalogEntry:
    """What a catalogue says of one model."""

    key: str
    """Name of the archive and number of the model: one of a kind."""
    name: str
    category: str
    creator: str
    path: str
    """Of the OBJ file in the archive."""
    size: tuple[float, float, float]
    """Width, height and depth, metres; the front is +Z."""
    elevation: float
    """Height of its base above the floor, metres."""
    turn: tuple[float, ...]
    """Nine numbers, row by row: the rotation of the file into the frame of the catalogue."""
    lights: tuple[tuple[float, float, float], ...]
    """Places of its lamps, metres, from the left, front, bottom corner."""


def entries(archive: Path) -> list[CatalogEntry]:
    """The models of an archive. Raises InputError where it is damaged or has no list."""
    try:
        with zipfile.ZipFile(archive) as file:
            text = file.read(CATALOG).decode("latin-1")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{archive} is no catalogue of furniture ({error}); install it again."
        ) from error
    return list(_entries(archive.stem, text))


def _entries(archive: str, text: str) -> Iterator[CatalogEntry]:
    models: dict[int, dict[str, str]] = {}
    for line in text.splitlines():
        match = _LINE.match(line.strip())
        if match:
            value = _ESCAPE.sub(lambda escape: chr(int(escape[1], 16)), match[3])
            models.setdefault(int(match[2]), {})[match[1]] = value.strip()
    for number, facts in sorted(models.items()):
        if not {"model", "width", "depth", "height"} <= set(facts):
            continue
        metres = {
            name: float(facts.get(name, 0)) / 100
            for name in ("width", "height", "depth", "elevation")
        }
        turn = facts.get("modelRotation", "1 0 0 0 1 0 0 0 1").split()
        yield CatalogEntry(
            key=f"{archive}-{number:03d}",
            name=facts.get("name", ""),
            category=facts.get("category", ""),
            creator=facts.get("creator", ""),
            path=facts["model"].lstrip("/"),
            size=(metres["width"], metres["height"], metres["depth"]),
            elevation=metres["elevation"],
            turn=tuple(float(value) for value in turn),
            lights=_lights(facts),
        )


def _lights(facts: dict[str, str]) -> tuple[tuple[float, float, float], ...]:
    """Places of lamps, metres: x from the left, y up, z from the back; the file measures y on its plan and z up."""
    axes = [[float(v) / 100 for v in facts.get(f"lightSource{axis}", "").split()] for axis in "XYZ"]
    return tuple((x, z, y) for x, y, z in zip(*axes, strict=True))
