"""Bodies as parts of an export: meshes beside the depth surface with maps of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.export.parts import Part
from materialist.types import Array, Body, Materials, Mesh, Scene, Surface

TEXTURED = ("glb", "mitsuba")
"""Formats that carry the textures and the glass of bodies."""


def body_parts(scene: Scene) -> list[Part]:
    """A part for every body of the scene, named `body0`, `body1`, ..."""
    return [_part(f"body{k}", body) for k, body in enumerate(scene.bodies)]


def plain(part: Part) -> Part:
    """The part with the means of its maps, for formats that give textures to the depth surface alone."""
    m = part.materials
    mean = Materials(
        m.albedo.mean((0, 1), keepdims=True), m.roughness.mean(keepdims=True), m.metallic.mean(keepdims=True)
    )
    return replace(part, materials=mean)


def left_out(parts: list[Part], to: str) -> list[str]:
    """What of bodies a format without their textures does not show."""
    surfaces = [part.surface for part in parts if part.surface is not None]
    names = ["textures"] * any(not part.constant for part in parts)
    names += ["glass"] * any(s.transmission > 0 for s in surfaces)
    return names + ["glow"] * (to == "html" and any(max(s.emission) > 0 for s in surfaces))


def in_photo(scene: Scene) -> int:
    """How many of the scene's bodies, the first ones, its photo shows: those of edits that were saved."""
    saved = [stage for stage in scene.report.stages if stage.get("name") == "edit"]
    return max((int(stage.get("bodies", len(scene.bodies))) for stage in saved), default=0)


def _part(name: str, body: Body) -> Part:
    count = len(body.faces)
    mesh = Mesh(
        body.vertices, body.faces, body.normals, body.uv, np.zeros(count, np.int32), np.full(count, -1, np.int16)
    )
    return Part(name, mesh, _one_size(body.surface), body.surface)


def _one_size(surface: Surface) -> Materials:
    """The maps at the size of the largest, by repetition of texels."""
    maps = (surface.albedo, surface.roughness, surface.metallic)
    height, width = (max(m.shape[axis] for m in maps) for axis in (0, 1))

    def grown(values: Array) -> Array:
        rows = np.arange(height) * values.shape[0] // height
        columns = np.arange(width) * values.shape[1] // width
        return np.ascontiguousarray(values[np.ix_(rows, columns)])

    return Materials(*(grown(values) for values in maps))
