"""Denoising of finished pictures (Intel Open Image Denoise); never used inside an optimisation."""

import sys
from typing import Any

import numpy as np

from materialist.buffers import placed, torch_device
from materialist.errors import InputError, SetupError
from materialist.install import install_command
from materialist.types import Array


def denoise(image: Array, albedo: Array, normal: Array, *, quality: str = "high") -> Array:
    """[H, W, 3] float32 linear without the path tracer's noise, guided by the scene's own maps, whose edges stay.

    image: [H, W, 3] linear radiance, >= 0, any range. albedo: [H, W, 3] linear, in [0, 1].
    normal: [H, W, 3] unit, or 0 where there is no surface. quality: of the filter, 'high', 'balanced' or 'fast'.
    The filter runs on `buffers.torch_device()`.

    Equal inputs give equal pictures on one machine. Raises InputError where the guides are not of the image's size,
    SetupError where pyoidn is missing or broken.
    """
    for name, guide in (("albedo", albedo), ("normal", normal)):
        if guide.shape != image.shape:
            raise InputError(
                f"The {name} guide is {guide.shape}, the image is {image.shape}; they must be equal."
            )
    require_denoiser()
    on_card = torch_device() == "cuda"
    pyoidn = _pyoidn(with_torch=on_card)
    height, width = image.shape[:2]
    # The maps carry no noise of their own (clean_aux), so that the filter may follow their edges to the pixel.
    pictures: list[Any] = [
        _padded(p) for p in (image, np.clip(albedo, 0, 1), np.clip(normal, -1, 1))
    ]
    if on_card:
        pictures = [placed(p) for p in pictures]
    # `hdr`: the values are linear radiance of any range, not sRGB in [0, 1].
    clean = pyoidn.denoise(*pictures, hdr=True, clean_aux=True, quality=quality)
    clean = clean.cpu().numpy() if on_card else clean
    return np.ascontiguousarray(np.maximum(clean[:height, :width], 0))


def denoiser_problem() -> str | None:
    """Why the denoiser cannot be loaded here; None where it can."""
    try:
        module = _pyoidn(with_torch=torch_device() == "cuda")
    except (ImportError, OSError) as error:
        return str(error)
    return None if hasattr(module, "denoise") else "it has no function denoise"


def require_denoiser() -> None:
    """Raise SetupError, with the command that installs it, where the denoiser cannot be loaded."""
    problem = denoiser_problem()
    if problem is not None:
        raise SetupError(
            f"Denoising needs the package pyoidn ({problem}); install it with: "
            f"{install_command('pyoidn')}, or render with `denoise=False`."
        )


def _pyoidn(with_torch: bool) -> Any:
    """The module. It imports PyTorch if it can: seconds, and only a GPU needs it. Raises ImportError, OSError."""
    # None in `sys.modules` makes an import fail at once, which pyoidn takes for "no torch".
    hidden = not with_torch and "torch" not in sys.modules
    if hidden:
        sys.modules["torch"] = None  # type: ignore[assignment]
    try:
        import pyoidn
    finally:
        if hidden:
            del sys.modules["torch"]
    return pyoidn


_SMALLEST = 32
"""Pixels a side below which the filter invents light (a constant 1x1 picture comes out at a quarter of its value)."""


def _padded(image: Array) -> Array:
    """float32 copy of [H, W, 3], its last row and column repeated until it has `_SMALLEST` of each."""
    missing = [max(0, _SMALLEST - n) for n in image.shape[:2]]
    return np.pad(
        np.asarray(image, np.float32), ((0, missing[0]), (0, missing[1]), (0, 0)), mode="edge"
    )
