"""Inpainting by a diffusion model (paper, Background Inpainting), where its weights are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from materialist.color import srgb_levels, srgb_to_linear
from materialist.errors import InputError, SetupError, WeightsError
from materialist.predict.weights import INSTEAD
from materialist.types import Array

Inpaint = Callable[[Array, Array], Array]
"""inpaint(photo [H, W, 3] linear, hole [H, W] bool) -> [H, W, 3] linear picture without the hole."""
DEFAULT = "stable-diffusion-v1-5/stable-diffusion-inpainting"
PROMPT = "empty background, nothing there"
LONGEST = 768
"""Longer side at which the model works; it was trained at 512."""


def inpainter(text: str, *, seed: int = 0, device: str = "auto", steps: int = 30) -> Inpaint:
    """The inpainter that an option names: `sd:FOLDER` or `sd:owner/name`, or `sd` for the usual model.

    Raises InputError for any other name; SetupError or WeightsError when the library or the model is not there.
    """
    kind, _, where = text.partition(":")
    if kind != "sd":
        raise InputError(f"The inpainter is '{text}'; give sd:FOLDER or sd:owner/name (patches need no option).")
    from materialist.predict import hub
    from materialist.predict.device import on_gpu

    gpu = on_gpu(device)
    try:
        folder, _ = hub.locate(where, DEFAULT)
        pipeline = hub.pipeline(
            "StableDiffusionInpaintPipeline", folder, gpu, "inpainting pipeline",
            safety_checker=None, requires_safety_checker=False,
        )  # fmt: skip
    except SetupError as error:
        raise SetupError(
            f"Inpainting by diffusion needs diffusers and transformers; install them with: {hub.INSTALL}, or leave "
            "--inpaint out."
        ) from error
    except WeightsError as error:
        # The hub's own sentence ends with advice about predictors.
        raise WeightsError(str(error).replace(INSTEAD, "leave --inpaint out")) from error
    return lambda photo, hole: diffused(pipeline, photo, hole, seed=seed, steps=steps)


def diffused(pipeline: Any, photo: Array, hole: Array, *, seed: int, steps: int) -> Array:
    """[H, W, 3] linear: a photo [H, W, 3] with the hole [H, W] bool filled by an inpainting pipeline of diffusers."""
    import cv2
    import torch
    from PIL import Image

    height, width = hole.shape
    unit = 8 * max(1, getattr(pipeline, "vae_scale_factor", 8) // 8)
    scale = min(1.0, LONGEST / max(height, width))
    w, h = (max(unit, round(n * scale / unit) * unit) for n in (width, height))
    picture = srgb_levels(photo)
    image = Image.fromarray(picture).resize((w, h), Image.Resampling.LANCZOS)
    mask = Image.fromarray(hole.astype(np.uint8) * 255).resize((w, h), Image.Resampling.NEAREST)
    out = pipeline(
        prompt=PROMPT, image=image, mask_image=mask, height=h, width=w, num_inference_steps=steps,
        generator=torch.Generator("cpu").manual_seed(seed), output_type="np",
    ).images[0]  # fmt: skip
    large = cv2.resize(np.asarray(out, np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    return np.where(hole[..., None], srgb_to_linear(np.clip(large, 0, 1)), photo).astype(np.float32)
