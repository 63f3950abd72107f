"""The scene's shape in one call: mesh of the depth map, continued planes, creases."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from materialist.errors import InputError
from materialist.geometry.boundary import QUAD, depth_to_mesh, face_camera
from materialist.geometry.completion import complete
from materialist.geometry.planes import find_planes
from materialist.options import TAU
from materialist.types import Array, Camera, Geometry, Mesh, Scene

COMPLETIONS = ("planes", "floors", "none")
"""What can be added to what the picture shows: the dominant planes continued, the same with walls (planes that do not
face up) ending at the frame, nothing."""
CREASE = 40.0
"""Angle between the normals of two pixels, degrees, from which neither has a part in the other's shading; by eye."""


def build_geometry(
    depth: Array,
    normal: Array,
    camera: Camera,
    *,
    tau: float = TAU,
    completion: str = "floors",
    seed: int = 0,
) -> Geometry:
    """Mesh of the depth map (paper, Mesh Reconstruction), with the dominant planes continued where nothing is seen.

    depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit, camera frame. tau: degrees in (0, 90).
    completion: one of `COMPLETIONS`; auto: floors.
    Raises InputError for maps or options that cannot be used.
    """
    completion = "floors" if completion == "auto" else completion
    if completion not in COMPLETIONS:
        raise InputError(
            f"Completion is '{completion}'; choose one of {', '.join(map(repr, COMPLETIONS))}."
        )
    mesh = depth_to_mesh(depth, normal, camera, tau=tau)
    label = np.full((camera.height, camera.width), -1, np.int8)  # [H, W] plane of each pixel
    if completion != "none":
        planes = find_planes(depth, normal, camera, seed=seed)
        for k, plane in enumerate(planes):
            label[plane.mask] = k
        mesh = complete(mesh, planes, depth, camera, walls=completion == "planes")
    return Geometry(split_creases(mesh, depth, normal), label)


def rebuilt(scene: Scene, depth: Array, normal: Array, camera: Camera) -> Geometry:
    """The geometry of other maps, built as the scene's own: as its provenance says, else as its mesh looks."""
    provenance = scene.provenance
    completion = "planes" if (scene.geometry.mesh.face_plane >= 0).any() else "none"
    if provenance.get("completion") in COMPLETIONS:
        completion = provenance["completion"]
    return build_geometry(
        depth,
        normal,
        camera,
        tau=float(provenance.get("tau", TAU)),
        completion=completion,
        seed=int(provenance.get("seed", 0) or 0),
    )


def continued_as(geometry: Geometry, other: Geometry) -> Geometry:
    """The depth surface of one geometry with the continued planes of another, of the same picture size."""
    near = geometry.mesh
    far = other.mesh
    surface = near.face_plane == -1
    planes = far.face_plane >= 0

    def both(a, b):
        return np.concatenate([a, b])

    # Vertices of the planes come after those of the surface: their faces count from there.
    mesh = Mesh(
        vertices=both(near.vertices, far.vertices),
        normals=both(near.normals, far.normals),
        uv=both(near.uv, far.uv),
        faces=both(near.faces[surface], far.faces[planes] + len(near.vertices)).astype(np.int32),
        face_pixel=both(near.face_pixel[surface], far.face_pixel[planes]),
        face_plane=both(near.face_plane[surface], far.face_plane[planes]),
    )
    return Geometry(_tidy(mesh), other.plane_label)


def with_normals(geometry: Geometry, normal: Array, region: Array) -> Geometry:
    """The same surfaces with the normals of a map [H, W, 3] inside a region [H, W] bool; its border keeps its own.

    Points and faces are shared with the geometry that is given.
    """
    mesh = geometry.mesh
    inside = (mesh.face_plane < 0) & region.ravel()[mesh.face_pixel]
    # --- At vertices that faces inside alone have: the mean of the map's normals ---
    total = np.zeros((len(mesh.vertices), 3))
    np.add.at(total, mesh.faces[inside], normal.reshape(-1, 3)[mesh.face_pixel[inside], None])
    changed = np.zeros(len(mesh.vertices), bool)
    changed[mesh.faces[inside]] = True
    changed[mesh.faces[~inside]] = False
    normals = mesh.normals.copy()
    normals[changed] = face_camera(total[changed], mesh.vertices[changed])
    return replace(geometry, mesh=replace(mesh, normals=normals))


