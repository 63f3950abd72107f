"""Edits of `bench edit` and `bench photo-alone`: what is done to a fitted scene, and the same in the true one."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.core.surfaces import uniform_surface
from materialist.edits.glass.glass import glass
from materialist.edits.glass.options import Glass
from materialist.edits.insert.insert import insert
from materialist.edits.insert.meshes import MeshModel
from materialist.edits.light.relight import relight
from materialist.edits.material.material import edit, shifted_hsv
from materialist.edits.remove.remove import remove
from materialist.geometry.build import build_geometry
from materialist.types import Array, Body, Photo, Prediction, Scene
from materialist_lab.procedural.arrangements import Item
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.shapes import Solid
from materialist_lab.procedural.synthetic import SyntheticSample, TrueScene, make_sample

SHIFTS = {
    f"{name}{sign}": (name, float(f"{sign}0.5"))
    for name in ("roughness", "metallic")
    for sign in "+-"
}
"""The paper's "high" and "low" (Material Editing): what is shifted, and by how much."""
MIN_SHIFT = 0.25
"""Smallest shift within [0, 1] for which an object is edited: the limits may leave less than the whole."""
KINDS = ("hue", "metal", "relight", "insert", "glass", "remove", "glass cup", "paint", *SHIFTS)
INSERTIONS = ("insert", "glass cup")
SHADOW = 0.02
"""Change of the sRGB value from which a pixel counts as part of a shadow or reflection."""
COPPER = (0.85, 0.45, 0.3)
PAINT = (0.05, 0.2, 0.5)
"""A new colour of a thing that stays as rough as it is."""
LIFT = 0.002
"""Metres of air under true glass: where two surfaces are one, either may be met first."""


@dataclass(frozen=True)
class Edit:
    """One edit with its truth."""

    kind: str
    change: Callable[..., Scene]
    """The edit of any scene fitted to the sample's photo."""
    truth: TrueScene
    """The true scene after it."""
    envmap: Array
    """[h, 2h, 3] the light it is seen under, at the photo's exposure."""
    mask: Array
    """[H, W] bool: what is edited."""

    def region(self, before: Array, after: Array) -> Array:
        """[H, W] bool: inside. For an insertion also where the true picture changes visibly."""
        return self.mask | self.traces(before, after) if self.kind in INSERTIONS else self.mask

    def traces(self, before: Array, after: Array) -> Array:
        """[H, W] bool: where the true picture changes visibly outside: in shadows and reflections."""
        return ~self.mask & (
            np.abs(linear_to_srgb(after) - linear_to_srgb(before)).max(-1) > SHADOW
        )


def edits(sample: SyntheticSample, light: Array, kinds: list[str]) -> Iterator[Edit]:
    """The edits of these KINDS that the scene has room for; `light` [h, 2h, 3] is that of the relit picture."""
    stage = sample.scene
    things = stage.things
    for kind in kinds:
        # Objects are neither floor nor wall.
        able = [
            k for k in things if kind not in SHIFTS or _shift(stage.items[k], kind) >= MIN_SHIFT
        ]
        largest = max(able, key=lambda k: things[k].sum(), default=None)
        if kind == "relight":
            # Another light changes the whole picture.
            everything = np.ones(stage.seen.shape, bool)
            yield Edit(kind, partial(relight, envmap=light), stage, light, everything)
        elif kind in INSERTIONS:
            yield from _insertion(sample, stage, kind)
        elif largest is None:
            continue
        else:
            mask = things[largest]
            item = stage.items[largest]
            if kind == "remove":
                change = partial(remove, mask=mask)
                others = []
            elif kind == "glass":
                change = partial(glass, mask=mask)
                # Removed, of glass, or of another material: only this object of the truth changes.
                others = [_of_glass(item, stage)]
            else:
                values, other = _material(kind, item)
                change = partial(edit, mask=mask, **values)
                others = [other]
            items = [*stage.items[:largest], *others, *stage.items[largest + 1 :]]
            yield Edit(kind, change, staged(stage, items), sample.envmap, mask)


def _material(kind: str, item: Item) -> tuple[dict[str, Any], Item]:
    """The values of an edit, and the true object after it."""
    if kind == "hue":
        return {"hue": 120.0}, replace(
            item, albedo=shifted_hsv(item.albedo.astype(np.float32), 120.0, 0.0, 0.0)
        )
    if kind in SHIFTS:
        name, by = SHIFTS[kind]
        shifted: dict[str, Any] = {name: getattr(item, name) + np.sign(by) * _shift(item, kind)}
        return {name: f"{by:+g}"}, replace(item, **shifted)
    # --- Another paint, or copper ---
    albedo = PAINT if kind == "paint" else COPPER
    colour = np.broadcast_to(np.array(albedo, np.float32), item.albedo.shape).copy()
    painted = replace(item, albedo=colour)
    if kind == "paint":
        return {"albedo": PAINT}, painted
    values = {"albedo": COPPER, "metallic": 1.0, "roughness": 0.3}
    return values, replace(painted, metallic=1.0, roughness=0.3)


