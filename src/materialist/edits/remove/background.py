"""A picture of what is behind the object: guessed by MI-GAN or a diffusion model, or a given one (paper, Background
Inpainting)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from materialist.color import srgb_levels, srgb_to_linear
from materialist.edits.remove.filling import filled
from materialist.edits.remove.options import Removal
from materialist.errors import InputError
from materialist.io.image import same_aspect
from materialist.io.photo import decode_photo
from materialist.predict import hub, resample
from materialist.predict.models import locate
from materialist.predict.protocol import on_gpu
from materialist.threads import fixed_threads
from materialist.types import Array, Scene

Inpaint = Callable[[Array, Array], Array]
"""inpaint(photo [H, W, 3] linear, hole [H, W] bool) -> [H, W, 3] linear picture without the hole."""
DEFAULT = "stable-diffusion-v1-5/stable-diffusion-inpainting"
PROMPT = "empty background, nothing there"
LONGEST = 768
"""Longer side at which the model works; it was trained at 512."""


def picture_behind(
    scene: Scene, options: Removal, hole: Array, usable: Array
) -> tuple[Array, str, list[str]]:
    """([h, w, 3] linear picture of what is behind a hole [H, W] bool, what made it, warnings of its file).

    usable [H, W] bool: what a filling may be guessed from. Raises InputError for a picture that is none of this view;
    see `inpainter` and `filling.filled`.
    """
    background = options.background
    inpaint = options.inpaint
    if background is not None and inpaint is not None:
        raise InputError("Give a background or an inpainter, not both.")
    if background is None and inpaint is None:
        return filled(scene.photo.original, hole, usable), "migan", []
    name = "background" if inpaint is None else "inpainter"
    notes = list[str]()
    if isinstance(inpaint, str):
        inpaint = inpainter(inpaint, seed=options.seed, device=options.device)
    if inpaint is not None:
        try:
            background = np.asarray(inpaint(scene.photo.linear, hole), np.float32)
        except Exception as error:  # whatever a user's function raises
            raise InputError(f"The inpainter failed: {type(error).__name__}: {error}.") from error
    # --- A file: display pictures have white at 1, HDR ones the photo's exposure ---
    if isinstance(background, str | Path):
        decoded = decode_photo(Path(background))
        notes = [f"The background {Path(background).name}: {note}" for note in decoded.warnings]
        background = decoded.exposed() * np.float32(
            2.0**scene.photo.stops if decoded.scene_linear else 1
        )
    # --- Whatever made it, it must be of this view ---
    picture = np.asarray(background, np.float32)
    if picture.ndim != 3 or picture.shape[2] != 3 or not same_aspect(picture.shape, hole.shape):
        raise InputError(
            f"The picture of the {name} is {picture.shape}, the photo {hole.shape} (rows, columns) at working size; "
            "give the same view in colour, at the same proportions."
        )
    if not (np.isfinite(picture).all() and picture.min() >= 0):
        raise InputError(
            f"The picture of the {name} has negative or infinite values, or NaN; give a linear one."
        )
    return picture, name, notes


def inpainter(text: str, *, seed: int = 0, device: str = "auto", steps: int = 30) -> Inpaint:
    """The inpainter that an option names: `sd:FOLDER` or `sd:owner/name`, or `sd` for the usual model.

    Raises InputError for any other name; SetupError or WeightsError when the library or the model is not there.
    """
    kind, _, where = text.partition(":")
    if kind != "sd":
        raise InputError(
            f"The inpainter is '{text}'; give sd:FOLDER or sd:owner/name (MI-GAN needs no option)."
        )
    # The library first, then weights: each error names what is missing.
    gpu = on_gpu(device)
    with hub.advice('leave `inpaint="sd"` out'):
        hub.import_library("diffusers")  # before gigabytes of weights are asked for
        folder = locate(where, DEFAULT)
        pipeline = hub.pipeline(
            "StableDiffusionInpaintPipeline",
            folder,
            gpu,
            "inpainting pipeline",
            safety_checker=None,
            requires_safety_checker=False,
        )
    return lambda photo, hole: _diffused(pipeline, photo, hole, seed=seed, steps=steps)


@fixed_threads()
def _diffused(pipeline: Any, photo: Array, hole: Array, *, seed: int, steps: int) -> Array:
    """[H, W, 3] linear: a photo [H, W, 3] with the hole [H, W] bool filled by an inpainting pipeline of diffusers."""
    import torch

    height, width = hole.shape
    # Sides must be multiples of what the pipeline's encoder shrinks by.
    unit = 8 * max(1, getattr(pipeline, "vae_scale_factor", 8) // 8)
    scale = min(1.0, LONGEST / max(height, width))
    w, h = (max(unit, round(n * scale / unit) * unit) for n in (width, height))
    image = Image.fromarray(srgb_levels(photo)).resize((w, h), Image.Resampling.LANCZOS)
    mask = Image.fromarray(hole.astype(np.uint8) * 255).resize((w, h), Image.Resampling.NEAREST)
    out = pipeline(
        prompt=PROMPT,
        image=image,
        mask_image=mask,
        height=h,
        width=w,
        num_inference_steps=steps,
        generator=torch.Generator("cpu").manual_seed(seed),
        output_type="np",
    ).images[0]
    large = srgb_to_linear(np.clip(resample.values(np.asarray(out, np.float32), hole.shape), 0, 1))
    return np.where(hole[..., None], large, photo).astype(np.float32)
