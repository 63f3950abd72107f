"""What fills a hole: planes with translational symmetry go on, patches of the surroundings do the rest."""

from __future__ import annotations

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.remove.patches import Plan, patch_plan
from materialist.edits.remove.seamless import seamless
from materialist.edits.remove.symmetry import repeated_sources
from materialist.geometry.membrane import membrane
from materialist.types import Array, Camera, Materials


def filling_plan(
    albedo: Array, photo: Array, hole: Array, label: Array, depth: Array, camera: Camera, *,
    seed: int = 0, usable: Array | None = None,
) -> Plan | None:  # fmt: skip
    """Where a hole takes its values from: places that are alike in albedo and photo, on the same surface.

    Args:
        albedo, photo: [H, W, 3] linear; not read in the hole.
        hole: [H, W] bool. label: [H, W] int, depth: [H, W]: surfaces in and around the hole (see `behind.Behind`).
        seed: of the patch search. usable: [H, W] bool: what may be copied, None for anything.

    Returns:
        None where nothing can be copied.
    """
    usable = np.ones(hole.shape, bool) if usable is None else usable
    paint = linear_to_srgb(albedo)
    features = np.concatenate([paint, linear_to_srgb(photo)], -1)
    known = repeated_sources(paint, features, hole, usable, label, depth, camera)
    return patch_plan(features, hole, usable, _joined(label, hole), known=known, seed=seed)


def filled(plan: Plan | None, maps: Array, hole: Array) -> Array:
    """[H, W, C] radiance or albedo with the hole filled: patches without seams, or a membrane where there are none."""
    return seamless(plan, maps) if plan is not None else membrane(maps, ~hole)


def filled_materials(plan: Plan | None, old: Materials, hole: Array) -> Materials:
    """Materials with the hole [H, W] bool filled."""
    rest = np.stack([old.roughness, old.metallic], -1)
    rest = np.clip(plan.fill(rest) if plan is not None else membrane(rest, ~hole), 0, 1)
    albedo = np.clip(filled(plan, old.albedo, hole), 0, 1)
    return Materials(albedo, np.ascontiguousarray(rest[..., 0]), np.ascontiguousarray(rest[..., 1]))


def _joined(label: Array, hole: Array) -> Array:
    """Labels [H, W] int where parts of a plane that do not reach the hole [H, W] bool are surfaces of their own.

    One plane may hold two things: the face of a die, and by accident a strip of the board behind it.
    """
    from skimage.measure import label as parts_of

    out = label.copy()
    for number in np.unique(label[hole & (label >= 0)]):
        parts = parts_of(label == number, connectivity=2)
        others = (parts > 0) & ~np.isin(parts, parts[hole])
        out[others] = out.max() + parts[others]
    return out
