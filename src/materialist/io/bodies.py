"""The bodies of a scene package: `bodies/N.ply`, their maps `bodies/N.albedo.exr` etc., and entries in scene.json."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from materialist.errors import InputError, SceneError
from materialist.io.exr import read_exr, write_exr
from materialist.io.ply import read_ply, write_ply
from materialist.types import Body, Mesh, Surface

FOLDER = "bodies"


def write_bodies(folder: Path, bodies: Sequence[Body]) -> list[dict[str, Any]]:
    """Write the files below the package FOLDER; returns the entries for scene.json."""
    (folder / FOLDER).mkdir()
    entries: list[dict[str, Any]] = []
    for k, body in enumerate(bodies):
        count, surface = len(body.faces), body.surface
        nowhere, kind = np.zeros(count, np.int32), np.full(count, -1, np.int16)
        write_ply(folder / FOLDER / f"{k}.ply", Mesh(body.vertices, body.faces, body.normals, body.uv, nowhere, kind))
        for name in ("albedo", "roughness", "metallic"):
            write_exr(folder / FOLDER / f"{k}.{name}.exr", getattr(surface, name))
        entries.append(
            {
                "name": body.name, "transmission": surface.transmission, "ior": surface.ior,
                "tint": list(surface.tint), "emission": list(surface.emission),
                "glass_roughness": surface.glass_roughness,
            }
        )  # fmt: skip
    return entries


def read_bodies(folder: Path, entries: Sequence[dict[str, Any]]) -> tuple[Body, ...]:
    """The bodies of the package FOLDER. Raises SceneError where a file is missing or damaged."""
    return tuple(_read_body(folder / FOLDER, k, entry) for k, entry in enumerate(entries))


def _read_body(folder: Path, number: int, entry: dict[str, Any]) -> Body:
    mesh = read_ply(folder / f"{number}.ply")
    try:
        albedo, roughness, metallic = (
            read_exr(folder / f"{number}.{name}.exr") for name in ("albedo", "roughness", "metallic")
        )
    except InputError as error:
        raise SceneError(f"{error} Save the scene again.") from error
    surface = Surface(
        albedo, roughness, metallic, float(entry["transmission"]), float(entry["ior"]), tuple(entry["tint"]),
        tuple(entry.get("emission", (0.0, 0.0, 0.0))), entry.get("glass_roughness"),
    )  # fmt: skip
    return Body(mesh.vertices, mesh.faces, mesh.normals, mesh.uv, surface, str(entry["name"]))
