"""What an object leaves on the surface it stands on: its contact shadow and its reflection.

The fit explains some of both by light; the rest has gone into the albedo and stays behind when the object goes. It is
found in the photo: there the surface is darker than around, or has taken on the object's hue.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.edits.composite.upsample import nearest
from materialist.types import Array


@dataclass(frozen=True)
class ShadowSettings:
    """What counts as a shadow; lengths are parts of the object's size (root of its area). Tuned by eye on 6 photos."""

    reach: float = 0.75  # how far from the object it is sought
    clear: float = 0.25  # from here on the surface tells what it looks like without a shadow ...
    around: float = 2.5  # ... up to here
    fewest: int = 200  # pixels of a surface that tell it
    spread: float = 3.0  # least deviation in units of the surface's own spread; more: fainter shadows stay
    darker: float = 0.05  # least darkening of all channels, logarithm of radiance
    hued: float = 0.04  # least turn to the object's hue, the same
    coloured: float = 0.2  # least difference of the channels of object and surface that is a hue, the same
    edge: float = 0.12  # least step from pixel to pixel at which another thing, or a shadow, ends, the same
    thin: float = 0.03  # what is thinner than twice this is no part of it
    rim: int = 2  # pixels around it that are filled, too: the edges of a hard shadow
    foot: float = 0.25  # part of the object's height above its lowest place within which it stands on something
    blur: float = 0.006  # before anything is compared, part of the picture's longer side


def contact_shadow(
    linear: Array, plane: Array, ground: Array, own: Array, gone: Array, settings: ShadowSettings = ShadowSettings()
) -> Array:
    """Where an object's shadow and reflection are, on the planes that it stands on.

    Args:
        linear: [H, W, 3] linear photo. plane: [H, W] int: plane of a pixel. ground: [H, W] bool: planes that a thing
            can stand on. own: [H, W] bool: the object. gone: [H, W] bool: the same with its rim.

    Returns:
        [H, W] bool, nothing of `gone`; joined to its lower part.
    """
    import cv2
    from scipy.ndimage import label

    size = float(np.sqrt(own.sum()))
    away = cv2.distanceTransform((~gone).astype(np.uint8), cv2.DIST_L2, 5) / size
    ground = ground & ~gone
    logs = np.log(np.maximum(linear, 0) + 0.01)
    near = ground & (away < settings.reach) & ~_edges(logs, gone, settings)
    found = np.zeros_like(gone)
    for number in np.unique(plane[ground & (away * size < 3)]):
        on = ground & (plane == number) & (away < settings.around)
        if (on & (away > settings.clear)).sum() >= settings.fewest:
            found |= near & on & _unlike(logs, on, away > settings.clear, np.median(logs[own], 0), settings)
    radius = max(1, round(settings.thin * size))
    found = morphed(cv2.MORPH_DILATE, morphed(cv2.MORPH_ERODE, found | gone, radius), radius) & near
    foot = gone.copy()
    rows = np.flatnonzero(gone.any(1))
    foot[: round(rows[-1] - settings.foot * np.ptp(rows))] = False
    parts, _ = label(found, np.ones((3, 3)))
    found &= np.isin(parts, np.unique(parts[morphed(cv2.MORPH_DILATE, foot, radius)]))
    return morphed(cv2.MORPH_DILATE, found, radius + settings.rim) & ground if found.any() else found


def _unlike(logs: Array, on: Array, clear: Array, colour: Array, settings: ShadowSettings) -> Array:
    """[H, W] bool: where a surface `on` is darker than elsewhere or has taken on a hue.

    `logs` [H, W, 3] log radiance, `colour` [3] that of the object, `clear` [H, W] bool: what tells the surface. The
    surface's look is a quadratic polynomial of the place, fitted robustly.
    """
    far = clear[on]
    smooth = _blurred(logs, on, settings)[on]
    rows, columns = (v / max(on.shape) for v in np.nonzero(on))
    basis = np.stack([np.ones_like(rows), columns, rows, columns**2, columns * rows, rows**2], -1)
    weight = far.astype(float)
    for _ in range(12):
        flat = np.linalg.lstsq(basis * weight[:, None], smooth * weight[:, None], rcond=None)[0]
        rest = smooth - basis @ flat
        error = np.abs(rest).max(-1)
        scale = max(float(np.median(error[far])) * 1.48, 1e-6)
        weight = far * (error < 2.5 * scale) / (1 + (error / scale) ** 2)
    turned = colour - np.median(logs[on], 0)
    turned = turned - turned.mean()
    length = float(np.linalg.norm(turned))
    darker, hue = -rest.mean(-1), rest - rest.mean(-1, keepdims=True)
    hued = hue @ turned / length if length > settings.coloured else np.zeros_like(darker)
    unlike = np.zeros(len(rest), bool)
    for how, least in ((darker, settings.darker), (hued, settings.hued)):
        unlike |= how > max(least, settings.spread * 1.48 * float(np.median(np.abs(how[far]))))
    found = np.zeros_like(on)
    found[on] = unlike
    return found


def _blurred(values: Array, known: Array, settings: ShadowSettings) -> Array:
    """[H, W, C] means of what is known around."""
    import cv2

    blur = lambda v: cv2.GaussianBlur(np.asarray(v, np.float32), (0, 0), settings.blur * max(known.shape))  # noqa: E731
    return blur(np.where(known[..., None], values, 0)) / np.maximum(blur(known), 1e-3)[..., None]


def _edges(logs: Array, gone: Array, settings: ShadowSettings) -> Array:
    """[H, W] bool: sharp steps of log radiance [H, W, 3], but for the outline of what is `gone`."""
    import cv2

    beside = logs[nearest(~gone)]
    soft = cv2.GaussianBlur(np.asarray(beside, np.float32), (0, 0), max(0.7, 0.002 * max(gone.shape)))
    down, right = np.gradient(soft, axis=(0, 1))
    return morphed(cv2.MORPH_DILATE, np.hypot(down, right).max(-1) > settings.edge, 1)


def morphed(how: int, mask: Array, radius: int) -> Array:
    """[H, W] bool: a mask after an operation of cv2.morphologyEx with a disc of `radius` pixels."""
    import cv2

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)
    return cv2.morphologyEx(mask.astype(np.uint8), how, kernel) > 0
