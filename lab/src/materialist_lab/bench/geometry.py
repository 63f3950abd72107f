"""`bench geometry`: whether the mesh of a photograph agrees with its normal map, and whether it holds together.

Every photo of the folder DATA/photos (where there is none, of DATA) and of its folders gets the predictor's maps and a
mesh without continued planes. `angle`: median angle, degrees, between the triangles and the normal map; `level` the
same where the normal map faces up (floors, table tops). `pieces`: parts of the mesh that share no point; `rest` is the
share of the surface outside the ten largest. There is no truth in this: a flat picture has one piece. `bench real`
tells whether depth is right.
sheet.png: photo, normal map, normals of the triangles, pieces in colours of their own.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from materialist.camera import unit
from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.geometry.build import build_geometry
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.types import Array, Mesh
from materialist_lab.bench.benchmark import COUNT_OR_0, SIZE, Benchmark, Row, spread, timed
from materialist_lab.bench.report import Column, Report, side_by_side

LEVEL = 0.7
"""Least upward part of a normal that faces up, as in `bench real`."""
LARGEST = 10
"""Pieces that do not count as the rest."""
SUFFIXES = (".png", ".jpg", ".jpeg")
SHEET_HEIGHT = 200
"""Pixels of a picture in the sheet."""


@dataclass(frozen=True, kw_only=True)
class GeometryBench(Benchmark):
    """Compare the meshes of photos with their normal maps, and count their pieces."""

    columns = (
        Column("angle", "mesh to normals, degrees", "lower", 1),
        Column("level", "where they face up", "lower", 1),
        Column("pieces", "pieces", "lower", 0),
        Column("rest", "rest", "lower", 4),
        Column("seconds", "mesh s", "lower", 1),
    )

    predictor: str = option("auto", "Where the maps come from.", kind="name")
    size: int = option(512, "Longer side of the photos.", **SIZE)
    tau: float = option(6.0, "That of `invert`.", low=0.1, high=89)
    limit: int = option(0, "At most so many photos, evenly spread; 0: all.", **COUNT_OR_0)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is None:
            raise InputError("This benchmark needs photographs; give --data DIR.")
        files = photo_files(data / "photos" if (data / "photos").is_dir() else data)
        if not files:
            raise InputError(f"{data} holds no photographs ({', '.join(SUFFIXES)}).")
        source = get_predictor(self.predictor, device=self.device)
        for file in spread(files, self.limit):
            photo = read_photo(file, size=self.size)
            maps = source.predict(photo, seed=self.seed)
            built: dict[str, Any] = {"tau": self.tau, "completion": "none"}
            geometry, cost = timed(build_geometry, maps.depth, maps.normal, photo.camera, **built)
            surface = maps.depth > 0
            mesh_normals = surface_normals(geometry.mesh, surface)
            piece = pieces(geometry.mesh, surface)
            figures = agreement(mesh_normals, maps.normal, surface) | connection(piece)
            pictures = (
                photo.linear,
                shown(maps.normal, surface),
                shown(mesh_normals, surface),
                _coloured(piece),
            )
            report.sheet.append(side_by_side(*(lowered(picture) for picture in pictures)))
            yield {
                "method": self.predictor,
                "sample": file.stem,
                **figures,
                "seconds": cost["seconds"],
            }


def photo_files(folder: Path) -> list[Path]:
    """The pictures of a folder and of its folders, without masks (`NAME_mask.png`)."""
    pictures = (path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    return sorted(path for path in pictures if not path.stem.endswith("_mask"))


def surface_normals(mesh: Mesh, surface: Array) -> Array:
    """[H, W, 3] unit: mean normal of the two triangles of each pixel of a surface [H, W] bool, 0 elsewhere."""
    count = int(surface.sum())
    corners = mesh.vertices[mesh.faces[: 2 * count]].astype(np.float64)  # [2 P, 3, 3]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros((*surface.shape, 3))
    normal[surface] = unit(unit(across).reshape(count, 2, 3).sum(1))
    return normal


def pieces(mesh: Mesh, surface: Array) -> Array:
    """[H, W] int: the piece of the mesh to which each pixel of a surface [H, W] bool belongs, -1 elsewhere.

    Triangles that share a point are of one piece; points at one place are one point, whatever their normals.
    """
    depth_faces = mesh.faces[mesh.face_plane == -1]
    _, point = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corner = point.ravel()[depth_faces]  # [F, 3]
    ends = corner[:, [0, 1]].reshape(-1), corner[:, [1, 2]].reshape(-1)
    links = coo_matrix((np.ones(len(ends[0]), np.int8), ends), (len(point), len(point)))
    _, piece = connected_components(links, directed=False)
    _, number = np.unique(piece[corner[: 2 * int(surface.sum()) : 2, 0]], return_inverse=True)
    piece = np.full(surface.shape, -1)
    piece[surface] = number.ravel()
    return piece


def agreement(mesh_normals: Array, normal: Array, surface: Array) -> dict[str, float]:
    """Median angles between normals [H, W, 3] over a surface [H, W] bool; `level` where there is such a thing."""
    cosine = np.clip((mesh_normals * normal).sum(-1), -1, 1)
    angle = np.degrees(np.arccos(cosine))
    figures = {"angle": float(np.median(angle[surface]))}
    level = surface & (normal[..., 1] > LEVEL)
    if level.any():
        figures["level"] = float(np.median(angle[level]))
    return figures


def connection(piece: Array) -> dict[str, float]:
    """How many pieces there are, of `pieces`, and the share of the surface that is in none of the largest."""
    sizes = np.sort(np.bincount(piece[piece >= 0]))[::-1]
    return {"pieces": len(sizes), "rest": float(sizes[LARGEST:].sum() / sizes.sum())}


def shown(normal: Array, surface: Array) -> Array:
    """[H, W, 3] linear: a normal map as colours, black where there is no surface."""
    colours = srgb_to_linear(np.clip(0.5 + 0.5 * normal, 0, 1).astype(np.float32))
    return np.where(surface[..., None], colours, 0).astype(np.float32)


def _coloured(piece: Array) -> Array:
    """[H, W, 3] linear: a colour for each piece, the same in every run; black where there is none."""
    palette = np.random.default_rng(0).uniform(0.05, 1, (int(piece.max()) + 2, 3))
    palette[-1] = 0
    return palette[piece].astype(np.float32)


def lowered(picture: Array) -> Array:
    """[h, w, 3] a picture at the height of the sheet's rows."""
    height, width = picture.shape[:2]
    size = (max(1, round(width * SHEET_HEIGHT / height)), SHEET_HEIGHT)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
