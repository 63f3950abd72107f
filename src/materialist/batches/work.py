"""What a worker does with one photo: invert it, save the scene, edit it. The same on every kind of worker."""

from __future__ import annotations

import gc
import hashlib
import io
import os
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from materialist.batches.edits import edits_for, edits_key
from materialist.batches.job import Job, thumbnail_path
from materialist.batches.packages import file_hash, package_hash, whole_size
from materialist.batches.remote import is_url, local_copy
from materialist.color import srgb_levels
from materialist.errors import InputError, OutputError
from materialist.io.target import ensure_writable
from materialist.types import Array, Scene

Tick = Callable[[str, int, int], None]

ONE_THREAD = {
    name: "1"
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OIDN_NUM_THREADS", "OIDN_SET_AFFINITY")
} | {"OIDN_SET_AFFINITY": "0"}
"""Environment of every worker. Sums over several threads are rounded in another order, which a fit amplifies: with one
thread a photo's result does not depend on how many workers there are, and several workers use a processor better."""

THUMBNAIL = (240, 150)
"""Largest width and height of a small picture, pixels."""


def process(job: Job, tick: Tick) -> dict[str, Any]:
    """Do a job. Returns what the ledger and the summary say of it; raises what the inversion or the edit raises."""
    start, processor = time.perf_counter(), time.process_time()
    if job.edits is not None and not job.replace_picture and job.picture.exists():
        raise OutputError(f"{job.picture} exists and is not of this batch; move it away.")
    scene, facts = _scene(job, tick)
    strip = [scene.photo.linear, scene.rerender]
    warnings = [*scene.photo.warnings, *scene.prior.warnings, *scene.report.warnings]
    if job.edits is not None:
        begun = time.perf_counter()
        try:
            picture, notes = _edited(job, scene, tick)
        except Exception as error:
            # The scene is whole: written down with it, the failure costs no second inversion.
            error.facts = {**facts, "scene_bytes": whole_size(job.scene)}  # type: ignore[attr-defined]
            raise
        strip.append(picture)
        warnings += notes
        facts |= {"edit_seconds": time.perf_counter() - begun, "picture_hash": file_hash(job.picture)}
        facts["edits"] = edits_key(job.edits, job.name, job.spp)
    _write_strip(thumbnail_path(job.runs, job.name), strip)
    metrics = scene.report.metrics
    facts |= {
        "scene_hash": package_hash(job.scene), "scene_bytes": whole_size(job.scene),
        "width": scene.camera.width, "height": scene.camera.height, "fov": scene.camera.fov,
        "predictor": scene.prior.predictor, "psnr": metrics.get("rerender_psnr_path"),
        "ssim": metrics.get("rerender_ssim_path"), "warnings": list(dict.fromkeys(warnings)),
    }  # fmt: skip
    del scene, strip
    gc.collect()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    facts["cpu_seconds"] = time.process_time() - processor
    return facts | {"seconds": time.perf_counter() - start, "peak_rss_mb": peak, "process": os.getpid()}


def _scene(job: Job, tick: Tick) -> tuple[Scene, dict[str, Any]]:
    """The inverted photo, and the hash of its file."""
    from materialist.io.package import load_scene, save_scene
    from materialist.io.photo import read_photo

    if job.inverted:
        scene = load_scene(job.scene)
        return scene, {"photo_hash": _hash(scene.photo.source)}
    if not job.replace and job.scene.exists():
        raise OutputError(f"{job.scene} exists and is not of this batch; move it away.")
    ensure_writable(job.scene, job.replace)
    options = job.named_options()
    size, fov = options.pop("size", 512), options.pop("fov", "auto")
    tick("read", 0, 1)
    with local_copy(job.location) as file:
        photo = read_photo(file if str(file) != job.location else job.location, size=size, fov=fov)
    place = job.id if is_url(job.location) else job.location
    photo = replace(photo, path=place.encode("utf-8", "backslashreplace").decode("utf-8"))
    tick("start", 0, 1)
    begun = time.perf_counter()
    scene = _function(job.function)(photo, size=size, fov=fov, progress=tick, **options)
    tick("save", 0, 1)
    save_scene(scene, job.scene, force=job.replace)
    return scene, {"photo_hash": _hash(photo.source), "invert_seconds": time.perf_counter() - begun}


def _edited(job: Job, scene: Scene, tick: Tick) -> tuple[Array, list[str]]:
    """[H0, W0, 3] the composite, which is also written, and the warnings of the edits."""
    from materialist.edits.composite.composite import composite
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.recipe import apply

    assert job.edits is not None
    tick("edit", 0, 1)
    seed, device = job.options.get("seed", 0), job.options.get("device", "auto")
    try:
        edited = apply(scene, edits_for(job.edits, job.name), seed=seed, device=device)
    except InputError as error:
        raise InputError(f"The scene is there, but not its edit: {error}") from error
    picture = composite(scene, edited, spp=job.spp, seed=seed, device=device, progress=tick)
    write_composite(job.picture, picture, scene.photo, force=True)
    return picture, warnings_since(scene, edited)


def _hash(source: bytes | None) -> str:
    return hashlib.sha256(source or b"").hexdigest()


def _function(name: str) -> Callable[..., Scene]:
    """The function of `module:function`."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def _write_strip(path: Path, pictures: list[Array]) -> None:
    """Small pictures of linear [H, W, 3] side by side, as a JPEG."""
    import cv2
    from PIL import Image

    small = []
    for picture in pictures:
        scale = min(THUMBNAIL[0] / picture.shape[1], THUMBNAIL[1] / picture.shape[0])
        size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
        resized = cv2.resize(np.clip(picture, 0, 1), size, interpolation=cv2.INTER_AREA)
        small.append(srgb_levels(np.asarray(resized)))
    height = max(one.shape[0] for one in small)
    gap = np.full((height, 4, 3), 255, np.uint8)
    columns: list[Array] = []
    for one in small:
        padded = np.full((height, one.shape[1], 3), 255, np.uint8)
        padded[: one.shape[0]] = one
        columns += [padded, gap]
    encoded = io.BytesIO()
    Image.fromarray(np.concatenate(columns[:-1], 1)).save(encoded, "JPEG", quality=85)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(exist_ok=True)
        temporary.write_bytes(encoded.getvalue())
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error
