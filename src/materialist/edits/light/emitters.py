"""Lights that the photo shows, windows and lamps in the frame, as surfaces that glow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from materialist.edits.core.emitters import KEY, OFF, emitting, with_emitters
from materialist.edits.core.notes import is_edited, warned
from materialist.edits.core.region import checked_region
from materialist.edits.core.surfaces import PHOTO_LIGHT, triple, uniform_surface
from materialist.errors import InputError
from materialist.render.scene import part
from materialist.types import Array, Body, Photo, Scene

CLIPPED = 0.97
"""Least channel of a linear photo from which a pixel is taken for a light, whose radiance is not known but larger."""
AROUND, REACH = 0.6, 0.015
"""What adjoins a light and has this part of that value belongs to it (its rim, a shade), as far as this share of the
picture's longer side."""
CLOSED = 0.006
"""Gaps in a light that are narrower than twice this share of the longer side, as leaves before a window, are closed."""
UPWARD = 0.7
"""A surface that faces up more than this (mean Y of its normals) reflects a light, or lies in the sun, and is none."""
LEAST = 0.001
"""Smallest share of the picture that a light covers; less is a highlight."""
SMALLEST = 9
"""Pixels below which a mask is no light."""
LIFT = 2e-3
"""A light lies before its surface by this share of the depth."""
RADIANCES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
"""Radiances that are tried, in units of the photo's white."""
HALF, SOME = 0.5, 0.1
"""Share of a light that is clipped beyond which its colour is unknown, and up to which its radiance is known."""
WORSE = 1.02
"""Errors of the photo that are alike: up to so many times the least one."""
BRIGHTER = 4.0
"""So many times as bright as an HDR photo in the median is a light in it, at least."""
SPP = 32


def visible_lights(scene: Scene) -> list[Array]:
    """Masks [H, W] bool of the lights on surfaces of the photo: connected regions of clipped pixels and the bright
    ones beside them, the largest first; none that face up.
    """
    photo, surface = scene.photo, scene.depth > 0
    least = CLIPPED
    if photo.hdr and surface.any():
        least = max(CLIPPED, BRIGHTER * float(np.median(photo.linear[surface].mean(-1))))
    value = photo.linear.min(-1)
    bright = (value >= least) & surface
    masks = [m for m in _parts(_spread(bright, (value >= AROUND * least) & surface)) if _is_light(m, bright, scene)]
    return sorted(masks, key=lambda m: -int(m.sum()))


