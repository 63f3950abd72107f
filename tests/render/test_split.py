"""The splitting path tracer against Mitsuba's own, and when which of the two is used."""

import numpy as np
import pytest
from render_scenes import uniform, wall, with_floor

from materialist.render import split
from materialist.render.envmap import is_peaked
from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials

CAMERA = Camera(8, 6, 60.0)


def light(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.2, 1.5, (8, 16, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def corner() -> RenderScene:
    """A wall with a gap of sky, on a floor: every material, and several bounces."""
    holes = np.zeros((6, 8), bool)
    holes[:2, 5:] = True
    scene = RenderScene(
        with_floor(wall(CAMERA, holes=holes), np.where(holes, -1, 0), height=-0.8), CAMERA, device="cpu"
    )
    rng = np.random.default_rng(3)
    scene.set_materials(
        Materials(
            rng.uniform(0.3, 0.9, (6, 8, 3)).astype(np.float32),
            rng.uniform(0.1, 1, (6, 8)).astype(np.float32),
            rng.uniform(0, 1, (6, 8)).astype(np.float32),
        )
    )
    scene.set_envmap(light(4))
    return scene


@pytest.mark.parametrize("max_depth", [2, 4, 6])
def test_is_the_path_tracers_picture(corner, max_depth):
    expected = corner.render_path(spp=8192, seed=1, max_depth=max_depth)
    found = corner.render(spp=4096, seed=2, max_depth=max_depth)
    assert found == pytest.approx(expected, rel=0.03, abs=3e-3)
    assert found.mean() == pytest.approx(float(expected.mean()), rel=3e-3)


def test_a_white_furnace_keeps_what_the_lobes_reflect():
    """A wall of albedo 1 under uniform light: no more comes back than arrives, and most of it does."""
    scene = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    scene.set_materials(uniform(CAMERA, albedo=1.0, roughness=0.5, metallic=1.0))
    scene.set_envmap(np.ones((8, 16, 3), np.float32))
    image = scene.render(spp=1024, seed=1)
    assert image.min() > 0.85 and image.max() < 1.001


def test_noise_is_less_than_the_path_tracers_at_equal_rays(corner):
    """4 camera rays with 3 paths of 3 rays each, and 6 paths of 1 + 3 x 2 rays: 40 against 42."""

    def noise(render):
        images = np.stack([render(seed) for seed in range(40)])
        return images.var(0).mean()

    ours = noise(lambda seed: corner.render(spp=4, seed=seed))
    paths = noise(lambda seed: corner.render_path(spp=6, seed=seed))
    assert ours < 0.8 * paths


def test_a_sun_is_left_to_the_path_tracer(corner, monkeypatch):
    called = []
    monkeypatch.setattr(split, "trace", lambda *a, **k: called.append("split"))
    monkeypatch.setattr(corner, "render_path", lambda **k: called.append("path"))
    sunny = np.ones((64, 128, 3), np.float32)
    sunny[12, 30] = 5000.0
    assert is_peaked(sunny) and not is_peaked(light(5))
    try:
        corner.set_envmap(sunny)
        corner.render(spp=1)
        corner.set_envmap(light(4))
        corner.render(spp=1)
        corner.render(spp=1, max_depth=1)
        corner.render(spp=1, max_depth=split.DEEPEST + 1)
    finally:
        corner.set_envmap(light(4))
    assert called == ["path", "split", "path", "path"]


def test_peaked_counts_solid_angle():
    """A bright row at the pole covers little of the sphere; of a part of it, the measure is 1 / share."""
    pole = np.ones((64, 128, 3), np.float32)
    pole[0] = 10.0
    assert not is_peaked(pole) and not is_peaked(np.zeros((4, 8, 3), np.float32))
    for share, expected in ((0.5, False), (0.25, True)):
        part = np.zeros((8, 16, 3), np.float32)
        part[:, : int(16 * share)] = 1.0
        assert is_peaked(part) is expected
