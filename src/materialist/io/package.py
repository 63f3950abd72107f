"""The scene package: a folder that holds everything of a Scene (format: docs/conventions.md)."""

import base64
import errno
import json
import math
import os
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist import __version__
from materialist.errors import OutputError, SceneError
from materialist.io.atomic import (
    MARKER,
    files_below,
    interrupted_replacement,
    partial,
    whole_folder,
    writing,
)
from materialist.io.exr import read_exr, write_exr
from materialist.io.image import write_png
from materialist.io.manifest import (
    LIGHT,
    MAPS,
    MAX_BYTES,
    check_files,
    inside,
    package_map,
    spread_file,
)
from materialist.io.meshes import read_bodies, read_ply, write_bodies, write_ply
from materialist.io.overview import overview
from materialist.io.photo import decode_photo
from materialist.plain import plain
from materialist.residual import shading_residual
from materialist.spelling import spelled
from materialist.types import (
    Array,
    Camera,
    FitReport,
    Geometry,
    Lamp,
    Materials,
    Photo,
    Prediction,
    Scene,
)

FORMAT = "materialist-scene"
VERSION = 1
_JSON_BYTES = 64_000_000
BYTES_A_PIXEL = 250
"""Of the working size that a package takes, beside the photo's file; 230 to 265 of ten photos."""
FIXED_BYTES = 1_700_000
"""Of the light and the overview, which a small photo has as well; 1.76 to 2.5 MB of five photos."""


def check_room(path: str | Path, photo: Photo) -> None:
    """Ask before an inversion whether the disk has room for the scene of a photo at PATH. Raises OutputError."""
    needed = FIXED_BYTES + BYTES_A_PIXEL * photo.linear[..., 0].size + len(photo.source or b"")
    free = shutil.disk_usage(Path(path).absolute().parent).free
    if free < needed:
        raise OutputError(
            f"{path} cannot be written: {os.strerror(errno.ENOSPC).lower()}: the scene takes about {needed:,} bytes, "
            f"and {free:,} are free."
        )


@spelled
def save_scene(scene: Scene, path: str | Path, *, force: bool = False) -> None:
    """Write the scene as a package folder at PATH, whole or not at all; `load_scene` gives every array back exactly.

    Raises OutputError when PATH exists and `force` is not given, when `force` would replace something that is not a
    scene package, or when the disk is full or read-only; nothing half-written stays behind.
    """
    with whole_folder(path, force) as folder:
        _write(scene, folder)


def replace_rerender(scene: Scene, path: str | Path) -> None:
    """Put the scene's re-rendering, its report and its provenance in place of those of its package at PATH.

    Each file is replaced whole, so that the package can be read meanwhile. Raises SceneError, OutputError.
    """
    folder = Path(path)
    meta = _read_meta(folder)
    temporary = partial(folder, "")
    try:
        with writing(path, temporary):
            (temporary / "maps").mkdir(parents=True)
            _write_rerender(scene, temporary)
            _write_json(temporary / MARKER, {**meta, "provenance": scene.provenance})
            # The report and scene.json last: where they are new, so is the picture.
            for file in sorted(files_below(temporary), key=lambda name: name.endswith(".json")):
                os.replace(temporary / file, folder / file)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def with_rerender(scene: Scene, path: str | Path) -> Scene:
    """The scene with the re-rendering, report and provenance of its package at PATH. Raises SceneError."""
    folder = Path(path)
    return replace(
        scene,
        rerender=package_map(folder / "rerender.exr", scene.rerender.shape),
        report=_read_report(folder),
        provenance=_read_meta(folder)["provenance"],
    )


@spelled
def load_scene(path: str | Path, *, most: float = MAX_BYTES) -> Scene:
    """Read a scene package of at most `most` bytes once decoded, by the headers of its files.

    Raises SceneError when it is missing, incomplete, damaged, too large or of an unknown version.
    """
    try:
        return _read(Path(path), most)
    except (SceneError, MemoryError):
        raise
    except Exception as error:  # readers of damaged files raise anything
        raise SceneError(
            f"The scene package {path} cannot be read: {' '.join(str(error).split())}"
        ) from error