def _shift(item: Item, kind: str) -> float:
    """How much of one of the SHIFTS the limits 0 and 1 leave."""
    name, by = SHIFTS[kind]
    old = getattr(item, name)
    # Towards the limit that the sign points to.
    return min(abs(by), 1 - old if by > 0 else old)


def _of_glass(item: Item, stage: TrueScene) -> Item:
    """The object in clear glass, LIFT above what it stands on."""
    solid = replace(item.solid, vertices=item.solid.vertices + LIFT * stage.view.to_scene[1])
    return replace(item, solid=solid, ior=Glass().ior)


def staged(stage: TrueScene, items: list[Item]) -> TrueScene:
    """The true scene with other objects."""
    return TrueScene(items, stage.view, stage.camera.height, stage.camera.width)


def free_place(floor: Array) -> tuple[float, float] | None:
    """Column and row farthest from what is no floor [H, W] bool; None where there is hardly any."""
    # Padded: the border of the picture is no floor.
    free = cv2.distanceTransform(np.pad(floor.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(free)), free.shape)
    return (float(column) + 0.5, float(row) + 0.5) if free[row, column] >= 2 else None


def cup() -> tuple[Solid, MeshModel]:
    """A blue cup, as a solid and as a mesh."""
    solid = shapes.vessel(
        np.array([(0.35, 0), (0.45, 0.3), (0.5, 0.8), (0.48, 1.0)]), thickness=0.08
    )
    vertices, normals, uv = (
        np.ascontiguousarray(x, np.float32) for x in (solid.vertices, solid.normals, solid.uv)
    )
    surface = uniform_surface(np.array([0.15, 0.35, 0.6], np.float32), 0.4, 0.0)
    return solid, MeshModel((Body(vertices, solid.faces, normals, uv, surface),), "cup")


def _insertion(sample: SyntheticSample, stage: TrueScene, kind: str) -> Iterator[Edit]:
    """A cup, blue or of glass, in a free place of the floor, if any; the true one has the vertices of the other one."""
    at = free_place(stage.seen == 0)
    if at is None:
        return
    solid, model = cup()
    material = "as-is" if kind == "insert" else "glass"
    # The product's placing, so that both cups stand at the same place.
    (body,) = insert(true_scene(sample), model, at, material=material).bodies
    placed = replace(
        solid, vertices=body.vertices.astype(np.float64), normals=body.normals.astype(np.float64)
    )
    ior = Glass().ior if kind == "glass cup" else None
    albedo = body.surface.albedo
    roughness = float(body.surface.roughness.mean())
    truth = staged(
        stage, [*stage.items, Item(placed, np.tile(albedo, (2, 2, 1)), roughness, 0.0, ior)]
    )
    # The last object of the true scene.
    mask = truth.seen == len(stage.items)
    yield Edit(
        kind, lambda scene: insert(scene, model, at, material=material), truth, sample.envmap, mask
    )


def awaited(size: int, data: Path | None, seed: int) -> tuple[Scene, Array, str]:
    """A scene with true maps, which cost the same as fitted ones, a region [H, W] bool of it, and what to call both."""
    scene = true_scene(make_sample(0, 0, 0, size=size, data=data, seed=seed, spp=16))
    mask = np.zeros(scene.depth.shape, bool)
    # The middle of the picture, as large as a typical object.
    third = np.s_[size // 3 : 2 * size // 3]
    mask[third, third] = True
    mask &= scene.depth > 0
    return scene, mask, f"{size} x {size}, {int(mask.sum())} pixels"


def sample_and_light(
    scene: int, view: int, light: int, **options: Any
) -> tuple[SyntheticSample, Array]:
    """The sample of these numbers, and the next light [h, 2h, 3] of its view; `options` as of `make_sample`."""
    sample = make_sample(scene, view, light, **options)
    other = make_sample(scene, view, light + 1, **options)
    return sample, other.envmap


def true_scene(
    sample: SyntheticSample,
    maps: Prediction | None = None,
    *,
    completion: str = "auto",
    seed: int = 0,
) -> Scene:
    """The sample as a fit without any error: true maps on the mesh of the true depth, true light; or other `maps`."""
    return scene_of(
        sample.photo, maps or sample.truth, sample.envmap, completion=completion, seed=seed
    )


def scene_of(
    photo: Photo, maps: Prediction, envmap: Array, *, completion: str = "auto", seed: int = 0
) -> Scene:
    """A photo with those maps and that light [h, 2h, 3], as they are: nothing is fitted."""
    geometry = build_geometry(
        maps.depth, maps.normal, photo.camera, completion=completion, seed=seed
    )
    return Scene(
        photo.camera,
        photo,
        maps,
        maps.materials,
        maps.normal,
        maps.depth,
        geometry,
        envmap,
        photo.linear,
    )
