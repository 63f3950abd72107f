"""What another program must be told to show an export as the photo was: the light's turn, scale, colour management."""

import numpy as np

from materialist.types import Scene

BLENDER_TURN = -90
"""Degrees about Z that Blender's world needs: the centre of its maps lies along +X, that of ours along the view, +Y."""


def advice(scene: Scene) -> dict[str, str]:
    """Light, scale and colour of an export, in sentences."""
    depth = float(np.median(scene.depth[scene.depth > 0]))
    return {
        "light": (
            "The centre column of the environment map lies along the camera's view. In Blender, give the Mapping node "
            f"before it a rotation of {BLENDER_TURN} degrees about Z, and strength 1."
        ),
        "scale": (
            f"A unit is no metre: one photo does not tell scale. The median depth is {depth:.3g} units."
        ),
        "colour": (
            "Base colour is sRGB, light is linear Rec.709. Show renders with a plain sRGB view and exposure 0; in "
            "Blender: View Transform Standard, not AgX."
        ),
    }
