"""Results of a batch: where they lie, whether they are whole, and whether two are the same."""

import hashlib
import json
from pathlib import Path

from materialist.errors import SceneError
from materialist.io.atomic import MARKER

RESULTS = (
    "photo.exr",
    "envmap.exr",
    "mesh.ply",
    "plane_label.png",
    "rerender.exr",
    "prior/*.exr",
    "maps/*.exr",
)
"""Files that the hash covers beside the camera. Times, memory, paths and pictures with figures are left out."""


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


def package_size(path: str | Path) -> int:
    """Bytes of all files of a scene package; 0 where there is none. Another size than at first: it is not whole."""
    return sum(file.stat().st_size for file in Path(path).rglob("*") if file.is_file())
