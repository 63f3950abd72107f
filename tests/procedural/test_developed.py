"""What is made of a rendering: picture and shading."""

import sys
from pathlib import Path

import numpy as np

from materialist.procedural import packing, sample, tiles
from materialist.procedural.materials import Material
from materialist.procedural.objects import shapes as s
from materialist.procedural.tracer import SampleTracer
from materialist.procedural.world import ScenePart, World, look
from materialist.types import Camera

sys.path.insert(0, str(Path(__file__).parent))
from made_worlds import X, Z, still

SIZE = 64


def developed(world):
    """The stored arrays of a world, and what its label rays saw."""
    rng = np.random.default_rng(0)
    tracer = SampleTracer(packing.pack(world, rng), Camera(SIZE, SIZE, world.view.fov), device="cpu")
    probe = tracer.probe(sample.PROBE)
    return sample._developed(world, probe, tracer, rng, sample.Options(size=SIZE, device="cpu")), probe


def test_texture_is_not_printed_into_the_shading():
    """A chequered floor under an even sky: its light is even, too."""
    tile = tiles.bank()[1]["checker"][0]
    floor = Material(tile, ((0.1, 0.1, 0.1), (0.8, 0.8, 0.8), (0.9, 0.3, 0.1)), 0.3, (0.6, 0.6), repeat=(0.3, 0.3))
    ground = ScenePart(s.sheet((-9, 0, 9), 18 * X, -18 * Z), floor)
    arrays, probe = developed(World([ground], np.ones((16, 32, 3), np.float32), look((0, 2, 1e-3), (0, 0, 0), 50)))
    texture = probe["albedo"].mean((2, 3))
    shading = arrays["shading"].astype(np.float32).mean(-1)
    assert texture.std() > 0.4 * texture.mean(), "the floor has a texture to print"
    assert abs(np.corrcoef(texture.ravel(), shading.ravel())[0, 1]) < 0.15
    assert shading.std() < 0.04 * shading.mean()


def test_the_shading_ends_where_the_surface_does():
    arrays, probe = developed(still())
    shading, covered = arrays["shading"].astype(np.float32).mean(-1), (probe["owner"] >= 0).mean(2)
    assert (covered == 0).sum() > 100 and (covered == 1).sum() > 1000
    assert np.percentile(shading[covered == 0], 99) < 0.05 * np.median(shading[covered == 1])
