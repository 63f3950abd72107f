"""What an edit shows that the photo does not: places that an object hid, and glass.

An edit that takes an object away carries a photo of its own, filled there (`background.without`). In the composite it
stands in for the photo, and a rendering without the object for the base.
"""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np

from materialist.edits.composite.layers import Layers
from materialist.edits.composite.native_layer import NativeLayer
from materialist.edits.core.region import body_coverage
from materialist.edits.core.renderer import EditRenderer, denoised
from materialist.geometry.membrane import membrane
from materialist.types import Array, Materials, Photo, Scene

LEAST = 0.02
"""Added to radiance before its change is taken as a factor."""
BRIGHT = 90
"""Percentile of the photo's surfaces up to which light that comes back makes others brighter."""
MOST = 0.4
"""Logarithm of the largest change of light that is carried on."""
USUAL, UNUSUAL = 0.05, 0.08
"""Logarithms by which a fit usually misses the photo, and beyond that, by which its changes lose 1 / e."""
NEARBY = 9
"""Pixels over which that is taken."""
RIM = 4.0
"""Pixels beside a filled place in which surfaces do not meet."""


def revealed(renderer: EditRenderer, edited: Scene, layers: Layers, *, spp: int, seed: int = 0, clean: bool = True):
    """(Photo, Layers) for `composite.into_photo`, of the layers that a `EditRenderer` rendered.

    The photo is that of the renderer's scene where the edit left it, else that of `edited`; the base there is a
    rendering of what that photo shows: the scene without the object, under its own light, and without what the edit
    put in its place. So a place that is merely uncovered shows the filled photo, and the shadow of glass falls on it.
    What the object did to the light around goes on in it: it was filled from surroundings that had that light.
    Under a body in place of the photo's surface (`layers.covered`) the rendering alone counts: what the photo has
    beyond the fit is not what is seen through the body or on it.
    """
    scene = renderer.scene
    if edited.photo is scene.photo:
        return scene.photo, layers
    filled = hole = (edited.photo.linear != scene.photo.linear).any(-1) | (edited.depth != scene.depth)
    if scene.bodies:
        filled = hole & (body_coverage(scene) < 1)
    bare = _bare(renderer, edited, layers, hole, spp, seed, clean)
    # What the removal alone does to the light, as far as it is believed; everything else of the edit comes on top.
    trust = _trust(scene, layers.base, filled)
    lit = np.maximum(bare - _too_bright(scene, bare - layers.base, filled), 0)
    lit = _believed(layers.base, lit, filled, scene.geometry.plane_label, trust)
    if layers.relit:
        shown = layers.edited * (lit + LEAST) / (np.maximum(bare, 0) + LEAST)
    else:
        # The shade of what was put there is believed as far, but for surfaces that are new themselves.
        share = np.where(layers.changed | filled, 1, trust)[..., None]
        shown = np.maximum(lit + share * (layers.edited - bare), 0)
    given = _given(scene, edited, filled)
    if (filled & ~given).any():
        factor = np.log((lit + LEAST) / (np.maximum(layers.base, 0) + LEAST))
        change = edited.photo.linear * np.expm1(_continued(factor, filled, edited.geometry.plane_label))
        # Filled places may be far brighter than what is rendered there.
        bare = np.where(given[..., None], bare, np.maximum(bare - change, 0))
    base = np.where(filled[..., None], bare, layers.base)
    photo, covered = edited.photo, layers.covered
    if covered is not None:
        covered = covered & ~renderer.emitter_pixels(edited)  # these stay the photo's
    if covered is not None and covered.any():
        covered, shown = _under(layers.native, covered, shown)
        base = np.where(covered[..., None], shown, base)
        photo = _as_body(photo, covered, shown)
    return photo, replace(
        layers,
        base=base.astype(np.float32),
        edited=shown.astype(np.float32),
        reached=layers.reached | filled,
        changed=layers.changed | filled,
        held=None if layers.held is None else np.where(filled, 1, layers.held).astype(np.float32),
        replaced=None if layers.replaced is None else layers.replaced | filled,
    )


