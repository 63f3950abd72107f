"""Shares of a picture's camera rays: together they are all of them, and a pixel's do not depend on other pixels."""

import numpy as np
import pytest
from render_scenes import uniform, wall

from materialist.errors import InputError
from materialist.render.scene import RenderScene
from materialist.render.share import Share
from materialist.types import Camera

CAMERA = Camera(8, 6, 60.0)


@pytest.fixture(scope="module")
def scene() -> RenderScene:
    scene = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    scene.set_materials(uniform(CAMERA, albedo=0.7, roughness=0.4, metallic=0.3))
    scene.set_envmap(np.random.default_rng(4).uniform(0.2, 1.5, (8, 16, 3)).astype(np.float32))
    return scene


@pytest.mark.parametrize(("spp", "every"), [(12, 4), (43, 4), (5, 2), (1, 4), (3, 4), (9, 3)])
def test_rays_add_up(spp, every):
    first, rest = Share(every).rays(spp), Share(every, rest=True).rays(spp)
    assert first + rest == spp and first == len(range(0, spp, every))


def test_both_shares_are_the_same_lattice_as_the_whole(scene):
    """Direct light of a convex scene needs no further random numbers: the sum of rays is the very same."""
    whole = scene.render(spp=11, seed=3, max_depth=2)
    shares = [Share(4), Share(4, rest=True)]
    parts = [scene.render(spp=11, seed=3, max_depth=2, share=share) * share.rays(11) for share in shares]
    np.testing.assert_allclose(sum(parts) / 11, whole, rtol=2e-5)


def test_a_pixel_is_what_it_is_among_all(scene):
    some = np.array([0, 7, 20, 47])
    share = Share(3, rest=True)
    whole = scene.render(spp=7, seed=1, share=share).reshape(-1, 3)
    part = scene.render(spp=7, seed=1, share=Share(3, rest=True, pixels=some)).reshape(-1, 3)
    np.testing.assert_array_equal(part[some], whole[some])
    assert not np.delete(part, some, axis=0).any()
    assert not scene.render(spp=7, seed=1, share=Share(3, pixels=np.zeros(0, int))).any()
    assert not scene.render(spp=1, seed=1, share=Share(4, rest=True)).any()  # one ray has no rest


def test_longer_paths_of_the_rest_have_numbers_of_their_own(scene):
    first, rest = (
        np.mean([scene.render(spp=64, seed=k, share=share) for k in range(8)], axis=0)
        for share in (Share(2), Share(2, rest=True))
    )
    assert first == pytest.approx(rest, rel=0.05) and (first != rest).any()


def test_a_peaked_light_has_no_shares(scene):
    sun = np.full((8, 16, 3), 0.01, np.float32)
    sun[2, 3] = 5000
    other = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    other.set_envmap(sun)
    with pytest.raises(InputError, match="share"):
        other.render(spp=4, share=Share(2))
