"""Materials of bodies as Mitsuba BSDFs: the scene's own BRDF, and (rough) dielectric interfaces."""

from __future__ import annotations

from typing import Any

import numpy as np

from materialist.bsdf.rough_dielectric import PLUGIN as FROSTED
from materialist.buffers import tensor
from materialist.types import Array, Surface

OUTSIDE = "materialist_outside"
"""Plugin name of a texture with one value outside of a body, and 1 seen from within."""
SMOOTH = 0.03
"""Perceptual roughness below which a dielectric is taken as perfectly smooth."""
LEAST_IOR = 1.0001
"""Mitsuba takes no interface between equal media."""


def is_transparent(surface: Surface) -> bool:
    """Whether light enters the body; paths then need `scene.GLASS_DEPTH`, and Mitsuba's path tracer."""
    return surface.transmission > 0


def is_glowing(surface: Surface) -> bool:
    """Whether it gives off light; Mitsuba's path tracer then has to aim at it."""
    return max(surface.emission) > 0


def body_emitter(surface: Surface) -> dict | None:
    """Mitsuba's description of an emitter of the surface's emission, None where it does not glow."""
    if not is_glowing(surface):
        return None
    return {
        "type": "area",
        "radiance": {"type": "rgb", "value": [float(c) for c in surface.emission]},
    }


def body_bsdf(surface: Surface, opaque: dict) -> dict:
    """A Mitsuba description: T times a dielectric and (1 - T) times the `opaque` BRDF, T the transmission.

    The opaque share is a coat on the outside: light that has entered meets the dielectric alone. The tint is shared
    by the way in and the way out: each interface has its square root.
    """
    if not is_transparent(surface):
        return opaque
    # --- The dielectric interface, smooth or rough ---
    tint = {"type": "rgb", "value": [float(np.sqrt(c)) for c in surface.tint]}
    ior = max(float(surface.ior), LEAST_IOR)
    glass: dict = {
        "type": "dielectric",
        "int_ior": ior,
        "ext_ior": 1.0,
        "specular_transmittance": tint,
    }
    if surface.interface_roughness >= SMOOTH:
        rough = {
            "type": "roughdielectric",
            "distribution": "ggx",
            "alpha": surface.interface_roughness**2,
        }
        glass = {"type": FROSTED, "interface": {**glass, **rough}}
    # --- A share of the opaque BRDF on its outside ---
    if surface.transmission >= 1:
        return glass
    weight = {"type": OUTSIDE, "value": float(surface.transmission)}
    return {"type": "blendbsdf", "weight": weight, "opaque": opaque, "glass": glass}


def opaque_bsdf(mi, surface: Surface) -> dict:
    """The scene's own BRDF with the surface's maps."""
    maps = {
        "base_color": surface.albedo,
        "roughness": surface.roughness,
        "metallic": surface.metallic,
    }
    # `raw`: the values are linear already. Texture coordinates of meshes repeat beyond [0, 1].
    bitmap = {"type": "bitmap", "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}
    bsdf: dict[str, Any] = {"type": "materialist_disney"}
    for name, values in maps.items():
        bsdf[name] = {**bitmap, "data": tensor(mi, at_least_2x2(np.atleast_3d(values)))}
    return bsdf


def at_least_2x2(values: Array) -> Array:
    """A map [h, w, ...]; a single row or column is repeated, since Mitsuba takes no texture below 2 x 2."""
    for axis in (0, 1):
        values = np.repeat(values, 2, axis) if values.shape[axis] == 1 else values
    return values


def register_outside() -> None:
    """Make the texture known to the active variant."""
    # Imported here: a Mitsuba class can be derived only once a variant is set.
    import drjit as dr
    import mitsuba as mi

    class Outside(mi.Texture):
        """`value` where the surface is seen from outside, 1 from within."""

        def __init__(self, props: mi.Properties):
            mi.Texture.__init__(self, props)
            value: Any = props["value"]
            self.value = float(value)

        def eval_1(self, si, active=True):
            return dr.select(si.wi.z > 0, mi.Float(self.value), mi.Float(1))

        def mean(self):
            return mi.Float(self.value)

        def to_string(self):
            return f"Outside[{self.value}]"

    mi.register_texture(OUTSIDE, Outside)
