"""Where walls end beyond the picture, as the light on what the picture shows tells.

A wall that goes on shuts out the light from beside and above, and its shadow's edge may lie in the picture. Which ends
are right nobody sees; but with the wrong ones no light explains the photo as well (`prior_error` of the fit).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from materialist.fit.engine import TransportEngine
from materialist.fit.leastsquares import explained
from materialist.fit.settings import FitSettings, LightSettings
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import Wall, walls_of
from materialist.geometry.ends import Ends
from materialist.geometry.planes import find_planes
from materialist.transport.walls import WallMatrix
from materialist.types import Array, Camera, Materials, Prediction

FARTHEST = 2.0
LEVELS = (0.0, 0.25, 0.5, 1.0, FARTHEST)
"""How far beyond what is seen of it a wall may go on, in its seen size."""
STARTS = (0.0, 0.5, 1.0)
"""Levels of all sides with which the search begins, beside the usual ends."""
DESCENTS = 2
"""Of all beginnings, the search goes on from this many."""
SWEEPS = 2
GAIN, LEAST = 0.04, 5e-4
"""Relative and absolute gain for which a side is moved: a little is had from any wall, by light that then comes from
elsewhere, and what is explained to the noise of its few rays already tells nothing."""
SIDES = ("left", "right", "up")
PIXELS = 1024
"""Surface pixels of the photo whose light is looked at."""
RUNOFF = 6
"""Of all ends that were tried, the best so many are compared once more on the finer map."""


def farthest(wall: Wall) -> Ends:
    """The rectangle that holds every one that is tried."""
    return _at(wall, {side: FARTHEST for side in SIDES})


def _at(wall: Wall, levels: dict[str, float]) -> Ends:
    """The usual lower side, and the others at levels beyond what is seen."""
    seen, size = wall.seen, wall.size
    return replace(
        wall.usual,
        left=seen.left - levels["left"] * size,
        right=seen.right + levels["right"] * size,
        down=min(wall.usual.down, seen.down),
        up=seen.up + levels["up"] * size,
    )


@dataclass(frozen=True)
class Found:
    """What a search came to."""

    ends: tuple[Ends, ...]
    error: float
    """Mean absolute error (encoded) that the best light leaves."""
    usual: float
    """The same with the usual ends."""


def find_ends(
    photo: Array, prior: Prediction, camera: Camera, settings: FitSettings, *, tau: float = 6.0, seed: int = 0
) -> Found | None:
    """Where the walls of a photo [H, W, 3] linear end; None if there are none, or light does not tell."""
    walls = walls_of(find_planes(prior.depth, prior.normal, camera, seed=seed), prior.depth, camera)
    if not walls:
        return None
    geometry = build_geometry(
        prior.depth, prior.normal, camera, tau=tau, completion="planes", ends=[farthest(w) for w in walls],
        seed=seed,
    )  # fmt: skip
    engine = TransportEngine(geometry, camera, photo, seed=seed, light_height=settings.light_grid)
    flat = torch.from_numpy(np.ascontiguousarray(photo.reshape(-1, 3), np.float32))
    return searched(engine, prior.materials, flat, settings, walls, seed)


def searched(
    engine: TransportEngine, materials: Materials, photo: torch.Tensor, settings: FitSettings, walls: Sequence[Wall],
    seed: int = 0,
) -> Found | None:  # fmt: skip
    """The ends that explain a photo [H * W, 3] best; where the prior is trusted, the finer map decides between them."""
    usual = tuple(wall.usual for wall in walls)
    coarse = Search(engine, materials, photo, settings.light, walls, engine.light_height, seed)
    best = coarse.best(usual)
    fine = settings.finer(coarse.error(best))
    if fine is None:
        return coarse.compared([best], usual)
    tried = sorted(coarse.tried, key=coarse.error)[:RUNOFF]
    return Search(engine, materials, photo, fine, walls, fine.height, seed).compared([best, *tried], usual)


@dataclass
class Search:
    """The error that the best light leaves, as a function of where walls end."""

    engine: TransportEngine
    """Of the mesh whose walls go on to `farthest`."""
    materials: Materials
    photo: torch.Tensor
    """[H * W, 3] linear."""
    settings: LightSettings
    walls: Sequence[Wall]
    height: int
    """Rows of the light's map."""
    seed: int = 0
    tried: dict[tuple[Ends, ...], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        engine = self.engine
        rng = np.random.default_rng(self.seed + 29)
        count = min(PIXELS, len(engine.cache.pixels))
        rows = np.sort(rng.permutation(len(engine.cache.pixels))[:count])
        planes = [(np.array(wall.usual.normal), wall.index) for wall in self.walls]
        slots = engine.cache.slot_radiance(engine.radiance)
        self._matrix = WallMatrix(engine.cache, self.materials, rows, self.height, planes, slots)
        self._light: torch.Tensor | None = None

    def error(self, ends: tuple[Ends, ...]) -> float:
        """Mean absolute error (encoded) under the best light."""
        if ends not in self.tried:
            matrix, indirect = self._matrix.ended(ends)
            self.tried[ends], self._light = explained(
                matrix.per_channel(), matrix.combine(indirect), self.photo[matrix.pixels], self.settings, self._light
            )
        return self.tried[ends]

    def compared(self, found: Sequence[tuple[Ends, ...]], usual: tuple[Ends, ...]) -> Found | None:
        """The best of the ends found; None if none are clearly better than the usual ones.

        A search goes on from the light of the one before, and what comes late has the better light: here all begin
        with the same.
        """
        self.tried.clear()
        self._light = None
        self.error(usual)
        first = self._light
        errors = {ends: self._afresh(ends, first) for ends in dict.fromkeys((usual, *found))}
        best = min(errors, key=errors.__getitem__)
        error, before = errors[best], errors[usual]
        return Found(best, error, before) if _clearly(error, before) else None

    def _afresh(self, ends: tuple[Ends, ...], light: torch.Tensor | None) -> float:
        """The error of ends whose search for a light begins from the given one."""
        self.tried.pop(ends, None)
        self._light = light
        return self.error(ends)

    def best(self, usual: tuple[Ends, ...]) -> tuple[Ends, ...]:
        """The ends of least error that a descent from the usual ones, or from even ones, comes to."""
        self.error(usual)
        self.tried.clear()  # that light began from nothing; from now on all begin with one
        even = [tuple(_at(wall, dict.fromkeys(SIDES, level)) for wall in self.walls) for level in STARTS]
        none = tuple(map(_nowhere, self.walls))
        begun = sorted([usual, none, *even], key=self.error)[:DESCENTS]
        return min((self._descended(ends) for ends in begun), key=self.error)

    def _descended(self, ends: tuple[Ends, ...]) -> tuple[Ends, ...]:
        """One side of one wall after the other at its best level, while that helps."""
        for _ in range(SWEEPS):
            before = self.error(ends)
            for k, wall in enumerate(self.walls):
                ends = self._better(ends, k, [_nowhere(wall)])
                for side in SIDES:
                    ends = self._better(ends, k, [_moved(ends[k], wall, side, level) for level in LEVELS])
            if not _clearly(self.error(ends), before):
                break
        return ends

    def _better(self, ends: tuple[Ends, ...], k: int, others: list[Ends]) -> tuple[Ends, ...]:
        """The ends with the best of `others` for wall k, where that is clearly better."""
        every = [(*ends[:k], other, *ends[k + 1 :]) for other in others]
        least = min(map(self.error, every))
        best = next(other for other in every if self.error(other) <= (1 + GAIN / 2) * least)  # the shortest as good
        return best if _clearly(self.error(best), self.error(ends)) else ends


def _clearly(error: float, before: float) -> bool:
    """Whether an error is less than another by more than chance."""
    return error < before - max(GAIN * before, LEAST)


def _nowhere(wall: Wall) -> Ends:
    """No continuation."""
    return replace(wall.usual, right=wall.usual.left, up=wall.usual.down)


def _moved(end: Ends, wall: Wall, side: str, level: float) -> Ends:
    """The ends with one side at a level; a wall that went nowhere has the others where the picture shows them."""
    if end.right <= end.left:
        end = _at(wall, dict.fromkeys(SIDES, 0.0))
    return replace(end, **{side: getattr(_at(wall, dict.fromkeys(SIDES, level)), side)})
