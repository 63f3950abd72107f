"""How far walls go on beyond the picture, as the light on what the picture shows tells.

A continued wall shuts out the light from beside and above, and its shadow's edge may lie in the picture. Which extents
are right nobody sees; but with wrong ones no light explains the photo as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from materialist.fit.engine import TransportEngine
from materialist.fit.light import start_radiance
from materialist.fit.losses import encode, residual
from materialist.fit.settings import ExtentSettings, FitSettings, LightSettings
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import ContinuedWall, continued_walls
from materialist.geometry.extents import PlaneExtent
from materialist.geometry.planes import find_planes
from materialist.transport.walls import WallMatrix
from materialist.types import Array, Camera, Materials, Prediction

SIDES = ("left", "right", "up")


@dataclass(frozen=True)
class FoundExtents:
    """What a search came to."""

    ends: tuple[PlaneExtent, ...]
    error: float
    """Mean absolute error (encoded) that the best light leaves."""
    usual: float
    """The same with the usual extents."""


def find_extents(
    photo: Array, prior: Prediction, camera: Camera, settings: FitSettings, *, tau: float = 6.0, seed: int = 0
) -> FoundExtents | None:
    """The extents of the walls of a photo [H, W, 3] linear; None if there are none, or the usual ones do as well."""
    walls = continued_walls(find_planes(prior.depth, prior.normal, camera, seed=seed), prior.depth, camera)
    if not walls:
        return None
    farthest = [at_levels(wall, dict.fromkeys(SIDES, max(settings.extents.levels))) for wall in walls]
    geometry = build_geometry(
        prior.depth, prior.normal, camera, tau=tau, completion="planes", extents=farthest, seed=seed
    )
    engine = TransportEngine(geometry, camera, photo, seed=seed, light_height=settings.light_grid)
    flat = torch.from_numpy(np.ascontiguousarray(photo.reshape(-1, 3), np.float32))
    return search_extents(engine, prior.materials, flat, settings, walls, seed)


def search_extents(
    engine: TransportEngine, materials: Materials, photo: torch.Tensor, settings: FitSettings,
    walls: Sequence[ContinuedWall], seed: int = 0,
) -> FoundExtents | None:  # fmt: skip
    """The extents that explain a photo [H * W, 3] best: found on a coarse map of the light, chosen on a finer one.

    engine: of the mesh whose walls go on as far as any extent that is tried.
    """
    usual = tuple(wall.usual for wall in walls)
    candidates = ExtentSearch(engine, materials, photo, settings, walls, settings.light_grid, seed).candidates(usual)
    search = ExtentSearch(engine, materials, photo, settings, walls, settings.extents.final_rows, seed)
    best = min((usual, *candidates), key=search.error)
    error, before = search.error(best), search.error(usual)
    return FoundExtents(best, error, before) if search.clearly_less(error, before) else None


def at_levels(wall: ContinuedWall, levels: dict[str, float]) -> PlaneExtent:
    """The usual lower side, and the others at levels beyond what is seen of the wall, in its seen size."""
    seen, size = wall.seen, wall.size
    return replace(
        wall.usual,
        left=seen.left - levels["left"] * size,
        right=seen.right + levels["right"] * size,
        down=min(wall.usual.down, seen.down),
        up=seen.up + levels["up"] * size,
    )


def nowhere(wall: ContinuedWall) -> PlaneExtent:
    """No continuation."""
    return replace(wall.usual, right=wall.usual.left, up=wall.usual.down)


class ExtentSearch:
    """Coordinate descent on the error that the best light leaves, as a function of the extents of all walls.

    Args:
        photo: [H * W, 3] linear.
        height: rows of the light's map.
    """

    def __init__(
        self, engine: TransportEngine, materials: Materials, photo: torch.Tensor, settings: FitSettings,
        walls: Sequence[ContinuedWall], height: int, seed: int = 0,
    ):  # fmt: skip
        self.walls, self.photo = walls, photo
        self.light, self.settings = settings.light, settings.extents
        pixels = engine.cache.pixels
        rows = np.random.default_rng(seed + 29).permutation(len(pixels))[: self.settings.pixels]
        planes = [(np.array(wall.usual.normal), wall.index) for wall in walls]
        slots = engine.cache.slot_radiance(engine.radiance)
        self._matrix = WallMatrix(engine.cache, materials, np.sort(rows), height, planes, slots)
        self._errors: dict[tuple[PlaneExtent, ...], float] = {}
        self._start: torch.Tensor | None = None
        self._start = self._explained(tuple(wall.usual for wall in walls))[1]

    def candidates(self, usual: tuple[PlaneExtent, ...]) -> list[tuple[PlaneExtent, ...]]:
        """What descents from the usual extents, or from even ones, come to, and the best of what they tried."""
        even = [tuple(at_levels(w, dict.fromkeys(SIDES, k)) for w in self.walls) for k in self.settings.starts]
        starts = sorted([usual, tuple(map(nowhere, self.walls)), *even], key=self.error)
        best = min((self._descended(ends) for ends in starts[: self.settings.descents]), key=self.error)
        return [best, *sorted(self._errors, key=self.error)[: self.settings.finalists]]

    def error(self, ends: tuple[PlaneExtent, ...]) -> float:
        """Mean absolute error (encoded) under the best light, which is sought from the same light for all extents."""
        if ends not in self._errors:
            self._errors[ends] = self._explained(ends)[0]
        return self._errors[ends]

    def _explained(self, ends: tuple[PlaneExtent, ...]) -> tuple[float, torch.Tensor]:
        matrix, indirect = self._matrix.ended(ends)
        photo = self.photo[matrix.pixels]
        rest = matrix.combine(indirect)
        return best_light(matrix.per_channel(), rest, photo, self.light, self.settings, self._start)

    def _descended(self, ends: tuple[PlaneExtent, ...]) -> tuple[PlaneExtent, ...]:
        """One side of one wall after the other at its best level, while that helps."""
        for _ in range(self.settings.sweeps):
            before = self.error(ends)
            for k, wall in enumerate(self.walls):
                ends = self._better(ends, k, [nowhere(wall)])
                for side in SIDES:
                    ends = self._better(ends, k, [_moved(ends[k], wall, side, at) for at in self.settings.levels])
            if not self.clearly_less(self.error(ends), before):
                break
        return ends

    def _better(self, ends: tuple[PlaneExtent, ...], k: int, others: list[PlaneExtent]) -> tuple[PlaneExtent, ...]:
        """The extents with the best of `others` for wall k, where that is clearly better."""
        every = [(*ends[:k], other, *ends[k + 1 :]) for other in others]
        least = min(map(self.error, every))
        # Of those that are as good, the shortest.
        best = next(other for other in every if self.error(other) <= (1 + self.settings.gain / 2) * least)
        return best if self.clearly_less(self.error(best), self.error(ends)) else ends

    def clearly_less(self, error: float, before: float) -> bool:
        """Whether an error is less than another by more than chance: a little is gained by any wall."""
        return error < before - max(self.settings.gain * before, self.settings.least_gain)


def _moved(end: PlaneExtent, wall: ContinuedWall, side: str, level: float) -> PlaneExtent:
    """The extents with one side at a level; a wall that went nowhere has the others where the picture shows them."""
    if end.right <= end.left:
        end = at_levels(wall, dict.fromkeys(SIDES, 0.0))
    return replace(end, **{side: getattr(at_levels(wall, dict.fromkeys(SIDES, level)), side)})


def best_light(
    transport: torch.Tensor, rest: torch.Tensor, photo: torch.Tensor, light: LightSettings, settings: ExtentSettings,
    start: torch.Tensor | None = None,
) -> tuple[float, torch.Tensor]:  # fmt: skip
    """How well the best light E >= 0 explains a photo by transport E + rest, and that light.

    Least squares, reweighted so that absolute differences of encoded radiance count.

    Args:
        transport: [3, Q, texels] per channel. rest: [Q, 3]. photo: [Q, 3] linear.
        start: [3, texels] a light to begin with.

    Returns:
        Mean absolute encoded error, and the light [3, texels].
    """
    rest, photo = rest.T, photo.T  # [3, Q]
    found = torch.full(transport.shape[::2], start_radiance(photo, light)) if start is None else start

    def errors() -> tuple[torch.Tensor, torch.Tensor]:
        radiance = torch.stack([torch.mv(t, x) for t, x in zip(transport, found, strict=True)]) + rest
        return radiance, residual(radiance, photo, light.encoding, clipped=light.clipped)

    for _ in range(settings.reweightings):
        radiance, error = errors()
        away = radiance - photo
        away = torch.where(away.abs() < 1e-4, 1e-4, away)
        slope = ((encode(photo + away, light.encoding) - encode(photo, light.encoding)) / away).abs()
        brighter = (error == 0) & (away > 0)  # than a clipped channel
        weight = slope * torch.where(brighter, 0.0, error.abs().clamp_min(settings.small).rsqrt())  # [3, Q]
        problem = zip(transport * weight[..., None], (photo - rest) * weight, found, strict=True)
        found = torch.stack([nonnegative(*channel, settings) for channel in problem])
    return float(errors()[1].abs().mean()), found


def nonnegative(
    matrix: torch.Tensor, target: torch.Tensor, start: torch.Tensor, settings: ExtentSettings
) -> torch.Tensor:
    """[T] x >= 0 of least |matrix [Q, T] x - target [Q]|^2 + ridge, by accelerated projected gradients from `start`."""
    ridge = settings.ridge * matrix.square().sum(0).mean()
    # A^T A has no negative entries, and is at most the diagonal of its row sums: safe steps for each texel.
    scale = (torch.mv(matrix.t(), matrix.sum(1)) + ridge).clamp_min(1e-12).reciprocal()
    x, y, t = start, start, 1.0
    for _ in range(settings.steps):
        gradient = torch.mv(matrix.t(), torch.mv(matrix, y) - target) + ridge * y
        new = (y - scale * gradient).clamp_min(0)
        if float((y - new) @ (new - x)) > 0:
            t = 1.0
        after = (1 + (1 + 4 * t * t) ** 0.5) / 2
        y, x, t = new + (t - 1) / after * (new - x), new, after
    return x
