"""What fills a hole: planes with translational symmetry go on, patches of the surroundings do the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.remove.patches import copied, patch_sources
from materialist.edits.remove.seamless import seamless
from materialist.edits.remove.symmetry import repeated_sources
from materialist.geometry.membrane import membrane
from materialist.types import Array, Camera, Materials


@dataclass(frozen=True)
class Filling:
    """Where a hole takes its values from."""

    hole: Array
    """[H, W] bool."""
    label: Array
    """[H, W] int: surfaces in and around the hole."""
    source: Array | None
    """[H, W] int row-major source of each pixel; None where nothing can be copied."""
    exact: Array
    """[H, W] bool: sources that a symmetry gives."""

    def radiance(self, values: Array) -> Array:
        """[H, W, C] float32 radiance or albedo with the hole filled, by a membrane where nothing can be copied."""
        if self.source is None:
            return membrane(values, ~self.hole)
        return seamless(values, self.hole, self.source, self.label, self.exact)

    def materials(self, old: Materials) -> Materials:
        """Materials with the hole filled."""
        rest = np.stack([old.roughness, old.metallic], -1)
        rest = membrane(rest, ~self.hole) if self.source is None else copied(rest, self.source)
        albedo = np.clip(self.radiance(old.albedo), 0, 1)
        return Materials(albedo, *(np.ascontiguousarray(v) for v in np.moveaxis(np.clip(rest, 0, 1), -1, 0)))


def find_filling(
    albedo: Array, photo: Array, hole: Array, label: Array, depth: Array, camera: Camera, *,
    seed: int = 0, usable: Array | None = None,
) -> Filling:  # fmt: skip
    """Find places that are alike in albedo and photo, on the same surface.

    Args:
        albedo, photo: [H, W, 3] linear; not read in the hole.
        hole: [H, W] bool. label: [H, W] int, depth: [H, W]: surfaces in and around the hole (see `behind.Behind`).
        seed: of the patch search. usable: [H, W] bool: what may be copied, None for anything.
    """
    usable = np.ones(hole.shape, bool) if usable is None else usable
    paint = linear_to_srgb(albedo)
    features = np.concatenate([paint, linear_to_srgb(photo)], -1)
    known = repeated_sources(paint, features, hole, usable, label, depth, camera)
    source = patch_sources(features, hole, usable, label, known=known, seed=seed)
    return Filling(hole, label, source, hole & (known >= 0))
