"""Small scenes made by hand for the renderer's tests."""

import numpy as np

from materialist.geometry.build import build_geometry
from materialist.types import Camera, Geometry, Materials, Mesh


def wall(camera: Camera, depth: float = 2.0, holes=None) -> Geometry:
    """A wall at planar `depth` that fills the picture but for `holes` [H, W]."""
    seen = np.full((camera.height, camera.width), depth, np.float32)
    if holes is not None:
        seen[holes] = 0
    return build_geometry(
        seen, np.tile(np.float32([0, 0, 1]), (*seen.shape, 1)), camera, completion="none"
    )


def empty(camera: Camera) -> Geometry:
    """One triangle behind the camera: every ray sees the sky."""
    vertices = np.float32([[0, 0, 5], [1, 0, 5], [0, 1, 5]])
    mesh = Mesh(
        vertices,
        np.int32([[0, 1, 2]]),
        np.tile(np.float32([0, 0, -1]), (3, 1)),
        np.zeros((3, 2), np.float32),
        np.int32([0]),
        np.int16([-1]),
    )
    return Geometry(mesh, np.full((camera.height, camera.width), -1, np.int8))


def with_floor(geometry: Geometry, label, height: float = -1.5, size: float = 40.0) -> Geometry:
    """`geometry` and, as plane 0, a floor at y = `height`; `label` [H, W] says which pixels give it its material."""
    mesh = geometry.mesh
    count = len(geometry.mesh.vertices)
    floor = np.float32(
        [[-size, height, size], [size, height, size], [size, height, -size], [-size, height, -size]]
    )
    faces = np.int32([[0, 1, 2], [0, 2, 3]]) + count
    joined = Mesh(
        np.concatenate([mesh.vertices, floor]),
        np.concatenate([mesh.faces, faces]),
        np.concatenate([mesh.normals, np.tile(np.float32([0, 1, 0]), (4, 1))]),
        np.concatenate([mesh.uv, np.zeros((4, 2), np.float32)]),
        np.concatenate([mesh.face_pixel, np.zeros(2, np.int32)]),
        np.concatenate([mesh.face_plane, np.zeros(2, np.int16)]),
    )
    return Geometry(joined, np.asarray(label, np.int8))


def uniform(camera: Camera, albedo=0.5, roughness: float = 1.0, metallic: float = 0.0) -> Materials:
    """The same material everywhere."""
    size = (camera.height, camera.width)
    return Materials(
        np.broadcast_to(np.float32(albedo), (*size, 3)).copy(),
        np.full(size, roughness, np.float32),
        np.full(size, metallic, np.float32),
    )


def random_maps(seed: int, size: tuple[int, int]) -> Materials:
    """Values from 0.3 to 0.8, each pixel its own."""
    draw = np.random.default_rng(seed).uniform
    return Materials(
        *(draw(0.3, 0.8, (*size, *channels)).astype(np.float32) for channels in ((3,), (), ()))
    )
