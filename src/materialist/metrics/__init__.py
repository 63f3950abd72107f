"""How close two pictures or two environment maps are: the figures of the report and of the benchmarks.

Images go in as linear Rec.709 and are compared as a viewer sees them: sRGB-encoded and clipped to [0, 1], unless the
name of the function says otherwise.
"""

from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.metrics import structural_similarity

from materialist.color import linear_to_srgb
from materialist.envmap import row_solid_angle, sh_basis, texel_directions
from materialist.errors import InputError
from materialist.types import Array


def mse(a: Array, b: Array, *, mask: Array | None = None) -> float:
    """Mean squared error of linear images a, b [H, W, 3] after sRGB encoding and clipping, in [0, 1].

    `mask` [H, W] bool restricts it to some pixels. Raises InputError when the shapes differ or no pixel is left.
    """
    return _mean_square(linear_to_srgb(_checked(a, b)), linear_to_srgb(b), mask)


def psnr(a: Array, b: Array, *, mask: Array | None = None) -> float:
    """Peak signal-to-noise ratio in dB of linear images [H, W, 3], on their sRGB encoding in [0, 1]; inf when equal."""
    error = mse(a, b, mask=mask)
    return float("inf") if error == 0 else float(-10 * np.log10(error))


def psnr_without_noise(first: Array, second: Array, b: Array) -> float:
    """PSNR in dB of the mean of two pictures [H, W, 3] linear, path traced independently, without their noise.

    The squared error of their mean, less its noise's variance, which a quarter of their squared difference estimates
    (all sRGB-encoded, clipped to [0, 1]): unbiased but for what encoding makes of noise. At most 80 dB, where chance
    takes more away than there is.
    """
    noise = _mean_square(linear_to_srgb(_checked(first, second)), linear_to_srgb(second)) / 4
    return float(-10 * np.log10(max(mse((first + second) / 2, b) - noise, 1e-8)))


def ssim(a: Array, b: Array, *, mask: Array | None = None) -> float:
    """Structural similarity of linear images [H, W, 3] on their sRGB encoding; 1 when equal.

    Wang et al. 2004 as published: Gaussian window, sigma 1.5 (11 x 11), mean over pixels (of `mask` [H, W] bool) and
    channels. Images smaller than the window are compared through the largest odd window that fits; below 3 x 3 pixels
    raises InputError.
    """
    return ssim_of_values(linear_to_srgb(_checked(a, b)), linear_to_srgb(b), mask=mask)


def ssim_without_noise(first: Array, second: Array, b: Array) -> float:
    """`ssim` of the mean of two pictures [H, W, 3] linear, path traced independently, without their noise.

    Their variance in a window is their covariance, to which the noise of neither adds.
    """
    first = linear_to_srgb(_checked(first, b)).astype(np.float64)
    second = linear_to_srgb(_checked(second, b)).astype(np.float64)
    b = linear_to_srgb(b).astype(np.float64)

    def smooth(v):
        return gaussian_filter(v, (1.5, 1.5, 0), truncate=3.5)

    # Local means, variances and the covariance; noise is independent in `first` and `second`.
    mean_first = smooth(first)
    mean_second = smooth(second)
    mean_b = smooth(b)
    mean = (mean_first + mean_second) / 2
    variance = (
        np.maximum(smooth(first * second) - mean_first * mean_second, 0) + smooth(b * b) - mean_b**2
    )
    covariance = smooth((first + second) / 2 * b) - mean * mean_b

    # --- SSIM of Wang et al., with their constants C1, C2 for values in [0, 1] ---
    c1 = 0.01**2
    c2 = 0.03**2
    similar = (2 * mean * mean_b + c1) * (2 * covariance + c2)
    norm = (mean_first * mean_second + mean_b**2 + c1) * (variance + c2)
    return float((similar / norm).mean())


