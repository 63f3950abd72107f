"""`bench light` on one tiny sample."""

import numpy as np
import pytest

from materialist import metrics
from materialist_lab.bench import light


def fitted_by(name, sample):
    method = light.METHODS[name]
    maps = light.given_maps(sample, method, seed=0, device="cpu")
    return light.fit(sample, method, maps, "auto", device="cpu")


@pytest.mark.slow
def test_the_fitted_light_explains_the_photo_better_than_grey_light(sample):
    fitted, steps, geometry = fitted_by("default", sample)
    assert geometry.plane_label.shape == sample.photo.linear.shape[:2]
    assert steps > 0 and fitted.shape == sample.envmap.shape and fitted.min() >= 0
    grey = np.full_like(fitted, sample.envmap.mean())
    assert metrics.sh_error(fitted, sample.envmap) < 0.7 * metrics.sh_error(grey, sample.envmap)
    photo = sample.photo.linear
    better = metrics.psnr(sample.scene.render(fitted, spp=64), photo)
    assert better > 3 + metrics.psnr(sample.scene.render(grey, spp=64), photo)


@pytest.mark.slow
def test_maps_are_given_as_the_method_says(sample):
    """The paper's "w/ mat" is MatNet's maps, held fixed; "w/o mat": A = R = 0.5 and M = 0.1, whatever the true ones."""
    names = ("paper", "paper w/o mat", "paper predicted", "paper predicted w/o mat")
    true, neutral, predicted, shape = (
        light.given_maps(sample, light.METHODS[name], seed=0, device="cpu") for name in names
    )
    assert (
        true.depth is neutral.depth is sample.truth.depth
        and true.materials is sample.truth.materials
    )
    assert not np.array_equal(predicted.depth, true.depth) and np.array_equal(
        shape.depth, predicted.depth
    )
    for materials in (neutral.materials, shape.materials):
        assert (
            materials.albedo.shape == true.materials.albedo.shape
            and (materials.albedo == 0.5).all()
        )
        assert (materials.roughness == 0.5).all() and np.allclose(materials.metallic, 0.1)


@pytest.mark.slow
def test_one_colour_of_light_and_the_predicted_one_are_not_fitted(sample, monkeypatch):
    # Without the detail of the photo that every light gets.
    monkeypatch.setattr("materialist.fit.invert.with_mirrored_photo", lambda envmap, *_: envmap)
    fitted, steps, _ = fitted_by("constant predicted", sample)
    colours = np.unique(fitted.reshape(-1, 3), axis=0, return_counts=True)[1]
    prior, none, _ = fitted_by("prior predicted", sample)
    assert none == 0 and prior.shape == fitted.shape and prior.std() > 0.05 * prior.mean() > 0
    assert (
        steps == 0 and colours.max() > 0.5 * fitted.shape[0] * fitted.shape[1] and fitted.min() >= 0
    )


@pytest.mark.slow
def test_mirrors_are_photographed_under_the_same_light(sample):
    polished = light.with_mirrors(sample)
    changed = np.abs(polished.photo.linear - sample.photo.linear).max(-1) > 0.05
    things = np.isin(sample.scene.seen, list(sample.scene.things))
    assert (polished.truth.materials.metallic == things).all() and np.array_equal(
        polished.envmap, sample.envmap
    )
    assert changed[things].mean() > 0.5 > changed[~things].mean()


@pytest.mark.slow
def test_a_run_writes_a_row_for_every_method(measured):
    options = {
        "scenes": 1,
        "lights": 1,
        "size": 24,
        "spp": 16,
        "methods": "default",
        "relight": False,
    }
    report = measured("light", device="cpu", **options)
    rows = report.rows
    assert [r["method"] for r in rows] == ["default"]
    assert {c.key for c in light.LightBench.columns} - set(rows[0]) == {"relit_psnr", "albedo_l1"}
    assert rows[0]["mesh_psnr"] > 10 and rows[0]["cpu_seconds"] > 0
    assert "| default | 1 |" in (report.folder / "report.md").read_text()


@pytest.mark.slow
def test_relit_inversions_and_the_paper_s_engine(measured):
    report = measured(
        "light", scenes=1, lights=1, size=48, spp=64, methods="paper path", device="cpu"
    )
    rows = {row["method"]: row for row in report.rows}
    each = [name + end for end in light.COMPLETIONS.values() for name in ("ceiling", "inversion")]
    assert list(rows) == [*each, "paper path"]
    assert min(row["mesh_psnr"] for row in rows.values()) > 15
    assert rows["inversion"]["relit_psnr"] < rows["ceiling"]["relit_psnr"] + 1
    assert rows["paper path"]["sh_error_relative"] < 1
