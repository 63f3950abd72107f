"""Denoising of finished pictures (Intel Open Image Denoise); never used inside an optimisation."""

from __future__ import annotations

import sys

import numpy as np

from materialist.errors import InputError, SetupError
from materialist.types import Array


def denoise(image: Array, *, albedo: Array, normal: Array) -> Array:
    """Remove the path tracer's noise, guided by the scene's own maps, whose edges stay.

    Args:
        image: [H, W, 3] linear radiance, >= 0, any range.
        albedo: [H, W, 3] linear, in [0, 1].
        normal: [H, W, 3] unit, or 0 where there is no surface.

    Returns:
        [H, W, 3] float32 linear radiance, >= 0. Equal inputs give equal pictures on one machine.

    Raises:
        InputError: the guides are not of the image's size. SetupError: the optional package pyoidn is missing or broken.
    """
    for name, guide in (("albedo", albedo), ("normal", normal)):
        if guide.shape != image.shape:
            raise InputError(f"The {name} guide is {guide.shape}, the image is {image.shape}; they must be equal.")
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise SetupError(
            f"Denoising needs the package pyoidn ({error}); install it with: {sys.executable} -m pip install pyoidn, "
            "or render with --no-denoise."
        ) from error
    # The maps carry no noise of their own (clean_aux), so that the filter may follow their edges to the pixel.
    clean = pyoidn.denoise(
        np.ascontiguousarray(image, np.float32),
        np.clip(albedo, 0, 1).astype(np.float32),
        np.clip(normal, -1, 1).astype(np.float32),
        hdr=True,
        clean_aux=True,
    )
    return np.maximum(clean, 0)
