"""Glass before sky shows the photo's sky."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import INNER, MASK, flat_scene

from materialist.edits.composite.composite import composite
from materialist.edits.core.renderer import photo_sky
from materialist.edits.glass.glass import glass
from materialist.edits.light.relight import relight
from materialist.geometry.build import build_geometry
from materialist.io.photo import HDR_CLIP


def before_sky():
    """A block on a strip of ground, before a sky that the fitted light (1.5) does not have."""
    scene = flat_scene()
    depth = np.where(MASK, 2, 0).astype(np.float32)
    depth[-10:] = 3
    sky = np.stack(
        np.broadcast_arrays(np.linspace(0.9, 0.1, 48), 0.3, np.linspace(0.2, 0.9, 48)), -1
    )
    photo = np.where((depth == 0)[..., None], sky[None], scene.photo.linear).astype(np.float32)
    geometry = build_geometry(depth, scene.normal, scene.camera, completion="none")
    return replace(
        scene,
        depth=depth,
        geometry=geometry,
        photo=replace(scene.photo, linear=photo, original=photo),
        rerender=photo,
    )


SCENE = before_sky()


def test_the_map_has_the_photo_where_the_photo_shows_sky():
    sky = photo_sky(SCENE)
    assert sky.shape[1] == 2 * sky.shape[0]
    row = sky[len(sky) // 2 - 3]
    photographed = row[:, 1] == np.float32(0.3)
    assert (
        0 < photographed.mean() < 0.2 and (np.diff(row[photographed][:, 2]) >= 0).all()
    )  # bluer to the right
    assert (row[~photographed] > 1).all()  # the fitted light elsewhere
    # What an HDR file clips is a lower bound, too: a sun that the fit found stays.
    clipped = np.where((SCENE.depth == 0)[..., None], HDR_CLIP, SCENE.photo.linear).astype(
        np.float32
    )
    hdr = replace(
        SCENE, photo=replace(SCENE.photo, linear=clipped, hdr=True), envmap=SCENE.envmap * 100
    )
    assert photo_sky(hdr).max() > HDR_CLIP
    assert photo_sky(replace(hdr, envmap=SCENE.envmap)).max() == HDR_CLIP
    whole = replace(SCENE, depth=np.full_like(SCENE.depth, 2))
    assert photo_sky(whole) is whole.envmap


@pytest.mark.slow
def test_glass_that_bends_nothing_shows_the_sky_behind_it():
    background = SCENE.photo.linear[4:5, :, ::-1].repeat(36, 0)
    edited = glass(SCENE, MASK, ior=1.0, thickness="symmetry", background=background)
    picture = composite(SCENE, edited, spp=16, denoise=False)
    assert (edited.depth[INNER] == 0).all()
    np.testing.assert_allclose(picture[INNER], edited.photo.linear[INNER], atol=0.03)
    assert picture[INNER][:, 0].mean() < picture[INNER][:, 2].mean()


@pytest.mark.slow
def test_under_another_light_the_sky_is_that_light():
    edited = relight(glass(SCENE, MASK, ior=1.0, thickness="symmetry"), ambient=0.5)
    picture = composite(SCENE, edited, spp=16, denoise=False)
    assert (
        picture[INNER].min() > 0.5 and picture[INNER].max() < 0.76
    )  # half of 1 to 1.5, the fitted light
    assert np.ptp(picture[INNER], axis=-1).max() < 0.01
