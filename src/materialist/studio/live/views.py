"""What is made of a live preview, in its process: pictures, meshes, maps, words.

Each is a call of `studio.live.process`.
"""

import json
from contextlib import suppress
from typing import Any

import numpy as np

from materialist.color import srgb_levels
from materialist.edits.core.surfaces import texels
from materialist.edits.recipe import Step, region_of
from materialist.edits.remove.filling import NotFilled, remembered_alone
from materialist.edits.select import material
from materialist.edits.select.select import select
from materialist.errors import InputError, MaterialistError
from materialist.io import display
from materialist.studio import SETTINGS
from materialist.studio.live.glass import Panes
from materialist.studio.live.preview import LivePreview
from materialist.studio.reporting import named_maps, quality
from materialist.types import Array, Body, Scene

Steps = tuple[Step, ...]
MESH_FACES = 160_000
"""About as many triangles of the photo's surface are sent; a phone turns them, too."""
_SAMPLE = 2
"""Pixels around a place whose colour counts."""


def check(live: LivePreview, steps: Steps) -> tuple[str, ...]:
    """The warnings of a list of edits. Raises InputError where it cannot be applied."""
    return live.edited(steps).report.warnings


def take_rerender(live: LivePreview) -> None:
    """Show the re-rendering that was added to the scene's package since it was opened."""
    live.take_rerender()


def unfilled(live: LivePreview, steps: Steps) -> bool:
    """Whether something that the edits take away hid what was not filled yet, which takes seconds."""
    try:
        with remembered_alone():
            live.edited(steps)
    except NotFilled:
        return True
    except MaterialistError:
        return False  # the picture tells what cannot be applied
    return False


def picture(live: LivePreview, steps: Steps, panes: Panes, coarse: bool = False) -> bytes:
    """The edits in the photo at working size, as a JPEG."""
    return encoded(live.picture(steps, panes, coarse=coarse))


def look_ahead(live: LivePreview) -> None:
    """Do what the first selection in a photo takes longest for: reading the networks, and the photo by them."""
    rows, columns = np.nonzero(live.scene.depth)
    middle = len(rows) // 2
    # What fails here fails at a click, which says why.
    with suppress(MaterialistError):
        select(live.scene, click=(int(columns[middle]), int(rows[middle])), sharpen=False)


def selected(live: LivePreview, where: dict[str, Any]) -> Array:
    """[H, W] bool: `select` with these keywords."""
    return select(live.scene, **where)


def of_material(live: LivePreview, region: Array, click: tuple[int, int]) -> Array:
    """[H, W] bool: what of a region [H, W] bool has the material of a click in it."""
    return material.of_material(live.scene, region, [click])


def region(live: LivePreview, step: Step) -> Array:
    """[H, W] bool: the region that a step says."""
    return region_of(live.scene, step)


def encoded(linear: Array, quality: int = SETTINGS.jpeg_quality) -> bytes:
    """A linear picture [H, W, 3] as a JPEG."""
    return display.encoded(srgb_levels(linear), "JPEG", quality=quality)


# The edited scene


def mesh(live: LivePreview, steps: Steps) -> bytes:
    """The mesh of the edited scene as one block, little-endian.

    It begins with the length of a JSON header, uint32, and the header, filled up to a multiple of 4 bytes:
    {vertices: V, faces: F, fov, aspect, middle: planar depth about which it turns}. Then come positions, float32
    [V, 3] (camera frame); colours, uint8 [V, 4] sRGB, with alpha 0 where the picture is laid on; faces, uint32 [F, 3].
    """
    scene = live.edited(steps)
    # --- The surface with the picture laid on (alpha 0), then bodies in their colours ---
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
    # --- One block; the header is filled up, so that arrays begin at whole words ---
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    blocks = [text, positions.tobytes(), colours.tobytes(), faces.astype("<u4").tobytes()]
    return len(text).to_bytes(4, "little") + b"".join(blocks)


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
    albedo = texels(body.surface.albedo, body.uv)
    levels = srgb_levels(albedo * np.asarray(body.surface.tint, np.float32))
    return body.vertices, body.faces, np.c_[levels, np.full(len(levels), 255, np.uint8)]


def colour(live: LivePreview, steps: Steps, column: int, row: int) -> str:
    """The colour of the surface at a pixel, without the light on it, as #rrggbb."""
    albedo = live.edited(steps).materials.albedo
    around = albedo[
        max(row - _SAMPLE, 0) : row + _SAMPLE + 1, max(column - _SAMPLE, 0) : column + _SAMPLE + 1
    ]
    # The median: a border in between gives the colour of one side.
    middle = np.median(around.reshape(-1, 3), 0)[None]
    return "#" + srgb_levels(middle).tobytes().hex()


def map_jpeg(live: LivePreview, steps: Steps, place: int) -> bytes:
    """A map of the edited scene, by its place in `named_maps`, as a JPEG. Raises InputError for another place."""
    maps = named_maps(live.edited(steps))
    if place >= len(maps):
        raise InputError(f"There is no map {str(place)!r}.")
    return display.encoded(maps[place][0], "JPEG", quality=92)


def report(live: LivePreview, steps: Steps) -> dict[str, Any]:
    """The names of the maps, and the quality in words with the warnings of the edits."""
    scene = live.edited(steps)
    return {
        "maps": [title for _, title in named_maps(scene)],
        "report": quality(scene),
    }
