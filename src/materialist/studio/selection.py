"""The selection: the union of regions that were clicked, boxed or brushed."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from materialist.edits.select.extents import LARGER, next_region
from materialist.edits.select.parts import piece_at
from materialist.errors import InputError
from materialist.studio.live.process import PreviewLost
from materialist.types import Array, Scene

ADD = "add"
REMOVE = "remove"
Choose = Callable[..., Array]
"""[H, W] bool of a `click`, a `box` or a `mask`, as `select` gives it."""


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
    ) -> Selection:
        """With the object at a pixel: alone, or added. What is selected there already is taken away, unless added."""
        height, width = scene.depth.shape
        # The right and bottom edge belong to the last pixel.
        row = min(int(y), height - 1)
        column = min(int(x), width - 1)
        inside = any(part[row, column] for part in self.parts)
        if mode == REMOVE:
            return self._reduced(scene, choose, row, column) if inside else self
        # A second click on a selected object takes it out.
        if inside and mode != ADD:
            return Selection(tuple(part for part in self.parts if not part[row, column]))
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

    def of_material(self, narrowed: Callable[..., Array]) -> Selection:
        """With only what has the material of the last click, of what that selected.

        narrowed: [H, W] bool of a `region` and a `click` in it, as `views.of_material` gives it.

        Raises InputError where that is all of it.
        """
        if self.clicked is None:
            raise InputError("Click an object first; then its material can be selected.")
        *rest, region = self.parts
        part = narrowed(region=region, click=self.clicked)
        if LARGER * part.sum() > region.sum():
            raise InputError(
                "All that is selected there seems to be of one material; take parts away with Alt, or use the brush."
            )
        return Selection((*rest, part), self.clicked)

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

    def _reduced(self, scene: Scene, choose: Choose, row: int, column: int) -> Selection:
        """Without the part, or else what is of one colour, at a pixel of it."""
        last = self.clicked
        parts = []
        for part in self.parts:
            rest = part
            if part[row, column]:
                try:
                    rest = choose(mask=part, exclude=(column, row))
                except PreviewLost:
                    raise
                except InputError:  # it is most of the part
                    rest = part & ~piece_at(scene.materials.albedo, part, (column, row))
            parts.append(rest)
        # The last click still is that of the last part, where it lies on it.
        held = last is not None and bool(parts[-1][last[1], last[0]])
        return Selection(tuple(p for p in parts if p.any()), last if held else None)

    def _without(self, region: Array) -> Selection:
        left = tuple(p & ~region for p in self.parts)
        return Selection(tuple(p for p in left if p.any()))


def data_url(data: bytes) -> str:
    """A JPEG file as a data URL."""
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"