def _bare(
    renderer: EditRenderer, edited: Scene, layers: Layers, hole: Array, spp: int, seed: int, clean: bool
) -> Array:
    """[H, W, 3] the fitted scene without what was taken away, and with nothing else of the edit."""
    scene = renderer.scene
    old, new = scene.materials, edited.materials
    albedo = np.where(hole[..., None], new.albedo, old.albedo)
    rest = (np.where(hole, *pair) for pair in ((new.roughness, old.roughness), (new.metallic, old.metallic)))
    materials = Materials(albedo, *rest)
    same = all(np.array_equal(*pair) for pair in zip(astuple(materials), astuple(new)))
    if same and edited.bodies == scene.bodies and not layers.relit:
        return layers.edited
    bare = replace(edited, materials=materials, bodies=scene.bodies, envmap=scene.envmap, lamps=scene.lamps)
    picture = renderer.beside(edited, bare)(-(-spp // 2), 2 * seed)
    return denoised(picture, albedo, edited.normal) if clean else picture


def _too_bright(scene: Scene, gained: Array, filled: Array) -> Array:
    """[H, W, 3] what of the light that came back beside `filled` would outshine the photo.

    What an object hid of the light is a guess, as its back is; no surface gets brighter by it than the brightest tenth
    of the photo.
    """
    seen = scene.photo.linear.mean(-1)
    surface = seen[scene.depth > 0]
    room = np.maximum(float(np.percentile(surface, BRIGHT)) - seen, 0) if len(surface) else 0 * seen
    gain = gained.mean(-1)
    kept = np.where((gain > room) & ~filled, room / np.maximum(gain, 1e-6), 1)
    return (1 - kept)[..., None] * np.maximum(gained, 0)


def _believed(base: Array, shown: Array, filled: Array, plane: Array, trust: Array) -> Array:
    """[H, W, 3] `shown`; beside filled places only as far as its change can be one of the light.

    At the rim the surface that was seen and the one that goes on seldom meet: there the change is that of the nearest
    pixel beyond, on the same plane or thing. No thing, as what lies on no plane, loses more than 1 - exp(-MOST) of its
    light; a polished plane may lose a reflection. And where the fit misses the photo (`trust`), its changes do, too.
    """
    from scipy.ndimage import distance_transform_edt

    change = np.log((np.maximum(shown, 0) + LEAST) / (np.maximum(base, 0) + LEAST))
    rim = ~filled & (distance_transform_edt(~filled) <= RIM)
    for number in np.unique(plane[rim]):
        own = plane == number
        beyond = own & ~rim & ~filled
        if beyond.any():
            row, column = distance_transform_edt(~beyond, return_distances=False, return_indices=True)
            change = np.where((rim & own)[..., None], change[row, column], change)
    change = np.where((plane < 0)[..., None], np.maximum(change, -MOST), change)
    change *= trust[..., None]
    believed = np.maximum((np.maximum(base, 0) + LEAST) * np.exp(change) - LEAST, 0)
    return np.where(filled[..., None], shown, believed)


def _trust(scene: Scene, base: Array, filled: Array) -> Array:
    """[H, W] in [0, 1]: how far the fit explains the photo nearby; what was taken away does not count."""
    import cv2

    photo = scene.photo.linear
    off = np.abs(np.log((photo + LEAST) / (np.maximum(base, 0) + LEAST))).mean(-1)
    off = np.where(filled, 0, off).astype(np.float32)
    window = (NEARBY, NEARBY)
    missed = cv2.blur(cv2.dilate(cv2.blur(off, window), np.ones(window, np.uint8)), window)
    return np.exp(-((np.maximum(missed - USUAL, 0) / UNUSUAL) ** 2))


def _given(scene: Scene, edited: Scene, filled: Array) -> Array:
    """[H, W] bool: the parts of `filled` that show a picture of what is there, and not their surroundings."""
    from scipy.ndimage import distance_transform_edt, label

    steps = edited.provenance.get("edits", ())[len(scene.provenance.get("edits", ())) :]
    places = [step["at"] for step in steps if step.get("filled_by") == "background"]
    given = np.zeros(filled.shape, bool)
    if not places or not filled.any():
        return given
    parts, _ = label(filled, np.ones((3, 3)))
    nearest = distance_transform_edt(~filled, return_distances=False, return_indices=True)
    for x, y in places:
        row, column = nearest[:, y, x]
        given |= parts == parts[row, column]
    return given


def _continued(change: Array, filled: Array, plane: Array) -> Array:
    """[H, W, 3] in the filled places, a change beside them (logarithms) carried on, on each plane by itself.

    Changes of more than MOST are not of the light: there another surface is seen.
    """
    out = np.zeros_like(change)
    light = np.abs(change).max(-1) < MOST
    for number in np.unique(plane[filled]):
        here = plane == number
        beside = here & ~filled & light
        if beside.any():
            own = filled & here
            out[own] = membrane(change, beside)[own]
    return out


def _under(native: NativeLayer | None, covered: Array, shown: Array) -> tuple[Array, Array]:
    """`covered` [H, W] bool and `shown` [H, W, 3], which go on under the rim of what stands before them: pixels there
    show both."""
    from scipy.ndimage import distance_transform_edt

    if native is None or not (native.inside == 0).any():
        return covered, shown
    away, (row, column) = distance_transform_edt(native.inside > 0, return_indices=True)
    own = (away > 0) & (away <= RIM) & covered[row, column]
    return covered | own, np.where(own[..., None], shown[row, column], shown)


def _as_body(photo: Photo, covered: Array, shown: Array) -> Photo:
    """The photo with the picture of a body [H, W, 3] where it covers it: nothing of the photo is left to be changed."""
    import cv2
    from scipy.ndimage import distance_transform_edt

    linear = np.where(covered[..., None], shown, photo.linear).astype(np.float32)
    native = photo.original.shape[:2]
    size = native[::-1]
    share = covered.astype(np.float32)
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    own = shown[row, column].astype(np.float32)
    if native != covered.shape:
        share, own = (np.asarray(cv2.resize(v, size, interpolation=cv2.INTER_LINEAR), np.float32) for v in (share, own))
    original = share[..., None] * own + (1 - share[..., None]) * photo.original
    return replace(photo, linear=linear, original=original.astype(np.float32))
