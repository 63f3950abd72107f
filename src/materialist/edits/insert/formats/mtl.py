"""Materials of OBJ files: .mtl libraries."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import triple
from materialist.edits.insert.formats.content import MeshContent, Paint, TextureLayout
from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.text import line_blocks
from materialist.edits.insert.formats.textures import GREY, Textures, clipped_surface
from materialist.types import Array

OPTIONS = {
    "-s": 3,
    "-o": 3,
    "-t": 3,
    "-mm": 2,
    "-blendu": 1,
    "-blendv": 1,
    "-cc": 1,
    "-clamp": 1,
    "-texres": 1,
    "-bm": 1,
    "-imfchan": 1,
    "-type": 1,
    "-boost": 1,
}
"""Options before the name of a map -> how many words follow them at most."""


class MtlLibrary:
    """The materials that an OBJ names."""

    def __init__(self, source: MeshSource, names: list[str]):
        self.source = source
        self.textures = Textures(source)
        self.materials: dict[str, dict[str, list[str]]] = {}
        for name in dict.fromkeys(names):
            self._read(name)

    def _read(self, name: str) -> None:
        """One line of `mtllib`: a file whose name may hold spaces, or several files."""
        folder = self.source.folder
        missing = list(folder.missing)
        data = folder.get(name)
        several = name.split()
        if data is None and len(several) > 1:
            folder.missing[:] = missing
            for part in several:
                self._parse(folder.get(part) or b"")
        self._parse(data or b"")

    def _parse(self, data: bytes) -> None:
        entries: dict[str, list[str]] = {}
        for lines in line_blocks(self.source, data):
            for line in lines:
                words = line.decode("utf-8", "replace").split()
                if len(words) < 2:
                    continue
                key = words[0].lower()
                if key == "newmtl":
                    entries = self.materials[" ".join(words[1:])] = {}
                    self.source.check("materials", len(self.materials))
                elif len(entries) < 100:
                    entries[key] = words[1:]

    def paints(self, names: Iterable[str], content: MeshContent) -> None:
        """Add the materials of these names to `content`, as far as the libraries have them, and what is not shown."""
        known = [name for name in names if " ".join(name.split()) in self.materials]
        for name in known:
            self._open_picture(name)
        for name in known:
            content.paints[name] = self._paint(name, content)
        content.notes += self.textures.notes()

    def _open_picture(self, name: str) -> None:
        picture, _ = _map(self.materials[" ".join(name.split())].get("map_kd", []))
        data = self.source.folder.get(picture) if picture else None
        if data is not None:
            self.textures.add(picture, data)

    def _paint(self, name: str, content: MeshContent) -> Paint:
        """A material as a surface.

        Kd (linear), or map_Kd; Pr and Pm; else the width of the highlight Ns: a Phong exponent n is about as wide as
        GGX with alpha^2 = 2 / (n + 2), and roughness = sqrt(alpha). Ke is emission; 1 is the photo's white.
        """
        entries = self.materials[" ".join(name.split())]
        picture, layout = _map(entries.get("map_kd", []))
        colour = self.textures.pixels(picture)
        # Writers leave Kd black, or half, beside a texture: it counts where there is none.
        kd = _colour(entries.get("kd"), GREY).reshape(1, 1, 3)
        albedo = kd if colour is None else srgb_to_linear(colour)
        (exponent,) = _numbers(entries.get("ns"), (0.0,))
        shiny = (2 / (max(exponent, 0.0) + 2)) ** 0.25 if exponent else GREY
        roughness = _numbers(entries.get("pr"), (shiny,)).reshape(1, 1)
        metallic = _numbers(entries.get("pm"), (0.0,)).reshape(1, 1)
        surface = clipped_surface(albedo, roughness, metallic)
        emission = np.clip(np.nan_to_num(_colour(entries.get("ke"), 0.0), posinf=0), 0, 1e6)
        content.left_out += _left_out(entries)
        return Paint(replace(surface, emission=triple(emission)), layout)


def _map(words: list[str]) -> tuple[str, TextureLayout]:
    """(file, where it lies) of the words of a map: options with their values, and a name that may hold spaces."""
    scale = (1.0, 1.0)
    offset = (0.0, 0.0)
    wrap = "repeat"
    rest = list(words)
    while len(rest) > 1 and rest[0].lower() in OPTIONS:
        option = rest.pop(0).lower()
        values: list[str] = []
        while len(rest) > 1 and len(values) < OPTIONS[option] and _is_value(option, rest[0]):
            values.append(rest.pop(0))
        if option == "-s" and values:
            scale = _pair(values, 1.0)
        elif option == "-o" and values:
            offset = _pair(values, 0.0)
        elif option == "-clamp" and values == ["on"]:
            wrap = "clamp"
    # v runs up in the file: v = s v + o there is 1 - s (1 - v) - o here.
    placed = (offset[0], 1 - scale[1] - offset[1])
    return " ".join(rest), TextureLayout(offset=placed, scale=scale, wrap=(wrap, wrap))


def _is_value(option: str, word: str) -> bool:
    if OPTIONS[option] == 1:
        return True
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _pair(values: list[str], otherwise: float) -> tuple[float, float]:
    numbers = [float(value) for value in values]
    return numbers[0], numbers[1] if len(numbers) > 1 else otherwise


def _left_out(entries: dict[str, list[str]]) -> list[str]:
    """Parts of a material that are not shown."""
    left_out = []
    if _numbers(entries.get("d"), (1.0,))[0] < 1 or _numbers(entries.get("tr"), (0.0,))[0] > 0:
        left_out.append("its transparency (taken as opaque)")
    for key in ("kd", "ke"):
        if not _is_colour(entries.get(key, ["0"])):
            left_out.append(
                f"its {key.title()} '{' '.join(entries[key])[:40]}', which is no RGB colour"
            )
    for key in entries:
        if key.startswith(("map_", "bump", "norm", "disp")) and key != "map_kd":
            left_out.append(f"its {key[:40]}")
    return left_out


def _is_colour(words: list[str]) -> bool:
    """Whether an entry has one or three numbers: not `xyz` or `spectral`."""
    try:
        return len(list(map(float, words))) in (1, 3)
    except ValueError:
        return False


def _colour(words: list[str] | None, otherwise: float) -> Array:
    """[3] float32 of an entry: one number is red, green and blue alike."""
    words = words * 3 if words is not None and len(words) == 1 else words
    return _numbers(words, (otherwise,) * 3)


def _numbers(value: Any, otherwise: tuple[float, ...]) -> Array:
    """[n] float32 of an entry; `otherwise` where the entry is missing or is no list of n numbers."""
    try:
        numbers = np.asarray([] if value is None else value, np.float32).ravel()
    except (TypeError, ValueError):
        numbers = np.zeros(0, np.float32)
    return np.asarray(numbers if len(numbers) == len(otherwise) else otherwise, np.float32)
