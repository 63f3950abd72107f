"""The thumbnails of the material presets: a ball each, path-traced under the computed light `Softboxes`.

Usage: python web/balls.py (writes web/src/balls/NAME.jpg; the client is built anew afterwards)
"""

from pathlib import Path

import cv2
import numpy as np

from materialist.color import srgb_levels
from materialist.edits.light.presets import preset_light
from materialist.io.display import encoded
from materialist.render.variant import setup

SIDE = 112
PAINT = {
    "gold": ((1.0, 0.71, 0.29), 1.0, 0.14),
    "copper": ((0.93, 0.49, 0.36), 1.0, 0.2),
    "chrome": ((0.86, 0.87, 0.88), 1.0, 0.03),
    "steel": ((0.52, 0.53, 0.55), 1.0, 0.36),
    "ceramic": ((0.86, 0.84, 0.8), 0.0, 0.12),
    "matt": ((0.45, 0.45, 0.45), 0.0, 0.95),
    "plastic": ((0.62, 0.07, 0.06), 0.0, 0.3),
    "rubber": ((0.025, 0.025, 0.03), 0.0, 0.6),
}
"""Preset -> linear colour, metallic, roughness; `web/src/presets.ts` has the same."""
GLASS = {"glass": 0.0, "frosted": 0.3}
"""Preset -> roughness."""


def material(name):
    if name in GLASS:
        kind = "roughdielectric" if GLASS[name] else "dielectric"
        rough = {"alpha": GLASS[name]} if GLASS[name] else {}
        return {"type": kind, "int_ior": 1.5, **rough}
    colour, metallic, roughness = PAINT[name]
    paint = {"type": "rgb", "value": list(colour)}
    return {
        "type": "principled",
        "base_color": paint,
        "metallic": metallic,
        "roughness": max(roughness, 0.02),
    }


def ball(mi, name):
    """[SIDE, SIDE, 3] linear picture of a ball of a preset, over a checkered ground."""
    light = np.ascontiguousarray(preset_light("Softboxes") * 1.4 + 0.05)
    camera = mi.ScalarTransform4f().look_at([0, 0.55, 4.1], [0, 0, 0], [0, 1, 0])
    turned = mi.ScalarTransform4f().translate([0, -1, 0]).rotate([1, 0, 0], -90).scale(30)
    checks = {
        "type": "checkerboard",
        "color0": {"type": "rgb", "value": 0.22},
        "color1": {"type": "rgb", "value": 0.1},
        "to_uv": mi.ScalarTransform3f().scale([60, 60]),
    }
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 8},
            "sensor": {
                "type": "perspective",
                "fov": 31,
                "to_world": camera,
                "film": {"type": "hdrfilm", "width": SIDE * 2, "height": SIDE * 2},
                "sampler": {"type": "independent", "sample_count": 256},
            },
            "light": {"type": "envmap", "bitmap": mi.Bitmap(light.astype(np.float32))},
            "ball": {"type": "sphere", "bsdf": material(name)},
            "ground": {
                "type": "rectangle",
                "to_world": turned,
                "bsdf": {"type": "diffuse", "reflectance": checks},
            },
        }
    )
    picture = np.asarray(mi.render(scene))[..., :3]
    return np.asarray(cv2.resize(picture, (SIDE, SIDE), interpolation=cv2.INTER_AREA))


def main():
    mi = setup()
    folder = Path(__file__).parent / "src" / "balls"
    for name in (*PAINT, *GLASS):
        picture = ball(mi, name)
        jpeg = encoded(srgb_levels(np.clip(picture, 0, 1)), "JPEG", quality=88)
        (folder / f"{name}.jpg").write_bytes(jpeg)


if __name__ == "__main__":
    main()
