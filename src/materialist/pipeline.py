"""The main job, end to end: photo -> prior -> geometry -> light and materials -> scene."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

import numpy as np

from materialist import __version__, metrics
from materialist.color import CLIPPED, linear_to_srgb
from materialist.errors import InputError
from materialist.forks import check_process
from materialist.io.image import read_mask
from materialist.io.photo import HDR_CLIP, exposed
from materialist.io.photo_input import PhotoInput, photo_of
from materialist.keywords import InvertKeywords
from materialist.memory import kept_memory
from materialist.option_kinds import documented
from materialist.options import InvertOptions
from materialist.render.envmap import is_peaked
from materialist.residual import shading_residual
from materialist.spelling import spelled
from materialist.threads import fixed_threads
from materialist.types import Array, FitReport, Photo, Prediction, Prior, Scene

if TYPE_CHECKING:
    from materialist.fit.invert import FitResult

MIN_DEPTH = 0.05
"""Least median depth for which the path tracer's offsets are small."""


@documented(InvertOptions)
@fixed_threads()
@kept_memory()
def invert(
    photo: PhotoInput,
    options: InvertOptions | None = None,
    *,
    encoded: bool | None = None,
    progress: Callable[[str, int, int], Any] | None = None,
    on_stage: Callable[[str, Any], Any] | None = None,
    stop: Callable[[], bool] | None = None,
    **values: Unpack[InvertKeywords],
) -> Scene:
    """Decompose a photograph into geometry, materials and light.

    Args:
        photo: a file's name, `example:NAME`, an open file, a picture of Pillow's, an array [H, W, 3 or 4] or [H, W],
            or a Photo already read.
        encoded: of an array: True where it holds sRGB display values (uint8, uint16, or floats in [0, 1]); else it
            must be of floats, linear Rec.709, and is read as an EXR of them would be.
        options, values: see `options.InvertOptions`; `values` are fields of it, as in `invert(photo, size=256)`.
        progress: called as progress(stage, done, total).
        on_stage: called as on_stage(name, value) with "prior" (a Prediction), "light" ([h, 2h, 3]) and "materials" as
            soon as each is there; "materials" also before "prior", where the predictor has them before the depth. Last,
            before the path-traced re-rendering: "scene" (a Scene whose `rerender` is the fit's own picture, and whose
            report has no figures), where the fit ended with materials by the engine `transport`.
        stop: asked after each step of the fit; True ends it there, and the scene has what was found until then.

    Raises:
        InputError, SetupError: see docs/inputs.md; nothing is written.
    """
    check_process()
    start = last = time.perf_counter()
    stages: list[dict] = []

    def lap(name: str) -> None:
        nonlocal last
        now = time.perf_counter()
        stages.append({"name": name, "seconds": round(now - last, 3)})
        last = now

    # --- Read the photo, at working size ---
    choices = InvertOptions.merged(options, **values)
    preset = "paper" if choices.engine == "path" else choices.preset
    tick = progress or (lambda *_: None)
    tell = on_stage or (lambda *_: None)
    tick("read", 0, 1)
    if isinstance(photo, Photo):
        picture = exposed(photo)
    else:
        picture = photo_of(
            photo, encoded=encoded, size=choices.size, fov=choices.fov, layer=choices.layer
        )
    # A photo that was read elsewhere keeps its pixels; only its field of view is replaced.
    if isinstance(photo, Photo) and choices.fov != "auto":
        picture = replace(
            picture,
            camera=replace(picture.camera, fov=cast(float, choices.fov)),
            fov_source="option",
        )
    mask = _mask(choices.mask, picture)
    lap("read")

    # --- Predict the prior ---
    tick("predict", 0, 1)
    picture, prior = _prior(picture, choices, tell)
    lap("predict")
    if mask is not None and not (mask & (prior.depth > 0)).any():
        raise InputError("The mask lies wholly where there is no surface (sky); mark an object.")
    tell("prior", prior)

    # --- Fit light and materials; the renderer is loaded only now ---
    from materialist.render.variant import setup

    setup(choices.device)
    from materialist.fit import invert as fitting
    from materialist.fit.invert import FitSetup
    from materialist.fit.optimise import never
    from materialist.fit.settings import preset as named

    settings = choices.settings or named(preset, hdr=picture.hdr)
    if choices.steps is not None:
        settings = settings.at_most(choices.steps)
    fit_setup = FitSetup(
        picture,
        prior,
        settings,
        choices.completion,
        choices.engine,
        envmap_height=choices.envmap_size[1],
        tau=choices.tau,
        mask=mask,
        strategy=choices.strategy,
        seed=choices.seed,
        device=choices.device,
        spp=choices.spp,
    )
    lap("setup")

    # --- The scene, with where everything came from ---
    provenance = {
        "tool_version": __version__,
        "predictor": prior.predictor,
        "sources": prior.sources,
        "engine": choices.engine,
        "preset": preset,
        "steps": choices.steps,
        "completion": fit_setup.completion,
        "completion_asked": choices.completion,
        "tau": choices.tau,
        "strategy": choices.strategy,
        "mask": _named(mask),
        "settings": asdict(settings) if choices.settings else None,
        "seed": choices.seed,
        "size": choices.size,
        "envmap_size": list(choices.envmap_size),
        "fov": picture.camera.fov,
        "fov_source": picture.fov_source,
    }

    def scene_of(result: FitResult) -> Scene:
        report = _report(picture, prior, result, (*stages, *result.stages), start)
        return Scene(
            camera=picture.camera,
            photo=picture,
            prior=prior,
            materials=result.materials,
            normal=prior.normal,
            depth=prior.depth,
            geometry=result.geometry,
            envmap=result.envmap,
            rerender=result.rerender,
            report=report,
            provenance={**provenance, "spp": result.spp},
        )

    def on_fit_stage(name: str, value: Any) -> None:
        if name != "fitted":
            tell(name, value)
        elif on_stage is not None:
            on_stage("scene", scene_of(value))

    best = fitting.invert(fit_setup, progress=progress, on_stage=on_fit_stage, stop=stop or never)
    return scene_of(best)


