"""Photos that are really inverted, small."""

import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from materialist.batches.results import package_hash
from materialist.batches.run import batch
from materialist.batches.task import SINGLE_THREAD
from materialist.io.package import load_scene
from materialist.io.photo import example_path

pytest.importorskip("mitsuba")
OPTIONS = {"size": 64, "envmap_size": [64, 32], "spp": 2, "device": "cpu", "predictor": "constant"}


@pytest.mark.slow
def test_a_photo_becomes_a_scene_and_an_edited_photo(tmp_path):
    (tmp_path / "edits.yaml").write_text("- relight:\n    rotate: 90\n")
    outcome = batch(
        "example:cat", tmp_path / "runs", apply=tmp_path / "edits.yaml", workers=1, **OPTIONS
    )
    (row,) = outcome.rows
    assert row["status"] == "done", row["reason"]
    scene = load_scene(tmp_path / "runs/cat.scene")
    assert scene.camera.width == 64 and row["psnr"] > 20 and row["warnings"]
    photo, edited = (
        np.asarray(Image.open(path))
        for path in (example_path("example:cat"), tmp_path / "runs/cat.png")
    )
    assert edited.shape == photo.shape and np.abs(edited.astype(int) - photo).mean() > 1
    assert row["edit_seconds"] > 0 and row["peak_rss_mb"] > 200


@pytest.mark.slow
def test_the_scene_is_the_one_of_a_single_inversion_whatever_the_worker_did_before(tmp_path):
    listing = tmp_path / "list.txt"
    listing.write_text("example:cat\nexample:coffee\nexample:rocket\n")
    one = batch(listing, tmp_path / "one", workers=1, size=64, device="cpu")
    two = batch(listing, tmp_path / "two", workers=2, size=64, device="cpu")
    assert one.hash == two.hash and one.exit_code == 0
    command = [
        sys.executable,
        "-m",
        "materialist",
        "invert",
        "example:rocket",
        "-o",
        str(tmp_path / "rocket.scene"),
    ]
    subprocess.run(
        [*command, "--size", "64", "--device", "cpu"],
        check=True,
        env={**os.environ, **SINGLE_THREAD},
    )
    assert package_hash(tmp_path / "rocket.scene") == package_hash(tmp_path / "one/rocket.scene")
