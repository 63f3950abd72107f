"""`bench glass --latency`: what a person waits for while making an object glass."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from materialist.bench.benchmark import Clock
from materialist.types import Array, Scene

CHANGES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ior", {"ior": 1.3}), ("ior", {"ior": 1.7}), ("tint", {"tint": (0.6, 0.9, 0.7)}),
    ("roughness", {"roughness": 0.2}), ("roughness", {"roughness": 0.4}), ("transmission", {"transmission": 0.9}),
)  # fmt: skip
"""What a person changes, one after the other."""


def latencies(data: Path | None, size: int, *, spp: int, seed: int, device: str) -> Iterator[dict[str, Any]]:
    """Rows of the preview (`edit.glass_preview`): built, its first picture, and one picture after another.

    The scene is a synthetic one with its true maps, `size` pixels wide; its object takes about a tenth of the picture.
    """
    from materialist.bench.edits import true_scene
    from materialist.edits.glass.preview import GlassPreview
    from materialist.procedural.synthetic import make_sample

    scene = true_scene(make_sample(0, 0, 0, size=size, data=data, seed=seed, spp=16))
    mask = block(scene)
    sample = f"{size} x {size}, {int(mask.sum())} pixels"
    clock = Clock()
    preview = GlassPreview(scene, mask, device=device, seed=seed)
    yield {"method": "preview: built once", "sample": sample, **clock.read()}
    for roughness in (0.0, 0.3):  # kernels are compiled at the first picture of a kind
        clock = Clock()
        preview.picture(roughness=roughness, spp=spp, seed=seed)
        yield {"method": "preview: first picture of a kind", "sample": sample, **clock.read()}
    for name, change in CHANGES:
        clock = Clock()
        preview.picture(**change, spp=spp, seed=seed)
        yield {"method": f"preview: {name}", "sample": sample, **clock.read()}


def block(scene: Scene) -> Array:
    """[H, W] bool: a third of the picture's width and height, where there is a surface."""
    height, width = scene.depth.shape
    mask = np.zeros((height, width), bool)
    mask[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3] = True
    return mask & (scene.depth > 0)
