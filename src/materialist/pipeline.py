"""The main job, end to end: photo -> prior -> geometry -> light and materials -> scene."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterable
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from materialist import metrics
from materialist.color import linear_to_srgb
from materialist.errors import InputError
from materialist.io.photo import HDR_CLIP
from materialist.render.envmap import is_peaked
from materialist.types import Array, FitReport, Photo, Prediction, Scene

if TYPE_CHECKING:
    from materialist.fit.invert import FitResult

STRATEGIES = ("default", "white-light-first")
ENGINES = ("transport", "path")
SMALL = 0.05
"""Least median depth for which the path tracer's offsets are small."""


def invert(
    photo: str | Path | Photo,
    *,
    predictor: str = "auto",
    albedo: str | None = None,
    roughness: str | None = None,
    metallic: str | None = None,
    normal: str | None = None,
    depth: str | None = None,
    engine: str = "transport",
    preset: str = "default",
    fov: float | str | None = "auto",
    size: int = 512,
    envmap_size: tuple[int, int] = (512, 256),
    completion: str = "auto",
    tau: float = 6.0,
    mask: Array | None = None,
    strategy: str = "default",
    seed: int = 0,
    device: str = "auto",
    progress=None,
    **overrides: Any,
) -> Scene:
    """Decompose a photograph into geometry, materials and light.

    Args:
        photo: a file, `example:NAME`, or a Photo already read.
        predictor: `auto`, `bundled`, `matnet`, `maps:DIR`, ...; see docs/predictors.md.
        albedo, roughness, metallic, normal, depth: another predictor for this map alone.
        engine: `transport` (cached transport) or `path` (Mitsuba PRB, as the paper).
        preset: `default` or `paper`; the path engine always follows the paper.
        fov: horizontal field of view in degrees, or `auto`: from the predictor of the depth where it knows one
            (MoGe), else from EXIF, else 35.
        size: longer side of the working image, pixels; a Photo keeps the size that it was read at.
        envmap_size: (width, height) of the environment map; width = 2 * height.
        completion: `planes` continues dominant planes beyond what the photo shows, `floors` ends walls at the frame,
            `none` adds nothing; `planes,backs` and `floors,backs` are accepted for `planes` and `floors`. `auto` is
            `planes` with walls that end where light explains the photo best.
        tau: grazing angle of the boundary duplication, degrees.
        mask: [H, W] bool at working size: roughness and metallic take one value inside.
        strategy: `default`, or `white-light-first` (paper, Material Editing Settings).
        seed: equal seeds give equal scenes on one machine.
        progress: called as progress(stage, done, total).
        overrides: `settings=FitSettings(...)` replaces the preset; `prior=Prediction(...)` replaces the predictor;
            `spp=N` sets the samples of the final re-rendering; `found(name, value)` is called with "prior" (a
            Prediction), "light" ([h, 2h, 3]) and "materials" as soon as each is there.

    Raises:
        InputError, SetupError: see docs/inputs.md; nothing is written.
    """
    start = time.perf_counter()
    check_overrides(overrides)
    preset = "paper" if engine == "path" else preset
    tick = progress or (lambda *_: None)
    found = overrides.get("found") or (lambda *_: None)
    _check(engine, strategy, completion, envmap_size, seed)
    tick("read", 0, 1)
    picture = _read(photo, size=size, fov=fov)
    tick("predict", 0, 1)
    stages: list[dict] = []
    prior = overrides.get("prior")
    if prior is None:
        parts = {"albedo": albedo, "roughness": roughness, "metallic": metallic, "normal": normal, "depth": depth}
        source = _predictor(predictor, parts, device)
        picture = _seen_by(source, picture)
        begun = time.perf_counter()
        prior = _predict(picture, source, seed)
        stages.append({"name": "predict", "seconds": round(time.perf_counter() - begun, 3)})
    _check_mask(mask, picture)
    if mask is not None and not (mask & (prior.depth > 0)).any():
        raise InputError("The mask lies wholly where there is no surface (sky); mark an object.")
    found("prior", prior)

    from materialist.render.variant import setup

    setup(device)
    from materialist.fit.invert import AUTO, FULL, FitSetup, Inversion
    from materialist.fit.settings import preset as named
    from materialist.geometry.build import SYNONYMS

    settings = overrides.get("settings") or named(preset, hdr=picture.hdr)
    if engine == "path" and (settings.corrections or settings.materials.second_metallic is not None):
        raise InputError(
            "The path engine fits as the paper does; give it settings with corrections=0 and second_metallic=None."
        )
    chosen = FULL if completion == AUTO and preset == "paper" else SYNONYMS.get(completion, completion)
    fit_setup = FitSetup(
        picture, prior, settings, chosen, engine, envmap_height=envmap_size[1], tau=tau, mask=mask, strategy=strategy,
        seed=seed, device=device, spp=overrides.get("spp"),
    )  # fmt: skip
    best = Inversion(fit_setup, progress=progress, found=found).run()
    prepared = best.prepared
    report = _report(picture, prior, best, (*stages, *best.stages), prepared.notes, start)
    return Scene(
        camera=picture.camera, photo=picture, prior=prior, materials=best.materials, normal=prior.normal,
        depth=prior.depth, geometry=prepared.geometry, envmap=best.envmap, rerender=best.rerender, report=report,
        provenance={
            "predictor": prior.predictor, "sources": prior.sources, "engine": engine, "preset": preset,
            "completion": prepared.completion, "completion_asked": completion,
            "ends": [asdict(e) for e in prepared.ends],
            "tau": tau, "strategy": strategy, "mask": _named(mask),
            "settings": asdict(settings) if overrides.get("settings") else None,
            "seed": seed, "spp": best.spp, "size": size,
            "envmap_size": list(envmap_size), "fov": picture.camera.fov, "fov_source": picture.fov_source,
        },
    )  # fmt: skip


