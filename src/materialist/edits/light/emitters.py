"""In-photo emitters: windows and lamps that the photo shows, found and turned into surfaces that can be dimmed."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage
from scipy.optimize import lsq_linear

from materialist.edits.core.notes import is_edited, warned
from materialist.edits.core.region import checked_region
from materialist.edits.core.surfaces import (
    KEY,
    OFF,
    PHOTO_LIGHT,
    emitting,
    triple,
    uniform_surface,
    with_emitters,
)
from materialist.errors import InputError
from materialist.geometry.build import part
from materialist.geometry.silhouette import disc
from materialist.types import Array, Body, Photo, Scene


@dataclass(frozen=True)
class EmitterSettings:
    """What counts as an emitter, and how bright it is; tuned by eye unless derived."""

    # Which pixels are of an emitter.
    clipped: float = 0.97  # least channel from which a pixel's radiance is unknown; derived: 8 bits
    min_hdr_ratio: float = 4.0  # to the median radiance of an HDR photo
    min_rim: float = 0.6  # share of `clipped` from which pixels beside it always belong to it
    rim_ratio: float = 2.5  # to the median radiance of the photo; from there on they do, too
    max_outshining_reach: float = 0.08  # how far beside it, share of the longer side
    max_rim_reach: float = 0.015  # likewise, in a photo as bright as its lights
    gap: float = 0.006  # half of the gaps that are closed, as leaves before a window; likewise
    max_upward: float = 0.7  # mean Y of the normals; above, a surface reflects or lies in the sun
    min_area: float = 0.001  # share of the picture; less is a highlight
    min_pixels: int = 9  # of a part of a mask; derived: a surface needs some triangles

    # How bright it is.
    max_clipped_known: float = 0.1  # share of clipped pixels up to which the photo tells it
    min_clipped_white: float = 0.5  # share of clipped pixels above which it is taken as white
    lift: float = 2e-3  # before its surface, share of the depth; derived: ray offsets
    spp: int = 32  # paths a pixel of the rendering that estimates it; derived: sums over all


SETTINGS = EmitterSettings()


def visible_lights(scene: Scene) -> list[Array]:
    """Masks [H, W] bool of the emitters on surfaces of the photo, the largest first.

    They are connected regions of clipped pixels with the bright ones beside them, and do not face up.
    """
    # --- Clipped pixels on surfaces; in an HDR photo those far above its median ---
    photo = scene.photo
    surface = scene.depth > 0
    threshold = SETTINGS.clipped
    if photo.hdr and surface.any():
        threshold = max(
            threshold, SETTINGS.min_hdr_ratio * float(np.median(photo.linear[surface].mean(-1)))
        )
    value = photo.linear.min(-1)
    longer = max(surface.shape)
    bright = (value >= threshold) & surface
    if not bright.any():
        return []
    # --- Grown over the bright pixels beside them, and gaps closed ---
    near = _beside(bright, SETTINGS.max_rim_reach) & (value >= SETTINGS.min_rim * threshold)
    near |= _beside(bright, SETTINGS.max_outshining_reach) & _outshining(photo, surface)
    grown = ndimage.binary_propagation(bright, mask=near & surface)
    gap = disc(round(SETTINGS.gap * longer))
    closed = cv2.morphologyEx(grown.astype(np.uint8), cv2.MORPH_CLOSE, gap) > 0
    closed = ndimage.binary_fill_holes(closed) & surface
    # --- Connected regions, large enough, that do not face up ---
    masks = [
        mask
        for mask in _parts(closed, SETTINGS.min_area * closed.size)
        if (mask & bright).sum() >= SETTINGS.min_area * mask.size
        and scene.normal[mask][:, 1].mean() <= SETTINGS.max_upward
    ]
    return sorted(masks, key=lambda mask: -int(mask.sum()))


def _beside(mask: Array, reach: float) -> Array:
    """[H, W] bool: within so many longer sides of a mask [H, W] bool, and at least its neighbours."""
    return ndimage.distance_transform_edt(~mask) <= max(1, round(reach * max(mask.shape)))


def _outshining(photo: Photo, surface: Array) -> Array:
    """[H, W] bool: what is much brighter than the surfaces are: trees in a window, the shade of a lamp."""
    radiance = photo.linear.mean(-1)
    return radiance >= SETTINGS.rim_ratio * float(np.median(radiance[surface]))


def dimmed(
    scene: Scene, dim: float, *, lights: Array | None = None, fitted: Scene | None = None
) -> Scene:
    """The scene with its in-photo emitters as surfaces of `dim` times their radiance; the photo's is 1.

    The fitted environment map explains the whole photo. Here it is scaled down to leave room for the emitters, whose
    radiance is that with which the two together explain the photo best, and at least its white; of emitters that are
    not clipped it is the photo's. With dim = 1 the scene gives about the same picture as before.

    lights: [H, W] bool mask of the emitters, at working size; None takes `visible_lights`.
    fitted: the scene before its edits, whose rendering is the photo: emitters are found in it.
    Raises InputError where the scene is edited, and `fitted` is not given, no clipped region of the photo is large
    enough, or the mask has another size or no surface in it.
    """
    if any(body.name.startswith(PHOTO_LIGHT) for body in scene.bodies):
        raise InputError(
            "The lights of this photo are dimmed already; start from the scene before."
        )
    if fitted is None and is_edited(scene):
        raise InputError(
            "The lights of a photo are found in the scene before its edits; dim that one, and edit it afterwards."
        )
    # --- Where the emitters are: marked, or clipped regions of the photo ---
    known = fitted or scene
    masks = (
        visible_lights(known)
        if lights is None
        else _parts(checked_region(known, lights) > 0.5, SETTINGS.min_pixels)
    )
    if not any(mask.sum() >= SETTINGS.min_pixels for mask in masks):
        raise InputError(
            "The photo shows no light: no clipped region on a surface covers a thousandth of it and does not face up; "
            "mark the lights that you mean."
            if lights is None
            else f"The mask of lights has no connected part of {SETTINGS.min_pixels} pixels; mark the whole light."
        )
    # --- Less what earlier edits took away ---
    gone = (scene.depth != known.depth) | (scene.photo.linear != known.photo.linear).any(-1)
    masks = [part for mask in masks for part in _parts(mask & ~gone, SETTINGS.min_pixels)]
    if not masks:
        raise InputError(
            "The lights of this photo were taken away by an earlier step; leave the dimming out."
        )
    # --- How bright they are, and how much light that leaves to the environment map ---
    colours, radiance = _looks(known.photo, masks)
    patches = [_patch(scene, mask, f"{PHOTO_LIGHT} {k}") for k, mask in enumerate(masks)]
    shining = tuple(emitting(body, colour) for body, colour in zip(patches, colours))
    ambient, radiance, share = _estimated(known, shining, np.any(masks, 0), radiance)
    emission = [[radiance * c for c in colour] for colour in colours]
    facts = {
        "ambient": ambient,
        "radiance": radiance,
        "dim": dim,
        "share": share,
        "emission": emission,
    }
    # --- The scene with them, and where they are, in words ---
    bodies = [emitting(body, [dim * c for c in colour]) for body, colour in zip(patches, emission)]
    edited = with_emitters(scene, bodies, facts)
    places = ", ".join("{1:.0f},{0:.0f}".format(*np.argwhere(mask).mean(0)) for mask in masks)
    kind = "clipped regions" if lights is None else "regions"
    note = f"Taken for lights, {radiance:.3g} times as bright as the photo's white: the {kind} around {places}."
    return warned(replace(edited, provenance={**scene.provenance, KEY: facts}), note)


def _parts(mask: Array, least: float) -> list[Array]:
    """[H, W] bool each: the connected parts of a mask that have at least `least` pixels."""
    label, _ = ndimage.label(mask)
    return [label == k for k in np.flatnonzero(np.bincount(label.ravel()) >= least) if k]


def _looks(
    photo: Photo, masks: list[Array]
) -> tuple[list[tuple[float, float, float]], float | None]:
    """(colours of the emitters, the radiance that goes with them where the photo tells it).

    An HDR photo tells the radiance, and any photo that of emitters that are not clipped. Else colours are 1 in the
    brightest channel, and white where most of an emitter is clipped.
    """
    inside = [photo.linear[mask] for mask in masks]
    means = [pixels.mean(0) for pixels in inside]
    # The photo tells the radiance where hardly anything of the lights is clipped.
    if (
        photo.hdr
        or np.concatenate([pixels.max(-1) >= SETTINGS.clipped for pixels in inside]).mean()
        < SETTINGS.max_clipped_known
    ):
        peak = max(*(float(mean.max()) for mean in means), OFF)
        return [triple(mean / peak) for mean in means], peak
    white = [
        (pixels.min(-1) >= SETTINGS.clipped).mean() > SETTINGS.min_clipped_white
        for pixels in inside
    ]
    means = [np.ones(3) if is_white else mean for is_white, mean in zip(white, means)]
    return [triple(mean / max(float(mean.max()), 1e-6)) for mean in means], None


def _estimated(
    scene: Scene, emitters: tuple[Body, ...], masked: Array, radiance: float | None
) -> tuple[float, float, float]:
    """(factor on the environment map, radiance of the emitters) that together give the photo, and the emitters' share.

    Weighted least squares of photo = factor * rerender + radiance * (picture by the emitters alone), the radiance at
    least 1, over unclipped pixels off the emitters `masked` [H, W] bool. The share is the light of the emitters on the
    surfaces of the photo, relative to that of the whole environment map.
    """
    from materialist.render.scene import RenderScene

    # --- What the emitters alone give: the environment map is next to nothing ---
    target = RenderScene(scene.geometry, scene.camera, bodies=(*scene.bodies, *emitters))
    target.set_materials(scene.materials)
    target.set_envmap(np.full((8, 16, 3), OFF, np.float32))
    by_emitters = target.render(spp=SETTINGS.spp)  # [H, W, 3] of emitters of radiance 1 alone
    photo = scene.photo.linear
    seen = (scene.depth > 0) & ~masked & (photo.max(-1) < SETTINGS.clipped)
    if not seen.any():
        return 1.0, 1.0 if radiance is None else radiance, 0.0
    photo_values, base, lit = (
        v[seen].astype(np.float64) for v in (photo, scene.rerender, by_emitters)
    )
    # --- Weighted least squares over unclipped pixels of other surfaces ---
    weight = 1 / (
        photo_values.mean(-1, keepdims=True) + 0.05
    )  # errors count relative to the brightness
    sides = np.stack([(weight * base).ravel(), (weight * lit).ravel()], -1)
    # A known radiance is a bound so narrow that it is fixed; the solver takes no equal bounds.
    low, high = (1.0, 1e3) if radiance is None else (radiance, radiance * (1 + 1e-9) + 1e-12)
    factor, radiance = lsq_linear(
        sides, (weight * photo_values).ravel(), bounds=([0, low], [2, high])
    ).x
    return float(factor), float(radiance), float(radiance * lit.mean() / max(base.mean(), 1e-6))


def _patch(scene: Scene, mask: Array, name: str) -> Body:
    """The surface of the masked pixels, black, and moved a little towards the camera."""
    surface = part(scene.geometry.mesh, -1, mask)
    vertices = (surface.vertices * np.float32(1 - SETTINGS.lift)).astype(np.float32)
    return Body(
        vertices, surface.faces, surface.normals, surface.uv, uniform_surface(0.0, 1.0, 0.0), name
    )