def split_creases(mesh: Mesh, depth: Array, normal: Array) -> Mesh:
    """The mesh with a vertex for each normal where pixels of different normals meet; its points stay where they are.

    The mean of a wall's and a floor's normal belongs to neither, and is a bright line along every crease. The corner of
    a pixel gets the mean normal of those pixels that have the vertex in common and whose normals are within `CREASE`
    degrees of the pixel's own. Faces keep their order.

    mesh: whose first faces are two for each pixel with a surface, as of `depth_to_mesh`. depth: [H, W], 0 = none.
    normal: [H, W, 3] unit, camera frame.
    """
    # --- Which pixels meet in each vertex: up to four ---
    pixel_normal = np.ascontiguousarray(normal[depth > 0], np.float32)  # [P, 3]
    corners = pixel_corners(mesh, depth > 0)[depth > 0]  # [P, 4]
    vertex = corners.ravel()
    place = np.empty_like(corners)  # which of its vertex's up to four pixels each one is, by row
    around = np.full((len(mesh.vertices), 4), -1)  # [V, 4] pixels that meet in a vertex
    met = np.zeros(len(mesh.vertices), np.int64)
    # The upper left of the pixels around a vertex has it at its lower right corner.
    for slot in (3, 2, 1, 0):
        at = corners[:, slot]
        place[:, slot] = met[at]
        around[at, met[at]] = np.arange(len(corners))
        met[at] += 1
    place = place.ravel()
    # --- Vertices on a crease: two of their pixels differ by more than CREASE ---
    cosine = np.cos(np.radians(CREASE))
    flat = np.ones(len(around), bool)
    for i, j in combinations(range(4), 2):
        both = around[:, j] >= 0  # places are filled from the first
        flat[both] &= (
            np.einsum("nk,nk->n", pixel_normal[around[both, i]], pixel_normal[around[both, j]])
            > cosine
        )
    # --- Corners there: the pixels of like normals that each is shaded with ---
    corner = np.flatnonzero(~flat[vertex])  # [C] of pixels, at creases
    at, near = vertex[corner], around[vertex[corner]]  # [C], [C, 4]
    alike = (near >= 0) & (
        np.einsum("njk,nk->nj", pixel_normal[near], pixel_normal[corner // 4]) > cosine
    )
    alike[np.arange(len(corner)), place[corner]] = True
    # --- One new vertex for each old one and company of pixels ---
    # The company is a number of four bits.
    key, first, number = np.unique(
        at * 16 + alike @ [1, 2, 4, 8], return_index=True, return_inverse=True
    )
    shading = np.where(alike[first][..., None], pixel_normal[near[first]], 0).sum(
        1, dtype=np.float64
    )  # [K, 3]
    new = vertex.copy()
    new[corner] = len(mesh.vertices) + number  # after the vertices there were
    points = mesh.vertices[key // 16]
    return _tidy(
        replace(
            mesh,
            vertices=np.concatenate([mesh.vertices, points]),
            normals=np.concatenate([mesh.normals, face_camera(shading, points)]),
            uv=np.concatenate([mesh.uv, mesh.uv[key // 16]]),
            faces=np.concatenate(
                [new.reshape(-1, 4)[:, QUAD].reshape(-1, 3), mesh.faces[2 * len(pixel_normal) :]]
            ).astype(np.int32),
        )
    )


def pixel_corners(mesh: Mesh, surface: Array) -> Array:
    """[H, W, 4] front vertices of each pixel's corners, read off the two faces that come first for each pixel."""
    faces = mesh.faces[: 2 * int(surface.sum())].reshape(-1, 6)
    corner = np.full((*surface.shape, 4), -1, np.int64)
    # Faces of a pixel: top left, bottom left, bottom right; top left, bottom right, top right.
    corner[surface] = faces[:, [0, 5, 1, 2]]
    return corner


def part(mesh: Mesh, plane: int, pixels: Array | None = None) -> Mesh:
    """The faces of one plane's continuation, or (-1) of the depth surface, with the vertices they use.

    pixels: [H, W] bool: those whose faces are meant; None: all.
    """
    chosen = mesh.face_plane == plane
    if pixels is not None:
        chosen &= pixels.ravel()[mesh.face_pixel]
    faces = {name: getattr(mesh, name)[chosen] for name in ("faces", "face_pixel", "face_plane")}
    return _tidy(replace(mesh, **faces))


def _tidy(mesh: Mesh) -> Mesh:
    """The mesh without vertices that no face has."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    number = np.cumsum(used, dtype=np.int32) - 1
    kept = {name: getattr(mesh, name)[used] for name in ("vertices", "normals", "uv")}
    return replace(mesh, faces=number[mesh.faces], **kept)
