"""GGX microfacets, written once for numpy, torch and Dr.Jit: distribution, masking and visible normals.

Directions are components (x, y, z) in the local shading frame, z along the normal; alpha = roughness^2.
"""

from importlib import import_module
from typing import Any

MIN_ALPHA = 1e-3
"""Lower clamp of alpha; the lobe of a perceptual roughness below 0.032 is that of 0.032."""


def array_module(values: Any) -> Any:
    """numpy, torch or drjit: the module whose functions take these values."""
    root = type(values).__module__.partition(".")[0]
    return import_module(
        {"torch": "torch", "drjit": "drjit", "mitsuba": "drjit"}.get(root, "numpy")
    )


def alpha_of(roughness):
    """alpha of perceptual roughness."""
    return array_module(roughness).clip(roughness * roughness, MIN_ALPHA, 1)


def distribution(sin2, alpha):
    """D(h) of a half vector with squared sine `sin2` to the normal.

    The sine is asked for because 1 - cos^2 loses all digits where alpha is small.
    """
    # D(h) = alpha^2 / (pi ((n.h)^2 (alpha^2 - 1) + 1)^2), written in the squared sine.
    alpha2 = alpha * alpha
    d = sin2 + alpha2 * (1 - sin2)
    return alpha2 / (3.141592653589793 * d * d)


def smith_g1(cosine, alpha):
    """Smith masking of a direction with this cosine to the normal; the same for both sides."""
    # G1 = 2 c / (c + sqrt(alpha^2 + (1 - alpha^2) c^2)).
    c = abs(cosine)
    c2 = cosine * cosine
    return 2 * c / (c + array_module(c).sqrt(c2 + alpha * alpha * (1 - c2)))


def visible_normal(wo, alpha, u, v) -> tuple[Any, Any, Any]:
    """(x, y, z) of a GGX normal distributed as those visible from `wo` (spherical caps, Dupuy and Benyoub 2023).

    u, v: in [0, 1).
    """
    x, y, z = wo
    xp = array_module(z)
    # --- Stretch: the ellipsoid of the distribution becomes the unit sphere ---
    x = alpha * x
    y = alpha * y
    scale = 1 / xp.sqrt(x * x + y * y + z * z)
    x = x * scale
    y = y * scale
    z = z * scale
    # --- A point of the spherical cap that is visible from `wo`, uniform in height and azimuth ---
    cap = (1 - v) * (1 + z) - z
    sine = xp.sqrt(xp.clip(1 - cap * cap, 0, 1))
    phi = 6.283185307179586 * u
    # --- The half vector towards it, stretched back ---
    x = alpha * (sine * xp.cos(phi) + x)
    y = alpha * (sine * xp.sin(phi) + y)
    z = xp.clip(cap + z, 1e-6, 2)
    scale = 1 / xp.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale
