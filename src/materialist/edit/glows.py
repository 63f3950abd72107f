"""Lights that the photo shows, windows and lamps in the frame, as surfaces that glow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.edit.material import warned
from materialist.edit.mesh_material import constant
from materialist.errors import InputError
from materialist.render.scene import part
from materialist.types import Array, Body, Scene

CLIPPED = 0.97
"""Least channel of a linear photo from which a pixel is taken for a light, whose radiance is not known but larger."""
LEAST = 0.001
"""Smallest share of the picture that a light covers; less is a highlight."""
LIFT = 2e-3
"""A light lies before its surface by this share of the depth."""
RADIANCES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
"""Radiances that are tried, in units of the photo's white."""
WORSE = 1.02
"""Errors of the photo that are alike: up to so many times the least one."""
DARK = 1e-6
"""Radiance of a light that is off: it is still the photo's own, with its outline."""
BRIGHTER = 4.0
"""So many times as bright as an HDR photo in the median is a light in it, at least."""
SPP = 32
NAME = "photo light"
KEY = "photo_lights"
"""Entry of the provenance of a scene whose lights are surfaces."""


def visible_lights(scene: Scene) -> list[Array]:
    """Masks [H, W] bool of the lights on surfaces of the photo: connected clipped regions, the largest first."""
    from scipy import ndimage

    photo, surface = scene.photo, scene.depth > 0
    least = CLIPPED
    if photo.hdr and surface.any():
        least = max(CLIPPED, BRIGHTER * float(np.median(photo.linear[surface].mean(-1))))
    bright = (photo.linear.min(-1) >= least) & surface
    label, count = ndimage.label(bright)
    masks = [label == k for k in range(1, count + 1)]
    return sorted((m for m in masks if m.sum() >= LEAST * bright.size), key=lambda m: -int(m.sum()))


def dimmed(
    scene: Scene, dim: float, *, fitted: Scene | None = None, seed: int = 0, device: str = "auto"
) -> Scene:  # fmt: skip
    """The scene with its visible lights as glowing surfaces of `dim` times their radiance; the photo's is 1.

    The fitted environment map explains the whole photo. Here it is scaled down to leave room for the lights, whose
    radiance is the largest of `RADIANCES` with which the two together explain the photo best, and at least its white.
    With dim = 1 the scene is about what it was.

    Args:
        fitted: the scene before its edits, whose rendering is the photo: the lights are found in it.

    Raises:
        InputError: the scene is edited, and `fitted` is not given; dim is not in [0, 10], or no clipped region of the
            photo is large enough.
    """
    if not (np.isfinite(dim) and 0 <= dim <= 10):
        raise InputError(f"The dimming is {dim:g}; it must lie in [0, 10], 1 for as it is, 0 for off.")
    if any(body.name.startswith(NAME) for body in scene.bodies):
        raise InputError("The lights of this photo are dimmed already; start from the scene before.")
    if fitted is None and is_edited(scene):
        raise InputError(
            "The lights of a photo are found in the scene before its edits; give that as fitted=, or dim first."
        )
    known = fitted or scene
    masks = visible_lights(known)
    if not masks:
        raise InputError("The photo shows no light: no clipped region on a surface covers a thousandth of it.")
    ambient, radiance, share = _explained(known, masks, seed, device)
    found = {"ambient": ambient, "radiance": radiance, "dim": dim, "share": share}
    provenance = {**scene.provenance, KEY: found}
    places = ", ".join("{1:.0f},{0:.0f}".format(*np.argwhere(mask).mean(0)) for mask in masks)
    note = f"Taken for lights, {radiance:g} times as bright as the photo's white: the clipped regions around {places}."
    return warned(replace(_shining(scene, masks, ambient, dim * radiance), provenance=provenance), note)


def is_edited(scene: Scene) -> bool:
    """Whether a scene has edits that its photo and its re-rendering do not show."""
    saved = [len(stage.get("edits", ())) for stage in scene.report.stages if stage.get("name") == "edit"]
    return len(scene.provenance.get("edits", ())) > max(saved, default=0)


def explained(scene: Scene, edited: Scene) -> Scene:
    """What an edit is compared with: the scene itself, or where the edit has dimmed its lights, the scene with them.

    The two give the same photo; the scene's own map has the light of the photo's lights from elsewhere.
    """
    found = edited.provenance.get(KEY)
    if not found or KEY in scene.provenance:
        return scene
    return _shining(scene, visible_lights(scene), found["ambient"], found["radiance"])


def _shining(scene: Scene, masks: list[Array], ambient: float, radiance: float) -> Scene:
    glow = max(radiance, DARK)
    lights = tuple(_patch(scene, mask, glow, f"{NAME} {k}") for k, mask in enumerate(masks))
    return replace(scene, envmap=scene.envmap * np.float32(ambient), bodies=(*scene.bodies, *lights))


def _explained(scene: Scene, masks: list[Array], seed: int, device: str) -> tuple[float, float, float]:
    """(factor on the environment map, radiance of the lights) that together give the photo, and the lights' share.

    The share is what the lights bring to the surfaces of the photo, relative to what the whole map brings.
    """
    from materialist.render.scene import RenderScene

    shining = tuple(_patch(scene, mask, 1.0, NAME) for mask in masks)
    target = RenderScene(scene.geometry, scene.camera, bodies=(*scene.bodies, *shining), device=device)
    target.set_materials(scene.materials)
    target.set_envmap(np.full((8, 16, 3), 1e-6, np.float32))
    by_lights = target.render_path(spp=SPP, seed=seed)  # [H, W, 3] of lights of radiance 1 alone
    photo = scene.photo.linear
    seen = (scene.depth > 0) & ~np.any(masks, 0) & (photo.max(-1) < CLIPPED)
    if not seen.any():
        return 1.0, 1.0, 0.0
    wanted, base, lit = (v[seen].astype(np.float64) for v in (photo, scene.rerender, by_lights))
    weight = 1 / (wanted.mean(-1, keepdims=True) + 0.05)  # errors count relative to the brightness

    def fitted(radiance: float) -> tuple[float, float]:
        rest = wanted - radiance * lit
        factor = float(np.clip((weight**2 * rest * base).sum() / max((weight**2 * base**2).sum(), 1e-12), 0, 2))
        return factor, float((np.abs(rest - factor * base) * weight).mean())

    # An HDR photo tells how bright its lights are.
    tried = (float(photo[np.any(masks, 0)].mean()),) if scene.photo.hdr else RADIANCES
    found = {radiance: fitted(radiance) for radiance in tried}
    best = min(error for _, error in found.values())
    chosen = max(radiance for radiance, (_, error) in found.items() if error <= WORSE * best)
    return found[chosen][0], chosen, float(chosen * lit.mean() / max(base.mean(), 1e-6))


def _patch(scene: Scene, mask: Array, radiance: float, name: str) -> Body:
    """The surface of the masked pixels, lifted a little towards the camera, black but for its light."""
    surface = part(scene.geometry.mesh, -1)
    chosen = mask.reshape(-1)[surface.face_pixel]
    faces = surface.faces[chosen]
    used, numbers = np.unique(faces, return_inverse=True)
    vertices = (surface.vertices[used] * np.float32(1 - LIFT)).astype(np.float32)
    emission = (float(radiance),) * 3
    return Body(
        vertices, numbers.reshape(faces.shape).astype(np.int32), surface.normals[used], surface.uv[used],
        constant(0.0, 1.0, 0.0, emission=emission), name,
    )  # fmt: skip
