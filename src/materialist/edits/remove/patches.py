"""Holes of a picture filled with pieces of the rest of it.

Patches of the hole and of the rest are matched coarse to fine by PatchMatch (Barnes et al. 2009); between two rounds
every hidden pixel becomes the mean of what the patches over it say (Wexler et al. 2007). The result is a map of
sources, the pixel from which each hidden pixel takes its value, so that several maps are filled alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.geometry.membrane import membrane, nearest
from materialist.types import Array


@dataclass(frozen=True)
class PatchSettings:
    """How patches are compared; tuned by eye on photos, and on the 19 rooms of `bench glass`."""

    radius: int = 3  # pixels to each side of a patch's middle; more: larger structures are kept, fewer patches fit
    finest: int = 256  # longest side, pixels, at which patches are compared last; beyond, pieces keep together
    smallest: int = 24  # least shorter side, pixels, at the first size; less: patches come from farther away
    rounds: tuple[int, ...] = (6, 5, 4, 3, 2)  # of matching and averaging, coarsest size first; the last one goes on
    other: float = 0.1  # squared sRGB a pixel that a patch of another surface costs; as much again if all of it is
    far: float = 0.004  # cost of a patch from as far as the picture is long; more: perspective is kept
    mixed: float = 1e-4  # weight in a mean of what a patch shows of another surface


SETTINGS = PatchSettings()


def patch_sources(
    features: Array, hole: Array, usable: Array, label: Array, *, known: Array | None = None, seed: int = 0
) -> Array | None:  # fmt: skip
    """[H, W] int: the row-major pixel that each pixel takes its values from, outside a hole itself.

    None where there is nothing to copy.

    Args:
        features: [H, W, F] what is compared; [0, 1], such as sRGB. Not read in the hole. hole: [H, W] bool.
        usable: [H, W] bool: what may be copied; the hole never is.
        label: [H, W] int: surfaces, known in the hole too; patches of another one are avoided.
        known: [H, W] int row-major sources that are known already (see `symmetry.repeated_sources`), -1 for none;
            patches are sought for the rest of the hole, and fit to these.
    """
    found = np.full(hole.shape, -1) if known is None else np.where(hole, known, -1)
    rest, given = hole & (found < 0), found >= 0
    if rest.any():
        features = features.copy()
        features[given] = features.reshape(-1, features.shape[-1])[found[given]]
        found = np.where(rest, _matched(features, rest, usable & ~hole, label, seed), found)
    if not (found >= 0).any():
        return None
    # A piece may stick out of what may be copied: such pixels take the source of the nearest one.
    return np.where(hole, found[nearest(found >= 0)], np.arange(hole.size).reshape(hole.shape))


def copied(maps: Array, source: Array) -> Array:
    """[H, W, C] float32 maps whose pixels take the values of their sources [H, W]."""
    return np.asarray(maps, np.float32).reshape(source.size, -1)[source]


def _matched(features: Array, hole: Array, usable: Array, label: Array, seed: int) -> Array:
    """[H, W] int sources of the hole's pixels; -1 elsewhere, and where none is found."""
    rng = np.random.default_rng(seed)
    factor = 1
    while max(hole.shape) / factor > SETTINGS.finest:
        factor *= 2
    factors = [factor]
    while min(hole.shape) / factors[0] >= 2 * SETTINGS.smallest and np.sqrt(hole.sum()) / factors[0] > 5:
        factors.insert(0, 2 * factors[0])
    source, before = None, 1
    for number, factor in enumerate(factors):
        level = _Level(features, hole, usable, label, factor)
        if level.candidates.size and level.targets.size:  # a thin hole is none in a small picture
            start = None if source is None else _enlarged(source, level.hole.shape, before / factor)
            source = level.match(start, SETTINGS.rounds[min(number, len(SETTINGS.rounds) - 1)], rng)
            before = factor
    if source is None:
        return np.full(hole.shape, -1)
    large = _enlarged(source, hole.shape, before)
    return np.where(hole & usable.ravel()[large], large, -1)


