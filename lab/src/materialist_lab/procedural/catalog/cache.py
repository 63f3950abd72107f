"""The catalogue on disk in a form that loads at once: a list, an .npz for each model, and who made what."""

import io
import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist.errors import InputError
from materialist.io.atomic import write_whole, writing
from materialist.types import Array, Progress
from materialist_lab.data.samples import described
from materialist_lab.procedural.catalog.archive import CatalogEntry, entries
from materialist_lab.procedural.catalog.look import CatalogLook
from materialist_lab.procedural.catalog.reading import ModelParts, read_catalog_model
from materialist_lab.procedural.catalog.roles import role_of
from materialist_lab.procedural.catalog.support import LevelPlace, level_places
from materialist_lab.procedural.materials import ColourPicture
from materialist_lab.procedural.objects.shapes import Solid

VERSION = 4
"""Counts the changes of what the cache holds."""
LIST = "catalog.json"
CREDITS = "ATTRIBUTION.txt"
"""The list of what a cache holds, and who made it."""
JPEG_QUALITY = 93
PHOTOGRAPH_SIDE = 1024
"""Pixels of a photograph's longer side."""
TILED = 1.15
"""Texture coordinates that reach further than that belong to a picture that repeats."""


@dataclass(frozen=True)
class CatalogModel:
    """One model, ready to be put into a scene."""

    entry: CatalogEntry
    role: str
    solids: tuple[Solid, ...]
    looks: tuple[CatalogLook, ...]
    pictures: tuple[ColourPicture | None, ...]
    """Of each solid."""
    places: tuple[LevelPlace, ...]
    """Where things can stand on it."""


@dataclass(frozen=True)
class Listing:
    """The models of a cache."""

    folder: Path
    models: dict[str, tuple[str, ...]]
    """Role -> keys, sorted."""
    textures: dict[str, tuple[tuple[str, int], ...]]
    """Family of materials -> (key, number of the solid) of surfaces with a picture that repeats."""
    photographs: tuple[str, ...]
    """Files of photographs in the folder."""

    def model(self, key: str) -> CatalogModel:
        return _load(self.folder, key)

    def photograph(self, name: str) -> Array:
        """[h, w, 3] uint8 sRGB."""
        return _photograph(self.folder / name)


def cache_folder() -> Path:
    """Where caches lie unless another place is named."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "materialist" / "furniture"


def listing(
    archives: Sequence[Path],
    photographs: Sequence[Path] = (),
    folder: Path | None = None,
    progress: Progress = lambda *_: None,
) -> Listing:
    """The models of archives, and photographs; the cache in `folder` is built where there is none of them.

    Raises InputError for a damaged archive, OutputError where the folder cannot be written.
    """
    folder = folder or cache_folder()
    # Names and sizes tell whether the packages changed since; hashing them would take long.
    made_of = [[path.name, path.stat().st_size] for path in (*archives, *photographs)]
    facts = described(folder / LIST)
    if facts is None or facts.get("version") != VERSION or facts.get("made_of") != made_of:
        facts = _build(archives, folder, progress) | {"photographs": _shrink(photographs, folder)}
        # Written last: a cache that was stopped half way is built again.
        write_whole(
            folder / LIST,
            json.dumps({"version": VERSION, "made_of": made_of, **facts}, indent=1) + "\n",
        )
    # --- The keys of each role ---
    by_role: dict[str, list[str]] = {}
    for key, role in facts["roles"].items():
        by_role.setdefault(role, []).append(key)
    textures = {
        family: tuple((key, k) for key, k in places) for family, places in facts["textures"].items()
    }
    roles = {role: tuple(sorted(keys)) for role, keys in by_role.items()}
    return Listing(folder, roles, textures, tuple(facts["photographs"]))


def _build(archives: Sequence[Path], folder: Path, progress: Progress) -> dict[str, Any]:
    """Write every model that can be used; returns the roles by key, textures, and why the others were left out."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    every = [(path, entry) for path in archives for entry in entries(path)]
    roles: dict[str, str] = {}
    left_out: dict[str, str] = {}
    textures: dict[str, list[tuple[str, int]]] = {}
    used: list[CatalogEntry] = []
    for done, (path, entry) in enumerate(every, 1):
        # A model that cannot be used is noted with the reason, and the others go on.
        role = role_of(entry)
        try:
            if role is None:
                raise InputError("it is of no use in a room")
            with zipfile.ZipFile(path) as file:
                parts = read_catalog_model(file, entry)
            _store(folder, entry, role, parts)
            for k, (solid, look) in enumerate(zip(parts.solids, parts.looks)):
                # Coordinates beyond the picture: it repeats, so it may cover other things too.
                if look.picture and np.ptp(solid.uv, axis=0).min() > TILED:
                    textures.setdefault(look.family, []).append((entry.key, k))
            roles[entry.key] = role
            used.append(entry)
        except InputError as error:
            left_out[f"{entry.key} {entry.name}"] = str(error)
        progress("furniture", done, len(every))
    write_whole(folder / CREDITS, _credits(used))
    return {"roles": roles, "textures": textures, "left_out": left_out}


