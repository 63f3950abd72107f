"""The loss of the material fit and its gradient in one kernel.

Its slow twin is `material_objective` over `transport.shading`. Everything is per pixel, except that total variation
looks at four neighbours: written out by hand, a step reads the tables once instead of some fifty times.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch

from materialist.bsdf.disney import DIELECTRIC_R0, base_reflectance, combine, quadratic
from materialist.buffers import floats, integers
from materialist.fit.losses import CLIPPED, EdgeWeights, encode, loss_weights, per_value
from materialist.fit.settings import Encoding, MaterialSettings
from materialist.transport.cache import ROUGHNESS_LEVELS, Tables


class FusedLoss:
    """L_re + delta L_cons + smoothness of P surface pixels as a function of their materials.

    Args:
        tables: transport under the light.
        factor: [P, 3] (or [1]) multiplies the rendering.
        photo: [P, 3] linear. prior: [P, 5].
        edges: for the smoothness, or None.
    """

    def __init__(
        self,
        tables: Tables,
        factor: torch.Tensor,
        photo: torch.Tensor,
        prior: torch.Tensor,
        settings: MaterialSettings,
        edges: EdgeWeights | None,
    ):
        count = len(photo)
        self.count, self.encoding, self.clipped = count, settings.encoding, settings.clipped
        target = encode(photo, settings.encoding)
        roof = torch.full_like(target, torch.inf)
        if settings.clipped:  # above its encoded value, a rendering is no error
            roof = torch.where(photo >= CLIPPED, target, roof)
        held = loss_weights(prior, settings) / count
        self._constants = [
            _flat(v) for v in (tables.diffuse, tables.specular, factor.expand(count, 3), target, roof, prior, held)
        ]
        self._smooth = _flat(per_value(settings.smooth) / count)
        self._links = None if edges is None or not any(settings.smooth) else _links(edges)

    def __call__(self, maps: torch.Tensor) -> torch.Tensor:
        """Loss (a scalar that can be differentiated) of materials [P, 5]."""
        return _Apply.apply(maps, self)

    def evaluate(self, maps: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Loss [] and its gradient [P, 5] at `maps` [P, 5]."""
        loss, gradient = _kernel(_flat(maps), self._constants, self._smooth, self._links, self)
        dr.eval(loss, *gradient)
        return loss.torch().cpu().double().sum().float(), torch.stack([g.torch().cpu() for g in gradient], 1)


class _Apply(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, maps: torch.Tensor, objective: FusedLoss) -> torch.Tensor:  # type: ignore[override]
        loss, gradient = objective.evaluate(maps.detach())
        ctx.save_for_backward(gradient)
        return loss

    @staticmethod
    def backward(ctx: Any, upstream: torch.Tensor) -> tuple[torch.Tensor, None]:  # type: ignore[override]
        return upstream * ctx.saved_tensors[0], None


def _kernel(maps, constants, smooth, links, objective: FusedLoss):
    """Per-pixel loss, and five arrays of gradients."""
    diffuse, specular, factor, target, roof, prior, held = constants
    lane: Any = dr.arange(mi.UInt32, objective.count)
    value: list[Any] = [dr.gather(mi.Float, maps, lane * 5 + k) for k in range(5)]
    albedo: Any = mi.Color3f(*value[:3])
    rough, metal = value[3], value[4]
    d0, d1, d2 = (dr.gather(mi.Color3f, diffuse, lane * 3 + k) for k in range(3))
    s0, s1, slope0, slope1 = _specular(specular, lane, rough, objective.count)
    body, base = quadratic((d0, d1, d2), rough), base_reflectance(albedo, metal)
    scale: Any = dr.gather(mi.Color3f, factor, lane)
    radiance = scale * combine(albedo, metal, body, s0, s1)

    encoded, slope = _encode(radiance, objective.encoding)
    error = encoded - dr.gather(mi.Color3f, target, lane)
    live = encoded <= dr.gather(mi.Color3f, roof, lane)
    error = dr.select(live, error, 0)
    share = dr.opaque(mi.Float, 1 / (3 * objective.count))
    loss = dr.sum(dr.abs(error) + error * error) * share
    up = dr.select(live, (_sign(error) + 2 * error) * share * slope * scale, 0)

    by_albedo = up * ((1 - metal) * body + metal * s0)
    by_rough = dr.sum(up * (albedo * (1 - metal) * (d1 + 2 * rough * d2) + base * slope0 + slope1))
    by_metal = dr.sum(up * ((albedo - DIELECTRIC_R0) * s0 - albedo * body))
    gradient = [by_albedo.x, by_albedo.y, by_albedo.z, by_rough, by_metal]
    for k in range(5):
        change = value[k] - dr.gather(mi.Float, prior, lane * 5 + k)
        weight = dr.gather(mi.Float, held, lane * 5 + k)
        loss += weight * dr.abs(change)
        gradient[k] += weight * _sign(change)
        if links is not None:
            cost, pull = _variation(maps, prior, links, lane, change, k)
            weight = dr.gather(mi.Float, smooth, k)
            loss += weight * cost
            gradient[k] += weight * pull
    return loss, gradient