class _Level:
    """The problem at one size."""

    def __init__(self, features: Array, hole: Array, usable: Array, label: Array, factor: int):
        import cv2

        known = _shrunk((~hole)[..., None], factor)[..., 0]
        self.hole = known < 0.5
        height, width = self.hole.shape
        seen = _shrunk(np.where(hole[..., None], 0, features), factor) / np.maximum(known, 1e-6)[..., None]
        self.features = membrane(seen, ~self.hole).reshape(height * width, -1)
        rows, columns = (
            np.minimum(np.arange(n) * factor + factor // 2, m - 1) for n, m in zip((height, width), hole.shape)
        )
        self.surface = label[rows[:, None], columns].ravel()
        # At the rim of the picture no patch fits around a pixel; those further in speak for it.
        r = min(SETTINGS.radius, (min(height, width) - 1) // 4)
        inside = np.zeros(self.hole.shape, bool)
        inside[r : height - r, r : width - r] = True
        square = np.ones((2 * r + 1,) * 2, np.uint8)
        allowed = (_shrunk(usable[..., None], factor)[..., 0] > 0.99) & ~self.hole
        self.whole = ((cv2.erode(allowed.astype(np.uint8), square) > 0) & inside).ravel()
        self.candidates = np.flatnonzero(self.whole)
        self.targets = np.flatnonzero((cv2.dilate(self.hole.astype(np.uint8), square) > 0) & inside)
        self.index = np.full(height * width, -1)
        self.index[self.targets] = np.arange(len(self.targets))
        dy, dx = np.mgrid[-r : r + 1, -r : r + 1]
        self.around = (dy * width + dx).ravel()

    def match(self, start: Array | None, rounds: int, rng: np.random.Generator) -> Array:
        """[h, w] int source of each patch over the hole, -1 elsewhere; `start` [h, w]: sources of a coarser size."""
        best = rng.choice(self.candidates, len(self.targets))
        filled = self.features
        if start is not None:
            begun = start.ravel()[self.targets]
            best = np.where(self.whole[begun], begun, best)
            filled = self._averaged(best)
        for _ in range(rounds):
            best = self._searched(filled, best, rng)
            filled = self._averaged(best)
        source = np.full(self.hole.shape, -1)
        source.ravel()[self.targets] = best
        return source

    def _cost(self, filled: Array, source: Array) -> Array:
        """[P] mean square difference of patches, with the prices of other surfaces and distance."""
        here, there = self.targets[:, None] + self.around, source[:, None] + self.around
        square = ((filled[here] - filled[there]) ** 2).mean((-2, -1))
        (y, x), (row, column) = (np.divmod(v, self.hole.shape[1]) for v in (self.targets, source))
        far = np.hypot(row - y, column - x).astype(np.float32) / max(self.hole.shape)
        strange = self.surface[here] != self.surface[there]
        other = strange.mean(-1, dtype=np.float32) + strange[:, strange.shape[1] // 2]
        return square + SETTINGS.far * far + SETTINGS.other * other

    def _searched(self, filled: Array, best: Array, rng: np.random.Generator) -> Array:
        """[P] sources after what neighbours found, moved along, and places near the best, ever nearer."""
        height, width = self.hole.shape
        cost = self._cost(filled, best)

        def improved(tried: Array) -> None:
            tried = np.where((tried >= 0) & (tried < self.whole.size), tried, best)
            tried = np.where(self.whole[tried], tried, best)
            new = self._cost(filled, tried)
            wins = new < cost
            best[wins], cost[wins] = tried[wins], new[wins]

        for shift in (1, -1, width, -width):
            other = self.index[np.clip(self.targets + shift, 0, self.index.size - 1)]
            improved(np.where(other >= 0, best[other] - shift, best))
        reach = max(height, width) / 2
        while reach >= 1:
            down, right = np.round(rng.uniform(-reach, reach, (2, len(best)))).astype(np.int64)
            row, column = np.divmod(best, width)
            improved(np.clip(row + down, 0, height - 1) * width + np.clip(column + right, 0, width - 1))
            reach /= 3
        return best

    def _averaged(self, best: Array) -> Array:
        """[h * w, F] the features, in the hole the mean of what the patches over a pixel say."""
        total, norm = np.zeros_like(self.features), np.zeros((len(self.features), 1), np.float32)
        for offset in self.around:  # no two patches have one middle, so that this sum meets no place twice
            here, there = self.targets + offset, best + offset
            weight = np.where(self.surface[here] == self.surface[there], 1, SETTINGS.mixed)[:, None]
            total[here] += weight * self.features[there]
            norm[here] += weight
        return np.where(self.hole.reshape(-1, 1) & (norm > 0), total / np.maximum(norm, 1e-12), self.features)


def _enlarged(source: Array, shape: tuple[int, ...], factor: float) -> Array:
    """[H, W] int sources [h, w] (-1 for none) at a size `factor` times as large: pieces of pixels keep together."""
    rows, columns = np.indices(shape)
    small = (
        np.minimum((rows / factor).astype(int), source.shape[0] - 1),
        np.minimum((columns / factor).astype(int), source.shape[1] - 1),
    )
    middle = tuple(v[small] for v in nearest(source >= 0))
    row, column = np.divmod(source[middle], source.shape[1])
    row = np.round((row - middle[0]) * factor).astype(int) + rows
    column = np.round((column - middle[1]) * factor).astype(int) + columns
    return np.clip(row, 0, shape[0] - 1) * shape[1] + np.clip(column, 0, shape[1] - 1)


def _shrunk(maps: Array, factor: int) -> Array:
    """[H, W, C] float32 means of factor x factor pixels, the last ones of fewer."""
    height, width, channels = maps.shape
    padded = np.pad(maps.astype(np.float32), ((0, -height % factor), (0, -width % factor), (0, 0)), mode="edge")
    return padded.reshape(padded.shape[0] // factor, factor, -1, factor, channels).mean((1, 3))
