"""The splitting path tracer against Mitsuba's own, and when which of the two is used."""

from pathlib import Path

import numpy as np
import pytest
from render_scenes import uniform, wall, with_floor

from materialist.render import split
from materialist.render.envmap import is_peaked
from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials

CAMERA = Camera(8, 6, 60.0)
OFFICIAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "official_indoor"


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


@pytest.mark.parametrize("max_depth", [2, 3, 4, 6])
@pytest.mark.parametrize("hide_emitters", [False, True])
def test_is_the_path_tracers_picture(corner, max_depth, hide_emitters):
    expected = corner.render_path(spp=16384, seed=1, max_depth=max_depth, hide_emitters=hide_emitters)
    found = corner.render(spp=8192, seed=2, max_depth=max_depth, hide_emitters=hide_emitters)
    assert found == pytest.approx(expected, rel=0.02, abs=2e-3)
    assert found.mean() == pytest.approx(float(expected.mean()), rel=2e-3)


def test_every_bounce_counts(corner):
    means = [float(corner.render(spp=1024, seed=2, max_depth=d).mean()) for d in (2, 3, 4, 6)]
    assert (np.diff(means) > 1e-3).all()


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
    """A bright row at the pole covers little of the sphere; a bright tenth of it is 10 times as bright as the mean."""
    pole = np.ones((64, 128, 3), np.float32)
    pole[0] = 10.0
    assert not is_peaked(pole)
    pole[0], pole[32] = 1.0, 10.0
    assert not is_peaked(pole)
    assert not is_peaked(np.ones((4, 8, 3), np.float32))
    assert not is_peaked(np.zeros((4, 8, 3), np.float32))
    for share, expected in ((0.5, False), (0.25, True)):
        part = np.zeros((8, 16, 3), np.float32)
        part[:, : int(16 * share)] = 1.0
        assert is_peaked(part) is expected, "the measure is 1 / share"


@pytest.mark.slow
@pytest.mark.skipif(not OFFICIAL.exists(), reason="shared/data/official_indoor is not here")
def test_noise_on_a_photograph():
    """Prints the variance of both tracers at equal rays."""
    from materialist.geometry.build import build_geometry
    from materialist.io.photo import read_photo
    from materialist.predict.maps import MapsPredictor

    photo = read_photo(OFFICIAL / "photo.png", size=256, fov=35.0)
    prior = MapsPredictor(str(OFFICIAL / "maps")).predict(photo)
    scene = RenderScene(build_geometry(prior.depth, prior.normal, photo.camera), photo.camera, device="cpu")
    scene.set_materials(prior.materials)
    scene.set_envmap(np.repeat(np.repeat(light(1), 8, 0), 8, 1))
    ours = np.stack([scene.render(spp=25, seed=k) for k in range(4)]).var(0, ddof=1).mean()
    paths = np.stack([scene.render_path(spp=36, seed=k) for k in range(4)]).var(0, ddof=1).mean()
    print(f"variance at 250 rays {ours:.2e}, of path at 252 rays {paths:.2e}: {ours / paths:.2f}")
    assert ours < 0.9 * paths
