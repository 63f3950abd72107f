"""What an edit shows that the photo does not: places that an object hid, and glass.

An edit that takes an object away carries a photo of its own, filled there, and a re-rendering filled alike
(`background.without`). In the composite these stand in for the photo and the base rendering.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.edit.layers import Layers
from materialist.types import Array, Photo, Scene


def revealed(scene: Scene, edited: Scene, layers: Layers) -> tuple[Photo, Layers]:
    """Photo and layers for `composite.into_photo`, of the layers of the two scenes' renderings.

    Returns the photo of `scene` where the edit left it, else that of `edited`, with layers whose base is the filled
    re-rendering there. Under a body in place of the photo's surface (`layers.covered`) the rendering alone counts:
    what the photo has beyond the fit is not what is seen through the body or on it.
    """
    if edited.photo is scene.photo:
        return scene.photo, layers
    covered = layers.covered
    filled = (edited.photo.linear != scene.photo.linear).any(-1) | (edited.depth != scene.depth)
    base = np.where(filled[..., None], edited.rerender, layers.base)
    photo = edited.photo
    if covered is not None and covered.any():
        base = np.where(covered[..., None], photo.linear, base)
        photo = _without_detail(photo, covered)
    return photo, replace(
        layers, base=base.astype(np.float32), reached=layers.reached | filled,
        changed=layers.changed | filled,
    )  # fmt: skip


def _without_detail(photo: Photo, covered: Array) -> Photo:
    """The photo with nothing beyond working size where a body covers it."""
    import cv2

    native = photo.original.shape[:2]
    if native == covered.shape:
        return photo
    size = native[::-1]
    share = cv2.resize(covered.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)[..., None]
    plain = cv2.resize(photo.linear, size, interpolation=cv2.INTER_LINEAR)
    return replace(photo, original=(share * plain + (1 - share) * photo.original).astype(np.float32))
