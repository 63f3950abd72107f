"""`bench materials` and `bench predictor` on predictors whose answers are known."""

import cv2
import made_samples
import numpy as np
import pytest

from materialist.color import linear_to_srgb
from materialist.io.exr import write_exr
from materialist.predict.normals import normals_from_depth
from materialist.types import Camera
from materialist_lab.bench import materials
from materialist_lab.bench.report import Report


@pytest.fixture
def folder(tmp_path):
    """A photo with true maps: a slanted plane, two paints."""
    place = tmp_path / "data" / "plane"
    (place / "maps").mkdir(parents=True)
    albedo = np.where(np.arange(48)[None, :, None] < 24, [0.6, 0.3, 0.2], [0.2, 0.4, 0.5]).astype(
        np.float32
    )
    albedo = np.repeat(albedo, 40, 0)
    depth = np.linspace(3, 2, 40)[:, None] + np.linspace(0.4, 0, 48)[None]
    depth = depth.astype(np.float32)
    photo = linear_to_srgb(albedo * np.linspace(0.3, 1, 48)[None, :, None]) * 255 + 0.5
    cv2.imwrite(str(place / "photo.png"), np.ascontiguousarray(photo.astype(np.uint8)[..., ::-1]))
    write_exr(place / "maps" / "albedo.exr", albedo)
    write_exr(place / "maps" / "depth.exr", depth)
    write_exr(place / "maps" / "normal.exr", normals_from_depth(depth, Camera(48, 40, 35.0)))
    for name, value in (("roughness", 0.4), ("metallic", 0.0)):
        write_exr(place / "maps" / f"{name}.exr", np.full((40, 48), value, np.float32))
    return tmp_path / "data"


def test_a_perfect_predictor_scores_perfectly(folder, measured):
    maps = folder / "plane" / "maps"
    report = measured("materials", data=folder, predictor=f"maps:{maps},constant")
    best = report.means[f"maps:{maps}"]
    guess = report.means["constant"]
    assert best["albedo_psnr"] == best["roughness_psnr_pooled"] == 100
    assert (
        best["depth_si_log_rmse"] == 0 and best["depth_order"] == 1 and best["normal_angle"] < 0.1
    )
    assert guess["albedo_psnr"] < 60 and guess["roughness_psnr"] == pytest.approx(20, abs=0.1)
    assert (report.folder / "sheet.png").is_file()


def test_maps_that_are_not_there_are_no_truth(folder, measured):
    """What stands in their place (0.5, 0.1, normals of the depth) is scored against by nobody."""
    for name in ("roughness", "metallic", "normal"):
        (folder / "plane" / "maps" / f"{name}.exr").unlink()
    report = measured("materials", data=folder, predictor="constant")
    (row,) = report.rows
    assert {"albedo_psnr", "depth_order"} <= set(row)
    assert not [key for key in row if key.startswith(("roughness", "metallic", "normal"))]
    assert report.settings["no true roughness"] is True


def test_samples_are_seen_by_their_own_camera(tmp_path):
    made_samples.write_set(tmp_path, 5, fov=48.0)
    report = Report("", "", {}, ())
    samples = list(materials.MaterialsBench(limit=2, photographic=False).samples(tmp_path, report))
    assert [name for name, _, _ in samples] == ["0000000", "0000004"]
    assert samples[0][1].camera.fov == pytest.approx(48.0, rel=1e-5)


def test_the_benchmark_of_time(measured):
    rows = measured("predictor", predictor="constant", size=48, warmups=1, runs=2).rows
    assert [row["method"] for row in rows] == ["constant predict"] and rows[0]["mean_ms"] >= rows[
        0
    ]["fastest_ms"] > 0