def _specular(specular, lane, rough, count: int):
    """S0, S1 and their slopes in roughness, interpolated linearly between ROUGHNESS_LEVELS."""
    levels = ROUGHNESS_LEVELS
    r = dr.clip(rough, levels[0], levels[-1])
    low, start, step = mi.UInt32(0), mi.Float(levels[0]), mi.Float(levels[1] - levels[0])
    for k in range(1, len(levels) - 1):
        beyond = r > levels[k]
        low = dr.select(beyond, k, low)
        start, step = dr.select(beyond, levels[k], start), dr.select(beyond, levels[k + 1] - levels[k], step)
    index: Any = (low * dr.opaque(mi.UInt32, count) + lane) * 2
    above = index + 2 * dr.opaque(mi.UInt32, count)
    t, inside = (r - start) / step, (rough >= levels[0]) & (rough <= levels[-1])
    out, slopes = [], []
    for k in range(2):
        a: Any = dr.gather(mi.Color3f, specular, index + k)
        b: Any = dr.gather(mi.Color3f, specular, above + k)
        out.append(a + t * (b - a))
        slopes.append(dr.select(inside, (b - a) / step, 0))
    return (*out, *slopes)


def _encode(radiance: Any, encoding: Encoding):
    """Encoded radiance and its derivative (see `losses.encode`)."""
    if encoding == "linear":
        return radiance, mi.Color3f(1)
    x: Any = dr.maximum(radiance, 0)
    if encoding == "log1p":
        return dr.log(1 + x), dr.select(radiance >= 0, 1 / (1 + x), 0)
    power = dr.power(dr.maximum(x, 0.0031308), 1 / 2.4)
    curved = x > 0.0031308
    slope = dr.select(curved, 1.055 / 2.4 * power / dr.maximum(x, 0.0031308), 12.92)
    return dr.select(curved, 1.055 * power - 0.055, 12.92 * x), dr.select(radiance >= 0, slope, 0)


def _variation(maps, prior, links, lane, change, k: int):
    """Weighted |differences| of the change to the next pixels, and the derivative by this pixel's value."""
    cost, pull = mi.Float(0), mi.Float(0)
    for side, (other, weight) in enumerate(links):
        there = dr.gather(mi.UInt32, other, lane) * 5 + k
        w = dr.gather(mi.Float, weight, lane)
        difference = change - (dr.gather(mi.Float, maps, there) - dr.gather(mi.Float, prior, there))
        if side < 2:
            cost += w * dr.abs(difference)
        pull += w * _sign(difference)
    return cost, pull


def _links(edges: EdgeWeights):
    """(lane of the neighbour, weight) below, to the right, above and to the left of each surface pixel."""
    height, width = edges.right.shape[0], edges.down.shape[1]
    pixels = edges.pixels.numpy()
    flat = np.zeros(height * width, np.uint32)
    flat[pixels] = np.arange(len(pixels), dtype=np.uint32)
    lane = flat.reshape(height, width)
    weight = np.zeros((4, height, width), np.float32)
    other = np.zeros((4, height, width), np.uint32)
    weight[0, :-1] = weight[2, 1:] = edges.down.numpy()
    weight[1, :, :-1] = weight[3, :, 1:] = edges.right.numpy()
    other[0, :-1], other[2, 1:] = lane[1:], lane[:-1]
    other[1, :, :-1], other[3, :, 1:] = lane[:, 1:], lane[:, :-1]
    rows = zip(other.reshape(4, -1)[:, pixels], weight.reshape(4, -1)[:, pixels], strict=True)
    return [(integers(mi, o), floats(mi, w)) for o, w in rows]


def _flat(values: torch.Tensor):
    values = values.detach().float().contiguous().view(-1)
    return mi.Float(values) if values.is_cuda else floats(mi, values.numpy())


def _sign(x):
    return dr.select(x > 0, 1, dr.select(x < 0, -1, mi.Float(0)))
