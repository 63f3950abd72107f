"""One photo's worth of work: invert it, save the scene, edit it. The same on every kind of worker."""

import gc
import hashlib
import time
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import materialist as mt
from materialist.batches.edits import edits_for, edits_key
from materialist.batches.options import BatchOptions
from materialist.batches.remote import fingerprint, is_url, local_copy
from materialist.batches.results import file_hash, package_hash, package_size
from materialist.color import srgb_levels
from materialist.errors import InputError
from materialist.io.atomic import ensure_writable, write_whole
from materialist.io.display import encoded
from materialist.io.package import check_room
from materialist.pipeline import peak_rss_mb
from materialist.types import Array, Progress, Scene

SINGLE_THREAD = {
    **dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OIDN_NUM_THREADS"), "1"
    ),
    "OIDN_SET_AFFINITY": "0",
}
"""Environment of every worker. Sums over several threads are rounded in another order, which a fit amplifies: with one
thread a photo's result does not depend on how many workers there are, and several workers use a processor better."""

OF_THE_SCENE = ("invert_seconds", "photo_version", "scene_bytes", "photo_hash")
"""Facts of the ledger that stay while a scene stays."""
THUMBNAIL = (240, 150)
"""Most width and height of a picture, pixels."""


@dataclass(frozen=True)
class PhotoTask:
    id: str
    name: str
    """Its results are NAME.scene, the edited photo NAME.FORMAT and thumbs/NAME.jpg."""
    location: str
    """Where the photo is read from: an absolute path, `example:NAME` or a URL."""
    runs: Path
    options: dict[str, Any] = field(default_factory=dict)
    """Keywords of the inversion; `{name}` in a text stands for the name."""
    batch_options: BatchOptions = field(default_factory=BatchOptions)
    kept: dict[str, Any] = field(default_factory=dict)
    """OF_THE_SCENE, where the package is there, whole and of this photo and these options: only the edit is missing."""

    @property
    def scene(self) -> Path:
        return self.runs / f"{self.name}.scene"

    @property
    def picture(self) -> Path:
        return self.runs / f"{self.name}.{self.batch_options.format}"

    def named_options(self) -> dict[str, Any]:
        return {
            k: v.replace("{name}", self.name) if isinstance(v, str) else v
            for k, v in self.options.items()
        }


def process(report: Progress, task: PhotoTask) -> dict[str, Any]:
    """Do a task. Returns the facts for the ledger and the summary; raises the errors of the inversion and the edit."""
    start = time.perf_counter()
    processor = time.process_time()
    scene, facts = _scene(task, report)
    pictures = [scene.photo.linear, scene.rerender]
    warnings = scene.warnings
    if task.batch_options.recipe is not None:
        begun = time.perf_counter()
        try:
            picture, notes = _edited(task, task.batch_options.recipe, scene, report)
        except Exception as error:
            # The scene is whole: with it in the ledger, the failure costs no second inversion.
            error.facts = {**facts, "scene_bytes": package_size(task.scene)}  # type: ignore[attr-defined]
            raise
        pictures.append(picture)
        warnings += notes
        facts |= {
            "edit_seconds": time.perf_counter() - begun,
            "picture_hash": file_hash(task.picture),
        }
        facts["picture"] = task.picture.name
        facts["edits"] = edits_key(
            task.batch_options.recipe, task.name, task.batch_options.spp, task.batch_options.quality
        )
    write_whole(task.runs / "thumbs" / f"{task.name}.jpg", _thumbnails(pictures))
    # --- What the ledger keeps of the result ---
    metrics = scene.report.metrics
    facts |= {
        "scene_hash": package_hash(task.scene),
        "scene_bytes": package_size(task.scene),
        "width": scene.camera.width,
        "height": scene.camera.height,
        "fov": scene.camera.fov,
        "predictor": scene.prior.predictor,
        "psnr": metrics.get("rerender_psnr_path"),
        "ssim": metrics.get("rerender_ssim_path"),
        "warnings": list(dict.fromkeys(warnings)),
    }
    # Memory is given back before the next photo of this worker.
    del scene, pictures
    gc.collect()
    peak = peak_rss_mb()
    facts["cpu_seconds"] = time.process_time() - processor
    return facts | {"seconds": time.perf_counter() - start, "peak_rss_mb": peak}


def _scene(task: PhotoTask, report: Progress) -> tuple[Scene, dict[str, Any]]:
    """The inverted photo, and what of OF_THE_SCENE is known."""
    # --- The scene of an earlier run, where only the edit is missing ---
    if task.kept:
        return mt.load_scene(task.scene), dict(task.kept)
    # --- The photo, under a name that does not depend on the machine's copy of it ---
    ensure_writable(task.scene, force=True)
    options = task.named_options()
    size = options.pop("size")
    fov = options.pop("fov")
    layer = options.pop("layer", None)
    report("read", 0, 1)
    photo_version = fingerprint(task.location)
    with local_copy(task.location) as file:
        source = file if str(file) != task.location else task.location
        photo = mt.read_photo(source, size=size, fov=fov, layer=layer)
    check_room(task.scene, photo)
    place = task.id if is_url(task.location) else task.location
    photo = replace(photo, path=place.encode("utf-8", "backslashreplace").decode("utf-8"))
    # --- Inverted and saved ---
    report("start", 0, 1)
    begun = time.perf_counter()
    module, _, attribute = task.batch_options.function.partition(":")
    scene = getattr(import_module(module), attribute)(
        photo, size=size, fov=fov, progress=report, **options
    )
    report("save", 0, 1)
    mt.save_scene(scene, task.scene, force=True)
    photo_hash = hashlib.sha256(photo.source or b"").hexdigest()
    seconds = time.perf_counter() - begun
    return scene, {
        "photo_hash": photo_hash,
        "photo_version": photo_version,
        "invert_seconds": seconds,
    }


def _edited(
    task: PhotoTask, edits: Path, scene: Scene, report: Progress
) -> tuple[Array, list[str]]:
    """[H0, W0, 3] the composite, which is also written, and the warnings of the edits."""
    from materialist.edits.core.notes import mean_change, noise_notes, warnings_since
    from materialist.edits.recipe import apply
    from materialist.edits.registry import picture_notes

    # --- The list of edits, and the composite in the photo's own format ---
    report("edit", 0, 1)
    seed = task.options["seed"]
    device = task.options["device"]
    try:
        edited = apply(scene, edits_for(edits, task.name), seed=seed, device=device)
    except InputError as error:
        raise InputError(f"The scene is there, but not its edit: {error}") from error
    picture = mt.composite(
        scene, edited, spp=task.batch_options.spp, seed=seed, device=device, progress=report
    )
    written = mt.save_image(
        task.picture, picture, scene, quality=task.batch_options.quality, force=True
    )
    change = mean_change(scene, picture)
    notes = [
        *warnings_since(scene, edited),
        *picture_notes(scene, edited, change),
        *noise_notes(),
        *written,
    ]
    return picture, notes


def _thumbnails(pictures: list[Array]) -> bytes:
    """A JPEG of pictures, linear [H, W, 3] of about one shape, small and side by side."""
    height, width = pictures[0].shape[:2]
    scale = min(1, THUMBNAIL[0] / width, THUMBNAIL[1] / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    gap = np.full((size[1], 4, 3), 255, np.uint8)
    strip = [gap]
    for picture in pictures:
        strip += [
            cv2.resize(srgb_levels(np.clip(picture, 0, 1)), size, interpolation=cv2.INTER_AREA),
            gap,
        ]
    return encoded(np.concatenate(strip[1:-1], 1), "JPEG", quality=85)
