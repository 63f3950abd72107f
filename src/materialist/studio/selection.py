"""The selection: the union of regions that were clicked, boxed or brushed."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.select.extents import next_region
from materialist.errors import InputError
from materialist.types import Array, Scene

ADD = "add"
REMOVE = "remove"
Choose = Callable[..., Array]
"""[H, W] bool of a `click`, a `box` or a `mask`, as `select` gives it."""
_PIECE_COLOUR = 14.0
"""How far colours of one piece may lie from that of its pixel, in each of L, a and b; tuned by eye."""


@dataclass(frozen=True)
class Selection:
    """Regions of one scene; the mask is their union."""

    parts: tuple[Array, ...] = ()
    """[H, W] bool each."""
    clicked: tuple[int, int] | None = None
    """(column, row) of the click that gave the last part, where it was a click."""
    _names: list[str] = field(default_factory=list, compare=False, repr=False, init=False)

    @property
    def mask(self) -> Array | None:
        """[H, W] bool, or None where nothing is selected."""
        if not self.parts:
            return None
        mask = np.logical_or.reduce(self.parts)
        return mask if mask.any() else None

    @classmethod
    def read(cls, parts: tuple[Array, ...], names: list[str]) -> Selection:
        """Of parts that are stored already."""
        made = cls(parts)
        made._names.extend(names)
        return made

    def stored(self, store: Callable[[Array], str]) -> list[str]:
        """What `store` gives for each part; asked once."""
        if not self._names:
            self._names.extend(store(part) for part in self.parts)
        return [*self._names]

    def click(
        self,
        scene: Scene,
        x: float,
        y: float,
        mode: str,
        choose: Choose,
        region: Array | None = None,
    ) -> Selection:
        """With the object at a pixel: alone, or added. What is selected there already is taken away, unless added.

        region: [H, W] bool of that object, where it is known already.
        """
        height, width = scene.depth.shape
        # The right and bottom edge belong to the last pixel.
        row = min(int(y), height - 1)
        column = min(int(x), width - 1)
        inside = any(part[row, column] for part in self.parts)
        if mode == REMOVE:
            return self._without(piece_at(scene, self.mask, row, column)) if inside else self
        # A second click on a selected object takes it out.
        if inside and mode != ADD:
            return Selection(tuple(part for part in self.parts if not part[row, column]))
        if region is None:
            region = choose(click=(x, y))
        return replace(self._with(region, mode), clicked=(column, row))

    def resized(self, larger: bool, choose: Choose) -> Selection:
        """With the next larger, or smaller, region at the last click in place of what that selected.

        Raises InputError where there is none.
        """
        if self.clicked is None:
            raise InputError("Click an object first; then its selection can grow or shrink.")
        *rest, region = self.parts
        others = np.logical_or.reduce([np.zeros_like(region), *rest])
        after = next_region(choose, self.clicked, region, larger=larger, others=others)
        if after is not None:
            return Selection((*rest, after), self.clicked)
        size = "larger" if larger else "smaller"
        raise InputError(
            f"Nothing {size} is found at that click; add another click, or use the brush."
        )

    def box(self, scene: Scene, box: Sequence[float], mode: str, choose: Choose) -> Selection:
        if mode == REMOVE:
            x0, y0, x1, y1 = (round(v) for v in box)
            gone = np.zeros(scene.depth.shape, bool)
            gone[min(y0, y1) : max(y0, y1), min(x0, x1) : max(x0, x1)] = True
            return self._without(gone)
        return self._with(choose(box=box), mode)

    def brush(
        self,
        scene: Scene,
        points: Sequence[Sequence[float]],
        radius: float,
        mode: str,
        choose: Choose,
    ) -> Selection:
        """With a stroke through pixels (x, y): added, or rubbed out."""
        if not points or not 0.5 <= radius <= 500:
            raise InputError("The brush stroke could not be read; paint again.")
        stroke = np.zeros(scene.depth.shape, np.uint8)
        line = np.round(np.clip(np.array(points, np.float64)[:, :2], -1e4, 1e4)).astype(np.int32)
        cv2.polylines(stroke, [line[:, None]], False, 1, thickness=max(1, round(2 * radius)))
        # Round ends: `polylines` ends its thick lines flat.
        for x, y in line[[0, -1]]:
            cv2.circle(stroke, (int(x), int(y)), max(1, round(radius)), 1, -1)
        painted = stroke > 0
        return self._without(painted) if mode == REMOVE else self._with(choose(mask=painted), ADD)

    def _with(self, region: Array, mode: str) -> Selection:
        return Selection((*self.parts, region) if mode == ADD else (region,))

    def _without(self, region: Array) -> Selection:
        left = tuple(p & ~region for p in self.parts)
        return Selection(tuple(p for p in left if p.any()))


def piece_at(scene: Scene, mask: Array | None, row: int, column: int) -> Array:
    """[H, W] bool: what is of one colour with a pixel of a selection [H, W] bool, and joined to it within that."""
    if mask is None:
        return np.zeros(scene.depth.shape, bool)
    # By the colour without light: a shadow is no border. Differences are those that the eye sees (Lab).
    lab = cv2.cvtColor(linear_to_srgb(scene.materials.albedo).astype(np.float32), cv2.COLOR_RGB2LAB)
    lab = cv2.bilateralFilter(lab, 5, 10, 3)
    barred = np.pad(np.where(mask, 0, 1).astype(np.uint8), 1, constant_values=1)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    around = (_PIECE_COLOUR,) * 3
    cv2.floodFill(lab, barred, (column, row), (0, 0, 0), around, around, flags)
    piece = (barred[1:-1, 1:-1] == 2).astype(np.uint8)
    # Specks that are left between belong to it.
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    return (cv2.morphologyEx(piece, cv2.MORPH_CLOSE, kernel) > 0) & mask


def data_url(data: bytes) -> str:
    """A JPEG file as a data URL."""
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"
