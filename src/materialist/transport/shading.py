"""Shading from the transport tables: one call gives the radiance of every pixel, with gradients, without noise."""

import torch

from materialist.bsdf.disney import combine, quadratic
from materialist.buffers import placed
from materialist.transport.cache import Tables
from materialist.types import Array


def shade(
    tables: Tables, albedo: torch.Tensor, roughness: torch.Tensor, metallic: torch.Tensor
) -> torch.Tensor:
    """[P, 3] outgoing linear radiance by the paper's simplified Disney BRDF (Preliminary), with gradients.

    L_o = A (1 - M) (D0 + D1 R + D2 R^2) + C_0 S0(R) + S1(R), with C_0 = R_0 (1 - M) + M A.
    tables: light transport at P pixels. albedo: [P, 3] in [0, 1]; roughness: [P] perceptual; metallic: [P].
    """
    r = roughness[:, None]
    m = metallic[:, None]
    diffuse = quadratic(tables.diffuse.split(3, -1), r)
    return combine(albedo, m, diffuse, *specular_at(tables, roughness).split(3, -1))


def specular_at(tables: Tables, roughness: torch.Tensor) -> torch.Tensor:
    """[P, 6] specular tables interpolated linearly between their roughness levels; differentiable in roughness [P].

    Tables made at the pixels' own roughness (L = 1) are returned unchanged.
    """
    if len(tables.specular) == 1:
        return tables.specular[0]
    levels = torch.tensor([float(level[0]) for level in tables.levels]).to(roughness)
    # --- The two levels around each pixel's roughness, and its place between them ---
    r = roughness.clamp(levels[0], levels[-1])
    low = (torch.bucketize(r.detach(), levels) - 1).clamp(0, len(levels) - 2)
    t = ((r - levels[low]) / (levels[low + 1] - levels[low]))[:, None]
    # --- Both tables at each pixel, by one index into [L * P, 6] ---
    flat = tables.specular.reshape(-1, 6)
    index = low * len(r) + torch.arange(len(r), device=r.device)
    s_low = flat[index]
    s_high = flat[index + len(r)]
    return s_low + t * (s_high - s_low)


def at_roughness(tables: Tables, roughness: Array) -> Tables:
    """Tables at the pixels' own roughness [P] alone (L = 1)."""
    specular = specular_at(tables, placed(roughness))
    return Tables(tables.diffuse, specular[None], (roughness,))