OVERRIDES = ("settings", "prior", "spp", "found")
"""Further keywords of `invert`."""


def check_overrides(given: Iterable[str]) -> None:
    """Raises InputError for a keyword that `invert` does not know: a misspelt one would change nothing."""
    import inspect

    known = [name for name in inspect.signature(invert).parameters if name not in ("photo", "overrides", "progress")]
    unknown = [name for name in given if name not in (*known, *OVERRIDES)]
    if unknown:
        raise InputError(f"invert has no option '{unknown[0]}'; it takes {', '.join([*known, *OVERRIDES])}.")


def render_scene(scene: Scene, *, spp: int = 64, denoise: bool = False, seed: int = 0, device: str = "auto") -> Array:
    """Path-trace a scene, with its bodies and lamps, from the photo's camera: [H, W, 3] float32 linear.

    `spp` counts camera rays a pixel. Denoising is for pictures only.
    """
    from materialist.edits.core.renderer import rendered

    if spp < 1:
        raise InputError(f"spp is {spp}; give at least 1 sample per pixel.")
    return rendered(scene, spp=spp, seed=seed, denoise=denoise, device=device)


def _report(
    picture: Photo, prior: Prediction, found: FitResult, stages: tuple[dict, ...], told: tuple[str, ...], start: float
) -> FitReport:
    materials, halves = found.materials, [np.nan_to_num(half, posinf=0) for half in found.halves]
    rerender = (halves[0] + halves[1]) / 2
    surface = prior.depth > 0
    distance = {
        f"prior_l1_{name}": float(np.abs(getattr(materials, name) - getattr(prior.materials, name))[surface].mean())
        for name in ("albedo", "roughness", "metallic")
    }
    residual = np.abs(linear_to_srgb(rerender) - linear_to_srgb(picture.linear)).max(-1)
    white = HDR_CLIP if picture.hdr else 0.99
    clipped = float((picture.linear >= white).any(-1).mean())
    notes = [*picture.warnings, *prior.warnings, *told]
    if lost := int((~np.isfinite(found.rerender).all(-1)).sum()):
        notes.append(
            f"{lost} pixels of the re-rendering are no numbers; look for wild values in the depth and normals."
        )
    if clipped > 0.01:
        notes.append(f"{clipped:.0%} of the photo's pixels are clipped: light and albedo there are lower bounds.")
    if found.prior_confidence == 1.0:
        notes.append(
            "No light explains the photo with the predicted materials; they were changed to match it, and shadows or "
            "shading may be baked into the albedo."
        )
    elif is_peaked(found.envmap):
        notes.append("The photo has hard light: its shadows may be baked into the albedo.")
    poor = float((residual > 0.1).mean())
    if poor > 0.05:
        notes.append(f"The re-rendering is off by more than 0.1 (sRGB) on {poor:.0%} of the pixels; see overview.png.")
    return FitReport(
        stages=stages,
        metrics={
            "rerender_psnr_path": metrics.psnr_without_noise(halves[0], halves[1], picture.linear),
            "rerender_ssim_path": metrics.ssim(rerender, picture.linear),
            **distance,
            "clipped_fraction": clipped,
            "poor_fraction": poor,
            "total_seconds": time.perf_counter() - start,
            "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        },
        warnings=tuple(notes),
    )


def _named(mask: Array | None) -> dict[str, Any] | None:
    """What the provenance keeps of a mask [H, W] bool: its size, and by what to know it again."""
    if mask is None:
        return None
    packed = np.packbits(np.asarray(mask, bool))
    return {"pixels": int(np.sum(mask)), "sha256": sha256(packed.tobytes()).hexdigest()}


def _read(photo: str | Path | Photo, *, size: int, fov: float | str | None) -> Photo:
    if isinstance(photo, Photo):
        from materialist.io.photo import exposed

        photo = exposed(photo)
        if fov in ("auto", None):
            return photo
        from materialist.io.photo import option_fov

        angle = option_fov(fov) or photo.camera.fov
        return replace(photo, camera=replace(photo.camera, fov=angle), fov_source="option")
    from materialist.io.photo import read_photo

    return read_photo(photo, size=size, fov=fov)


def _predictor(spec: str, parts: dict[str, str | None], device: str):
    from materialist.predict import get_predictor

    return get_predictor(spec, device=device, **parts)


def _seen_by(source, picture: Photo) -> Photo:
    """The photo with the field of view of the predictor whose depth is used, unless the caller chose one."""
    angle = getattr(source, "field_of_view", None)
    if angle is None or picture.fov_source == "option":
        return picture
    known, notes = picture.camera.fov, picture.warnings
    if picture.fov_source == "exif" and abs(known - angle) > 0.1 * angle:
        notes = (*notes, f"EXIF says a field of view of {known:.1f} degrees, the depth was made with {angle:.1f}.")
    return replace(picture, camera=replace(picture.camera, fov=angle), fov_source="predictor", warnings=notes)


def _predict(picture: Photo, source, seed: int) -> Prediction:
    prediction = source.predict(picture, seed=seed)
    if not (prediction.depth > 0).any():
        raise InputError("The predictor found no surface in the photo; give a depth map with --predictor maps:DIR.")
    middle = float(np.median(prediction.depth[prediction.depth > 0]))
    if middle < SMALL:
        note = (
            f"Depth is {middle:.3g} in the median. Rays start about 0.0001 off a surface, which thins out its shadows; "
            f"give depth in a smaller unit, so that the median is {SMALL:g} or more."
        )
        prediction = replace(prediction, warnings=(*prediction.warnings, note))
    return prediction


def _check(engine: str, strategy: str, completion: str, envmap_size: tuple[int, int], seed: int) -> None:
    if engine not in ENGINES:
        raise InputError(f"Engine is '{engine}'; choose one of {', '.join(ENGINES)}.")
    if strategy not in STRATEGIES:
        raise InputError(f"Strategy is '{strategy}'; choose one of {', '.join(STRATEGIES)}.")
    from materialist.geometry.build import COMPLETIONS, SYNONYMS

    if completion not in ("auto", *COMPLETIONS, *SYNONYMS):
        raise InputError(f"Completion is '{completion}'; choose one of 'auto', {', '.join(map(repr, COMPLETIONS))}.")
    width, height = envmap_size
    if width != 2 * height or not 8 <= height <= 4096:
        raise InputError(
            f"Envmap size is {width}x{height}; the width must be twice the height, and the height 8 to 4096."
        )
    if not 0 <= seed < 2**31:
        raise InputError(f"Seed is {seed}; give 0 to {2**31 - 1}.")


def _check_mask(mask: Array | None, picture: Photo) -> None:
    if mask is None:
        return
    if mask.shape != picture.linear.shape[:2]:
        raise InputError(
            f"Mask is {mask.shape}, the photo at working size is {picture.linear.shape[:2]} (rows, columns)."
        )
    if mask.dtype != bool:
        raise InputError(f"Mask holds {mask.dtype}; give truth values, for example mask > 0.5.")
    if not mask.any():
        raise InputError("The mask is empty; mark at least one pixel.")


__all__ = ["invert", "render_scene"]
