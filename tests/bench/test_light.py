"""`bench light` on one tiny sample."""

import json

import numpy as np

from materialist import bench, metrics
from materialist.bench import light


def test_the_fitted_light_explains_the_photo_better_than_grey_light(sample):
    from materialist.geometry.build import build_geometry
    from materialist.render.scene import RenderScene

    truth, camera = sample.truth, sample.photo.camera
    geometry = build_geometry(truth.depth, truth.normal, camera)
    found, steps = light.fit(sample, geometry, RenderScene(geometry, camera, device="cpu"), light.METHODS["default"])
    assert steps > 0 and found.shape == sample.envmap.shape and found.min() >= 0
    grey = np.full_like(found, sample.envmap.mean())
    assert metrics.sh_error(found, sample.envmap) < 0.7 * metrics.sh_error(grey, sample.envmap)
    photo = sample.photo.linear
    better = metrics.psnr(sample.render(found, spp=64), photo)
    assert better > 3 + metrics.psnr(sample.render(grey, spp=64), photo)


def test_a_run_writes_a_row_for_the_ceiling_and_every_method(mitsuba, tmp_path):
    out = bench.run(
        "light", output=tmp_path / "out", scenes=1, lights=1, size=24, spp=16, methods="default", device="cpu"
    )
    rows = json.loads((out / "report.json").read_text())["rows"]
    assert [r["method"] for r in rows] == ["ceiling", "default"]
    assert rows[0]["mesh_psnr"] > 10 and rows[0]["relit_psnr"] > 10
    assert {c.key for c in light.COLUMNS} - set(rows[1]) == {"relit_psnr"}
    assert "| ceiling | 1 |" in (out / "report.md").read_text()
