"""The training of ClickNet, on pictures of two things."""

import os
import shutil

import made_cutouts
import made_runs
import numpy as np
import pytest
import torch
from made_catalog import make_archive
from made_samples import write_set

from materialist.errors import InputError
from materialist.predict.clicks.features import BOX, CHANNELS, SPOT
from materialist_lab.procedural.dataset import produce as produce_set
from materialist_lab.procedural.options import DataSetOptions
from materialist_lab.train.clicks import (
    PASTED,
    click_losses,
    draw_click,
    load_click_views,
    produce_views,
)


def test_clicks_lie_on_what_they_ask_for():
    rng = np.random.default_rng(0)
    view = made_runs.click_view(0)
    seen = set()
    for _ in range(60):
        maps, mask = draw_click(view, 64, rng)
        assert maps.shape == (CHANNELS, 64, 64) and mask.shape == (64, 64) and mask.any()
        spots = maps[SPOT] == 1
        box = maps[BOX] == 1
        assert spots.any() != box.any(), "clicks or a box"
        assert mask[spots].all(), "every click lies on the object"
        if box.any():
            assert mask[box].sum() > 0.85 * mask.sum(), "a box holds about all of it"
        seen.add((bool(mask.mean() > 0.5), bool(box.any())))
    assert len(seen) == 4, "things mostly, the floor at times; clicks and boxes"


def test_the_loss_has_a_closed_form():
    mask = torch.zeros(1, 4, 4)
    mask[0, :2] = 1
    terms = click_losses(torch.zeros(1, 4, 4), mask)
    assert terms["entropy"].item() == pytest.approx(np.log(2), rel=1e-6)
    assert terms["overlap"].item() == pytest.approx(1 - (2 * 4 + 1) / (8 + 8 + 1), rel=1e-6)
    sure = click_losses(40 * (2 * mask - 1), mask)
    assert sure["entropy"].item() < 1e-6 and sure["overlap"].item() < 1e-6


@pytest.fixture
def small_set(tmp_path):
    """Options of a set of single things, of a tiny catalogue."""
    make_archive(tmp_path / "made.sh3f")
    places = {"furniture": tmp_path, "cache": tmp_path / "cache"}
    return {"size": 64, "spp": 1, "device": "cpu", "only": "single", **places}


@pytest.mark.slow
def test_views_are_made_from_a_data_set_as_the_package_sees_it(tmp_path, small_set):
    sets = tmp_path / "first", tmp_path / "second"
    for seed, data in enumerate(sets):
        produce_set(
            data,
            DataSetOptions(seed=11 + seed, **small_set),
            count=1,
        )
    views = tmp_path / "run" / "views"
    produce_views(sets[0], views)
    (view,) = load_click_views(views)
    assert view["rgb"].shape == (64, 64, 3) and view["rgb"].dtype == np.uint8
    length = np.linalg.norm(view["normal"].astype(float) / 127, axis=-1)
    assert np.abs(length[view["depth"] > 0] - 1).max() < 0.03
    assert 1 in np.sign(view["thing"])
    before = (views / "0000000.npz").stat().st_mtime_ns
    shutil.move(sets[0], tmp_path / "elsewhere")
    produce_views(tmp_path / "elsewhere", views)  # a set may move
    with pytest.raises(InputError, match="seed 11, not 12"):
        produce_views(sets[1], views)
    assert (views / "0000000.npz").stat().st_mtime_ns == before, "what is there is kept"


@pytest.mark.slow
def test_cut_outs_are_things_of_further_views(tmp_path, small_set):
    data = tmp_path / "set"
    folder = tmp_path / "cutouts"
    produce_set(data, DataSetOptions(seed=11, **small_set), count=1)
    folder.mkdir()
    made_cutouts.write_disc(folder / "red.png")
    produce_views(data, tmp_path / "views", folder)
    *pasted, plain = load_click_views(tmp_path / "views")
    assert len(pasted) == PASTED
    for view in pasted:
        new = view["thing"] > plain["thing"].max()
        red = view["rgb"][new].astype(int)
        assert new.any() and np.median(red[:, 0] - red[:, 1:].max(1)) > 30
        np.testing.assert_array_equal(view["thing"][~new], plain["thing"][~new])
    with pytest.raises(InputError, match="begun with cutouts 1, not 0"):
        produce_views(data, tmp_path / "views")
    made_cutouts.write_disc(folder / "red.png", size=20)
    with pytest.raises(InputError, match=r"No picture in .* large enough"):
        produce_views(data, tmp_path / "other", folder)
    assert not (tmp_path / "other").exists()


def test_input_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match="no views"):
        made_runs.clicks(tmp_path)
    made_runs.write_click_views(tmp_path / "views")
    os.truncate(tmp_path / "views" / "0000001.npz", 500)
    with pytest.raises(InputError, match=r"0000001\.npz cannot be read .*; delete it"):
        load_click_views(tmp_path / "views")
    write_set(tmp_path / "set", 1)
    with pytest.raises(InputError, match="describes no data set"):
        produce_views(tmp_path / "set", tmp_path / "other")
