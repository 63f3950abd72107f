"""What an object leaves on the surface it stands on: its contact shadow and its reflection.

The fit explains some of both by light; the rest has gone into the albedo and stays behind when the object goes. It is
found in the photo: there the surface is darker than around, or has taken on the object's hue.
"""

from __future__ import annotations

import numpy as np

from materialist.types import Array

REACH = 0.75
"""How far from the object it is sought, in units of the object's size (root of its area), as all of these are."""
AROUND = 2.5
"""How far from the object the surface tells what it looks like."""
CLEAR = 0.25
"""How far from the object at least."""
FEWEST = 200
"""Pixels of a surface that tell it."""
SPREAD = 3.0
"""Deviations count beyond this multiple of the surface's own spread: on grain and patterns nothing is found."""
DARKER, HUED = 0.05, 0.04
"""And beyond these logarithms of radiance: darkening of all channels, and turning to the object's hue."""
COLOURED = 0.2
"""An object has a hue where its channels differ from the surface's by so much, as logarithms."""
EDGE = 0.12
"""Steps of log radiance from pixel to pixel at which another thing begins; a shadow ends there, too."""
THIN = 0.03
"""What is thinner than twice this is no part of it."""
RIM = 2
"""Pixels that are added around what is found: the edges of a hard shadow."""
FOOT = 0.25
"""Part of the object's height above its lowest place within which it stands on something."""
BLUR = 0.006
"""Blur before anything is compared, as a part of the picture's longer side."""
ROUNDS = 12
"""Rounds of the robust fit of what a surface looks like."""


def cast(linear: Array, plane: Array, upward: Array, own: Array, gone: Array) -> Array:
    """Where an object's shadow and reflection are, on the planes that it stands on.

    Args:
        linear: [H, W, 3] linear photo. plane: [H, W] int: plane of a pixel, -1 for none. upward: [H, W] bool: what a
            thing can stand on. own: [H, W] bool: the object. gone: [H, W] bool: the same with its rim.

    Returns:
        [H, W] bool, nothing of `gone`; joined to its lower part.
    """
    import cv2
    from scipy.ndimage import label

    size = float(np.sqrt(own.sum()))
    away = cv2.distanceTransform((~gone).astype(np.uint8), cv2.DIST_L2, 5) / size
    ground = upward & (plane >= 0) & ~gone
    logs = np.log(np.maximum(linear, 0) + 0.01)
    near = ground & (away < REACH) & ~_edges(logs, gone)
    found = np.zeros_like(gone)
    for number in np.unique(plane[ground & (away * size < 3)]):
        on = ground & (plane == number) & (away < AROUND)
        if (on & (away > CLEAR)).sum() >= FEWEST:
            found |= near & on & _unlike(logs, on, away, np.median(logs[own], 0))
    radius = max(1, round(THIN * size))
    found = _morphed(cv2.erode, found | gone, radius)
    found = _morphed(cv2.dilate, found, radius) & near
    parts, _ = label(found, np.ones((3, 3)))
    found &= np.isin(parts, np.unique(parts[_morphed(cv2.dilate, _foot(gone), radius)]))
    return _morphed(cv2.dilate, found, radius + RIM) & ground if found.any() else found


def _foot(gone: Array) -> Array:
    """[H, W] bool: the lower part of an object, where what it casts begins."""
    rows = np.flatnonzero(gone.any(1))
    lower = gone.copy()
    lower[: round(rows[-1] - FOOT * np.ptp(rows))] = False
    return lower


def _unlike(logs: Array, on: Array, away: Array, colour: Array) -> Array:
    """[H, W] bool: where a surface `on` is darker than elsewhere or has taken on a hue.

    `logs` [H, W, 3] log radiance, `colour` [3] that of the object, `away` [H, W] sizes from it.
    """
    smooth = _blurred(logs, on)[on]
    far = away[on] > CLEAR
    rows, columns = (v / max(on.shape) for v in np.nonzero(on))
    basis = np.stack([np.ones_like(rows), columns, rows, columns**2, columns * rows, rows**2], -1)
    weight = far.astype(float)
    for _ in range(ROUNDS):
        flat = np.linalg.lstsq(basis * weight[:, None], smooth * weight[:, None], rcond=None)[0]
        rest = smooth - basis @ flat
        error = np.abs(rest).max(-1)
        scale = max(float(np.median(error[far])) * 1.48, 1e-6)
        weight = far * (error < 2.5 * scale) / (1 + (error / scale) ** 2)
    turned = colour - np.median(logs[on], 0)
    turned = turned - turned.mean()
    length = float(np.linalg.norm(turned))
    darker = -rest.mean(-1)
    hued = (rest - rest.mean(-1, keepdims=True)) @ turned / max(length, 1e-9) if length > COLOURED else 0 * darker
    unlike = np.zeros(len(rest), bool)
    for how, least in ((darker, DARKER), (hued, HUED)):
        unlike |= how > max(least, SPREAD * 1.48 * float(np.median(np.abs(how[far]))))
    found = np.zeros_like(on)
    found[on] = unlike
    return found


def _blurred(values: Array, known: Array) -> Array:
    """[H, W, C] means of what is known around."""
    import cv2

    sigma = BLUR * max(known.shape)
    blur = lambda v: cv2.GaussianBlur(np.ascontiguousarray(v, np.float32), (0, 0), sigma)  # noqa: E731
    return blur(np.where(known[..., None], values, 0)) / np.maximum(blur(known), 1e-3)[..., None]


def _edges(logs: Array, gone: Array) -> Array:
    """[H, W] bool: sharp steps of log radiance [H, W, 3], but for the outline of what is `gone`."""
    import cv2
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(gone, return_distances=False, return_indices=True)
    beside = np.ascontiguousarray(logs[rows, columns], np.float32)
    soft = cv2.GaussianBlur(beside, (0, 0), max(0.7, 0.002 * max(gone.shape)))
    down, right = np.gradient(soft, axis=(0, 1))
    return _morphed(cv2.dilate, np.hypot(down, right).max(-1) > EDGE, 1)


def _morphed(how, mask: Array, radius: int) -> Array:
    import cv2

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)
    return how(mask.astype(np.uint8), kernel) > 0
