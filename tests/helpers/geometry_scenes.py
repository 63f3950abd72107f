"""Analytic depth maps with known geometry, and a slow, exact ray tracer that shares no code with the package."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.types import Camera


def plane_depth(camera: Camera, normal, offset: float):
    """Depth [H, W] of the plane normal . p = offset (scene units), inf where rays miss it."""
    facing = pixel_rays(camera).astype(float) @ np.asarray(normal, float)
    with np.errstate(divide="ignore"):
        depth = offset / facing
    return np.where(depth > 0, depth, np.inf)


def sphere_depth(camera: Camera, centre, radius: float):
    """Depth [H, W] of a sphere's front, inf where rays miss it, and its unit normals [H, W, 3]."""
    rays = pixel_rays(camera).astype(float)
    centre = np.asarray(centre, float)
    a = (rays**2).sum(-1)
    b = rays @ centre
    root = b**2 - a * (centre @ centre - radius**2)
    depth = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    points = rays * np.where(np.isfinite(depth), depth, 1)[..., None]
    return depth, (points - centre) / radius


def ball(camera: Camera, centre, radius: float):
    """Depth [H, W] (0 beside it), normals [H, W, 3] (towards the viewer beside it), mask, and thickness along rays."""
    depth, normal = sphere_depth(camera, centre, radius)
    mask = np.isfinite(depth)
    rays = pixel_rays(camera).astype(float)
    cosine = -(rays * normal).sum(-1) / np.linalg.norm(rays, axis=-1)
    normal = np.where(mask[..., None], normal, [0.0, 0, 1])
    return np.where(mask, depth, 0), normal, mask, np.where(mask, 2 * radius * cosine, 0)


def box_depth(camera: Camera, low, high):
    """Depth [H, W] of an axis-aligned box (corners low, high), inf where missed, and its face normals [H, W, 3]."""
    rays = pixel_rays(camera).astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        first = np.asarray(low) / rays
        second = np.asarray(high) / rays
    near = np.minimum(first, second)
    far = np.maximum(first, second)
    axis = near.argmax(-1)
    hit = (near.max(-1) < far.min(-1)) & (near.max(-1) > 0)
    normal = -np.sign(rays) * np.eye(3)[axis]
    return np.where(hit, near.max(-1), np.inf), normal


def room(camera: Camera):
    """Floor y = -1 (label 0), wall z = -6 (1), a box on the floor (2): depth [H, W], normal [H, W, 3], label [H, W]."""
    floor = plane_depth(camera, (0, 1, 0), -1.0)
    wall = plane_depth(camera, (0, 0, 1), -6.0)
    box, box_normal = box_depth(camera, (-0.9, -1.0, -4.0), (0.1, -0.2, -3.0))
    depths = np.stack([floor, wall, box])
    label = depths.argmin(0)
    normal = np.where(
        (label == 2)[..., None], box_normal, np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0]])[label]
    )
    return depths.min(0), normal.astype(np.float32), label


def screen_rays(camera: Camera, screen):
    """Directions [N, 3] with z = -1 through screen positions [N, 2] (pixels, x right, y down)."""
    screen = np.asarray(screen, float)
    x = screen[:, 0] - camera.width / 2
    y = camera.height / 2 - screen[:, 1]
    return np.stack([x / camera.focal, y / camera.focal, -np.ones(len(x))], -1)


def look(mesh, camera: Camera, within=0.5):
    """`trace` along a ray through each pixel, row by row; `within` is where in its pixel, [P, 2] or for all."""
    rows, columns = np.indices((camera.height, camera.width)).reshape(2, -1)
    return trace(mesh, np.zeros(3), screen_rays(camera, np.stack([columns, rows], -1) + within))


def trace(mesh, origin, directions, slack: float = 1e-7):
    """First hits of rays [N, 3] from origin [3]: distance in units of the direction [N] (inf: none) and face [N] (-1).

    Every ray against every triangle in float64; `slack` is how far outside a triangle, as a share of its size, still
    counts as a hit: float32 vertices are no more exact than that.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) - origin for k in range(3))
    scale = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    # Signed volumes of the ray with each edge: cross products do not depend on the ray.
    sides = [np.cross(u, v) for u, v in ((b, c), (c, a), (a, b))]
    normal = np.cross(b - a, c - a)
    height = (normal * a).sum(-1)
    distance = np.full(len(directions), np.inf)
    face = np.full(len(directions), -1)
    for start in range(0, len(directions), 256):
        rays = directions[start : start + 256]
        one, two, three = (rays @ side.T for side in sides)  # [n, F]
        low = np.minimum(np.minimum(one, two), three)
        high = np.maximum(np.maximum(one, two), three)
        size = slack * np.maximum(high, -low)
        # Few rays pass within a triangle.
        ray, hit = np.nonzero((low >= -size) | (high <= size))
        facing = (rays[ray] * normal[hit]).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(np.abs(facing) > 1e-12 * scale[hit], height[hit] / facing, np.inf)
        t = np.where(t > 1e-6, t, np.inf)
        ray += start
        np.minimum.at(distance, ray, t)
        # Of triangles at one distance the first.
        nearest = np.flatnonzero(np.isfinite(t) & (t == distance[ray]))[::-1]
        face[ray[nearest]] = hit[nearest]
    return distance, face
