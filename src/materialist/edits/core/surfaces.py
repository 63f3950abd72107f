"""Surfaces of bodies, whether bodies are closed, and those that stand for something in the photo, as its lights do."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.types import Array, Body, Scene, Surface

PHOTO_LIGHT = "photo light"
"""Names of bodies that are emitters of the photo begin so."""
PHOTO_GLASS = "photo glass"
"""Names of bodies that are objects of the photo turned to glass begin so."""
KEY = "photo_lights"
"""Entry of the provenance of a scene with in-photo emitters: `ambient` (factor on the fitted environment map),
`radiance` of the emitters, `dim` (the factor that the user asked for), their `share` of the light, `emission`."""
OFF = 1e-6
"""Radiance of an emitter that is switched off: the renderer still knows it as an emitter."""


def uniform_surface(
    albedo: Array | float, roughness: float, metallic: float, **fields: Any
) -> Surface:
    """A surface without texture; albedo [3] linear, or one number for a grey. `fields` are others of `Surface`."""
    colour = np.broadcast_to(np.asarray(albedo, np.float32), (3,)).reshape(1, 1, 3).copy()

    def flat(v):
        return np.full((1, 1), v, np.float32)

    return Surface(colour, flat(roughness), flat(metallic), **fields)


def texels(texture: Array, place: Array) -> Array:
    """[N] or [N, C] values of a repeated map [h, w(, C)] at texture coordinates [N, 2], the nearest."""
    height, width = texture.shape[:2]
    column, row = np.floor(place * (width, height)).astype(int).T
    return texture[row % height, column % width]


def triple(values: Array | Sequence[float]) -> tuple[float, float, float]:
    """Three numbers as a tuple of plain floats, as files and comparisons want them."""
    a, b, c = (float(v) for v in values)
    return a, b, c


def dimmed_emitters(scene: Scene, edited: Scene) -> dict | None:
    """The entry KEY of an edit that dimmed emitters of this scene's photo; None where it did not."""
    return None if KEY in scene.provenance else edited.provenance.get(KEY) or None


def base_of(scene: Scene, edited: Scene) -> Scene:
    """The scene that an edit is compared with: the fitted scene, with its emitters as surfaces if the edit has them.

    Both give the photo; without the surfaces the light of the emitters is in the environment map.
    """
    facts = dimmed_emitters(scene, edited)
    if facts is None:
        return scene
    lights = [body for body in edited.bodies if body.name.startswith(PHOTO_LIGHT)]
    return with_emitters(
        scene,
        [emitting(body, emission) for body, emission in zip(lights, facts["emission"])],
        facts,
    )


def with_emitters(scene: Scene, emitters: Sequence[Body], facts: dict) -> Scene:
    """The scene with emitters as further bodies, and without their light in the environment map."""
    return replace(
        scene, envmap=scene.envmap * np.float32(facts["ambient"]), bodies=(*scene.bodies, *emitters)
    )


def emitting(body: Body, emission: Sequence[float]) -> Body:
    """The body with an emission [3]; a channel of 0 becomes `OFF`."""
    red, green, blue = (max(float(c), OFF) for c in emission)
    return replace(body, surface=replace(body.surface, emission=(red, green, blue)))


def edge_faults(vertices: Array, faces: Array) -> tuple[int, int]:
    """(edges with one face, edges with three or more) of a mesh of vertices [V, 3] and faces [F, 3].

    Vertices within a millionth of the mesh's size of each other count as one.
    """
    extent = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    corners = welded(np.round((vertices - vertices.min(0)) / extent * 1e6))[faces]
    # Triangles of no area have no edges that count.
    corners = corners[(np.diff(np.sort(corners, 1), axis=1) > 0).all(1)]
    # An edge inside a closed surface belongs to exactly two faces.
    _, count = np.unique(edge_keys(corners), return_counts=True)
    return int((count == 1).sum()), int((count > 2).sum())


def welded(vertices: Array) -> Array:
    """[V] int32 number of the place of each vertex [V, n], in float32: equal ones share a number."""
    places = np.asarray(vertices, np.float32) + np.float32(0)  # no -0
    # Sorted places: a new number begins where a place differs from the one before.
    order = np.lexsort(places.T)
    steps = np.zeros(len(places), np.int32)
    steps[1:] = (places[order[1:]] != places[order[:-1]]).any(1)
    numbers = np.empty(len(places), np.int32)
    numbers[order] = np.cumsum(steps, dtype=np.int32)
    return numbers


def edge_keys(faces: Array) -> Array:
    """[3 F] int64 of faces [F, 3], face by face: a number for each edge, the same both ways."""
    after = np.roll(faces, -1, 1)
    low = np.minimum(faces, after)
    high = np.maximum(faces, after)
    return (low.astype(np.int64) * (int(faces.max(initial=0)) + 1) + high).ravel()
