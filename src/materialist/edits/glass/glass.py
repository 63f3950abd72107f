"""An object of the photo turned to glass (paper, Material Transparency Editing)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import pixel_rays
from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import checked_region
from materialist.edits.glass.several import objects_in
from materialist.edits.glass.thickness import ObjectThickness, object_thickness
from materialist.edits.remove.background import Inpaint, without
from materialist.edits.remove.hole import GROW
from materialist.errors import InputError
from materialist.solids.closed import closed_proxy
from materialist.solids.shell import Shell, joined
from materialist.types import Array, Body, Scene, Surface

MODELS = ("closed", "two-interface")
OPEN = "open"
"""Value of `hollow`: a vessel without a lid."""
SOLID = "The two-interface model knows no walls: this glass is solid."
LID = "Only a surface of revolution can be open at the top; this glass is hollow, and closed."
NO_ROOM = "There is no room for a wall around air: this glass is solid."
IOR = (1.0, 3.0)
NAME = "photo glass"


def glass(
    scene: Scene, mask: Array, *, ior: float = 1.5, transmission: float = 1.0,
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0), roughness: float = 0.0, hollow: bool | str = False,
    model: str = "closed", thickness: str | Array | Path = "auto", background: Array | str | Path | None = None,
    inpaint: Inpaint | None = None, grow: float = GROW, shadow: float | None = None, smooth: float = 0.01,
    seed: int = 0, fitted: Scene | None = None,
) -> Scene:  # fmt: skip
    """The scene with the object under a mask of glass, before what it hid.

    Args:
        mask: [H, W] bool, or weights in [0, 1], at working size: one object, or several.
        ior: index of refraction, in [1, 3]: water 1.33, glass 1.5, diamond 2.4. 1 bends nothing.
        transmission: share T of light that meets glass, in [0, 1]; the rest meets the object's own material. The
            default is clear; the paper's pictures have 0.9.
        tint: colour of white light after a way in and a way out, linear, in [0, 1].
        roughness: perceptual, in [0, 1]; below 0.03 the glass is smooth.
        hollow: a wall around air, as thick as RefractionNet says (else 5 % of the object's size); `open`: and no lid,
            for a surface of revolution (anything else stays closed, and the report says so).
        model: `closed` path-traces a closed object (`solids.closed`); `two-interface` is the paper's: every camera
            ray is bent twice and looks up the background, and there are no shadows.
        thickness: see `thickness.object_thickness`.
        background, inpaint, grow, shadow, fitted: see `background.without`.
        smooth: see `solids.closed.closed_proxy`.

    Raises:
        InputError: an option out of its range, or a mask that cannot be used. WeightsError: a network without weights.
    """
    check_glass(ior, transmission, tint, roughness)
    if model not in MODELS:
        raise InputError(f"The model is '{model}'; choose one of {', '.join(MODELS)}.")
    if hollow not in (True, False, OPEN):
        raise InputError(f"hollow is {hollow!r}; choose true, false or {OPEN}.")
    own = checked_region(scene, mask) > 0.5
    removed = without(
        scene, mask, background=background, inpaint=inpaint, grow=grow, shadow=shadow, seed=seed, fitted=fitted
    )  # fmt: skip
    each = [
        (part, object_thickness(scene, part, thickness, behind=removed.depth))
        for part in objects_in(own, scene.depth) if (part & (scene.depth > 0)).any()
    ]  # fmt: skip
    if model == "two-interface":
        look = {"ior": ior, "transmission": transmission, "tint": tint, "roughness": roughness}
        edited = _two_interface(scene, removed, each, look, smooth, (fitted or scene).envmap)
        edited = warned(edited, SOLID) if hollow else edited
    else:
        surface = glass_surface(scene, ior=ior, transmission=transmission, tint=tint, roughness=roughness)
        shells = [_shell(scene, removed, part, found, hollow, smooth) for part, found in each]
        shell = joined(shells)
        body = Body(shell.vertices, shell.faces, shell.normals, shell.uv, surface, NAME)
        edited = warned(replace(removed, bodies=(*removed.bodies, body)), *_unlike(each, shells, hollow))
    methods = list(dict.fromkeys(found.method for _, found in each))
    what = {
        "ior": ior, "transmission": transmission, "tint": list(tint), "roughness": roughness, "hollow": hollow,
        "model": model, "thickness": ", ".join(methods), "pixels": int(own.sum()),
    }  # fmt: skip
    return noted(edited, "glass", what)


def _shell(
    scene: Scene, removed: Scene, part: Array, found: ObjectThickness, hollow: bool | str, smooth: float
) -> Shell:
    wall = found.wall if hollow else None
    if found.revolution is not None:
        return found.revolution.body(scene.camera, wall=wall, open_top=hollow == OPEN)
    return closed_proxy(
        scene.depth, scene.normal, part, found.solid, scene.camera,
        smooth=smooth, wall=wall, behind=removed.depth, back=found.back,
    )  # fmt: skip


def _unlike(each: list[tuple[Array, ObjectThickness]], shells: list[Shell], hollow: bool | str) -> list[str]:
    """What of a hollow could not be made, in words."""
    notes = []
    for (_, found), shell in zip(each, shells, strict=True):
        opened = hollow == OPEN and found.revolution is not None and found.revolution.opens(found.wall)
        notes += [LID] * (hollow == OPEN and not opened)
        notes += [NO_ROOM] * (bool(hollow) and not opened and not shell.hollow)
    return list(dict.fromkeys(notes))


def glass_surface(
    scene: Scene, *, ior: float, transmission: float, tint: tuple[float, float, float], roughness: float
) -> Surface:
    """The material: glass, and (1 - T) of what the object was; values as for `glass`."""
    clear = transmission >= 1
    albedo = np.ones((1, 1, 3), np.float32) if clear else scene.materials.albedo
    metallic = np.zeros((1, 1), np.float32) if clear else scene.materials.metallic
    rough = np.full((1, 1), roughness, np.float32) if clear else scene.materials.roughness
    r, g, b = (float(c) for c in tint)
    return Surface(
        albedo, rough, metallic, float(transmission), float(ior), (r, g, b), glass_roughness=float(roughness)
    )  # fmt: skip


def _two_interface(
    scene: Scene, removed: Scene, each: list[tuple[Array, ObjectThickness]], look: dict[str, Any], smooth: float,
    envmap: Array,
) -> Scene:  # fmt: skip
    """The removed scene with the paper's picture of the glass in its photo, in the light of the photo."""
    from materialist.edits.glass.two_interface import back_of, two_interface
    from materialist.edits.remove.background import resized

    own = np.zeros(scene.depth.shape, bool)
    photo, picture = removed.photo, np.zeros(scene.photo.linear.shape, np.float32)
    for part, found in each:
        seen, front, facing = _front(scene, part, found, smooth)
        one = two_interface(
            scene.camera, facing, front, seen, found.solid, removed.depth, photo.linear, envmap,
            back=back_of(front, seen, found.solid, found.back, scene.camera), **{**look, "transmission": 1.0},
        )  # fmt: skip
        picture = np.where(seen[..., None], one, picture)
        own |= seen
    if look["transmission"] < 1:
        # The photo has the reflections of its own surface: that share of it takes the place of all of the glass.
        clear = look["transmission"]
        picture = clear * picture + (1 - clear) * scene.photo.linear * own[..., None]
    linear = np.where(own[..., None], picture, photo.linear).astype(np.float32)
    native = photo.original.shape[:2]
    share = np.clip(resized(own.astype(np.float32), native), 0, 1)[..., None]
    near = resized(_beyond(picture, own), native)
    original = (share * near + (1 - share) * photo.original).astype(np.float32)
    return replace(removed, photo=replace(photo, linear=linear, original=original))


def _front(scene: Scene, own: Array, found: ObjectThickness, smooth: float) -> tuple[Array, Array, Array]:
    """Where glass is seen, [H, W] bool, and its front's depth and normals: of a surface of revolution, or the maps.

    Normals of the maps are blurred as for the closed proxy.
    """
    from materialist.geometry.slopes import blurred_normals

    if found.revolution is None:
        return own, scene.depth, blurred_normals(scene.normal, own, smooth * float(np.sqrt(own.sum())))
    depth, normal = found.revolution.front(own, pixel_rays(scene.camera).astype(np.float64))
    return depth > 0, depth, normal


def _beyond(picture: Array, own: Array) -> Array:
    """[H, W, 3] the picture with its nearest values outside the mask, so that enlarging mixes in nothing else."""
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(~own, return_distances=False, return_indices=True)
    return picture[rows, columns]


def check_glass(ior: float, transmission: float, tint, roughness: float) -> None:
    """Raise InputError for values out of range, as of `glass`."""
    if not (np.isfinite(ior) and IOR[0] <= ior <= IOR[1]):
        raise InputError(
            f"The index of refraction is {ior:g}; it must lie in [1, 3] (water 1.33, glass 1.5, diamond 2.4)."
        )
    for name, value in (("transmission", transmission), ("roughness", roughness)):
        if not (np.isfinite(value) and 0 <= value <= 1):
            raise InputError(f"The {name} is {value:g}; it must lie in [0, 1].")
    if len(tint) != 3 or not all(np.isfinite(c) and 0 <= c <= 1 for c in tint):
        raise InputError(f"The tint is {tint}; it must be three numbers in [0, 1]: linear R, G, B.")