def _read(folder: Path, most: float) -> Scene:
    # --- What scene.json says, checked before anything is decoded ---
    meta = _read_meta(folder)
    camera = Camera(**meta["camera"])
    photo = meta["photo"]
    prior = meta["prior"]
    # By headers alone: nothing is decoded that would not fit into memory.
    check_files(folder, Path(photo["original"]).name, len(meta.get("bodies", ())), most)
    # --- Maps, those of the prior and those of the fit ---
    shape = (camera.height, camera.width)
    prior_maps = _read_maps(folder / "prior", shape)
    fitted_maps = _read_maps(folder / "maps", shape)
    light = package_map(folder / LIGHT) if (folder / LIGHT).exists() else None
    if light is not None and light.shape[2:] != (4,):
        raise SceneError(
            f"{folder / LIGHT} is {list(light.shape)}, and needs 4 channels; the package is damaged."
        )
    spread = {
        key: package_map(folder / spread_file(key), shape)
        for key in MAPS
        if (folder / spread_file(key)).exists()
    }
    # Stored from 0 on, see `_write`.
    label = package_map(folder / "plane_label.png", shape).astype(np.int16) - 1
    return Scene(
        camera=camera,
        photo=_read_photo(folder, photo, shape),
        materials=_materials(fitted_maps),
        normal=fitted_maps["normal"],
        depth=fitted_maps["depth"],
        prior=Prediction(
            materials=_materials(prior_maps),
            normal=prior_maps["normal"],
            depth=prior_maps["depth"],
            predictor=_typed(prior["predictor"], str, "predictor"),
            warnings=_texts(prior["warnings"]),
            sources=prior.get("sources", {}),
            light=light,
            spread=spread,
        ),
        geometry=Geometry(
            mesh=read_ply(folder / "mesh.ply", math.prod(shape)),
            plane_label=label.astype(np.int8),
        ),
        envmap=package_map(folder / "envmap.exr"),
        rerender=package_map(folder / "rerender.exr", (*shape, 3)),
        report=_read_report(folder),
        provenance=meta["provenance"],
        lamps=tuple(Lamp(**entry) for entry in meta.get("lamps", ())),
        bodies=read_bodies(folder, meta.get("bodies", [])),
    )


def _write(scene: Scene, folder: Path) -> None:
    photo = scene.photo
    # --- The photo, as it was given and at working size ---
    write_exr(folder / "photo.exr", photo.linear)
    write_png(folder / "photo.png", photo.linear)
    original = _write_original(photo, folder)
    # --- What the predictor said, and what the fit made of it ---
    for name, maps in (("prior", scene.prior), ("maps", scene)):
        (folder / name).mkdir()
        for key, array in {
            **vars(maps.materials),
            "normal": maps.normal,
            "depth": maps.depth,
        }.items():
            write_exr(folder / name / f"{key}.exr", array)
    for key, array in scene.prior.spread.items():
        write_exr(folder / spread_file(key), array)
    if scene.prior.light is not None:
        write_exr(folder / LIGHT, scene.prior.light)
    # --- Light and geometry ---
    write_exr(folder / "envmap.exr", scene.envmap)
    write_ply(folder / "mesh.ply", scene.geometry.mesh)
    # Labels -1 .. 126 become 0 .. 127, so that an image viewer shows them as grey levels.
    write_png(
        folder / "plane_label.png",
        (scene.geometry.plane_label.astype(np.int16) + 1).astype(np.uint8),
    )
    _write_rerender(scene, folder)
    # --- scene.json last: a folder without it is no package ---
    meta = _meta(scene, original)
    if scene.bodies:
        meta["bodies"] = write_bodies(folder, scene.bodies)
    _write_json(folder / MARKER, meta)


def _write_rerender(scene: Scene, folder: Path) -> None:
    """The re-rendering and all that follows from it: the residual, what a person looks at, and the report."""
    residual = shading_residual(scene.photo.linear, scene.rerender)
    write_exr(folder / "maps/shading_residual.exr", residual)
    write_exr(folder / "rerender.exr", scene.rerender)
    write_png(folder / "rerender.png", scene.rerender)
    write_png(folder / "overview.png", overview(scene))
    report = scene.report  # its metrics lie flat beside `stages` and `warnings`
    warnings = list(dict.fromkeys(report.warnings))
    _write_json(
        folder / "report.json",
        {**report.metrics, "stages": list(report.stages), "warnings": warnings},
    )


def _meta(scene: Scene, original: str) -> dict[str, Any]:
    photo = scene.photo
    return {
        "format": FORMAT,
        "version": VERSION,
        "camera": asdict(scene.camera),
        "size": [scene.camera.width, scene.camera.height],
        "photo": {
            "original": original,
            "has_source": photo.source is not None,
            "camera": asdict(photo.camera),
            **{
                key: getattr(photo, key)
                for key in ("hdr", "fov_source", "path", "deep", "stops", "layer", "warnings")
            },
            "exif": None if photo.exif is None else base64.b64encode(photo.exif).decode("ascii"),
        },
        "prior": {key: getattr(scene.prior, key) for key in ("predictor", "warnings", "sources")},
        "provenance": {
            "tool_version": __version__,
            **scene.provenance,
        },  # one that was read keeps its own
        **({"lamps": [asdict(lamp) for lamp in scene.lamps]} if scene.lamps else {}),
    }


def _write_original(photo: Photo, folder: Path) -> str:
    """The input file untouched, or, for a photo that came from memory, its pixels; returns the file name."""
    if photo.source is None:
        write_exr(folder / "original.exr", photo.original)
        return "original.exr"
    suffix = Path(photo.path or "").suffix.lower() or _suffix_of(photo.source)
    (folder / f"original{suffix}").write_bytes(photo.source)
    return f"original{suffix}"


