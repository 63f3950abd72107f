"""What a page looks at: the mesh of the edited scene, the photo's own pixels, and the colour of a surface."""

import json
from typing import Any

import numpy as np

from materialist.color import srgb_levels
from materialist.darkroom import bodies
from materialist.darkroom.desk import Desk
from materialist.edits.core.operation import Target
from materialist.io import display
from materialist.studio import SETTINGS
from materialist.types import Array, Body, Scene

MESH_FACES = 160_000
"""About as many triangles of the photo's surface are sent; a phone turns them, too."""
FULL_SIDE = 8192
"""Longest side of the photo's own pixels, which is the largest picture that graphics cards are sure to take."""
_SAMPLE = 2
"""Pixels around a place whose colour counts."""


def edited_scene(desk: Desk) -> Scene:
    """The scene with the edits that do not take long to be made, glass aside."""
    session = desk.session
    live = session.live
    return session.scene if live is None else live.edited(session.edits.active)


def mesh_bytes(desk: Desk) -> bytes:
    """The mesh of the edited scene as one block, little-endian.

    It begins with the length of a JSON header, uint32, and the header, filled up to a multiple of 4 bytes:
    {vertices: V, faces: F, fov, aspect, middle: planar depth about which it turns}. Then come positions, float32
    [V, 3] (camera frame); colours, uint8 [V, 4] sRGB, with alpha 0 where the picture is laid on; faces, uint32 [F, 3].
    """
    scene = edited_scene(desk)
    positions, faces = _surface(scene)
    colours = np.zeros((len(positions), 4), np.uint8)
    parts = [(positions, faces, colours), *(_of_body(body) for body in scene.bodies)]
    starts = np.cumsum([0, *(len(part[0]) for part in parts)])
    positions = np.concatenate([part[0] for part in parts]).astype("<f4")
    colours = np.concatenate([part[2] for part in parts])
    faces = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
    seen = scene.depth[scene.depth > 0]
    header = {
        "vertices": len(positions),
        "faces": len(faces),
        "fov": scene.camera.fov,
        "aspect": scene.camera.width / scene.camera.height,
        "middle": float(np.median(seen)) if seen.size else 1.0,
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    blocks = [text, positions.tobytes(), colours.tobytes(), faces.astype("<u4").tobytes()]
    return len(text).to_bytes(4, "little") + b"".join(blocks)


def skin_jpeg(desk: Desk) -> bytes:
    """The edited picture without the objects in it, which the mesh has as such."""
    session = desk.session
    steps = tuple(s for s in session.edits.active if s.operation.target is not Target.PLACE)
    live = session.live
    picture = session.scene.photo.linear if live is None else live.picture(steps, session.glass)
    return display.encoded(srgb_levels(picture), "JPEG", quality=SETTINGS.jpeg_quality)


def _surface(scene: Scene) -> tuple[Array, Array]:
    """([V, 3], [F, 3]): the photo's surface without the planes that continue it, with at most some MESH_FACES."""
    mesh = scene.geometry.mesh
    # Faces of one place in the picture continue the ground behind what hides it: they were never seen.
    seen = np.ptp(mesh.uv[mesh.faces], axis=1).max(1) > 0
    faces = mesh.faces[(mesh.face_plane < 0) & seen]
    if len(faces) <= MESH_FACES:
        return mesh.vertices, faces
    # Vertices of one cell of the picture, and of about one depth, become one: borders between things stay cuts.
    camera = scene.camera
    cell = np.sqrt(len(faces) / MESH_FACES)
    places = np.floor(mesh.uv * (camera.width, camera.height) / cell).astype(np.int64)
    unused = np.ones(len(places), bool)
    unused[faces] = False
    places[unused] = -1
    layers = np.round(np.log(np.maximum(-mesh.vertices[:, 2], 1e-6)) / 0.04).astype(np.int64)
    keys = (places[:, 1] * 100_000 + places[:, 0]) * 4096 + layers % 4096
    _, merged, counts = np.unique(keys, return_inverse=True, return_counts=True)
    positions = np.stack(
        [np.bincount(merged, mesh.vertices[:, axis], len(counts)) / counts for axis in range(3)], 1
    )
    faces = merged[faces]
    whole = (faces != np.roll(faces, 1, 1)).all(1)
    return positions, faces[whole]


def _of_body(body: Body) -> tuple[Array, Array, Array]:
    """Vertices [V, 3], faces [F, 3] and sRGB colours [V, 4] of a thing that stands in the scene."""
    albedo = body.surface.albedo
    height, width = albedo.shape[:2]
    rows = (np.floor(body.uv[:, 1] * height) % height).astype(int)
    columns = (np.floor(body.uv[:, 0] * width) % width).astype(int)
    levels = srgb_levels(albedo[rows, columns] * np.asarray(body.surface.tint, np.float32))
    return body.vertices, body.faces, np.c_[levels, np.full(len(levels), 255, np.uint8)]


def colour_at(desk: Desk, body: bodies.Pointed) -> dict[str, Any]:
    """The colour of the surface at a pixel, without the light on it, as #rrggbb."""
    column, row = desk.session.pixel(*body.at)
    albedo = edited_scene(desk).materials.albedo
    around = albedo[
        max(row - _SAMPLE, 0) : row + _SAMPLE + 1, max(column - _SAMPLE, 0) : column + _SAMPLE + 1
    ]
    # The median: a border in between gives the colour of one side.
    middle = np.median(around.reshape(-1, 3), 0)[None]
    return {"colour": "#" + srgb_levels(middle).tobytes().hex()}