def _spread(bright: Array, beside: Array) -> Array:
    """[H, W] bool: `bright` with what is connected to it of `beside`, and without its narrow gaps."""
    import cv2
    from scipy import ndimage

    if not bright.any():
        return bright
    longer = max(bright.shape)
    near = ndimage.distance_transform_edt(~bright) <= max(1, round(REACH * longer))
    grown = ndimage.binary_propagation(bright, mask=beside & near)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * round(CLOSED * longer) + 1,) * 2)
    return cv2.morphologyEx(grown.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0


def _parts(mask: Array) -> list[Array]:
    """[H, W] bool each: the connected parts of a mask."""
    from scipy import ndimage

    label, count = ndimage.label(mask)
    return [label == k for k in range(1, count + 1)]


def _is_light(mask: Array, bright: Array, scene: Scene) -> bool:
    return bool((mask & bright).sum() >= LEAST * mask.size and scene.normal[mask][:, 1].mean() <= UPWARD)


def dimmed(
    scene: Scene, dim: float, *, lights: Array | None = None, fitted: Scene | None = None, seed: int = 0,
    device: str = "auto",
) -> Scene:  # fmt: skip
    """The scene with its visible lights as glowing surfaces of `dim` times their radiance; the photo's is 1.

    The fitted environment map explains the whole photo. Here it is scaled down to leave room for the lights, whose
    radiance is the largest of `RADIANCES` with which the two together explain the photo best, and at least its white;
    of lights that are not clipped it is what the photo shows. With dim = 1 the scene is about what it was.

    Args:
        lights: [H, W] bool mask of the lights that are meant, at working size; None takes `visible_lights`.
        fitted: the scene before its edits, whose rendering is the photo: the lights are found in it.

    Raises:
        InputError: the scene is edited, and `fitted` is not given; no clipped region of the photo is large enough, or
            the mask has another size or no surface in it.
    """
    if any(body.name.startswith(PHOTO_LIGHT) for body in scene.bodies):
        raise InputError("The lights of this photo are dimmed already; start from the scene before.")
    if fitted is None and is_edited(scene):
        raise InputError(
            "The lights of a photo are found in the scene before its edits; give that as fitted=, or dim first."
        )
    known = fitted or scene
    masks = visible_lights(known) if lights is None else _given(known, lights)
    if not masks:
        raise InputError(
            "The photo shows no light: no clipped region on a surface covers a thousandth of it and does not face up; "
            "mark the lights that you mean."
        )
    masks = [part for mask in masks for part in _parts(mask & ~_gone(scene, known)) if part.sum() >= SMALLEST]
    if not masks:
        raise InputError("The lights of this photo were taken away by an earlier step; leave the dimming out.")
    colours, given = _looks(known.photo, masks)
    ambient, radiance, share = _explained(known, masks, colours, seed, device, given)
    shining = [[radiance * c for c in colour] for colour in colours]
    found = {"ambient": ambient, "radiance": radiance, "dim": dim, "share": share, "emission": shining}
    emitters = [
        emitting(_patch(scene, mask, f"{PHOTO_LIGHT} {k}"), [dim * c for c in own])
        for k, (mask, own) in enumerate(zip(masks, shining))
    ]  # fmt: skip
    edited = with_emitters(scene, emitters, found)
    places = ", ".join("{1:.0f},{0:.0f}".format(*np.argwhere(mask).mean(0)) for mask in masks)
    kind = "clipped regions" if lights is None else "regions"
    note = f"Taken for lights, {radiance:.3g} times as bright as the photo's white: the {kind} around {places}."
    return warned(replace(edited, provenance={**scene.provenance, KEY: found}), note)


def _given(scene: Scene, lights: Array) -> list[Array]:
    """The parts of a mask of lights that are large enough to be a surface."""
    masks = [part for part in _parts(checked_region(scene, lights) > 0.5) if part.sum() >= SMALLEST]
    if not masks:
        raise InputError(f"The mask of lights has no connected part of {SMALLEST} pixels; mark the whole light.")
    return masks


def _gone(scene: Scene, known: Scene) -> Array:
    """[H, W] bool: what edits took away of a photo since it was fitted."""
    return (scene.depth != known.depth) | (scene.photo.linear != known.photo.linear).any(-1)


def _looks(photo: Photo, masks: list[Array]) -> tuple[list[tuple[float, float, float]], float | None]:
    """The lights' colours, and the radiance that goes with them where the photo tells it.

    An HDR photo tells how bright its lights are, and any photo those that are not clipped. Else colours are 1 in the
    brightest channel, and white where most of a light is clipped.
    """
    inside = [photo.linear[mask] for mask in masks]
    clipped = np.concatenate([(part.max(-1) >= CLIPPED) for part in inside]).mean()
    if photo.hdr or clipped < SOME:
        peak = max(max(float(part.mean(0).max()) for part in inside), OFF)
        return [triple(part.mean(0) / peak) for part in inside], peak
    white = [(part.min(-1) >= CLIPPED).mean() > HALF for part in inside]
    means = [np.ones(3) if is_white else part.mean(0) for part, is_white in zip(inside, white)]
    return [triple(mean / max(float(mean.max()), 1e-6)) for mean in means], None


def _explained(
    scene: Scene,
    masks: list[Array],
    colours: Sequence[tuple[float, float, float]],
    seed: int,
    device: str,
    given: float | None = None,
) -> tuple[float, float, float]:
    """(factor on the environment map, radiance of the lights) that together give the photo, and the lights' share.

    The share is what the lights bring to the surfaces of the photo, relative to what the whole map brings.
    """
    from materialist.render.scene import RenderScene

    shining = tuple(emitting(_patch(scene, mask, PHOTO_LIGHT), colour) for mask, colour in zip(masks, colours))
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

    tried = RADIANCES if given is None else (given,)
    found = {radiance: fitted(radiance) for radiance in tried}
    best = min(error for _, error in found.values())
    chosen = max(radiance for radiance, (_, error) in found.items() if error <= WORSE * best)
    return found[chosen][0], chosen, float(chosen * lit.mean() / max(base.mean(), 1e-6))


def _patch(scene: Scene, mask: Array, name: str) -> Body:
    """The surface of the masked pixels, black, and moved a little towards the camera."""
    surface = part(scene.geometry.mesh, -1)
    chosen = mask.reshape(-1)[surface.face_pixel]
    faces = surface.faces[chosen]
    used, numbers = np.unique(faces, return_inverse=True)
    vertices = (surface.vertices[used] * np.float32(1 - LIFT)).astype(np.float32)
    return Body(
        vertices, numbers.reshape(faces.shape).astype(np.int32), surface.normals[used], surface.uv[used],
        uniform_surface(0.0, 1.0, 0.0), name,
    )  # fmt: skip
