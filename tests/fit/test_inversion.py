"""The whole inverse problem on a small synthetic room whose materials and light are known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_room import Room

from materialist import metrics
from materialist.color import CLIPPED
from materialist.envmap import paste_visible_sky, texel_directions
from materialist.fit.invert import invert, stacked
from materialist.fit.settings import DEFAULT, PAPER, MaterialStage, Schedule
from materialist.types import Camera

SMALL_PAPER = replace(PAPER, light=replace(PAPER.light, height=32), light_grid=16)
"""The paper's fit with a small light: most of its time goes to 512 x 256 texels, and to a ray through each."""


@pytest.fixture(scope="module")
def room():
    return Room()


@pytest.fixture(scope="module")
def fitted(room):
    fit = room.fit(DEFAULT)
    return fit, fit.run()


def test_light_is_recovered(room, fitted):
    envmap = fitted[1].envmap
    assert envmap.shape == room.light.shape
    assert float(envmap.min()) >= 0
    assert metrics.sh_error_relative(envmap, room.light) < 0.75 * room.start_error
    turned = np.roll(envmap, envmap.shape[1] // 2, axis=1)
    assert metrics.sh_error_relative(envmap, room.light) < metrics.sh_error_relative(
        turned, room.light
    )


def test_rerendering_comes_close_to_the_photo(room, fitted):
    fit, state = fitted
    before = room.render(room.prior, np.full_like(room.light, 0.6), 64)
    after = room.render(fit.materials(state), state.envmap, 64)
    assert metrics.psnr(after, room.photo.linear) > max(
        28, metrics.psnr(before, room.photo.linear) + 8
    )


def test_true_materials_and_light_stay(room):
    """With true maps as the prior, the fit finds no reason to leave them."""
    fit = room.fit(DEFAULT, prior=room.truth)
    materials = fit.materials(fit.run())
    assert float(np.abs(materials.albedo - room.truth.albedo).mean()) < 0.04
    np.testing.assert_array_equal(materials.roughness, room.truth.roughness)
    np.testing.assert_array_equal(materials.metallic, room.truth.metallic)


def test_mask_unifies_roughness_and_metallic(room):
    mask = room.truth.metallic == 1
    fit = room.fit(DEFAULT.at_most(15), mask=mask)
    materials = fit.materials(fit.run())
    for values in (materials.roughness, materials.metallic):
        assert float(np.ptp(values[mask])) < 1e-6
        assert float(np.ptp(values[~mask])) > 0.05
    assert float(materials.albedo[mask].std(0).max()) > 1e-3


@pytest.mark.parametrize("settings", [SMALL_PAPER, DEFAULT], ids=["paper", "default"])
def test_white_light_first(room, settings):
    """Roughness and metallic from 0.5 under white light, then the light, then albedo alone (appendix)."""
    fit = room.fit(settings.at_most(4), strategy="white-light-first")
    state = fit.run()
    assert [s["name"] for s in state.stages][:3] == ["roughness+metallic", "light", "albedo"]
    moved = (state.maps[:, 3:] - 0.5).abs()
    assert 0 < float(moved.max()) < 0.2
    assert not state.maps[:, :3].equal(fit.start().maps[:, :3])


def test_papers_first_stage_leaves_albedo_alone(room):
    stage = MaterialStage(("roughness", "metallic"), Schedule(learning_rate=3e-4, max_steps=1))
    settings = replace(SMALL_PAPER.at_most(1), materials=replace(PAPER.materials, stages=(stage,)))
    fit = room.fit(settings)
    state = fit.run()
    prior = fit.start().maps
    torch.testing.assert_close(state.maps[:, :3], prior[:, :3])
    expected = 0.7 * prior[:, 3:] + 0.2
    assert 0 < float((state.maps[:, 3:] - expected).abs().max()) < 0.1


@pytest.mark.slow
def test_paper_fits_the_light_again_after_each_stage_under_its_own_bounces(room):
    """The maps move; the light of the second fit goes on from that of the first."""
    fit = room.fit(PAPER.at_most(25))
    state = fit.run()
    names = [stage["name"] for stage in state.stages]
    assert names == [
        "light",
        "roughness+metallic",
        "light 2",
        "materials",
        "light 3",
        "materials 2",
        "light 4",
    ]
    lights = [stage for stage in state.stages if stage["name"].startswith("light")]
    assert lights[1]["loss_first"] < lights[0]["loss_first"]
    start = fit.start().maps
    assert not state.maps[:, :3].equal(start[:, :3])
    assert float(state.maps.min()) >= 0 and float(state.maps.max()) <= 1


def test_bounces_of_the_cache_are_the_path_tracers(room):
    """Cached shading with the bounces of the same maps is the path-traced picture; with the photo's it is not."""
    engine = room.fit(PAPER).engine
    dark = replace(room.truth, albedo=0.4 * room.truth.albedo)
    maps = torch.from_numpy(stacked(dark))[engine.pixels]
    traced = room.render(dark, room.light, 256)

    def decibels(sent):
        picture = np.zeros_like(room.photo.linear)
        picture.reshape(-1, 3)[engine.pixels] = engine.material_problem(room.light, sent)(maps)
        return metrics.psnr(picture, traced)

    assert decibels(engine.bounced(maps, room.light)) > max(30, decibels(None) + 1)


def test_a_stopped_fit_has_what_was_found(room):
    """After the first step of the second stage; nothing comes after it."""
    asked = []

    def stop():
        asked.append(1)
        return len(asked) > 7  # 5 steps of the light, before the next stage, one step

    fit = replace(room.fit(SMALL_PAPER.at_most(5)), stop=stop)
    state = fit.run()
    assert [(s["name"], s["steps"]) for s in state.stages] == [
        ("light", 5),
        ("roughness+metallic", 2),
    ]
    assert float(np.ptp(state.envmap)) > 0
    assert not state.maps[:, 3:].equal(fit.start().maps[:, 3:])


@pytest.mark.parametrize("field", ["mlp-uv", "sh"])
def test_every_light_field_learns(room, field):
    light = replace(
        DEFAULT.light, field=field, height=16, schedule=Schedule(learning_rate=5e-3, max_steps=25)
    )
    fit = room.fit(replace(DEFAULT, light=light).at_most(25))
    stage = next(s for s in fit.run().stages if s["name"] == "light")
    assert stage["loss_last"] < 0.97 * stage["loss_first"]


def test_visible_sky_is_pasted_where_it_is_seen():
    """Radiance of the photo's upper half goes to the texels that look through it; clipped sky only raises them."""
    camera = Camera(32, 32, 60.0)
    photo = np.full((32, 32, 3), 0.4, np.float32)
    photo[:, 16:] = 1.0
    surface = np.zeros((32, 32), bool)
    surface[16:] = True
    envmap = np.full((64, 128, 3), 3.0, np.float32)
    pasted = paste_visible_sky(envmap, photo, surface, camera, white=CLIPPED)
    d = texel_directions(64, 128)
    ahead = (d[..., 2] < -0.95) & (d[..., 1] > 0.03)
    np.testing.assert_allclose(pasted[ahead & (d[..., 0] < -0.03)], 0.4)
    np.testing.assert_allclose(
        pasted[ahead & (d[..., 0] > 0.03)], 3.0
    )  # clipped: at least 1, and 3 is more
    np.testing.assert_allclose(pasted[(d[..., 1] < -0.03) | (d[..., 2] > 0)], 3.0)
    assert paste_visible_sky(envmap, photo, np.ones_like(surface), camera, white=CLIPPED) is envmap
    # What a texel shows is the mean of its pixels, not one of them.
    fine = Camera(320, 320, 60.0)
    noisy = np.random.default_rng(0).uniform(0.2, 0.6, (320, 320, 3)).astype(np.float32)
    mean = paste_visible_sky(
        envmap, noisy, np.kron(surface, np.ones((10, 10))) > 0, fine, white=CLIPPED
    )
    assert np.abs(mean[ahead] - 0.4).max() < 0.08
    # An HDR photo measures up to its own white.
    measured = paste_visible_sky(envmap, 1.5 * photo, surface, camera, white=10.0)
    np.testing.assert_allclose(measured[ahead & (d[..., 0] > 0.03)], 1.5)


def test_a_result_has_two_independent_halves(room):
    told = {}
    setup = replace(
        room.setup(SMALL_PAPER.at_most(3), room.truth), completion="none", spp=4, device="cpu"
    )
    result = invert(setup, on_stage=told.__setitem__)
    assert result.spp == 4 and not np.array_equal(*result.halves)
    np.testing.assert_allclose(result.rerender, np.mean(result.halves, 0), rtol=1e-6)
    assert told["light"] is result.envmap and told["materials"] is result.materials
    names = [stage["name"] for stage in result.stages]
    assert names[:4] == ["geometry", "scene", "engine", "trace"] and names[-1] == "rerender"
