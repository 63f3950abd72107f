"""Bodies as parts of an export: meshes beside the depth surface with maps of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.edits.core.topology import edge_faults, volume
from materialist.exporters.parts import Part
from materialist.types import Array, Body, Materials, Mesh, Scene, Surface


def body_parts(scene: Scene) -> list[Part]:
    """A part for every body of the scene, named `body0`, `body1`, ..."""
    return [_part(f"body{k}", body) for k, body in enumerate(scene.bodies)]


def left_out(parts: list[Part], to: str) -> list[str]:
    """What a format does not show of bodies, as phrases."""
    surfaces = [part.surface for part in parts if part.surface is not None]
    clear = any(s.transmission > 0 for s in surfaces)
    if to == "usd":
        return ["refraction and tint of glass"] * clear
    if to != "html":
        return []
    names = ["textures but for their colours at the vertices"] * any(not part.constant for part in parts)
    return names + ["glass"] * clear + ["glow"] * any(max(s.emission) > 0 for s in surfaces)


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


def mean_chord(part: Part) -> float:
    """Mean way through a closed part, scene units: 4 volume / area (Cauchy); 0 for an open one."""
    mesh = part.mesh
    open_edges, _ = edge_faults(mesh.vertices, mesh.faces)
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2)
    return 0.0 if open_edges or area == 0 else 4 * abs(volume(mesh.vertices, mesh.faces)) / area


def one_roughness(part: Part) -> Materials:
    """The part's maps for formats in which glass and the opaque share have one roughness: their mean, by share."""
    surface = part.surface
    if surface is None or surface.transmission == 0:
        return part.materials
    share = np.float32(surface.transmission)
    mixed = (1 - share) * part.materials.roughness + share * np.float32(surface.interface_roughness)
    return replace(part.materials, roughness=mixed.astype(np.float32))