def _suffix_of(source: bytes) -> str:
    """File suffix by content, for photos without a file name."""
    # The first bytes of the formats that photos come in.
    known = {
        b"\x89PNG": ".png",
        b"\xff\xd8": ".jpg",
        b"\x76\x2f\x31\x01": ".exr",
        b"#?RA": ".hdr",
        b"RIFF": ".webp",
    }
    return next((suffix for mark, suffix in known.items() if source.startswith(mark)), ".img")


def _read_photo(folder: Path, meta: dict[str, Any], shape: tuple[int, int]) -> Photo:
    """The Photo; its native pixels are decoded again from the original file."""
    file = folder / Path(meta["original"]).name
    stops = int(meta.get("stops", 0))
    if meta["has_source"]:
        # Decoded again instead of stored: the file is smaller, and exact.
        original = decode_photo(file, meta.get("layer")).exposed(stops)
        source = file.read_bytes()
    else:
        original = read_exr(file)
        source = None
    exif = meta.get("exif")
    return Photo(
        linear=package_map(folder / "photo.exr", (*shape, 3)),
        camera=Camera(**meta["camera"]),
        original=original,
        hdr=meta["hdr"],
        fov_source=_typed(meta["fov_source"], str, "fov_source"),
        path=meta["path"],
        source=source,
        warnings=_texts(meta["warnings"]),
        deep=bool(meta.get("deep", False)),
        stops=stops,
        layer=meta.get("layer"),
        exif=None if exif is None else base64.b64decode(exif, validate=True),
    )


def _read_maps(folder: Path, shape: tuple[int, int]) -> dict[str, Array]:
    """Each of `MAPS` by its name: albedo and normal [H, W, 3], the others [H, W]."""
    maps = {}
    for name in MAPS:
        channels = (3,) if name in ("albedo", "normal") else ()
        maps[name] = package_map(folder / f"{name}.exr", (*shape, *channels))
    return maps


def _materials(maps: dict[str, Array]) -> Materials:
    return Materials(
        albedo=maps["albedo"],
        roughness=maps["roughness"],
        metallic=maps["metallic"],
    )


def _read_meta(folder: Path) -> dict[str, Any]:
    """scene.json, checked for kind and version."""
    if (aside := interrupted_replacement(folder)) is not None:
        raise SceneError(
            f"An interrupted save left {folder} without its scene; get it back: mv {aside} {folder}"
        )
    # --- Is it a package, of this program and version? ---
    if not folder.is_dir():
        raise SceneError(
            f"There is no scene package at {folder}; make one with: materialist invert PHOTO -o {folder}"
        )
    meta = _read_json(folder, MARKER)
    if meta.get("format") != FORMAT:
        raise SceneError(f"{folder / MARKER} does not describe a scene of this program.")
    if meta.get("version") != VERSION:
        raise SceneError(
            f"{folder} has format version {meta.get('version')}, this program reads version {VERSION}; "
            "open it with the version that wrote it, or invert the photo again."
        )
    _typed(meta["provenance"], dict, "provenance")
    return meta


def _read_json(folder: Path, name: str) -> dict[str, Any]:
    path = inside(folder, name)
    if path.stat().st_size > _JSON_BYTES:
        raise SceneError(
            f"{path} has more than {_JSON_BYTES / 1e6:g} MB; the scene package is damaged."
        )
    try:
        content = json.loads(path.read_text("utf-8"), parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path} is damaged ({error}); save the scene again.") from error
    if not isinstance(content, dict):
        raise SceneError(f"{path} is damaged (not an object); save the scene again.")
    return content


def _finite(text: str) -> float:
    """A number of a JSON file. Raises ValueError for NaN, and for what is too large."""
    if not math.isfinite(number := float(text)):
        raise ValueError(f"{text} is not a finite number")
    return number


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(plain(content), indent=1, ensure_ascii=False) + "\n"
    # Bytes of a file name that are no UTF-8 become JSON's own escapes.
    path.write_text(text, "utf-8", "backslashreplace")


def _read_report(folder: Path) -> FitReport:
    content = _read_json(folder, "report.json")
    metrics = {
        k: math.nan if v is None else _typed(v, (int, float), k)
        for k, v in content.items()
        if k not in ("stages", "warnings")
    }
    return FitReport(
        stages=tuple(content.get("stages", ())),
        metrics=metrics,
        warnings=_texts(content.get("warnings", [])),
    )


def _texts(values: Any) -> tuple[str, ...]:
    """The warnings of a JSON file. Raises SceneError unless they are a list of texts."""
    return tuple(_typed(value, str, "warnings") for value in _typed(values, list, "warnings"))


def _typed(value: Any, kind: type | tuple[type, ...], name: str) -> Any:
    """A value of a JSON file under its name. Raises SceneError for another type of value."""
    if not isinstance(value, kind):
        raise SceneError(
            f"The {name} of the scene cannot be {value!r:.60}; the package is damaged."
        )
    return value
