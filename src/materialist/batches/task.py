"""One photo's worth of work: invert it, save the scene, edit it. The same on every kind of worker."""

from __future__ import annotations

import gc
import hashlib
import io
import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from materialist.batches import results
from materialist.batches.edits import edits_for, edits_key
from materialist.batches.remote import is_url, local_copy
from materialist.batches.results import file_hash, package_hash, whole_size
from materialist.color import srgb_levels
from materialist.errors import InputError, OutputError
from materialist.io.atomic import ensure_writable
from materialist.types import Array, Scene

INVERSION = "materialist.pipeline:invert"
"""The function that a worker calls on a photo, as module:function."""
SINGLE_THREAD = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OIDN_NUM_THREADS"), "1"),
    "OIDN_SET_AFFINITY": "0",
}
"""Environment of every worker. Sums over several threads are rounded in another order, which a fit amplifies: with one
thread a photo's result does not depend on how many workers there are, and several workers use a processor better."""

THUMBNAIL = (240, 150)
"""Largest width and height of a small picture, pixels."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class PhotoTask:
    """A photo, and how to process it."""

    id: str
    """The key of the photo in the ledger: its path below the folder, its line in the list, or its URL."""
    name: str
    """Its results are NAME.scene, NAME.png and thumbs/NAME.jpg."""
    location: str
    """Where the photo is read from: an absolute path, `example:NAME` or a URL."""
    runs: Path
    """Folder of the results."""
    options: dict[str, Any] = field(default_factory=dict)
    """Keywords of the inversion; `{name}` in a text stands for the name."""
    edits: Path | None = None
    """A list of edits to apply."""
    spp: int = 256
    """Paths per pixel of each rendering of the edit."""
    inverted: bool = False
    """The package is there, whole and of this photo and these options: only the edit is missing."""
    replace_scene: bool = False
    """A scene that lies there is of this batch, and may be replaced."""
    replace_picture: bool = False
    """The same of an edited photo."""
    function: str = INVERSION

    @property
    def scene(self) -> Path:
        """The scene package."""
        return results.scene_path(self.runs, self.name)

    @property
    def picture(self) -> Path:
        """The edited photo."""
        return results.picture_path(self.runs, self.name)

    def named_options(self) -> dict[str, Any]:
        """The options of the inversion, for this photo."""
        return {k: v.replace("{name}", self.name) if isinstance(v, str) else v for k, v in self.options.items()}


def process(report: Progress, task: PhotoTask) -> dict[str, Any]:
    """Do a task. Returns the facts for the ledger and the summary; raises the errors of the inversion and the edit."""
    start, processor = time.perf_counter(), time.process_time()
    if task.edits is not None and not task.replace_picture and task.picture.exists():
        raise OutputError(f"{task.picture} exists and is not of this batch; move it away.")
    scene, facts = _scene(task, report)
    pictures = [scene.photo.linear, scene.rerender]
    warnings = [*scene.photo.warnings, *scene.prior.warnings, *scene.report.warnings]
    if task.edits is not None:
        begun = time.perf_counter()
        try:
            picture, notes = _edited(task, task.edits, scene, report)
        except Exception as error:
            # The scene is whole: with it in the ledger, the failure costs no second inversion.
            error.facts = {**facts, "scene_bytes": whole_size(task.scene)}  # type: ignore[attr-defined]
            raise
        pictures.append(picture)
        warnings += notes
        facts |= {"edit_seconds": time.perf_counter() - begun, "picture_hash": file_hash(task.picture)}
        facts["edits"] = edits_key(task.edits, task.name, task.spp)
    _write_strip(results.thumbnail_path(task.runs, task.name), pictures)
    metrics = scene.report.metrics
    facts |= {
        "scene_hash": package_hash(task.scene), "scene_bytes": whole_size(task.scene),
        "width": scene.camera.width, "height": scene.camera.height, "fov": scene.camera.fov,
        "predictor": scene.prior.predictor, "psnr": metrics.get("rerender_psnr_path"),
        "ssim": metrics.get("rerender_ssim_path"), "warnings": list(dict.fromkeys(warnings)),
    }  # fmt: skip
    del scene, pictures
    gc.collect()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    facts["cpu_seconds"] = time.process_time() - processor
    return facts | {"seconds": time.perf_counter() - start, "peak_rss_mb": peak, "process": os.getpid()}


def _scene(task: PhotoTask, report: Progress) -> tuple[Scene, dict[str, Any]]:
    """The inverted photo, and the hash of its file."""
    from materialist.io.package import load_scene, save_scene
    from materialist.io.photo import read_photo

    if task.inverted:
        scene = load_scene(task.scene)
        return scene, {"photo_hash": _hash(scene.photo.source)}
    if not task.replace_scene and task.scene.exists():
        raise OutputError(f"{task.scene} exists and is not of this batch; move it away.")
    ensure_writable(task.scene, task.replace_scene)
    options = task.named_options()
    size, fov = options.pop("size", 512), options.pop("fov", "auto")
    report("read", 0, 1)
    with local_copy(task.location) as file:
        photo = read_photo(file if str(file) != task.location else task.location, size=size, fov=fov)
    place = task.id if is_url(task.location) else task.location
    photo = replace(photo, path=place.encode("utf-8", "backslashreplace").decode("utf-8"))
    report("start", 0, 1)
    begun = time.perf_counter()
    module, _, attribute = task.function.partition(":")
    scene = getattr(import_module(module), attribute)(photo, size=size, fov=fov, progress=report, **options)
    report("save", 0, 1)
    save_scene(scene, task.scene, force=task.replace_scene)
    return scene, {"photo_hash": _hash(photo.source), "invert_seconds": time.perf_counter() - begun}


def _edited(task: PhotoTask, edits: Path, scene: Scene, report: Progress) -> tuple[Array, list[str]]:
    """[H0, W0, 3] the composite, which is also written, and the warnings of the edits."""
    from materialist.edits.composite.composite import composite
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.recipe import apply

    report("edit", 0, 1)
    seed, device = task.options.get("seed", 0), task.options.get("device", "auto")
    try:
        edited = apply(scene, edits_for(edits, task.name), seed=seed, device=device)
    except InputError as error:
        raise InputError(f"The scene is there, but not its edit: {error}") from error
    picture = composite(scene, edited, spp=task.spp, seed=seed, device=device, progress=report)
    write_composite(task.picture, picture, scene.photo, force=True)
    return picture, warnings_since(scene, edited)


def _hash(source: bytes | None) -> str:
    return hashlib.sha256(source or b"").hexdigest()


def _write_strip(path: Path, pictures: list[Array]) -> None:
    """Small pictures of linear [H, W, 3] side by side, as a JPEG."""
    import cv2
    from PIL import Image

    columns: list[Array] = []
    for picture in pictures:
        scale = min(THUMBNAIL[0] / picture.shape[1], THUMBNAIL[1] / picture.shape[0])
        size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
        columns.append(srgb_levels(np.asarray(cv2.resize(np.clip(picture, 0, 1), size, interpolation=cv2.INTER_AREA))))
    height = max(one.shape[0] for one in columns)
    white = {"mode": "constant", "constant_values": 255}
    padded = [np.pad(one, ((0, height - one.shape[0]), (0, 4), (0, 0)), **white) for one in columns]  # type: ignore[call-overload]
    encoded = io.BytesIO()
    Image.fromarray(np.concatenate(padded, 1)[:, :-4]).save(encoded, "JPEG", quality=85)
    results.replace_file(path, encoded.getvalue())
