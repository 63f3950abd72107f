"""How far RefractionNet and the symmetry prior are from true thickness."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.bench import shapes
from materialist.errors import InputError
from materialist.predict.refraction.crop import MASK, MIRROR
from materialist.train.refraction.glassware import Shape, centred
from materialist.train.refraction.paths import Tracer
from materialist.train.refraction.view import lesson
from materialist.types import Array

THIN = 0.05
"""Thickness, in units of the object's size, below which a pixel has no relative error of its own."""


def relative_error(found: Array, truth: Array, inside: Array) -> Array:
    """[N] mean absolute error over mean true thickness, of maps [N, S, S] within inside [N, S, S]."""
    error = (np.abs(found - truth) * inside).sum((1, 2))
    return error / np.maximum((truth * inside).sum((1, 2)), 1e-6)


def pixel_error(found: Array, truth: Array, inside: Array) -> Array:
    """[N] mean over pixels of |found - truth| / truth, where the truth is above THIN."""
    counted = inside & (truth > THIN)
    each = np.where(counted, np.abs(found - truth) / np.maximum(truth, THIN), 0)
    return each.sum((1, 2)) / np.maximum(counted.sum((1, 2)), 1)


def score(network, lessons: dict[str, Array], batch: int = 64) -> dict[str, float]:
    """Mean figures over views (see `lessons.views`): `solid`, `hollow` and `symmetry` are relative errors.

    `solid_median`: the median over views; `solid_pixel`, `symmetry_pixel`: `pixel_error`; `hollow` counts only
    hollow shapes, `symmetry` the mirrored thickness as the solid one.
    """
    import torch

    from materialist.predict.refraction.network import both_ways

    maps, target = lessons["maps"].astype(np.float32), lessons["target"].astype(np.float32)
    with torch.inference_mode():
        parts = [both_ways(network, torch.from_numpy(maps[k : k + batch])).numpy() for k in range(0, len(maps), batch)]
    found = np.concatenate(parts)
    # Where the mask that the network got is wider than the object, there is nothing to compare with.
    inside = (maps[:, MASK] > 0.5) & (target[:, 0] > 0)
    solid = relative_error(found[:, 0], target[:, 0], inside)
    symmetry = relative_error(maps[:, MIRROR], target[:, 0], inside)
    figures = {
        "solid": float(solid.mean()), "solid_median": float(np.median(solid)),
        "solid_pixel": float(pixel_error(found[:, 0], target[:, 0], inside).mean()),
        "symmetry": float(symmetry.mean()), "symmetry_median": float(np.median(symmetry)),
        "symmetry_pixel": float(pixel_error(maps[:, MIRROR], target[:, 0], inside).mean()),
    }  # fmt: skip
    hollow = lessons["hollow"].astype(bool)
    if hollow.any():
        walls = relative_error(found[hollow, 1], target[hollow, 1], inside[hollow])
        figures |= {"hollow": float(walls.mean()), "hollow_median": float(np.median(walls))}
    return figures


def of_meshes(folder: Path, views: int = 8, seed: int = 0) -> dict[str, dict[str, Array]]:
    """Views of every .ply mesh below a folder, by the mesh's name: upright, exact maps. Raises InputError."""
    from materialist.render.variant import setup

    setup()
    files = sorted(folder.rglob("*.ply"))
    if not files:
        raise InputError(f"{folder} holds no .ply meshes; give a folder that does.")
    found: dict[str, dict[str, Array]] = {}
    for file in files:
        shape = Shape(centred(shapes.load(file)), False, file.stem, True)
        tracer, rng = Tracer(shape.solid), np.random.default_rng([seed, len(found)])
        lessons = [lesson(shape, tracer, rng, exact=True) for _ in range(views)]
        found[file.stem] = {
            "maps": np.stack([x.maps for x in lessons]),
            "target": np.stack([x.target for x in lessons]),
            "hollow": np.zeros(views, bool),
        }
    return found
