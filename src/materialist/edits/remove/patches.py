"""Holes of a picture filled with pieces of the rest of it.

Patches of the hole and of the rest are matched coarse to fine by PatchMatch (Barnes et al. 2009), and every pixel of
the hole becomes the mean of what the patches over it say (Wexler et al. 2007). What is found is a plan, where each
pixel takes its value from, so that several maps are filled alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from materialist.geometry.membrane import membrane
from materialist.types import Array


@dataclass(frozen=True)
class PatchSettings:
    """How patches are compared; tuned by eye on photos, and on the 19 rooms of `bench glass`."""

    radius: int = 3  # pixels to each side of a patch's middle; more: larger structures are kept, fewer patches fit
    finest: int = 256  # longest side, pixels, at which patches are compared last; beyond, pieces keep together
    smallest: int = 24  # least shorter side, pixels, at the first size; less: patches come from farther away
    rounds: tuple[int, ...] = (6, 5, 4, 3, 2)  # of matching and averaging, coarsest size first; the last one goes on
    other: float = 0.1  # squared sRGB a pixel that a patch of another surface costs; as much again if all of it is
    far: float = 0.004  # what a patch costs from as far as the picture is long; more: perspective is kept
    decay: float = 0.9  # a hidden pixel counts by this power of its distance to what is known


OTHER_SURFACE = 1e-4
"""Weight of what a patch shows of another surface: only where nothing else is said."""


@dataclass(frozen=True)
class Plan:
    """Where each pixel of a hole takes its value from."""

    rows: Array
    """[P] of the patches' middles, which lie in the hole or next to it."""
    columns: Array
    """[P]"""
    source: Array
    """[P] row-major pixel that a patch's middle is like."""
    weight: Array
    """[P] float32 how far to trust it."""
    hole: Array
    """[H, W] bool"""
    reach: int = 1
    """Pixels around a patch's middle for which the patch gives values."""
    exact: int = 0
    """The first so many entries give the value of their own pixel, and nothing else does there."""
    label: Array | None = None
    """[H, W] int: surfaces; what a patch shows of another one counts only where no other patch gives a value."""

    def fill(self, maps: Array) -> Array:
        """`maps` [H, W, C] with the hole filled; float32, the rest as it was."""
        height, width = self.hole.shape
        values = np.ascontiguousarray(maps, np.float32)
        total, norm = np.zeros_like(values), np.zeros((height, width, 1), np.float32)
        row, column = np.divmod(self.source, width)
        for dy in range(-self.reach, self.reach + 1):
            for dx in range(-self.reach, self.reach + 1):
                y, x = self.rows + dy, self.columns + dx
                use = (y >= 0) & (y < height) & (x >= 0) & (x < width)
                use[: self.exact] &= dy == dx == 0
                # No two patches have one middle, so that this sum meets no place twice.
                part = self.weight[use, None]
                from_y, from_x = np.clip(row[use] + dy, 0, height - 1), np.clip(column[use] + dx, 0, width - 1)
                if self.label is not None:
                    own = self.label[y[use], x[use]] == self.label[from_y, from_x]
                    part = part * np.where(own, 1, OTHER_SURFACE)[:, None].astype(np.float32)
                total[y[use], x[use]] += part * values[from_y, from_x]
                norm[y[use], x[use]] += part
        total = np.where(self.hole[..., None] & (norm > 0), total / np.maximum(norm, 1e-12), values)
        total[self.rows[: self.exact], self.columns[: self.exact]] = values[row[: self.exact], column[: self.exact]]
        return total


def patch_plan(
    features: Array, hole: Array, source: Array, label: Array, *, known: Array | None = None, seed: int = 0,
    settings: PatchSettings = PatchSettings(),
) -> Plan | None:  # fmt: skip
    """Find what to fill a hole with.

    Args:
        features: [H, W, F] what is compared; [0, 1], such as sRGB. Not read in the hole.
        hole: [H, W] bool.
        source: [H, W] bool: what may be copied; the hole never is.
        label: [H, W] int: surfaces, known in the hole too; patches of another one are avoided.
        known: [H, W] int row-major sources that are known already (see `symmetry.repeated_sources`), -1 for none;
            patches are sought for the rest of the hole, and fit to these.

    Returns:
        None where there is no whole patch to copy from.
    """
    exact = np.zeros_like(hole) if known is None else hole & (known >= 0)
    if known is None or not exact.any():
        return _matched(features, hole, source, label, seed, settings)
    filled = features.copy()
    filled[exact] = features.reshape(-1, features.shape[-1])[known[exact]]
    rest = _matched(filled, hole & ~exact, source & ~hole, label, seed, settings) if (hole & ~exact).any() else None
    if rest is None:  # no patch fits: what is left takes the source of the nearest pixel that has one
        from scipy.ndimage import distance_transform_edt

        near = distance_transform_edt(~exact, return_distances=False, return_indices=True)
        known, exact = np.where(hole, known[tuple(near)], -1), hole
    rows, columns = np.nonzero(exact)
    plan = Plan(rows, columns, known[exact], np.ones(len(rows), np.float32), hole, exact=len(rows), label=label)
    if rest is None:
        return plan
    own = ~exact[rest.rows, rest.columns]
    joined = lambda name: np.concatenate([getattr(plan, name), getattr(rest, name)[own]])  # noqa: E731
    return replace(
        plan, rows=joined("rows"), columns=joined("columns"), source=joined("source"), weight=joined("weight")
    )  # fmt: skip


