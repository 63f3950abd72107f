"""Results of a batch: where they lie, whether they are whole, and whether two are the same."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path

from materialist.errors import OutputError, SceneError
from materialist.io.atomic import MARKER

RESULTS = ("photo.exr", "envmap.exr", "mesh.ply", "plane_label.png", "rerender.exr", "prior/*.exr", "maps/*.exr")
"""Files that the hash covers beside the camera. Times, memory, paths and pictures with figures are left out."""
MAPS = ("albedo", "roughness", "metallic", "normal", "depth")
NEEDED = (
    *("photo.exr", "photo.png", "envmap.exr", "mesh.ply", "plane_label.png", "rerender.exr", "rerender.png"),
    *(f"{folder}/{name}.exr" for folder in ("prior", "maps") for name in MAPS),
    *("overview.png", "report.json", MARKER),
)
"""Files of a whole package."""


def scene_path(runs: Path, name: str) -> Path:
    """The scene package of a name."""
    return runs / f"{name}.scene"


def picture_path(runs: Path, name: str) -> Path:
    """The edited photo of a name."""
    return runs / f"{name}.png"


def thumbnail_path(runs: Path, name: str) -> Path:
    """Small pictures of the photo, its re-rendering and its edit, side by side."""
    return runs / "thumbs" / f"{name}.jpg"


def replace_file(path: Path, content: bytes) -> None:
    """Write a file whole or not at all. Raises OutputError."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error


def package_hash(path: str | Path) -> str:
    """SHA-256 (hex) of an inversion's result: camera, photo at working size, prior, maps, light, mesh, re-rendering.

    Two packages with equal hashes hold equal arrays, bit for bit; how long they took and where the photo lay differs.
    Raises SceneError where a file is missing.
    """
    folder = Path(path)
    files = sorted({file for pattern in RESULTS for file in folder.glob(pattern)})
    digest = hashlib.sha256()
    try:
        meta = json.loads((folder / MARKER).read_text("utf-8"))
        digest.update(json.dumps([meta["camera"], meta.get("lamps", [])], sort_keys=True).encode())
        for file in files:
            digest.update(f"\n{file.relative_to(folder).as_posix()} {file_hash(file)}".encode())
    except (OSError, ValueError, KeyError) as error:
        raise SceneError(f"{folder} is no whole scene package: {error}.") from error
    return digest.hexdigest()


def file_hash(path: str | Path) -> str:
    """SHA-256 (hex) of a file's bytes. Raises OSError."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def whole_size(path: str | Path) -> int | None:
    """Bytes of a scene package, or None where a file that it needs is missing or empty."""
    folder = Path(path)
    try:
        if not all((folder / name).stat().st_size for name in NEEDED):
            return None
        return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    except OSError:
        return None


def together(hashes: Iterable[tuple[str, str]]) -> str:
    """SHA-256 (hex) of a whole batch from (name, hash) of each result, whatever their order."""
    return hashlib.sha256("\n".join(f"{name} {value}" for name, value in sorted(hashes)).encode()).hexdigest()
