"""The edits of `bench edit`: what is done to a fitted scene, and what the same is in the true one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from materialist.procedural.arrangements import Item
from materialist.procedural.objects import shapes
from materialist.procedural.synthetic import SyntheticSample, TrueScene
from materialist.types import Array, Body, Scene

SHADOW = 0.02
"""Change of the sRGB value from which a pixel counts as part of an insertion's shadow or reflection."""
COPPER = (0.85, 0.45, 0.3)


@dataclass(frozen=True)
class Edit:
    """One edit with its truth."""

    kind: str
    change: Callable[[Scene], Scene]
    """The edit of any scene fitted to the sample's photo."""
    render: Callable[..., Array]
    """render(envmap, spp=, seed=) -> [H, W, 3] linear: the true scene after it."""
    envmap: Array
    """[h, 2h, 3] the light it is seen under, at the photo's exposure."""
    mask: Array | None = None
    """[H, W] bool: what is edited; None where the truth must tell (`region`)."""

    def region(self, before: Array, after: Array) -> Array:
        """[H, W] bool: inside. For an insertion the object, and where the true picture changes visibly."""
        from materialist.color import linear_to_srgb

        if self.kind == "relight":
            return np.ones(before.shape[:2], bool)
        if self.mask is not None and self.kind != "insert":
            return self.mask
        changed = np.abs(linear_to_srgb(after) - linear_to_srgb(before)).max(-1) > SHADOW
        return changed if self.mask is None else changed | self.mask


def edits(sample: SyntheticSample, light: Array, kinds: tuple[str, ...]) -> Iterator[Edit]:
    """The edits of these kinds: hue, metal, relight, insert. `light` [h, 2h, 3] is that of the relit picture."""
    stage: TrueScene = sample.render.__self__  # type: ignore[attr-defined]
    item = stage._probe((0.5, 0.5))["item"]
    chosen = _largest_object(stage, item)
    for kind in kinds:
        if kind == "relight":
            yield Edit(kind, lambda scene: _relit(scene, light), stage.render, light)
        elif kind == "insert":
            found = _insertion(sample, stage, item)
            if found is not None:
                yield found
        elif chosen is not None:
            mask = item == chosen
            change, other = _material(kind, stage.items[chosen])
            truth = _with_item(stage, chosen, other)
            yield Edit(kind, _masked(change, mask), truth.render, sample.envmap, mask)


def _masked(change: Callable[[Scene, Array], Scene], mask: Array) -> Callable[[Scene], Scene]:
    return lambda scene: change(scene, mask)


def _relit(scene: Scene, light: Array) -> Scene:
    from materialist.edits.light.relight import relight

    return relight(scene, envmap=light)


def _material(kind: str, item: Item) -> tuple[Callable[[Scene, Array], Scene], Item]:
    """The edit of a mask, and the true object after it."""
    from materialist.edits.material.material import edit, shifted_hsv

    if kind == "hue":
        change: dict[str, Any] = {"hue": 120.0}
        other = replace(item, albedo=shifted_hsv(item.albedo.astype(np.float32), 120.0, 0.0, 0.0))
    else:
        change = {"albedo": COPPER, "metallic": 1.0, "roughness": 0.3}
        colour = np.broadcast_to(np.array(COPPER, np.float32), item.albedo.shape).copy()
        other = replace(item, albedo=colour, metallic=1.0, roughness=0.3)
    return lambda scene, mask: edit(scene, mask, **change), other


def _with_item(stage: TrueScene, number: int, item: Item) -> TrueScene:
    items = list(stage.items)
    if number == len(items):
        items.append(item)
    else:
        items[number] = item
    return TrueScene(items, stage.view, stage.camera.height, stage.camera.width)


def _largest_object(stage: TrueScene, item: Array) -> int | None:
    """Number of the object, not floor or wall, that covers the most pixels."""
    count = [int((item == k).sum()) if len(i.solid.vertices) > 4 else 0 for k, i in enumerate(stage.items)]
    return int(np.argmax(count)) if count and max(count) > 0 else None


def _insertion(sample: SyntheticSample, stage: TrueScene, item: Array) -> Edit | None:
    """A cup in a free place of the floor; the true one has the vertices that the fitted scene is given."""
    import cv2

    from materialist.edits.insert.insert import insert
    from materialist.edits.insert.meshes import MeshModel

    floor = np.pad((item == 0).astype(np.uint8), 1)
    free = cv2.distanceTransform(floor, cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(free)), free.shape)
    if free[row, column] < 2:
        return None
    at = (float(column) + 0.5, float(row) + 0.5)
    control = np.array([(0.35, 0), (0.45, 0.3), (0.5, 0.8), (0.48, 1.0)])
    solid = shapes.vessel(control, thickness=0.08)
    model = MeshModel((_body(solid),), "cup")
    base = true_scene(sample)
    (body,) = insert(base, model, at).bodies
    rows = lambda v: v.astype(np.float64)  # noqa: E731
    placed = replace(solid, vertices=rows(body.vertices), normals=rows(body.normals))
    surface = body.surface
    truth = _with_item(
        stage, len(stage.items), Item(placed, np.tile(surface.albedo, (2, 2, 1)), float(surface.roughness.mean()), 0.0)
    )  # fmt: skip
    mask = truth._probe((0.5, 0.5))["item"] == len(stage.items)
    return Edit("insert", lambda scene: insert(scene, model, at), truth.render, sample.envmap, mask)


def _body(solid: shapes.Solid) -> Body:
    from materialist.edits.core.surfaces import uniform_surface

    take = lambda v: np.ascontiguousarray(v, np.float32)  # noqa: E731
    colour = np.array([0.15, 0.35, 0.6], np.float32)
    return Body(
        take(solid.vertices), solid.faces, take(solid.normals), take(solid.uv), uniform_surface(colour, 0.4, 0.0)
    )


def true_scene(sample: SyntheticSample) -> Scene:
    """The sample as a fit without any error: true maps on the mesh of the true depth, true light."""
    from materialist.geometry.build import build_geometry

    truth, camera = sample.truth, sample.photo.camera
    geometry = build_geometry(truth.depth, truth.normal, camera)
    return Scene(
        camera, sample.photo, truth, truth.materials, truth.normal, truth.depth, geometry, sample.envmap,
        sample.photo.linear,
    )  # fmt: skip
