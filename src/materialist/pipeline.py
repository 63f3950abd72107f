"""The main job, end to end: photo -> prior -> geometry -> light and materials -> scene."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

import numpy as np

from materialist import __version__, metrics
from materialist.color import CLIPPED, linear_to_srgb
from materialist.errors import InputError
from materialist.forks import check_process
from materialist.io.given import PhotoInput, photo_of
from materialist.io.image import read_mask
from materialist.io.photo import HDR_CLIP, exposed
from materialist.keywords import InvertKeywords
from materialist.metrics.residual import shading_residual
from materialist.option_kinds import documented
from materialist.options import InvertOptions
from materialist.render.envmap import is_peaked
from materialist.types import Array, FitReport, Photo, Prediction, Prior, Scene

if TYPE_CHECKING:
    from materialist.fit.invert import FitResult

SMALL = 0.05
"""Least median depth for which the path tracer's offsets are small."""


@documented(InvertOptions)
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
            soon as each is there.
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

    wanted = InvertOptions.given(options, **values)
    preset = "paper" if wanted.engine == "path" else wanted.preset
    tick = progress or (lambda *_: None)
    tell = on_stage or (lambda *_: None)
    tick("read", 0, 1)
    if isinstance(photo, Photo):
        picture = exposed(photo)
    else:
        picture = photo_of(
            photo, encoded=encoded, size=wanted.size, fov=wanted.fov, layer=wanted.layer
        )
    if isinstance(photo, Photo) and wanted.fov != "auto":
        picture = replace(
            picture,
            camera=replace(picture.camera, fov=cast(float, wanted.fov)),
            fov_source="option",
        )
    mask = _mask(wanted.mask, picture)
    lap("read")
    tick("predict", 0, 1)
    picture, prior = _prior(picture, wanted)
    lap("predict")
    if mask is not None and not (mask & (prior.depth > 0)).any():
        raise InputError("The mask lies wholly where there is no surface (sky); mark an object.")
    tell("prior", prior)

    from materialist.render.variant import setup

    setup(wanted.device)
    from materialist.fit import invert as fitting
    from materialist.fit.invert import FitSetup
    from materialist.fit.optimise import never
    from materialist.fit.settings import preset as named

    settings = wanted.settings or named(preset, hdr=picture.hdr)
    if wanted.steps is not None:
        settings = settings.at_most(wanted.steps)
    fit_setup = FitSetup(
        picture,
        prior,
        settings,
        wanted.completion,
        wanted.engine,
        envmap_height=wanted.envmap_size[1],
        tau=wanted.tau,
        mask=mask,
        strategy=wanted.strategy,
        seed=wanted.seed,
        device=wanted.device,
        spp=wanted.spp,
    )
    lap("setup")
    best = fitting.invert(fit_setup, progress=progress, found=tell, stop=stop or never)
    report = _report(picture, prior, best, (*stages, *best.stages), start)
    return Scene(
        camera=picture.camera,
        photo=picture,
        prior=prior,
        materials=best.materials,
        normal=prior.normal,
        depth=prior.depth,
        geometry=best.geometry,
        envmap=best.envmap,
        rerender=best.rerender,
        report=report,
        provenance={
            "tool_version": __version__,
            "predictor": prior.predictor,
            "sources": prior.sources,
            "engine": wanted.engine,
            "preset": preset,
            "steps": wanted.steps,
            "completion": fit_setup.completion,
            "completion_asked": wanted.completion,
            "tau": wanted.tau,
            "strategy": wanted.strategy,
            "mask": _named(mask),
            "settings": asdict(settings) if wanted.settings else None,
            "seed": wanted.seed,
            "spp": best.spp,
            "size": wanted.size,
            "envmap_size": list(wanted.envmap_size),
            "fov": picture.camera.fov,
            "fov_source": picture.fov_source,
        },
    )