def _prior(
    picture: Photo, choices: InvertOptions, tell: Callable[[str, Any], Any]
) -> tuple[Photo, Prediction]:
    """The photo as the predictor sees it, and the prior."""
    known = choices.prior
    if known is not None and not isinstance(known, Prediction | Prior):
        raise InputError(
            f"The prior is a {type(known).__name__}; give a materialist.Prior of arrays, or a Prediction."
        )
    # --- A whole prediction is the prior as it is ---
    if isinstance(known, Prediction):
        height, width = picture.linear.shape[:2]
        for values in (*vars(known.materials).values(), known.normal, known.depth):
            if values.shape[:2] != (height, width):
                raise InputError(
                    f"The prior has {values.shape[1]} x {values.shape[0]} pixels, the photo {width} x {height} at "
                    "working size; give maps of that size, or another working size."
                )
        return picture, known
    from materialist.predict import get_predictor
    from materialist.predict.protocol import MAPS

    # --- Else a predictor, with maps that are known in place of its own ---
    parts = {name: getattr(choices, name) for name in MAPS}
    source = get_predictor(choices.predictor, device=choices.device, prior=known, **parts)
    picture = _seen_by(source, picture)
    source.on_materials = partial(tell, "materials")
    result = source.predict(picture, seed=choices.seed)
    if not (result.depth > 0).any():
        raise InputError(
            'The predictor found no surface in the photo; give a depth map, as in `depth="maps:DIR"`.'
        )
    # --- A scene so small that the renderer's offsets show gets a warning ---
    middle = float(np.median(result.depth[result.depth > 0]))
    # Offsets of rays are absolute: in a tiny scene they are as large as its details.
    if middle < MIN_DEPTH:
        note = (
            f"Depth is {middle:.3g} in the median. Rays start about 0.0001 off a surface, which thins out its shadows; "
            f"give depth in a smaller unit, so that the median is {MIN_DEPTH:g} or more."
        )
        result = replace(result, warnings=(*result.warnings, note))
    return picture, result


@spelled
def render_scene(
    scene: Scene, *, spp: int = 64, denoise: bool = False, seed: int = 0, device: str = "auto"
) -> Array:
    """Path-trace a scene, with its bodies and lamps, from the photo's camera: [H, W, 3] float32 linear.

    `spp` counts camera rays a pixel. Denoising is for pictures only.
    """
    from materialist.edits.core.renderer import rendered

    if spp < 1:
        raise InputError(f"spp is {spp}; give at least 1 sample per pixel.")
    return rendered(scene, spp=spp, seed=seed, denoise=denoise, device=device)


