"""New bodies at the photo's native resolution: their own radiance and a soft matte, for the composite."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from materialist.edits.composite.matte import matte, unmixed
from materialist.edits.core.renderer import (
    EditRenderer,
    RenderOptions,
    denoised,
    is_relit,
    path_depth,
)
from materialist.edits.core.surfaces import PHOTO_LIGHT
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import Box, area, grown, window
from materialist.render.bodies import is_transparent
from materialist.types import Array, Scene


@dataclass(frozen=True)
class NativeSettings:
    """Resolution and paths of the native-resolution layer; tuned by eye unless derived."""

    max_pixels: int = 1_500_000  # a larger layer is traced smaller, and enlarged; derived: time
    finest_glass: float = 8.0  # traced pixels a working pixel, along a side, which maps have
    min_paths: int = 32  # a native pixel, as the denoiser needs
    max_path_factor: int = 4  # on the picture's paths a pixel, twice that in glass; derived: time
    path_budget: float = 0.5  # all paths, of those of a whole working-size picture; derived: time
    paths_at_once: int = 2**21  # traced together; derived: memory
    denoiser_margin: int = 3  # working pixels around the bodies that the denoiser sees
    max_contact: float = 0.05  # share of a body's extent: a nearer surface is what it stands on
    max_lamp_contact: float = 2.0  # the same of lamps, which a surface cuts


SETTINGS = NativeSettings()


@dataclass(frozen=True)
class NativeLayer:
    """The new bodies of an edit, as the photo would show them."""

    inside: Array
    """[H, W] float32 in [0, 1]: share of each pixel of working size that they cover."""
    box: Box
    """The native pixels that they may cover."""
    share: Array
    """[h0, w0] float32: the same of each native pixel of the box."""
    picture: Array
    """[h0, w0, 3] float32 linear: their radiance, of nothing else; 0 away from them."""
    names: tuple[str, ...]
    """Of these bodies and lamps, as `RenderScene` names them."""


def native_layer(
    renderer: EditRenderer, edited: Scene, options: RenderOptions
) -> NativeLayer | None:
    """Trace the bodies and lamps that are new in `edited` at native size; None where the camera sees none of them.

    The photo's own lights are left to its outlines. Under another light every lamp counts as new: it stays as bright as
    it was, and what changes beside it must not colour its rim.
    """
    from materialist.render.pixels import coverage, first_hits, only, radiance

    # --- Which bodies and lamps are new ---
    scene = renderer.scene
    lamps = [f"lamp{k}" for k in range(len(edited.lamps)) if is_relit(scene, edited)]
    bodies = {f"body{k}": body for k, body in enumerate(edited.bodies)}
    # The photo's own lights have the outline that the photo shows.
    placed = (name for name, body in bodies.items() if not body.name.startswith(PHOTO_LIGHT))
    names = [name for name in placed if bodies[name] not in scene.bodies] + lamps
    if not names:
        return None
    target = renderer.render_scene(renderer.lit(edited, edited))
    camera = scene.camera
    native = scene.photo.original.shape[:2]
    working = scene.depth.shape
    chosen = {name: bodies.get(name) for name in names}
    # --- Where they are seen: at working size, then at native size, in the scene and alone ---
    small = coverage(target.mi_scene, camera, chosen, working).share
    if not small.any():
        return None
    there = window(small > 0, native, SETTINGS.denoiser_margin)
    sight = coverage(target.mi_scene, camera, chosen, native, there)
    everything = [*bodies, *(f"lamp{k}" for k in range(len(edited.lamps)))]
    bare = only(target.mi_scene, everything)  # without the photo's surface
    alone = coverage(bare, camera, chosen, native, there)
    # A lamp that touches a surface is cut by it, not hidden by a thing before it.
    stands = names != lamps
    gap = (SETTINGS.max_contact if stands else SETTINGS.max_lamp_contact) * _extent(alone)

    # --- Their radiance: as many paths as the budget allows ---
    clear = [body is not None and is_transparent(body.surface) for body in chosen.values()]
    has_glass = any(clear)
    finest = SETTINGS.finest_glass if all(clear) else np.inf
    size, part = _traced_size(native, there, finest * working[1] / native[1])
    max_factor = SETTINGS.max_path_factor * (1 + has_glass)
    budget = int(SETTINGS.path_budget * options.spp * small.size / area(part))
    paths = max(SETTINGS.min_paths, min(max_factor * options.spp, budget))
    paths = 1 << paths.bit_length() - 1  # every number of paths is compiled anew: few of them
    depth = path_depth(edited)
    picture = radiance(
        target,
        size,
        part,
        spp=paths,
        seed=options.seed,
        max_depth=depth,
        names=names,
        at_once=SETTINGS.paths_at_once,
    )
    # Where most of a pixel's body is hidden, too few paths met it: its neighbours' radiance is taken.
    hidden = (sight.share < alone.share / 2).astype(np.float32)
    few = _resized(hidden, picture.shape[:2])[..., None] > 0
    picture = spread_known(np.where(few, 0, picture))
    if options.denoise:
        guide = first_hits(bare, camera, chosen, size, part)
        picture = spread_known(np.where(few, 0, denoised(picture, guide.albedo, guide.normal)))

    # --- Coverage and radiance at native size ---
    bodies_share, hidden = _behind_things(
        target.mi_scene, sight, alone, scene, there, gap, stands=stands
    )
    # A share of a pixel's body takes the place of what it hides, not of the thing before it.
    colours = _resized(picture, sight.share.shape) + scene.photo.original[there] - hidden
    colours = np.where(bodies_share[..., None] > 0, colours, 0).astype(np.float32)
    if lamps or any(body and max(body.surface.emission) > 1 for body in chosen.values()):
        # A corner of what glows that is too small to be met by a ray outshines its pixel.
        small = np.asarray(cv2.dilate(small, np.ones((3, 3), np.uint8)))
    return NativeLayer(small, there, bodies_share, colours, tuple(names))


def _traced_size(native: tuple[int, ...], box: Box, largest: float) -> tuple[tuple[int, int], Box]:
    """Size of the picture that is traced, at most `largest` times the native one, and the native box in it."""
    # A layer has at most `max_pixels`, and glass no more than the maps tell apart.
    factor = min(1.0, largest, np.sqrt(SETTINGS.max_pixels / area(box)))
    size = tuple(max(2, round(n * factor)) for n in native)
    sides = []
    for side, whole, traced in zip(box, native, size):
        first = side.start * traced // whole
        sides.append(slice(first, min(max(first + 1, round(side.stop * traced / whole)), traced)))
    return (size[0], size[1]), (sides[0], sides[1])


def _resized(values: Array, shape: tuple[int, ...], kind: int = cv2.INTER_LINEAR) -> Array:
    return np.asarray(cv2.resize(values, shape[1::-1], interpolation=kind))


def _behind_things(
    mi_scene: Any, sight: Any, alone: Any, scene: Scene, there: Box, gap: float, *, stands: bool
) -> tuple[Array, Array]:
    """[h, w] share of the bodies, with the photo's own silhouettes where its surface is more than `gap` before them.

    And [h, w, 3] the colours that they hide, without those of the things before them. The mesh has the steps of working
    pixels there; `matte` finds the thing's outline in the photo. A surface less than `gap` before a body is the ground
    that it `stands` on, and hides nothing: its bumps would make the foot ragged.
    """
    from materialist.render.pixels import coverage

    native = scene.photo.original.shape[:2]
    working = scene.depth.shape
    # --- Where something of the photo hides a part of the bodies ---
    share = alone.share if stands else sight.share
    photo = scene.photo.original[there]
    hidden = alone.share > sight.share + 0.05
    if hidden.any():
        ground = coverage(mi_scene, scene.camera, ("surface",), native, there)
        hidden &= (ground.share > 0) & (alone.depth - ground.depth > gap)
    if not hidden.any():
        return share, photo
    # --- The outline of that thing in the photo, and the colours it leaves uncovered ---
    near = grown(hidden, int(np.ceil(2 * max(native[0] / working[0], 1.0))))
    whole = np.zeros(native, np.float32)
    whole[there] = spread_known(alone.depth)
    depth = spread_known(_resized(whole, working, cv2.INTER_NEAREST))
    thing = (scene.depth > 0) & (scene.depth < depth - gap)
    before = matte(thing, scene.photo.original, there)
    _, behind = unmixed(before, photo, native[1] / working[1])
    # Where nothing but the thing is seen, nothing is known of what it hides.
    mixed = near & (before > 0) & (before < 1)
    cut = np.where(near, alone.share * (1 - before), share)
    return cut.astype(np.float32), np.where(mixed[..., None], behind, photo)


def _extent(alone: Any) -> float:
    """How deep bodies seen alone are, scene units; a flat one that faces the camera has some depth, too."""
    if not (alone.depth > 0).any():
        return 1e-9
    # At least some 5 % of their distance, less where they fill little of the box.
    size = float(alone.depth.max() - alone.depth[alone.depth > 0].min()) + 1e-9
    return max(size, float(alone.depth.max()) * float(np.sqrt((alone.share > 0).mean())) * 0.05)


def spread_known(values: Array) -> Array:
    """[h, w] or [h, w, 3] with every 0 replaced by the nearest other value."""
    known = np.asarray(values.reshape(*values.shape[:2], -1).any(-1))
    return values[nearest(known)] if known.any() else values