def _prior(picture: Photo, wanted: InvertOptions) -> tuple[Photo, Prediction]:
    """The photo as the predictor sees it, and the prior."""
    known = wanted.prior
    if known is not None and not isinstance(known, Prediction | Prior):
        raise InputError(
            f"The prior is a {type(known).__name__}; give a materialist.Prior of arrays, or a Prediction."
        )
    if isinstance(known, Prediction):
        given, (height, width) = known, picture.linear.shape[:2]
        for values in (*vars(given.materials).values(), given.normal, given.depth):
            if values.shape[:2] != (height, width):
                raise InputError(
                    f"The prior has {values.shape[1]} x {values.shape[0]} pixels, the photo {width} x {height} at "
                    "working size; give maps of that size, or another working size."
                )
        return picture, given
    from materialist.predict import get_predictor

    parts = {
        name: getattr(wanted, name)
        for name in ("albedo", "roughness", "metallic", "normal", "depth")
    }
    source = get_predictor(wanted.predictor, device=wanted.device, prior=known, **parts)
    picture = _seen_by(source, picture)
    prediction = source.predict(picture, seed=wanted.seed)
    if not (prediction.depth > 0).any():
        raise InputError(
            'The predictor found no surface in the photo; give a depth map, as in `depth="maps:DIR"`.'
        )
    middle = float(np.median(prediction.depth[prediction.depth > 0]))
    if middle < SMALL:
        note = (
            f"Depth is {middle:.3g} in the median. Rays start about 0.0001 off a surface, which thins out its shadows; "
            f"give depth in a smaller unit, so that the median is {SMALL:g} or more."
        )
        prediction = replace(prediction, warnings=(*prediction.warnings, note))
    return picture, prediction


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
    picture: Photo, prior: Prediction, found: FitResult, stages: tuple[dict, ...], start: float
) -> FitReport:
    materials = found.materials
    halves = [np.nan_to_num(half, posinf=0) for half in found.halves]
    rerender = (halves[0] + halves[1]) / 2
    surface = prior.depth > 0
    distance = {
        f"prior_l1_{name}": float(
            np.abs(getattr(materials, name) - getattr(prior.materials, name))[surface].mean()
        )
        for name in ("albedo", "roughness", "metallic")
    }
    residual = np.abs(linear_to_srgb(rerender) - linear_to_srgb(picture.linear)).max(-1)
    white = HDR_CLIP if picture.hdr else CLIPPED
    clipped = float((picture.linear >= white).any(-1).mean())
    notes = [*picture.warnings, *prior.warnings]
    if lost := int((~np.isfinite(found.rerender).all(-1)).sum()):
        notes.append(
            f"{lost} pixels of the re-rendering are no numbers; look for wild values in the depth and normals."
        )
    if clipped > 0.01:
        notes.append(
            f"{clipped:.0%} of the photo's pixels are clipped: light and albedo there are lower bounds."
        )
    if is_peaked(found.envmap):
        notes.append("The photo has hard light: its shadows may be baked into the albedo.")
    if found.stopped:
        last = [stage for stage in found.stages if "steps" in stage][-1]
        notes.append(
            f"The fit was stopped in its stage '{last['name']}', after {last['steps']} steps."
        )
    poor = float((residual > 0.1).mean())
    return FitReport(
        stages=stages,
        metrics={
            "rerender_psnr_path": metrics.psnr_without_noise(halves[0], halves[1], picture.linear),
            "rerender_ssim_path": metrics.ssim_without_noise(halves[0], halves[1], picture.linear),
            "rerender_psnr_residual": metrics.psnr(
                rerender * shading_residual(picture.linear, rerender), picture.linear
            ),
            **distance,
            "clipped_fraction": clipped,
            "poor_fraction": poor,
            "total_seconds": time.perf_counter() - start,
            "peak_rss_mb": peak_rss_mb(),
        },
        warnings=tuple(notes),
    )


def peak_rss_mb() -> float:
    """The most memory that this process has held, MB; macOS counts in bytes, Linux in kB."""
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


def _mask(given: Array | str | Path | None, picture: Photo) -> Array | None:
    """[H, W] bool of an array or a file. Raises InputError for one of another size or type, or empty."""
    if given is None:
        return None
    shape = picture.linear.shape[:2]
    if isinstance(given, str | Path):
        given = read_mask(given, shape, picture.original.shape[:2])
    if given.shape != shape:
        raise InputError(
            f"Mask is {given.shape}, the photo at working size is {shape} (rows, columns)."
        )
    if given.dtype != bool:
        raise InputError(f"Mask holds {given.dtype}; give truth values, for example mask > 0.5.")
    if not given.any():
        raise InputError("The mask is empty; mark at least one pixel.")
    return given
