"""Losses between maps [B, C, H, W], over the pixels that a mask [B, 1, H, W] keeps; each is a scalar."""

from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.envmap import row_solid_angle, sh_basis, texel_directions

SILOG_LAMBDA = 0.5
"""Weight of the mean term (paper, equation of L_D): 1 would not see the scale at all, 0 fully."""
SILOG_RANGE = (1e-3, 20.0)
"""Depths that count (paper: "we set the mask to a depth value in [0, 20]"); a logarithm needs more than 0."""


def mean(error: Tensor, mask: Tensor) -> Tensor:
    """Mean of error [B, C, H, W] over the kept pixels; 0 when none is kept."""
    return (error * mask).sum() / (mask.sum() * error.shape[1]).clamp(min=1)


def l1(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """Mean absolute difference."""
    return mean((predicted - true).abs(), mask)


def l2(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """Mean squared difference."""
    return mean((predicted - true).square(), mask)


def cross_entropy(logit: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """Binary cross-entropy of logits against values in [0, 1]; least where sigmoid(logit) is the expected value."""
    return mean(F.binary_cross_entropy_with_logits(logit, true, reduction="none"), mask)


def cosine(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """1 - cosine of the angle between normals (paper: L_N)."""
    return mean(1 - F.cosine_similarity(predicted, true, dim=1).unsqueeze(1), mask)


def silog(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """The paper's L_D of depths: sqrt(E[g^2] - lambda E[g]^2), g = log true - log predicted, for depths in (0, 20]."""
    mask = mask * ((true > SILOG_RANGE[0]) & (true <= SILOG_RANGE[1]))
    g = true.clamp(min=SILOG_RANGE[0]).log() - predicted.clamp(min=SILOG_RANGE[0]).log()
    # A root has no gradient at 0.
    variance = mean(g.square(), mask) - SILOG_LAMBDA * mean(g, mask).square()
    return variance.clamp(min=1e-8).sqrt()


def centred_l1(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """L1 of logarithmic depths after each picture's mean difference is removed: blind to scale, robust to outliers."""
    difference = predicted - true
    # The scale of depth is not known: a constant of its logarithm is no error.
    centre = (difference * mask).flatten(1).sum(1) / mask.flatten(1).sum(1).clamp(min=1)
    return mean((difference - centre.view(-1, 1, 1, 1)).abs().clamp(max=2), mask)


def laplace(error: Tensor, log_scale: Tensor, mask: Tensor) -> Tensor:
    """Negative log likelihood of absolute errors under Laplace distributions, less a constant.

    It is least where the scale is the mean of the error. error, log_scale: [B, C, H, W].
    """
    return mean(error * (-log_scale).exp() + log_scale, mask)


def absolute_errors(predicted: dict[str, Tensor], true: dict[str, Tensor], mask: Tensor) -> Tensor:
    """[B, 5, H, W] absolute errors of maps, as `Prediction.spread` counts them; without gradients.

    albedo is sRGB-encoded, depth the natural logarithm of relative depth, each up to a constant of the picture.
    """
    with torch.no_grad():
        # Angles of normals, in radians; depth as in `centred_l1`.
        cosine = F.cosine_similarity(predicted["normal"], true["normal"], dim=1).unsqueeze(1)
        difference = predicted["depth"] - true["depth"]
        centre = (difference * mask).flatten(1).sum(1) / mask.flatten(1).sum(1).clamp(min=1)
        depth = (difference - centre.view(-1, 1, 1, 1)).abs().clamp(max=2)
        albedo = (predicted["albedo"] - true["albedo"]).abs().mean(1, keepdim=True)
        flat = [(predicted[name] - true[name]).abs() for name in ("roughness", "metallic")]
        return torch.cat([albedo, *flat, cosine.clamp(-1, 1).acos(), depth], 1)


def scaled_l1(predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
    """L1 of linear albedos after one factor a picture (least squares; itself not a path of the gradient)."""
    with torch.no_grad():
        # argmin_s sum (s p - t)^2 = sum p t / sum p^2.
        over = (predicted * true * mask).flatten(1).sum(1)
        under = (predicted.square() * mask).flatten(1).sum(1)
        scale = (over / under.clamp(min=1e-6)).clamp(0.25, 4).view(-1, 1, 1, 1)
    return l1(predicted * scale, true, mask)


def gradient(predicted: Tensor, true: Tensor, mask: Tensor, scales: int = 4) -> Tensor:
    """L1 of the differences of neighbours, at 1, 1/2, 1/4, ... of the resolution: edges where they are, flat elsewhere.

    Coarser scales are plain subsampling, so that both neighbours of a difference are pixels that the mask keeps.
    """
    total = predicted.new_zeros(())
    for scale in range(scales):
        step = 2**scale
        p, t, m = (x[..., ::step, ::step] for x in (predicted, true, mask))
        # Gradients are linear: that of the difference is the difference of the gradients.
        difference = p - t
        change = (difference[..., 1:] - difference[..., :-1]).abs()
        across = mean(change, m[..., 1:] * m[..., :-1])
        change = (difference[..., 1:, :] - difference[..., :-1, :]).abs()
        down = mean(change, m[..., 1:, :] * m[..., :-1, :])
        total = total + across + down
    return total / scales


def slopes(
    log_depth: Tensor, rays: Tensor, true_normal: Tensor, mask: Tensor, step: int = 4
) -> Tensor:
    """1 - cosine between the normals of the depth surface and the true ones: flat walls stay flat in the mesh.

    log_depth [B, 1, H, W], rays [B, 2, H, W]. Depth is averaged over step x step cells, and cells on an edge of the
    true surface, where neighbours belong to other objects, do not count.
    """
    depth = F.avg_pool2d(log_depth, step).clamp(-8, 8).exp()
    directions = F.avg_pool2d(rays, step)
    points = torch.cat([directions, -torch.ones_like(depth)], 1) * depth  # [B, 3, h, w]
    # Central differences of neighbouring cells span the surface.
    across = points[..., 1:-1, 2:] - points[..., 1:-1, :-2]
    down = points[..., 2:, 1:-1] - points[..., :-2, 1:-1]
    normal = torch.linalg.cross(down, across, dim=1)  # +Z to the viewer: rows run downwards
    true = F.avg_pool2d(true_normal, step)[..., 1:-1, 1:-1]
    # The mean of unit vectors is short where they disagree; and all nine cells must be surface.
    whole = 1 - F.max_pool2d(1 - F.avg_pool2d(mask, step), 3, 1)
    alike = (true.norm(dim=1, keepdim=True) > 0.97).float() * (whole > 0.99).float()
    return mean(1 - F.cosine_similarity(normal, true, dim=1, eps=1e-8).unsqueeze(1), alike)


DARKEST = 0.01
"""Radiance below which the logarithm of a light does not tell maps apart; white in the photo is 1."""


def light(predicted: Tensor, true: Tensor) -> tuple[Tensor, Tensor]:
    """(likelihood, irradiance) losses of the light around a scene.

    The first is the negative log likelihood of log radiance under a Laplace distribution of the predicted scale, the
    second the error of spherical harmonics of radiance up to degree 3, relative to those of the truth. Directions count
    by their solid angle and the share of the surfaces that they reach.

    predicted: [B, 4, h, 2h] log radiance and log scale. true: [B, 4, h, 2h] radiance and share; all 0 where it is not
    known.
    """
    angle, basis = _light_basis(true.shape[-2], true.device)
    weight = true[:, 3:] * angle
    # Samples without light have no weight anywhere.
    known = (weight.flatten(1).sum(1) > 0).float()
    under = weight.flatten(1).sum(1).clamp(min=1e-6)
    log = predicted[:, :3].clamp(-8, 8)
    scale = predicted[:, 3:].clamp(-4, 3)
    # --- Likelihood: |e| / b + log b of a Laplace distribution of scale b, `scale` its logarithm ---
    error = (log - true[:, :3].clamp(min=DARKEST).log()).abs()
    surprise = (error * (-scale).exp() + scale).mean(1, keepdim=True)
    likelihood = (surprise * weight).flatten(1).sum(1) / under

    # --- Irradiance: harmonics of the radiance, by solid angle and share ---

    def project(map_):
        return torch.einsum("bchw,hwk->bck", map_ * weight, basis)

    aim = project(true[:, :3])
    difference = (project(log.exp()) - aim).flatten(1).norm(dim=1)
    relative = difference / aim.flatten(1).norm(dim=1).clamp(min=1e-6)
    # Logarithmic above 1: a much too bright light must not outweigh the rest of a batch.
    irradiance = torch.where(relative < 1, relative, 1 + relative.clamp(min=1).log())
    # --- Means over the samples whose light is known ---
    count = known.sum().clamp(min=1)
    return (likelihood * known).sum() / count, (irradiance * known).sum() / count


@lru_cache(maxsize=4)
def _light_basis(rows: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """Solid angle [1, 1, h, 1] of the texels of a map of that many rows, and their harmonics [h, 2h, 16]."""
    angle = torch.from_numpy(row_solid_angle(rows)).float().view(1, 1, -1, 1)
    basis = torch.from_numpy(sh_basis(texel_directions(rows, 2 * rows), 3))
    return angle.to(device), basis.to(device)
