"""What `bench glass` compares: backgrounds, thicknesses and models of glass, each from the maps of one view.

Backgrounds are meshes that reflect the light: they are lit, and do not glow, so that the glass casts its shadow and its
caustics on them, as in a fitted scene.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from materialist.edits.core.renderer import denoised
from materialist.edits.glass import two_interface as interfaces
from materialist.edits.glass.glass import glass
from materialist.edits.glass.options import Glass
from materialist.edits.glass.thickness import object_thickness
from materialist.edits.remove.filling import filled
from materialist.edits.remove.remove import remove
from materialist.geometry.build import build_geometry, part
from materialist.geometry.silhouette import grown, window
from materialist.predict.refraction.thickness import Thickness
from materialist.solids.closed import closed_proxy
from materialist.types import Array, Camera, Prediction, Scene
from materialist_lab.bench.edits import staged
from materialist_lab.bench.glass_scenes import PROTOCOL, GlassScene
from materialist_lab.procedural.arrangements import Item
from materialist_lab.procedural.synthetic import TrueScene


@dataclass(frozen=True)
class Case:
    """One object under one light with one index of refraction."""

    stage: GlassScene
    scene: Scene
    """The photo of the grey object with true maps and light."""
    truth: Array
    """[H, W, 3] linear: the object glass."""
    ior: float
    name: str
    spp: int = 16
    """Paths a pixel of the predictions."""


@dataclass(frozen=True)
class Background:
    """What is taken to be behind the object."""

    picture: Array
    """[H, W, 3] linear radiance."""
    maps: Prediction

    def surfaces(self, camera: Camera) -> list[Item]:
        """The mesh of its depth, and its planes, which go on with their mean albedo."""
        depth = self.maps.depth
        albedo = self.maps.materials.albedo
        items = list[Item]()
        if not depth.any():
            return items
        geometry = build_geometry(depth, self.maps.normal, camera)
        for k in np.unique(geometry.mesh.face_plane):
            # Planes reach beyond what is seen: there they have their mean albedo.
            mean = (
                np.broadcast_to(albedo[geometry.plane_label == k].mean(0), (2, 2, 3))
                if k >= 0
                else albedo
            )
            mesh: Any = part(geometry.mesh, int(k))
            items.append(Item(mesh, mean, 1.0, 0.0))
        return items

    def fitted(self, envmap: Array, room: TrueScene) -> "Background":
        """With the albedo under which its surfaces, path-traced under the light, look like its picture."""
        old = self.maps.materials
        items = self.surfaces(room.camera)
        if not items:
            return self
        # --- One multiplicative step: albedo times picture over rendering ---
        seen = denoised(
            staged(room, items).render(envmap, PROTOCOL.albedo_spp), old.albedo, self.maps.normal
        )
        albedo = np.clip(
            old.albedo * self.picture / np.maximum(seen, 1e-6), 0, PROTOCOL.brightest_albedo
        )
        materials = replace(old, albedo=albedo.astype(np.float32))
        return replace(self, maps=replace(self.maps, materials=materials))


def inpainted_background(scene: Scene, stage: GlassScene) -> Background:
    """What `materialist glass` takes to be behind the object.

    Before nothing but the light, where it refuses, the same filling.
    """
    # --- A room: the object is removed from it ---
    if stage.room.items:
        photo = Background(scene.photo.linear, scene.prior).fitted(scene.envmap, stage.room)
        removed = remove(replace(scene, materials=photo.maps.materials), stage.mask)
        return Background(
            removed.photo.linear, Prediction(removed.materials, removed.normal, removed.depth)
        )
    # --- The light alone: guessed from what is around the object ---
    hole = grown(stage.mask, 1)
    maps = stage.room.truth
    return Background(filled(scene.photo.linear, hole, ~hole), maps)


def two_interface(
    case: Case, thickness: Thickness, behind: Background, *, papers_back: bool = False
) -> Array:
    """[H, W, 3] linear, inside the object's mask: the two-interface model.

    The normals of the back are the known ones, or with `papers_back` the opposite of the front's.
    """
    scene = case.scene
    mask = case.stage.mask
    # "found" takes the normals that are given, "same" those of the front.
    beyond = interfaces.Backdrop(behind.picture, behind.maps.depth, scene.envmap)
    depth, normal = thickness.front or (scene.depth, scene.normal)
    material = Glass(ior=case.ior, model="two-interface", back="same" if papers_back else "found")
    return interfaces.two_interface(
        scene.camera,
        normal,
        depth,
        mask,
        thickness.solid,
        beyond,
        material,
        thickness.back,
    )


def closed(case: Case, thickness: Thickness, behind: Background) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed object before the background, path-traced."""
    scene = case.scene
    mask = case.stage.mask
    # A solid of revolution is whole already; else front and back are closed at the outline.
    whole = thickness.revolution
    if whole is not None:
        return before(case, whole.body(scene.camera), behind)
    depth, normal = thickness.front or (scene.depth, scene.normal)
    beyond = behind.maps.depth
    body = closed_proxy(
        depth, normal, mask, thickness.solid, scene.camera, behind=beyond, back=thickness.back
    )
    return before(case, body, behind)


def edited(case: Case, behind: Background) -> Array:
    """[H, W, 3] linear, inside the object's mask: the body that `materialist glass` makes, before the background."""
    body: Any = glass(case.scene, case.stage.mask).bodies[-1]
    return before(case, body, behind)


def before(case: Case, body: Any, behind: Background) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed body (vertices, faces, normals, uv) before the background.

    Denoised as `materialist glass` does, where the denoiser is installed.
    """
    scene = case.scene
    mask = case.stage.mask
    # The true renderer, so that only the shape differs from the truth.
    things = [*behind.surfaces(scene.camera), replace(case.stage.item, solid=body, ior=case.ior)]
    picture = staged(case.stage.room, things).render(scene.envmap, case.spp)
    # Only the object is denoised: its background is that of the photo.
    box = window(mask)
    seen = np.ascontiguousarray(picture[box])
    normal = np.ascontiguousarray(scene.normal[box])
    picture[box] = denoised(seen, np.ones_like(seen), normal)
    return np.where(mask[..., None], picture, 0)


def thicknesses(scene: Scene, stage: GlassScene, behind: Background) -> dict[str, Thickness]:
    """Thickness along the camera rays, and the normals of the back, by where they come from.

    'true', 'predicted' (what `materialist glass` takes by itself), 'network' (RefractionNet alone), 'symmetry'. Where
    the normals are None they are those of the thickness: 'true' leaves out what true ones add.
    """
    methods: dict[str, Any] = {"true": stage.front.thickness, "predicted": "auto"}
    methods |= {name: name for name in ("network", "symmetry")}
    depth = behind.maps.depth
    return {
        name: object_thickness(scene, stage.mask, method, behind=depth)
        for name, method in methods.items()
    }
