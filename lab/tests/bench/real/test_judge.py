"""`bench real` on tiny folders: what is right scores perfectly, and every row is what it says."""

from dataclasses import replace

import made_real
import numpy as np
import pytest

from materialist import pipeline
from materialist.types import Camera, Materials, Photo, Prediction
from materialist_lab.bench.edits import scene_of
from materialist_lab.bench.real.layouts import LAYOUTS
from materialist_lab.bench.real.measures import light_figures, map_figures
from materialist_lab.bench.real.photos import OtherLight, Reading, RealPhoto, with_depth


@pytest.fixture
def folder(tmp_path):
    """Every layout but the large one."""
    for name, write in made_real.WRITERS.items():
        if name != "nyu":
            write(tmp_path / "data" / name)
    return tmp_path / "data"


@pytest.fixture
def real():
    """A photo of two paints on a floor before a wall, with its whole truth."""
    # Two paints, left and right.
    linear = np.where(
        np.arange(32)[None, :, None] < 16, [0.6, 0.3, 0.2], [0.2, 0.4, 0.5]
    ) * np.ones((24, 1, 1))
    linear = linear.astype(np.float32)
    photo = Photo(linear, Camera(32, 24, 53.13), linear)
    measured = with_depth("made", photo, made_real.floor())
    return replace(
        measured, albedo=linear, other=OtherLight(np.ones((8, 16, 3), np.float32), linear[:, ::-1])
    )


def _maps(real, **changed):
    grey = np.full(real.depth.shape, 0.5, np.float32)
    truth = {"albedo": real.albedo, "normal": real.normal, "depth": real.depth, **changed}
    return Prediction(Materials(truth["albedo"], grey, grey), truth["normal"], truth["depth"])


def test_the_truth_scores_perfectly_up_to_its_factors(real):
    # Albedo and depth are known up to a factor.
    figures = map_figures(_maps(real, albedo=real.albedo * 0.5, depth=real.depth * 7), real)
    assert figures["normal_angle"] < 0.1 and figures["steep_angle"] < 0.1
    assert (
        figures["albedo_psnr"] > 60
        and figures["depth_abs_rel"] < 1e-5
        and figures["depth_order"] == 1
    )


def test_floors_do_not_hide_what_walls_are_like(real):
    """A prediction of floors everywhere is right on the floor alone."""
    up = np.zeros_like(real.normal)
    up[..., 1] = 1
    figures = map_figures(_maps(real, normal=up), real)
    assert figures["steep_angle"] == pytest.approx(90, abs=1) and 20 < figures["normal_angle"] < 80


def test_figures_are_of_the_mask(real):
    # An error outside the mask.
    left = np.zeros(real.depth.shape, bool)
    left[:, :16] = True
    wrong = real.albedo.copy()
    wrong[:, 16:] = 0.9
    assert map_figures(_maps(real, albedo=wrong), real)["albedo_psnr"] < 20
    assert map_figures(_maps(real, albedo=wrong), replace(real, mask=left))["albedo_psnr"] > 60


def test_another_light_after_one_factor(real):
    assert light_figures(real.other.picture * 0.3, real)["relit_psnr"] > 60
    assert light_figures(real.photo.linear, real)["relit_psnr"] < 20
    assert light_figures(real.photo.linear, RealPhoto("bare", real.photo)) == {}


def test_the_maps_alone(folder, measured):
    report = measured("real", data=folder, predictor="constant", prior_only=True)
    rows = {(row["method"], row["sample"]) for row in report.rows}
    assert ("objects: photo", "ball light_00") in rows and (
        "objects: constant",
        "ball light_02",
    ) in rows
    assert not [method for method, _ in rows if "fitted" in method]
    means = report.means
    assert (
        means["room: constant"]["depth_order"] == 0.5
        and means["garage: constant"]["depth_abs_rel"] < 1e-5
    )
    assert means["IIW: photo"]["whdr"] == 0 and means["IIW: constant"]["whdr"] == 1
    assert set(means["published maps, no truth: photo"]) == {"samples", "albedo_psnr"}
    assert (
        report.settings["skipped, since not there"]
        == "nyu/ with ROOM/rgb_NNNNN.jpg with sync_depth_NNNNN.png"
    )
    assert {method.partition(":")[0] for method in means} == {
        x.name for x in LAYOUTS if x.folder != "nyu"
    }
    assert (report.folder / "pictures" / "real_light_ball_light_00.png").is_file()


def test_a_limit_and_few_sheets(folder, measured):
    made_real.write_object(folder / "real_light" / "cube")
    report = measured(
        "real",
        data=folder / "real_light",
        predictor="constant",
        prior_only=True,
        limit=1,
        pictures=2,
    )
    assert {row["sample"] for row in report.rows} == {f"ball light_0{k}" for k in range(3)}
    assert len(list((report.folder / "pictures").iterdir())) == 2


@pytest.mark.slow
def test_a_fitted_scene_is_relit(folder, measured, monkeypatch):
    """With the true shape and paint, the relit photo is nearer to the other one than the photo itself."""

    def fitted(photo, *, prior, **_):
        # The fit is replaced by the truth, so that only the relighting is judged.
        truth = next(real for real in views if np.array_equal(real.photo.linear, photo.linear))
        lamp = next(
            real.other.envmap for real in views if np.array_equal(real.other.picture, photo.linear)
        )
        normal = np.where(truth.mask[..., None], truth.normal, np.float32([0, 0, 1]))
        albedo = np.where(truth.mask[..., None], truth.albedo, np.float32(0.02))
        maps = replace(prior, materials=replace(prior.materials, albedo=albedo), normal=normal)
        return scene_of(photo, maps, 100 * lamp)

    views = list(LAYOUTS[0].photos(folder / "real_light" / "ball", Reading(512, 0)))
    monkeypatch.setattr(pipeline, "invert", fitted)
    means = measured("real", data=folder / "real_light", predictor="constant", lamps=2).means
    assert (
        means["objects: constant, fitted"]["relit_psnr"] > means["objects: photo"]["relit_psnr"] + 2
    )
    assert (
        means["objects: constant, fitted"]["albedo_psnr"]
        > 60
        > means["objects: constant"]["albedo_psnr"]
    )


@pytest.mark.slow
def test_a_whole_run_with_the_network(folder, measured):
    report = measured("real", data=folder / "real_light", predictor="bundled", lamps=1)
    assert [row["method"] for row in report.rows] == [
        "objects: photo",
        "objects: bundled",
        "objects: bundled, fitted",
    ]
    assert all(np.isfinite(row["relit_psnr"]) for row in report.rows[::2])
