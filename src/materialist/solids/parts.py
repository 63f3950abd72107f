"""What stands under a mask: objects, and those among them that are surfaces of revolution, with their handles."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from materialist.camera import pixel_rays
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import silhouette_field, surface_in
from materialist.solids.handles import without_handles
from materialist.solids.inflated import inflated
from materialist.solids.outline import surface_of_revolution
from materialist.types import Array, Camera


@dataclass(frozen=True)
class PartSettings:
    """What an object is."""

    min_depth_pixels: float = 0.02  # inside its outline that a part must reach; derived
    min_part: float = 0.01  # share of the mask's largest part from which a part is an object
    max_round: int = 16  # objects among which round ones are looked for, up to some seconds each


SETTINGS = PartSettings()


def objects_in(mask: Array) -> list[Array]:
    """[H, W] bool masks of the connected objects under a mask [H, W] bool; together they are the mask.

    Specks, and lines too thin for a body, count to the nearest object.
    """
    # Connected parts, diagonally as well; thin ones have no pixel deep enough inside.
    number, _ = label(mask, np.ones((3, 3)))
    thick = np.isin(number, number[mask & (silhouette_field(mask) > SETTINGS.min_depth_pixels)])
    area = np.bincount(number[thick] if thick.any() else number.ravel())
    area[0] = 0
    large = np.flatnonzero(area >= max(SETTINGS.min_part * area.max(), 1))
    whose = number[nearest(np.isin(number, large))]
    return [mask & (whose == k) for k in large]


def outline_normals(
    depth: Array, normal: Array, mask: Array, camera: Camera, up: Array | None
) -> Array:
    """[H, W, 3] float32 unit: a normal map in which round objects have the normals of their bodies.

    Where an object under the mask is a surface of revolution, with handles or without, normals come from its outline;
    all others stay, and all where the mask has very many objects. A mirror shows every unevenness of predicted normals.
    depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool. up: [3] unit, upright in
    the camera's frame; None: no object is round. Raises InputError for maps of different sizes.
    """
    result = np.array(normal, np.float32)
    rays = pixel_rays(camera).astype(np.float64)
    if up is None or len(objects := objects_in(mask & (depth > 0))) > SETTINGS.max_round:
        return result
    for one in objects:
        # --- The whole object, or without its handles ---
        inside = surface_in(one, depth, camera)
        fitted = surface_of_revolution(depth, normal, inside, camera, up=up)
        body = inside
        if fitted is None:
            rest = without_handles(inside, up, camera)
            body = inside if rest is None else rest
            if rest is not None:
                fitted = surface_of_revolution(depth, normal, rest, camera, up=up)
        if fitted is None:
            continue
        # --- Normals of the body, and of what stands out from it ---
        entered, facing = fitted[0].front(body, rays)
        result[body & (entered > 0)] = facing[body & (entered > 0)]
        for handle in objects_in(inside & ~body) if (inside & ~body).any() else ():
            result[handle] = inflated(depth, normal, handle, camera).normal[handle]
    return result
