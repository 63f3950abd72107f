"""Shadows of inserted bodies in screen space: the baseline that has a depth buffer and no mesh.

Screen-space directional occlusion (Ritschel, Grosch, Seidel 2009, "Approximating Dynamic Global Illumination in Image
Space"): beams of the environment map are marched through the depth buffer; those that the bodies block are taken from
the irradiance of the photo's surfaces. What the camera does not see casts no shadow, and nothing is reflected.
"""

from dataclasses import dataclass

import numpy as np

from materialist.camera import project, unproject
from materialist.color import luminance
from materialist.edits.core.renderer import EditRenderer
from materialist.envmap import row_solid_angle, texel_directions
from materialist.render.pixels import first_hits
from materialist.types import Array, Scene
from materialist_lab.procedural.packing import resample


@dataclass(frozen=True)
class ScreenSpaceSettings:
    """How far and how finely the depth buffer is searched."""

    beams: int = 192  # directions, by the light that comes from them
    steps: int = 32  # along each of them
    reach: float = 3.0  # length of a beam, in diagonals of the bodies; longer shadows are lost
    # of what is seen of the bodies, in their diagonals; the best of four on eight photos
    thickness: float = 0.2


SETTINGS = ScreenSpaceSettings()


def screen_space(photo: Array, edited: Scene, picture: Array, *, device: str = "auto") -> Array:
    """[H, W, 3] linear: the photo under the shadows of the edited scene's bodies, and the bodies as in `picture`."""
    bodies = {f"body{k}": body for k, body in enumerate(edited.bodies)}
    traced = EditRenderer(edited, device=device).render_scene(edited).mi_scene
    sight = first_hits(traced, edited.camera, bodies, edited.depth.shape)
    corners = np.concatenate([body.vertices for body in edited.bodies])
    size = float(np.linalg.norm(np.ptp(corners, 0)))
    shadow = shadowed(edited, np.where(sight.share > 0.5, sight.depth, 0), size)
    return np.where(sight.share[..., None] > 0.5, picture, photo * shadow).astype(np.float32)


def shadowed(scene: Scene, buffer: Array, size: float) -> Array:
    """[H, W, 3] in [0, 1]: share of the irradiance of each pixel that bodies leave to it.

    buffer: [H, W] planar depth of the bodies, 0 where none is seen. size: their diagonal, in scene units.
    """
    height, width = buffer.shape
    points = unproject(scene.depth, scene.camera)
    whole = np.full((*buffer.shape, 3), 1e-9)
    lost = np.zeros((*buffer.shape, 3))
    directions, beams = strongest(scene.envmap, SETTINGS.beams)
    for direction, beam in zip(directions, beams, strict=True):
        blocked = np.zeros(buffer.shape, bool)
        for step in (np.arange(SETTINGS.steps) + 0.5) / SETTINGS.steps:
            place, depth = project(
                points + direction * (SETTINGS.reach * size * step), scene.camera
            )
            column, row = (
                np.clip(place[..., k], 0, n - 1).astype(int) for k, n in ((0, width), (1, height))
            )
            shown = (depth > 0) & (
                np.abs(place - [width / 2, height / 2]) < [width / 2, height / 2]
            ).all(-1)
            met = np.where(shown, buffer[row, column], 0)
            blocked |= (met > 0) & (depth > met) & (depth < met + SETTINGS.thickness * size)
        received = np.clip(scene.normal @ direction, 0, None)[..., None] * beam
        whole += received
        lost += received * blocked[..., None]
    return np.where(scene.depth[..., None] > 0, 1 - lost / whole, 1)


def strongest(envmap: Array, count: int) -> tuple[Array, Array]:
    """`count` directions [n, 3] towards a light [h, 2h, 3] and the radiance times solid angle [n, 3] from each.

    By systematic sampling: each stands for an equal share of the light's luminance.
    """
    height, width = envmap.shape[:2]
    power = (envmap * row_solid_angle(height)[:, None, None]).reshape(-1, 3).astype(np.float64)
    light = np.maximum(luminance(power), 1e-12)
    chosen, _ = resample(light, count)
    share = light.sum() / count / light[chosen]
    return texel_directions(height, width).reshape(-1, 3)[chosen], power[chosen] * share[:, None]