def _matched(
    features: Array, hole: Array, source: Array, label: Array, seed: int, settings: PatchSettings
) -> Plan | None:
    """`patch_plan` where no source is known."""
    rng = np.random.default_rng(seed)
    finest = 1
    while max(hole.shape) / finest > settings.finest:
        finest *= 2
    factors = [finest]
    while min(hole.shape) / factors[-1] >= 2 * settings.smallest and np.sqrt(hole.sum()) / factors[-1] > 5:
        factors.append(factors[-1] * 2)
    found: _Match | None = None
    for number, factor in enumerate(reversed(factors)):
        level = _Level(features, hole, source, label, factor, settings)
        if level.candidates.size and level.targets.size:  # a thin hole is none in a small picture
            found = level.match(found, settings.rounds[min(number, len(settings.rounds) - 1)], rng)
    return None if found is None else replace(_enlarged(found, hole, finest), label=label)


@dataclass(frozen=True)
class _Match:
    """The best source of each patch at one size."""

    factor: int
    hole: Array
    features: Array
    """[h, w, F] with the hole filled."""
    index: Array
    """[h, w] patch number, -1 for none."""
    best: Array
    """[P] row-major source."""
    cost: Array
    """[P]"""


class _Level:
    """The problem at one size."""

    def __init__(self, features: Array, hole: Array, source: Array, label: Array, factor: int, settings: PatchSettings):
        known = _shrunk((~hole)[..., None].astype(np.float32), factor)[..., 0]
        self.factor, self.hole, self.settings = factor, known < 0.5, settings
        weighted = _shrunk(np.where(hole[..., None], 0, features).astype(np.float32), factor)
        self.features = weighted / np.maximum(known, 1e-6)[..., None]
        self.shape = self.hole.shape
        rows, columns = (np.minimum(np.arange(n) * factor + factor // 2, m - 1) for n, m in zip(self.shape, hole.shape))
        self.label = label[rows[:, None], columns[None]]
        allowed = (_shrunk((source & ~hole)[..., None].astype(np.float32), factor)[..., 0] > 0.99) & ~self.hole
        height, width = self.shape
        r = self.radius = min(settings.radius, (min(height, width) - 1) // 4)
        whole = _eroded(allowed, r)
        whole[:r], whole[height - r :], whole[:, :r], whole[:, width - r :] = False, False, False, False
        self.whole = whole
        self.candidates = np.flatnonzero(whole)
        near = _dilated(self.hole, r)
        near[:r], near[height - r :], near[:, :r], near[:, width - r :] = False, False, False, False
        # At the rim of the picture no patch fits around a pixel; those further in speak for it.
        self.rows, self.columns = np.nonzero(near)
        self.targets = self.rows * width + self.columns
        self.index = np.full(self.shape, -1)
        self.index[near] = np.arange(len(self.rows))
        dy, dx = np.mgrid[-r : r + 1, -r : r + 1]
        self.around = (dy * width + dx).ravel()
        self.trust = self._trust()
        self.surface = self.label.ravel()
        self.surfaces = self.surface[self.targets[:, None] + self.around]  # [P, n]
        self.several = bool((self.surface != self.surface[0]).any())

    def _trust(self) -> Array:
        from scipy.ndimage import distance_transform_edt

        away = distance_transform_edt(self.hole) if not self.hole.all() else np.ones(self.shape)
        return np.maximum(self.settings.decay**away, 0.02).astype(np.float32).ravel()

    def match(self, before: _Match | None, rounds: int, rng: np.random.Generator) -> _Match:
        """Alternate matching and averaging; starts from the next coarser size."""
        if before is None:
            filled = membrane(self.features, ~self.hole)
            best = rng.choice(self.candidates, len(self.targets))
        else:
            best = self._from_coarser(before, rng)
            filled = self._averaged(self.features, best, np.ones(len(best), np.float32))
        cost = np.zeros(len(best), np.float32)
        for _ in range(rounds):
            self._flat = filled.reshape(-1, filled.shape[-1])
            self._patch = self._flat[self.targets[:, None] + self.around]  # [P, n, F]
            cost = self._cost(best)
            best, cost = self._searched(best, cost, rng)
            spread = max(float(np.quantile(cost, 0.75)), 1e-8)
            filled = self._averaged(self.features, best, np.exp(-cost / spread))
        return _Match(self.factor, self.hole, filled, self.index, best, cost)

    def _cost(self, source: Array) -> Array:
        """[P] weighted mean square difference of patches, with the prices of other surfaces and distance."""
        other = self._flat[source[:, None] + self.around]
        trust = self.trust[self.targets[:, None] + self.around]
        square = ((self._patch - other) ** 2).mean(-1)
        width = self.shape[1]
        far = np.hypot(source // width - self.rows, source % width - self.columns) / max(self.shape)
        cost = (square * trust).sum(-1) / trust.sum(-1) + self.settings.far * far.astype(np.float32)
        if self.several:
            strange = self.surface[source[:, None] + self.around] != self.surfaces
            cost += self.settings.other * (strange.mean(-1, dtype=np.float32) + strange[:, strange.shape[1] // 2])
        return cost

    def _searched(self, best: Array, cost: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """What neighbours found, moved along; then places near the best so far, ever nearer."""
        height, width = self.shape
        for step in (2, 1):
            for dy, dx in ((0, step), (0, -step), (step, 0), (-step, 0)):
                y, x = np.clip(self.rows + dy, 0, height - 1), np.clip(self.columns + dx, 0, width - 1)
                other = self.index[y, x]
                moved = best[other] - dy * width - dx
                best, cost = self._better(best, cost, np.where(other >= 0, moved, best))
        reach = max(self.shape) / 2
        while reach >= 1:
            jump = np.round(rng.uniform(-reach, reach, (2, len(best)))).astype(np.int64)
            row, column = np.divmod(best, width)
            best, cost = self._better(
                best, cost,
                np.clip(row + jump[0], 0, height - 1) * width + np.clip(column + jump[1], 0, width - 1),
            )  # fmt: skip
            reach /= 3
        return best, cost

    def _better(self, best: Array, cost: Array, tried: Array) -> tuple[Array, Array]:
        tried = np.clip(tried, 0, self.whole.size - 1)
        tried = np.where(self.whole.ravel()[tried], tried, best)
        if (tried == best).all():
            return best, cost
        new = self._cost(tried)
        wins = new < cost
        return np.where(wins, tried, best), np.where(wins, new, cost)

    def _averaged(self, features: Array, best: Array, weight: Array) -> Array:
        plan = Plan(self.rows, self.columns, best, weight.astype(np.float32), self.hole, self.radius, label=self.label)
        return plan.fill(features)

    def _from_coarser(self, before: _Match, rng: np.random.Generator) -> Array:
        """[P] sources found at another size, where they are whole patches here; random ones elsewhere."""
        ratio = before.factor / self.factor
        height, width = before.index.shape
        y, x = (
            np.minimum((v / ratio).astype(np.int64), n - 1) for v, n in ((self.rows, height), (self.columns, width))
        )
        number = before.index[y, x]
        source = before.best[number]
        row = np.round(source // width * ratio + self.rows - y * ratio).astype(np.int64)
        column = np.round(source % width * ratio + self.columns - x * ratio).astype(np.int64)
        row, column = np.clip(row, 0, self.shape[0] - 1), np.clip(column, 0, self.shape[1] - 1)
        place = row * self.shape[1] + column
        good = (number >= 0) & self.whole.ravel()[place]
        return np.where(good, place, rng.choice(self.candidates, len(place)))


def _enlarged(found: _Match, hole: Array, factor: int) -> Plan:
    """The matches of size 1 / `factor` for the pixels of full size: pieces of factor x factor keep together."""
    height, width = hole.shape
    small_width = found.index.shape[1]
    rows, columns = np.nonzero(_dilated(hole, 1))
    near = _spread(found.index)
    number = near[np.minimum(rows // factor, near.shape[0] - 1), np.minimum(columns // factor, near.shape[1] - 1)]
    middle = np.argwhere(found.index >= 0)[number]  # [P, 2] of the patch at the small size
    source = found.best[number]
    row = np.clip((source // small_width - middle[:, 0]) * factor + rows, 0, height - 1)
    column = np.clip((source % small_width - middle[:, 1]) * factor + columns, 0, width - 1)
    inside = hole[row, column]
    # A piece may stick out of what may be copied by a pixel: such pixels are left to their neighbours.
    weight = np.where(inside, 1e-6, np.exp(-found.cost[number] / max(float(np.quantile(found.cost, 0.75)), 1e-8)))
    return Plan(rows, columns, row * width + column, np.maximum(weight, 1e-6).astype(np.float32), hole)


def _spread(index: Array) -> Array:
    """[h, w] every -1 replaced by the nearest number."""
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(index < 0, return_distances=False, return_indices=True)
    return index[rows, columns]


def _shrunk(maps: Array, factor: int) -> Array:
    """[H, W, C] means of factor x factor pixels, the last ones of fewer."""
    if factor == 1:
        return maps
    height, width = maps.shape[:2]
    padded = np.pad(maps, ((0, -height % factor), (0, -width % factor), (0, 0)), mode="edge")
    return padded.reshape(padded.shape[0] // factor, factor, -1, factor, maps.shape[2]).mean((1, 3))


def _eroded(mask: Array, radius: int) -> Array:
    import cv2

    return cv2.erode(mask.astype(np.uint8), np.ones((2 * radius + 1,) * 2, np.uint8)) > 0


def _dilated(mask: Array, radius: int) -> Array:
    import cv2

    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * radius + 1,) * 2, np.uint8)) > 0
