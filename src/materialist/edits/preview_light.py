"""Another light on the surfaces of a preview.

Filtering the transport tables of all roughness levels is most of what a new light costs. For one roughness a pixel the
tables come down to nine numbers, D(R), S0(R) and S1(R) (see `transport.shading`): those are filtered at once, and all
levels only when somebody moves a roughness under this light.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from materialist.types import Array

if TYPE_CHECKING:
    import torch

    from materialist.transport.cache import Tables
    from materialist.transport.filter import Tap


class OtherLight:
    """Unfiltered tables of an engine under one light, and what was filtered of them so far.

    Args:
        engine: the `TransportEngine` whose cache gathered `tables`.
        taps: `transport.filter.taps` of its guide.
    """

    def __init__(self, engine: Any, tables: Tables, taps: list[Tap]):
        self._engine, self._raw, self._taps = engine, tables, taps
        self._lobes: tuple[Array, torch.Tensor] | None = None
        self._tables: Tables | None = None

    def shaded(self, albedo: torch.Tensor, roughness: torch.Tensor, metallic: torch.Tensor) -> torch.Tensor:
        """[P, 3] radiance of all surface pixels; albedo [P, 3], roughness and metallic [P]."""
        from materialist.bsdf.disney import combine
        from materialist.transport.filter import filter_tables
        from materialist.transport.shading import shade

        known = roughness.numpy()
        if self._lobes is None and self._tables is None:
            self._lobes = (known, self._filtered(roughness))
        if self._lobes is not None and np.array_equal(known, self._lobes[0]):
            return combine(albedo, metallic[:, None], *self._lobes[1].split(3, -1))
        if self._tables is None:
            self._tables = filter_tables(self._engine.cache, self._raw, self._engine.guide, self._taps)
        return shade(self._tables, albedo, roughness, metallic)

    def _filtered(self, roughness: torch.Tensor) -> torch.Tensor:
        """[P, 9]: D(R), S0(R), S1(R) of each pixel's roughness [P]."""
        import torch

        from materialist.transport.cache import ROUGHNESS_LEVELS
        from materialist.transport.filter import first_filtered, joint_filter
        from materialist.transport.shading import specular_at

        r = roughness[:, None]
        d0, d1, d2 = self._raw.diffuse.split(3, -1)
        lobes = torch.cat([d0 + r * (d1 + r * d2), specular_at(self._raw, roughness)], -1)
        guide, pixels = self._engine.guide, torch.from_numpy(self._engine.cache.pixels.astype(np.int64))
        grid = torch.zeros(guide.scale.numel(), 9)
        grid[pixels] = lobes
        smooth = joint_filter(grid.view(*guide.scale.shape, 9), guide, known=self._taps).view(-1, 9)[pixels]
        # Levels below the first filtered one stay sharp; the one before it is where that begins.
        first = first_filtered()
        low, high = ROUGHNESS_LEVELS[first - 1], ROUGHNESS_LEVELS[first]
        share = ((r - low) / (high - low)).clamp(0, 1)
        return torch.cat([smooth[:, :3], lobes[:, 3:] + share * (smooth - lobes)[:, 3:]], -1)