def _report(
    picture: Photo, prior: Prediction, result: FitResult, stages: tuple[dict, ...], start: float
) -> FitReport:
    """Warnings of a fit, and figures of one whose paths were traced."""
    # --- Where the photo cannot be trusted, or the fit does not explain it ---
    clipped = _clipped(picture)
    notes = [*picture.warnings, *prior.warnings]
    if lost := int((~np.isfinite(result.rerender).all(-1)).sum()):
        notes.append(
            f"{lost} pixels of the re-rendering are no numbers; look for wild values in the depth and normals."
        )
    if clipped > 0.01:
        notes.append(
            f"{clipped:.0%} of the photo's pixels are clipped: light and albedo there are lower bounds."
        )
    if is_peaked(result.envmap):
        notes.append("The photo has hard light: its shadows may be baked into the albedo.")
    if result.stopped:
        last = [stage for stage in result.stages if "steps" in stage][-1]
        notes.append(
            f"The fit was stopped in its stage '{last['name']}', after {last['steps']} steps."
        )
    figures: dict[str, float] = {}
    if result.spp:
        figures = {
            **_figures(picture, prior, result),
            "clipped_fraction": clipped,
            "total_seconds": time.perf_counter() - start,
            "peak_rss_mb": peak_rss_mb(),
        }
    return FitReport(stages=stages, metrics=figures, warnings=tuple(notes))


def _clipped(picture: Photo) -> float:
    """The share of a photo's pixels that are clipped."""
    white = HDR_CLIP if picture.hdr else CLIPPED
    return float((picture.linear >= white).any(-1).mean())


def _figures(picture: Photo, prior: Prediction, result: FitResult) -> dict[str, float]:
    """How near the re-rendering is to the photo, and how far the maps moved from the prior."""
    # Two halves with independent noise: their difference tells how much of the error is noise.
    halves = [np.nan_to_num(half, posinf=0) for half in result.halves]
    rerender = (halves[0] + halves[1]) / 2
    surface = prior.depth > 0
    # How far the fit moved from the prior: mean L1 over the surface.
    distance = {
        f"prior_l1_{name}": float(
            np.abs(getattr(result.materials, name) - getattr(prior.materials, name))[surface].mean()
        )
        for name in ("albedo", "roughness", "metallic")
    }
    residual = np.abs(linear_to_srgb(rerender) - linear_to_srgb(picture.linear)).max(-1)
    return {
        # Noise in the re-rendering is no error of the fit.
        "rerender_psnr_path": metrics.psnr_without_noise(halves[0], halves[1], picture.linear),
        "rerender_ssim_path": metrics.ssim_without_noise(halves[0], halves[1], picture.linear),
        "rerender_psnr_residual": metrics.psnr(
            rerender * shading_residual(picture.linear, rerender), picture.linear
        ),
        **distance,
        "poor_fraction": float((residual > 0.1).mean()),
    }


def peak_rss_mb() -> float:
    """The most memory that this process has held, MB; macOS counts in bytes, Linux in kB."""
    # `ru_maxrss` has another unit on each system.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (
        2**20 if sys.platform == "darwin" else 2**10
    )


def _named(mask: Array | None) -> dict[str, Any] | None:
    """What the provenance keeps of a mask [H, W] bool: its size, and by what to know it again."""
    if mask is None:
        return None
    packed = np.packbits(np.asarray(mask, bool))
    return {"pixels": int(np.sum(mask)), "sha256": sha256(packed.tobytes()).hexdigest()}


def _seen_by(source, picture: Photo) -> Photo:
    """The photo with the field of view of the predictor whose depth is used, unless the caller chose one."""
    angle = getattr(source, "field_of_view", None)
    if angle is None or picture.fov_source == "option":
        return picture
    known = picture.camera.fov
    notes = picture.warnings
    if picture.fov_source == "exif" and abs(known - angle) > 0.1 * angle:
        notes = (
            *notes,
            f"EXIF says a field of view of {known:.1f} degrees, the depth was made with {angle:.1f}.",
        )
    return replace(
        picture, camera=replace(picture.camera, fov=angle), fov_source="predictor", warnings=notes
    )


def _mask(mask: Array | str | Path | None, picture: Photo) -> Array | None:
    """[H, W] bool of an array or a file. Raises InputError for one of another size or type, or empty."""
    if mask is None:
        return None
    shape = picture.linear.shape[:2]
    if isinstance(mask, str | Path):
        mask = read_mask(mask, shape, picture.original.shape[:2])
    if mask.shape != shape:
        raise InputError(
            f"Mask is {mask.shape}, the photo at working size is {shape} (rows, columns)."
        )
    if mask.dtype != bool:
        raise InputError(f"Mask holds {mask.dtype}; give truth values, for example mask > 0.5.")
    if not mask.any():
        raise InputError("The mask is empty; mark at least one pixel.")
    return mask