def ssim_of_values(a: Array, b: Array, *, mask: Array | None = None) -> float:
    """As `ssim`, of maps [H, W] or [H, W, C] in [0, 1] as they are, without encoding."""
    smallest = min(a.shape[:2])
    if smallest < 3:
        raise InputError(
            f"SSIM needs at least 3 x 3 pixels, but the images are {a.shape[1]} x {a.shape[0]}."
        )
    # The 11 x 11 Gaussian of the paper; smaller pictures get the largest odd window that fits.
    window = (
        {"gaussian_weights": True, "sigma": 1.5}
        if smallest >= 11
        else {"win_size": smallest - 1 + smallest % 2}
    )
    a = a.astype(np.float64)
    b = b.astype(np.float64)
    channel = -1 if a.ndim == 3 else None
    options = {"data_range": 1, "channel_axis": channel, "use_sample_covariance": False, **window}
    if mask is None:
        return float(structural_similarity(a, b, **options))
    _, similarity = structural_similarity(a, b, full=True, **options)
    return float(similarity[mask].mean())


def sh_coefficients(envmap: Array) -> Array:
    """Real spherical harmonic coefficients [16, 3] float64, to degree 3, of an envmap [h, 2h, 3] (linear radiance).

    Ordered (l, m) = (0,0), (1,-1), (1,0), (1,1), ... as `envmap.sh_basis`; every texel is weighted with its exact solid
    angle, so a constant map L has the single coefficient L sqrt(4 pi).
    """
    envmap = np.asarray(envmap, np.float64)
    if envmap.ndim != 3 or envmap.shape[2] != 3 or envmap.shape[1] != 2 * envmap.shape[0]:
        raise InputError(
            f"An environment map has shape (h, 2h, 3), but this one has {envmap.shape}."
        )
    # The integral over the sphere of envmap times basis, as a sum over texels.
    return np.tensordot(_weighted_basis(len(envmap)), envmap, ([0, 1], [0, 1]))


@lru_cache(maxsize=4)
def _weighted_basis(height: int) -> Array:
    """[h, 2h, 16] spherical harmonics at the texels of a map, times their solid angles."""
    return (
        sh_basis(texel_directions(height, 2 * height), 3) * row_solid_angle(height)[:, None, None]
    )


def sh_error(a: Array, b: Array) -> float:
    """RMS over RGB of the Euclidean distance of the SH coefficients of envmaps [h, 2h, 3], whose sizes may differ."""
    return _rms_norm(sh_coefficients(a) - sh_coefficients(b))


def sh_error_relative(estimate: Array, truth: Array) -> float:
    """`sh_error` divided by the same norm of the true envmap: 0 is perfect, 1 is as bad as darkness."""
    norm = _rms_norm(sh_coefficients(truth))
    error = sh_error(estimate, truth)
    return error / norm if norm > 0 else (0.0 if error == 0 else float("inf"))


def _rms_norm(coefficients: Array) -> float:
    """RMS over RGB of the Euclidean norm of coefficients [n, 3]."""
    return float(np.sqrt(np.mean(np.sum(coefficients**2, axis=0))))


def _mean_square(a: Array, b: Array, mask: Array | None = None) -> float:
    """Mean of (a - b)**2 over pixels (of mask [H, W], if given) and channels, in double precision."""
    # Double precision: a float32 mean over a large picture loses digits.
    square = (a.astype(np.float64) - b) ** 2
    if mask is not None:
        if mask.shape != a.shape[:2]:
            raise InputError(f"The mask is {mask.shape}, but the images are {a.shape[:2]}.")
        square = square[mask.astype(bool)]
        if square.size == 0:
            raise InputError("The mask selects no pixel, so there is nothing to compare.")
    return float(square.mean())


def _checked(a: Array, b: Array) -> Array:
    """Array a as float32, after checking that b has its shape."""
    if np.shape(a) != np.shape(b):
        raise InputError(
            f"Two images of one size are compared, but these are {np.shape(a)} and {np.shape(b)}."
        )
    return np.asarray(a, np.float32)
