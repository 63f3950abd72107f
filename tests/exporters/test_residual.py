"""Maps that carry the shading residual: a rendering with them is the photo."""

from dataclasses import replace

import numpy as np
import pytest
from export_scenes import renderer, room

from materialist.color import linear_to_srgb
from materialist.exporters.residual import with_residual
from materialist.metrics import mse


@pytest.fixture(scope="module")
def rendered():
    """The room with its own path-traced re-rendering."""
    scene = room()
    return replace(scene, rerender=renderer(scene).render(spp=256, seed=0))


def photographed(scene, factor):
    """The scene with a photo that is the factor times its re-rendering."""
    linear = np.clip(scene.rerender * factor, 0, 1).astype(np.float32)
    return replace(scene, photo=replace(scene.photo, linear=linear))


def error(scene):
    """Of a rendering with the scene's maps, against its photo, on its surfaces, sRGB."""
    surface = scene.depth > 0
    picture = renderer(scene).render(spp=256, seed=3)[surface]
    return mse(np.clip(picture, 0, 1), scene.photo.linear[surface])


def test_a_rendering_with_the_carried_residual_is_the_photo(rendered):
    """Darker to the left and brighter to the right, in two colours."""
    ramp = np.linspace(0.4, 1.15, rendered.camera.width, dtype=np.float32)[None, :, None]
    scene = photographed(rendered, ramp * np.array([1, 1, 0.7], np.float32))
    maps = with_residual(scene)
    assert error(replace(scene, materials=maps)) < 0.08 * error(scene)
    np.testing.assert_array_equal(maps.roughness, scene.materials.roughness)
    for values in (maps.albedo, maps.metallic):
        assert values.dtype == np.float32 and values.min() >= 0 and values.max() <= 1
    assert (maps.metallic >= scene.materials.metallic).all()
    sky = scene.depth <= 0
    np.testing.assert_array_equal(maps.albedo[sky], scene.materials.albedo[sky])


def test_blacks_are_darker_than_a_dielectric():
    """Base colour 0 still reflects; metallic takes that away, and nowhere else."""
    scene = room()
    dim = replace(scene.materials, albedo=np.float32(0.1) * scene.materials.albedo)
    scene = replace(scene, materials=dim)
    scene = replace(scene, rerender=renderer(scene).render(spp=256, seed=0))
    factor = np.ones_like(scene.rerender)
    factor[:, :30] = 0.2
    scene = photographed(scene, factor)
    maps = with_residual(scene)
    black = np.zeros(scene.depth.shape, bool)
    black[20:, :27] = True
    others = np.zeros_like(black)
    others[20:, 34:] = True
    change = maps.metallic - scene.materials.metallic
    assert change[black].mean() > 0.1 and change[others].mean() < 0.02
    picture = renderer(replace(scene, materials=maps)).render(spp=64, seed=3)
    far = linear_to_srgb(np.clip(picture, 0, 1)) - linear_to_srgb(scene.photo.linear)
    plain = replace(maps, metallic=scene.materials.metallic)
    grey = renderer(replace(scene, materials=plain)).render(spp=64, seed=3)
    haze = linear_to_srgb(np.clip(grey, 0, 1)) - linear_to_srgb(scene.photo.linear)
    assert far[black].mean() < 0.7 * haze[black].mean()


def test_what_is_explained_stays(rendered):
    maps = with_residual(replace(rendered, photo=replace(rendered.photo, linear=rendered.rerender)))
    surface = rendered.depth > 0
    change = np.abs(maps.albedo - rendered.materials.albedo)[surface]
    assert change.mean() < 0.03
    assert np.abs(maps.metallic - rendered.materials.metallic)[surface].mean() < 0.02
