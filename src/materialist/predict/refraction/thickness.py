"""From a photo and its maps to the thickness of one object in it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import pixel_rays, unit
from materialist.errors import InputError, WeightsError
from materialist.geometry.silhouette import surface_in
from materialist.predict.refraction.crop import BACK_X, Window, refraction_features, to_window
from materialist.solids.inflated import inflated
from materialist.solids.outline import surface_of_revolution
from materialist.solids.revolution import Revolution
from materialist.threads import fixed_threads
from materialist.types import Array, Camera

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""
FRAMES = ((1.0, 0.0, 0.0), (1.05, 0.015, 0.0), (1.1, 0.0, 0.015), (1.05, -0.015, -0.015))
"""How much larger and how far aside (right, down), in sides, the windows are over which answers are averaged."""


@dataclass(frozen=True)
class Thickness:
    """How long the camera rays run through an object (paper, Refraction Network Details, d_GT)."""

    solid: Array
    """[H, W] float32 scene units: from the first to the last point of its outer surface; 0 outside the mask."""
    hollow: Array
    """[H, W] float32 scene units: through its walls alone, were it hollow; at most `solid`. 0: unknown."""
    back: Array | None = None
    """[H, W, 3] float32 unit, camera frame: outward normals of its last surface, 0 outside the mask; None: unknown."""
    revolution: Revolution | None = None
    """The whole object, where it is a surface of revolution."""
    front: tuple[Array, Array] | None = None
    """[H, W] planar depth and [H, W, 3] normals of its first surface, where it has others than the maps."""
    method: str = "network"
    """Where it comes from."""


@fixed_threads()
def thickness(
    photo_linear: Array,
    mask: Array,
    normal: Array,
    depth: Array,
    camera: Camera,
    *,
    weights: str | Path = "",
) -> Thickness:
    """The thickness and the back of the object under a mask, as RefractionNet predicts them.

    Both lengths are along the straight camera rays in the units of `depth`, normals are where those rays leave.

    photo_linear: [H, W, 3] linear Rec.709. mask: [H, W] bool or weights: one object. normal: [H, W, 3] unit, camera
    frame. depth: [H, W] planar, 0 where there is no surface. weights: a file of `materialist train refraction`, or ""
    for those in the package. Raises InputError for maps of another size than the camera's, or a mask without any
    surface; WeightsError for weights that cannot be used.
    """
    from materialist.predict.network import loaded
    from materialist.predict.refraction.network import RefractionNet

    # --- Maps of one size, and the network ---
    inside = surface_in(mask, depth, camera)
    for name, value in (("photo", photo_linear), ("normals", normal)):
        if value.shape != (*inside.shape, 3):
            raise InputError(
                f"The {name} has shape {value.shape}, the camera needs {(*inside.shape, 3)}."
            )
    network = loaded(RefractionNet, Path(weights) if str(weights) else WEIGHTS)
    maps = (photo_linear, inside, normal, depth, pixel_rays(camera))
    # The mean over several framings: the network's answer depends a little on where the window
    # lies.
    answers = [_answer(network, Window.around(inside).moved(*frame), *maps) for frame in FRAMES]
    mean = np.mean(answers, axis=0)  # [H, W, 5]
    if not np.isfinite(mean).all():
        raise WeightsError(
            f"RefractionNet gave values that are not finite; check its weights ({weights or WEIGHTS})."
        )
    # --- Its answer: two lengths, and the normals of the back ---
    solid = mean[..., 0]
    hollow = mean[..., 1]
    back = unit(mean[..., BACK_X:])
    return Thickness(solid, np.minimum(hollow, solid), back)


def best_thickness(
    photo_linear: Array,
    mask: Array,
    normal: Array,
    depth: Array,
    camera: Camera,
    *,
    up: Array | None = None,
    behind: Array | None = None,
) -> Thickness:
    """The thickness of the object under a mask: of a surface of revolution by itself, else of its inflated outline.

    `back` and `front` are None for surfaces of revolution, whose `revolution` tells more. `up`: [3] unit, the upright
    direction in the camera's frame, where a support tells it. `behind`: [H, W] planar depth of the surface behind the
    object, 0 = nothing.
    """
    # The network still gives the wall of the hollow object, which an outline does not show.
    guess = thickness(photo_linear, mask, normal, depth, camera)
    inside = surface_in(mask, depth, camera)
    fitted = surface_of_revolution(depth, normal, inside, camera, up=up, behind=behind)
    if fitted is None:
        return of_outline(guess.hollow, inside, normal, depth, camera)
    body, solid = fitted
    return Thickness(solid, np.minimum(guess.hollow, solid), revolution=body, method="revolution")


def of_outline(
    hollow: Array, mask: Array, normal: Array, depth: Array, camera: Camera
) -> Thickness:
    """The thickness, front and back of the body inflated from the outline of a mask; maps as of `thickness`.

    hollow: [H, W] through the walls alone, scene units, as far as it is known.
    """
    body = inflated(depth, normal, mask, camera)
    # A wall is never thicker than the body.
    return Thickness(
        body.thickness,
        np.minimum(hollow, body.thickness),
        body.back,
        front=(body.depth, body.normal),
        method="outline",
    )


def _answer(
    network: Any,
    window: Window,
    photo: Array,
    inside: Array,
    normal: Array,
    depth: Array,
    rays: Array,
) -> Array:
    """[H, W, 5] float32 of one window, 0 outside the mask: both thicknesses in scene units, and the back's normal."""
    import torch

    # --- The object in a square of its own, lengths in its own size ---
    view = window.cut(photo, inside, normal, depth, rays)
    with torch.inference_mode():  # [5, S, S], lengths in units of the object's size
        answer = network(torch.from_numpy(refraction_features(view))[None])[0].numpy()
    # Normals [S, S, 3] back in the camera frame: a product from the right with R is R^T n.
    turned = np.moveaxis(answer[BACK_X:], 0, -1) @ to_window(view.rays)
    channels = [*(answer[:BACK_X] * view.size), *np.moveaxis(turned, -1, 0)]
    return np.stack([window.put_back(channel, view.inside, inside) for channel in channels], -1)
