"""Small worlds for the tests, and Mitsuba's own path tracer on them as the slow twin."""

from dataclasses import replace

import numpy as np

from materialist.render.envmap import half_turn, on_mitsuba_grid
from materialist.render.scene import look_along, sensor, shape
from materialist.types import Camera
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.walls import Opening, RoomWall, surface
from materialist_lab.procedural.world import Portal, ScenePart, World, block, look, moved

X, Y, Z = np.eye(3)


def plain(colour, roughness=0.6, metallic=0.0, emission=(0.0, 0.0, 0.0)):
    """One colour all over."""
    return m.Material(0, (colour,) * 3, 0.0, (roughness,) * 2, (metallic,) * 2, emission=emission)


def room(*, window: bool, lamp: bool, sky: float = 1.0) -> World:
    """A closed box of 2 m with a metal and a painted block, lit by a window in its right side and by a lamp."""
    grey = plain((0.6, 0.6, 0.55))
    red = plain((0.7, 0.2, 0.15), 0.4)
    # Floor, ceiling, back, left and right walls, two blocks.
    parts = [
        ScenePart(s.sheet((-1, 0, 1), 2 * X, -2 * Z), grey),
        ScenePart(s.sheet((-1, 2, -1), 2 * X, 2 * Z), grey),
        ScenePart(s.sheet((-1, 0, -1), 2 * X, 2 * Y), grey),
        ScenePart(s.sheet((1, 0, 1), -2 * X, 2 * Y), grey),
        ScenePart(s.sheet((-1, 0, 1), -2 * Z, 2 * Y), red),
        block((0.5, 0.7, 0.5), (0.3, 0, -0.3), plain((0.9, 0.7, 0.4), 0.3, 1.0), 0.05, turn=0.5),
        block((0.4, 0.4, 0.4), (-0.4, 0, 0), red, turn=0.2),
    ]
    side = RoomWall(2.0, 2.0, [Opening(0.6, 1.4, 0.6, 1.5)] if window else [])
    parts += moved(surface(side, grey), (1, 0, -1), -np.pi / 2)
    if lamp:
        glow = plain((0.8, 0.8, 0.8), emission=(8.0, 6.0, 4.0))
        parts.append(ScenePart(s.sheet((-0.3, 1.95, -0.3), 0.6 * X, 0.6 * Z), glow))
    envmap = np.full((32, 64, 3), sky, np.float32)
    # A blue sky with a small sun.
    envmap[:12] *= np.array([1.0, 1.5, 3.0], np.float32)
    envmap[10, 40] *= 60
    portals = [Portal(np.array([1, 0.6, -0.4]), 0.8 * Z, 0.9 * Y)] if window else []
    return World(parts, envmap, look((0.1, 1.0, 0.95), (0, 0.6, -0.5), 70), portals)


def still() -> World:
    """Blocks on a ground under the open sky."""
    parts = [
        ScenePart(s.sheet((-2, 0, 2), 4 * X, -4 * Z), plain((0.5, 0.45, 0.4))),
        block((0.5, 0.7, 0.5), (0.3, 0, -0.3), plain((0.9, 0.7, 0.4), 0.3, 1.0), 0.1, turn=0.5),
        ScenePart(s.moved(s.ball(32), (-0.4, 0.35, 0), scale=0.35), plain((0.2, 0.4, 0.7), 0.25)),
    ]
    return World(parts, room(window=True, lamp=False).envmap, look((0, 1.2, 2.5), (0, 0.3, 0), 45))


def reference(world: World, size: int, spp: int, depth: int) -> np.ndarray:
    """[H, W, 3] of the world by Mitsuba's path integrator with the project's BSDF; materials without a pattern."""
    from materialist.render.variant import setup

    mi = setup()
    rotation = world.view.to_scene
    origin = world.view.position
    description = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth, "rr_depth": 100},
    }
    for k, part in enumerate(world.parts):
        material = part.material

        def flat(v):
            return {
                "type": "bitmap",
                "raw": True,
                "data": mi.TensorXf(np.tile(np.float32(v), (2, 2, 1))),
            }

        # Mitsuba's BSDF takes bitmaps.
        colour, roughness, metallic = map(
            flat, (material.colours[0], material.roughness[0], material.metallic[0])
        )
        bsdf = {
            "type": "materialist_disney",
            "base_color": colour,
            "roughness": roughness,
            "metallic": metallic,
        }
        light = None
        if max(material.emission) > 0:
            radiance = (np.array(material.emission) * material.colours[0]).tolist()
            light = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        # The scene in the camera frame, as the tracer has it.
        place = (part.solid.vertices - origin) @ rotation
        normals = part.solid.normals @ rotation
        solid = replace(part.solid, vertices=place, normals=normals)
        description[f"part{k}"] = shape(mi, solid, bsdf, light)
    grid = on_mitsuba_grid(world.envmap, np)
    to_camera = np.eye(4)
    to_camera[:3, :3] = rotation.T
    description["sky"] = {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ones((9, 8, 3), np.float32)),
        "to_world": mi.ScalarTransform4f(to_camera) @ half_turn(mi),
    }
    description["sensor"] = sensor(Camera(size, size, world.view.fov), look_along(mi))
    scene = mi.load_dict(description)
    params = mi.traverse(scene)
    # Set afterwards, on the grid that Mitsuba itself uses.
    params["sky.data"] = mi.TensorXf(grid)
    params.update()
    return np.array(mi.render(scene, spp=spp, seed=3))[..., :3]
