"""The training of ClickNet, on pictures of two things."""

import os
import shutil

import made_runs
import numpy as np
import pytest
import torch
from made_samples import write_set

from materialist.errors import InputError
from materialist.predict.clicks.features import CHANNELS
from materialist.procedural.dataset import produce as produce_set
from materialist.procedural.options import DataSetOptions
from materialist.train.clicks import click_losses, draw_click, load_views, produce_views


def test_clicks_lie_on_what_they_ask_for():
    rng = np.random.default_rng(0)
    view = made_runs.click_view(0)
    seen = set()
    for _ in range(60):
        maps, mask = draw_click(view, 64, rng)
        assert maps.shape == (CHANNELS, 64, 64) and mask.shape == (64, 64) and mask.any()
        spots = maps[-2] == 1
        assert spots.any() and mask[spots].all(), "every click lies on the object"
        seen.add(bool(mask.mean() > 0.5))
    assert seen == {True, False}, "things mostly, the floor at times"


def test_the_loss_has_a_closed_form():
    mask = torch.zeros(1, 4, 4)
    mask[0, :2] = 1
    found = click_losses(torch.zeros(1, 4, 4), mask)
    assert found["entropy"].item() == pytest.approx(np.log(2), rel=1e-6)
    assert found["overlap"].item() == pytest.approx(1 - (2 * 4 + 1) / (8 + 8 + 1), rel=1e-6)
    sure = click_losses(40 * (2 * mask - 1), mask)
    assert sure["entropy"].item() < 1e-6 and sure["overlap"].item() < 1e-6


def test_views_are_made_from_a_data_set_as_the_package_sees_it(tmp_path):
    sets = tmp_path / "first", tmp_path / "second"
    for seed, data in enumerate(sets):
        produce_set(data, DataSetOptions(size=64, seed=11 + seed, spp=1, device="cpu", only="still-life"), count=1)
    views = tmp_path / "run" / "views"
    produce_views(sets[0], views)
    (made,) = load_views(views)
    assert made["rgb"].shape == (64, 64, 3) and made["rgb"].dtype == np.uint8
    length = np.linalg.norm(made["normal"].astype(float) / 127, axis=-1)
    assert np.abs(length[made["depth"] > 0] - 1).max() < 0.03
    assert 1 in np.sign(made["thing"])
    before = (views / "0000000.npz").stat().st_mtime_ns
    shutil.move(sets[0], tmp_path / "elsewhere")
    produce_views(tmp_path / "elsewhere", views)  # a set may move
    with pytest.raises(InputError, match="seed 11, not 12"):
        produce_views(sets[1], views)
    assert (views / "0000000.npz").stat().st_mtime_ns == before, "what is there is kept"


def test_input_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match="no views"):
        made_runs.clicks(tmp_path)
    made_runs.write_click_views(tmp_path / "views")
    os.truncate(tmp_path / "views" / "0000001.npz", 500)
    with pytest.raises(InputError, match=r"0000001\.npz cannot be read .*; delete it"):
        load_views(tmp_path / "views")
    write_set(tmp_path / "set", 1)
    with pytest.raises(InputError, match="describes no data set"):
        produce_views(tmp_path / "set", tmp_path / "other")
