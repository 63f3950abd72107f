"""The shading residual, carried by base colour and metallic, so that an export looks like the photo unedited.

Light and fitted maps leave something of the photo unexplained: `materialist.residual` has it as a factor on the
re-rendering, which no format knows. With the light held, the radiance of a pixel is affine in its base colour, so the
colour that gives the wanted radiance is known. Where even black reflects too much, as a dielectric does (4 %, and more
at grazing angles), metallic goes up as far as needed: that lowers the specular reflectance to the base colour's.
"""

from dataclasses import dataclass

import numpy as np

from materialist.bsdf.disney import combine_by_albedo
from materialist.color import linear_to_srgb
from materialist.render.variant import setup
from materialist.residual import shading_residual
from materialist.types import Array, Materials, Scene

_LEVELS = 21
"""Values of metallic that are tried."""
_METALLIC_COST = 3e-3
"""Of the square of its change, beside squared errors of sRGB values (by eye): 0.3 costs as three errors of 0.01."""
_TOLERANCE = 2e-3
"""Radiance by which a pixel may be too bright before metallic moves: half a level of 8 bits."""


@dataclass(frozen=True)
class _Lit:
    """What light and geometry make of the materials of P pixels, roughness fixed; see docs/transport.md."""

    diffuse: Array
    """[P, 3] radiance of a white diffuse surface."""
    s0: Array
    s1: Array
    """[P, 3] each: the specular radiance is C_0 s0 + s1."""

    def by_colour(self, metallic: Array) -> tuple[Array, Array]:
        """(slope, black), [P, 3] each: with metallic [P, 1] the radiance is base colour times slope + black."""
        slope, black = combine_by_albedo(metallic, self.diffuse, self.s0, self.s1)
        return slope, black

    def colour(self, radiance: Array, metallic: Array) -> Array:
        """[P, 3] base colour in [0, 1] that comes nearest to a radiance [P, 3]."""
        slope, black = self.by_colour(metallic)
        return np.clip((radiance - black) / np.maximum(slope, 1e-6), 0, 1)

    def radiance(self, colour: Array, metallic: Array) -> Array:
        slope, black = self.by_colour(metallic)
        return black + colour * slope

    def rows(self, which: Array) -> "_Lit":
        return _Lit(self.diffuse[which], self.s0[which], self.s1[which])


def with_residual(scene: Scene) -> Materials:
    """The scene's maps with the residual in them, as far as they can carry it. Roughness stays, and so does the sky."""
    setup()
    from materialist.transport.cache import TransportCache
    from materialist.transport.filter import filter_tables, surface_guide
    from materialist.transport.shading import specular_at

    maps = scene.materials
    if not (scene.geometry.mesh.face_plane == -1).any():
        return maps  # there is no surface to carry it
    cache = TransportCache(scene.geometry, scene.camera, roughness=maps.roughness)
    guide = surface_guide(cache)
    pixels = cache.pixels
    roughness = maps.roughness.reshape(-1)[pixels][:, None]

    def lit(sent: Array) -> _Lit:
        """sent: [H, W, 3] what surfaces send to each other."""
        tables = filter_tables(cache, cache.gather(scene.envmap, sent), guide)
        powers = np.concatenate([roughness**k for k in range(3)], 1)  # [P, 3]
        coefficients = tables.diffuse.cpu().numpy().reshape(-1, 3, 3)
        specular = specular_at(tables, tables.diffuse[:, 0]).cpu().numpy()
        diffuse = np.einsum("pk,pkc->pc", powers, coefficients)
        return _Lit(diffuse, specular[:, :3], specular[:, 3:])

    # --- What each pixel should send: its rendering, times the residual ---
    rerender = np.nan_to_num(scene.rerender, posinf=0, neginf=0)
    factor = shading_residual(scene.photo.linear, scene.rerender)
    colour = maps.albedo.reshape(-1, 3)[pixels]
    metallic = maps.metallic.reshape(-1)[pixels][:, None]
    # By a factor on the rendering, not by the photo: what inserted bodies shade stays out of the maps.
    goal = lit(rerender).radiance(colour, metallic) * factor.reshape(-1, 3)[pixels]
    colour, metallic = _carried(goal, lit(rerender * factor), metallic)
    # --- Base colour and metallic that do, in the places of their pixels ---
    albedo = maps.albedo.reshape(-1, 3).copy()
    metal = maps.metallic.reshape(-1).copy()
    albedo[pixels] = colour
    metal[pixels] = metallic[:, 0]
    return Materials(
        albedo.reshape(maps.albedo.shape), maps.roughness, metal.reshape(maps.metallic.shape)
    )


def _carried(goal: Array, lit: _Lit, metallic: Array) -> tuple[Array, Array]:
    """Base colour [P, 3] and metallic [P, 1] that come nearest to radiance [P, 3]; metallic never falls."""
    colour = lit.colour(goal, metallic)
    excess = lit.radiance(colour, metallic) - goal
    # Only pixels where even the best base colour is too bright move their metallic.
    dark = np.flatnonzero((excess > _TOLERANCE).any(1))
    some = lit.rows(dark)
    goal_srgb = linear_to_srgb(goal[dark])
    first = metallic[dark]
    least = np.full((len(dark), 1), np.inf, np.float32)
    metallic = metallic.copy()
    # All levels from the pixel's own metallic up; the cheapest one wins.
    for level in np.linspace(0, 1, _LEVELS, dtype=np.float32):
        tried = np.maximum(first, level)
        fits = some.colour(goal[dark], tried)
        error = linear_to_srgb(np.maximum(some.radiance(fits, tried), 0)) - goal_srgb
        cost = (error**2).sum(1, keepdims=True) + _METALLIC_COST * (tried - first) ** 2
        better = cost < least
        least = np.where(better, cost, least)
        metallic[dark] = np.where(better, tried, metallic[dark])
        colour[dark] = np.where(better, fits, colour[dark])
    return colour.astype(np.float32), metallic.astype(np.float32)