def _shrink(photographs: Sequence[Path], folder: Path) -> list[str]:
    """Write photographs at a size that loads at once; returns their names. Those that cannot be read are left out."""
    names = []
    for k, path in enumerate(photographs):
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
        # Smaller ones would be enlarged to a blur.
        if pixels is None or min(pixels.shape[:2]) < 256:
            continue
        scale = min(1.0, PHOTOGRAPH_SIDE / max(pixels.shape[:2]))
        small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
        write_whole(folder / f"photograph{k:03d}.jpg", packed.tobytes())
        names.append(f"photograph{k:03d}.jpg")
    return names


@lru_cache(maxsize=64)
def _photograph(path: Path) -> Array:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError(
            f"The photograph {path} cannot be read; delete the folder, and it will be made again."
        )
    return np.ascontiguousarray(picture[..., ::-1])


def _credits(used: Sequence[CatalogEntry]) -> str:
    # The licences ask for these credits.
    head = (
        "3D models of Sweet Home 3D (http://www.sweethome3d.com), changed: stretched to size, repainted.\n"
        "BlendSwap-CC-0: CC0 1.0. KatorLegaz, Reallusion: CC-BY 3.0 United States. BlendSwap-CC-BY, Scopia: CC-BY 3.0\n"
        "(http://creativecommons.org/licenses/by/3.0/).\n\n"
    )
    return head + "".join(
        f"{entry.key}: {entry.name}, by {entry.creator or 'unknown'}\n" for entry in used
    )


def _store(folder: Path, entry: CatalogEntry, role: str, parts: ModelParts) -> None:
    """Write one model: what is known of it as JSON, its solids as arrays, its pictures as JPEG."""
    # --- What is known of it ---
    facts: dict[str, Any] = {
        "entry": asdict(entry),
        "role": role,
        "looks": [asdict(look) for look in parts.looks],
    }
    facts["places"] = [list(place) for place in level_places(parts.solids)]
    # --- Solids and pictures ---
    arrays: dict[str, Array] = {"facts": np.array(json.dumps(facts))}
    for k, solid in enumerate(parts.solids):
        arrays[f"vertices{k}"] = solid.vertices.astype("f4")
        arrays[f"uv{k}"] = solid.uv.astype("f4")
        arrays[f"normals{k}"] = solid.normals.astype("f2")
        arrays[f"faces{k}"] = solid.faces.astype("i4")
    # OpenCV has blue first.
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    for name, pixels in parts.pictures.items():
        _, packed = cv2.imencode(".jpg", pixels[..., ::-1], quality)
        arrays[f"picture {name}"] = packed.ravel()
    memory = io.BytesIO()
    np.savez(memory, **arrays)  # type: ignore[arg-type]
    write_whole(folder / f"{entry.key}.npz", memory.getvalue())


@lru_cache(maxsize=160)
def _load(folder: Path, key: str) -> CatalogModel:
    try:
        with np.load(folder / f"{key}.npz", allow_pickle=False) as stored:
            arrays = dict(stored)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(
            f"The model {key} in {folder} cannot be read ({error}); delete the folder."
        ) from error
    # --- The entry, with tuples where JSON has lists ---
    facts = json.loads(str(arrays["facts"]))
    entry = facts["entry"]
    lights = tuple(tuple(place) for place in entry.pop("lights"))
    entry |= {name: tuple(entry[name]) for name in ("size", "turn")}
    looks = tuple(
        CatalogLook(**{**look, "colour": tuple(look["colour"])}) for look in facts["looks"]
    )
    # --- Pictures and solids ---
    pictures = {
        name.removeprefix("picture "): ColourPicture(as_roots(_decoded(packed)))
        for name, packed in arrays.items()
        if name.startswith("picture ")
    }
    solids = tuple(
        Solid(
            arrays[f"vertices{k}"].astype(float),
            arrays[f"faces{k}"],
            arrays[f"normals{k}"].astype(float),
            arrays[f"uv{k}"].astype(float),
        )
        for k in range(len(looks))
    )
    return CatalogModel(
        CatalogEntry(lights=lights, **entry),
        facts["role"],
        solids,
        looks,
        tuple(pictures.get(look.picture) for look in looks),
        tuple(LevelPlace(*place) for place in facts["places"]),
    )


def _decoded(packed: Array) -> Array:
    """[h, w, 3] uint8 sRGB of the bytes of a JPEG."""
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))[..., ::-1]


_ROOTS = np.sqrt(np.clip((np.arange(256) / 255.0) ** 2.2, 0.012, 0.85)) * 255


def as_roots(pixels: Array) -> Array:
    """[h, w, 3] uint8 sRGB as a `ColourPicture` holds them; blacks and whites are kept within real albedos."""
    return np.rint(_ROOTS).astype(np.uint8)[pixels]
