"""Relief finer than the mesh: fixed banks of slopes by which shading normals are bent.

Two banks serve every scene, as the bank of tiles does. Slopes of tiles follow the texture coordinates: joints, boards,
threads. Slopes of solid noise follow the place in space and need no texture coordinates: stone, plaster, hammered
metal, folds, fur.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import map_coordinates

from materialist.types import Array
from materialist_lab.procedural import tiles

SIDE = 64
"""Voxels on a side of a block of solid noise, which repeats."""
SLAB = SIDE + 2
"""Layers of a block in the bank: one more at each end, for the interpolation."""
FINE_SLOPE = 1 / 64
"""Step of the stored slopes of tiles, in heights per tile."""


@dataclass(frozen=True)
class Relief:
    """Solid noise on a surface."""

    kind: str
    """One of `SOLID`."""
    size: tuple[float, float, float]
    """Metres that a block covers along x, y and z of the scene; unequal ones draw the noise out."""
    slope: float
    """Root mean square of the tangent of the angle by which normals are bent."""

    def row(self) -> list[float]:
        """[5] as the path tracer reads it: blocks a metre, slope, number of the kind."""
        smallest = min(self.size)
        return [*(1 / s for s in self.size), self.slope * smallest, float(SOLID.index(self.kind))]


def _frequency(stretch: tuple[float, float, float] = (1, 1, 1)) -> Array:
    """[SIDE]*3 frequencies in waves per block; a `stretch` above 1 draws noise out along that axis."""
    axes = [np.fft.fftfreq(SIDE) * SIDE * s for s in stretch]
    f = np.sqrt(sum(a**2 for a in np.meshgrid(*axes, indexing="ij")))
    # The mean has no wave; 1 avoids a division by zero, and `_field` drops it.
    f[0, 0, 0] = 1
    return f


def _field(rng: np.random.Generator, weight: Array) -> Array:
    """Periodic noise [SIDE]*3 of that weight a frequency, mean 0, deviation 1."""
    spectrum = np.fft.fftn(rng.normal(size=(SIDE,) * 3)) * weight
    spectrum[0, 0, 0] = 0
    field = np.fft.ifftn(spectrum).real
    return field / field.std()


def _rough(rng):
    """Stone, plaster, bark: every size of bump."""
    return _field(rng, _frequency() ** -2.2)


def _grain(rng):
    """Orange peel, cast metal, sand: bumps of one size."""
    f = _frequency()
    return _field(rng, np.exp(-(((f - 10) / 4) ** 2)))


def _ridges(rng):
    """Sharp ridges and cracks: folded noise."""
    folded = -np.abs(_field(rng, _frequency() ** -2.0))
    return folded + 0.3 * _field(rng, _frequency() ** -1.8)


def _hammered(rng):
    """Dents side by side: the distance to the nearest of many points."""
    nearest = np.full((SIDE,) * 3, np.inf)
    for point in rng.uniform(0, SIDE, (60, 3)):
        # The shorter way around the block, which repeats.
        away = np.abs(np.arange(SIDE)[:, None] - point)
        x, y, z = (np.minimum(away, SIDE - away) ** 2).T
        nearest = np.minimum(nearest, x[:, None, None] + y[:, None] + z)
    return nearest / nearest.std()


def _carved(rng):
    """Ornament: flat islands with steep sides."""
    # The hyperbolic tangent flattens what is high or low.
    return np.tanh(4 * _field(rng, np.exp(-(((_frequency() - 4) / 2) ** 2))))


def _folds(rng):
    """Soft folds along x, bent by noise."""
    bent = _field(rng, _frequency() ** -2.5)
    # Whole numbers of folds along both axes: the block stays periodic.
    axis = np.arange(SIDE) / SIDE
    y, z = np.meshgrid(axis, axis, indexing="ij")
    folds = np.sin(2 * np.pi * (3 * y + 2 * z) + 1.6 * bent)
    return folds + 0.3 * _field(rng, _frequency() ** -2.5)


def _hair(rng):
    """Strands along x."""
    return _field(rng, np.exp(-(((_frequency((8, 1, 1)) - 14) / 6) ** 2)))


_SOLID = {
    "rough": _rough,
    "grain": _grain,
    "ridges": _ridges,
    "hammered": _hammered,
    "carved": _carved,
    "folds": _folds,
    "hair": _hair,
}
SOLID = tuple(_SOLID)
"""Kinds of solid noise."""


@lru_cache(maxsize=1)
def heights() -> dict[str, Array]:
    """Kind -> [SIDE]*3 float32 heights along x, y, z, periodic, deviation 1; the same in every process."""
    fields = {
        kind: make(np.random.default_rng([43, k])) for k, (kind, make) in enumerate(_SOLID.items())
    }
    return {
        kind: ((field - field.mean()) / field.std()).astype(np.float32)
        for kind, field in fields.items()
    }


def height(kind: str, places: Array) -> Array:
    """[N] heights of a kind at places [N, 3], in blocks; cubic interpolation."""
    return map_coordinates(heights()[kind], (places % 1).T * SIDE, order=3, mode="grid-wrap")


@lru_cache(maxsize=1)
def solid_bank() -> Array:
    """[kinds * SLAB, SIDE, SIDE, 4] float32: slopes along x, y, z (rms of their length 1), and 0.

    Layers lie along z, rows along y, columns along x, as a 3D texture has them.
    """
    slabs = []
    for field in heights().values():
        # Central differences, periodic; a fourth channel of zeros, since textures have one, two or four.
        slopes = [np.roll(field, -1, k) - np.roll(field, 1, k) for k in range(3)]
        slope = np.stack([*slopes, 0 * field], -1)
        slope /= np.sqrt((slope**2).sum(-1).mean())
        slope = slope.transpose(2, 1, 0, 3)
        # The last layer before the first and the first behind the last, for the interpolation.
        slabs.append(np.concatenate([slope[-1:], slope, slope[:1]]))
    return np.concatenate(slabs).astype(np.float32)


@lru_cache(maxsize=1)
def tile_bank() -> Array:
    """[tiles, SIZE, SIZE] uint32: slopes of each tile's height to the right and down, 16 bits each, FINE_SLOPE a step.

    The height is the tile's brightness grain, with joints, seams and the like below it.
    """
    bank, where = tiles.bank()
    depth = np.ones(len(bank), np.float32) * 0.0
    for kind in ("bricks", "tiling", "planks", "facade"):
        depth[where[kind].start : where[kind].stop] = 1.0
    words = np.empty(bank.shape[:3], np.uint32)
    for k, tile in enumerate(bank):
        field = 0.3 * tile[..., 2] / 255.0 - depth[k] * tile[..., 1] / 255.0
        # Slopes in heights per tile, to the right in the lower 16 bits and down in the upper ones.
        steps = []
        for axis in (1, 0):
            slope = (np.roll(field, -1, axis) - np.roll(field, 1, axis)) * tiles.SIZE / 2
            rounded = np.rint(slope / FINE_SLOPE) + 32768
            steps.append(np.clip(rounded, 0, 65535).astype(np.uint32))
        words[k] = steps[0] | steps[1] << 16
    return words
