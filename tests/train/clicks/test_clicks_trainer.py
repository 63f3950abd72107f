"""The training of ClickNet, on pictures of two things."""

import os
import shutil

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from materialist.cli import app
from materialist.errors import InputError, OutputError
from materialist.predict.clicks.features import CHANNELS
from materialist.predict.clicks.network import ClickNet
from materialist.train import checkpoint
from materialist.train.budget import Budget
from materialist.train.clicks import views
from materialist.train.clicks.trainer import Recipe, Trainer
from materialist.train.clicks.views import View, click_in, lesson, worse

RECIPE = Recipe(batch=4, warm_up=1, side=32, last_side=64, rate=2e-3)


def picture(seed):
    """A floor with two discs, told by their colours alone."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:64, :80]
    thing = np.full((64, 80), -1, np.int16)
    for number, column in ((1, 24), (2, 58)):
        thing[(x - column) ** 2 + (y - 30) ** 2 < rng.integers(10, 15) ** 2] = number
    colours = rng.uniform(0.1, 0.9, (4, 3))
    rgb = (255 * colours[thing + 1]).astype(np.uint8)
    normal = np.zeros((64, 80, 3), np.int8)
    normal[..., 2] = 127
    return {"rgb": rgb, "normal": normal, "depth": np.full((64, 80), 2, np.float16), "thing": thing}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("views")
    for k in range(3):
        np.savez(path / f"{k:07d}.npz", **picture(k))
    return path


def test_lessons_click_on_what_they_ask_for():
    rng = np.random.default_rng(0)
    view = View(**picture(0))
    seen = set()
    for _ in range(60):
        maps, mask = lesson(view, 64, rng)
        assert maps.shape == (CHANNELS, 64, 64) and mask.shape == (64, 64) and mask.any()
        spots = maps[-2] == 1
        assert spots.any() and mask[spots].all(), "every click lies on the object"
        seen.add(bool(mask.mean() > 0.5))
    assert seen == {True, False}, "things mostly, the floor at times"


def test_a_view_without_anything_large_enough_is_no_lesson():
    view = View(**{**picture(0), "thing": np.zeros((64, 80), np.int16)})
    assert lesson(view, 64, np.random.default_rng(0)) is None
    assert click_in(np.zeros((9, 9), bool), np.random.default_rng(0)) is None


def test_worse_maps_lose_edges_and_keep_what_they_are():
    depth = np.full((96, 96), 2, np.float32)
    depth[:, 48:], depth[:10] = 4, 0
    normal = np.zeros((96, 96, 3), np.float32)
    normal[:, :48, 2], normal[:, 48:, 0] = 1, 1
    steps = []
    for seed in range(12):
        turned, bent = worse(normal, depth, np.random.default_rng(seed))
        assert ((bent > 0) == (depth > 0)).all(), "what has no depth keeps none, and gives its neighbours none"
        known = depth > 0
        np.testing.assert_allclose(np.linalg.norm(turned[known], axis=-1), 1, atol=1e-4)
        assert abs(np.log(bent[known]).mean() - np.log(depth[known]).mean()) < 0.15
        steps.append(float(np.log(bent[40:, 50] / bent[40:, 45]).mean() / np.log(2)))
    assert np.median(steps) < 0.9 and min(steps) < 0.3, "an edge is softer, at times much; waves may add a little"


def test_it_learns_resumes_and_leaves_weights(folder, tmp_path):
    run = tmp_path / "run"
    Trainer(run, folder, budget=Budget(steps=3), recipe=RECIPE).run()
    with pytest.raises(OutputError, match="holds a run already"):
        Trainer(run, folder, budget=Budget(steps=1), recipe=RECIPE)
    resumed = Trainer(run, folder, budget=Budget(steps=2), recipe=RECIPE, resume=True)
    assert resumed.clock.step == 3
    resumed.run()
    network, facts = ClickNet.load(run / "weights.safetensors")
    assert facts["step"] == 5 and facts["recipe"]["last_side"] == 64
    with torch.inference_mode():
        assert network(torch.zeros(1, CHANNELS, 32, 32)).shape == (1, 32, 32)


def test_the_loss_falls(folder, tmp_path):
    torch.manual_seed(0)
    trainer = Trainer(tmp_path / "run", folder, budget=Budget(steps=40), recipe=RECIPE)
    batch = next(trainer.batches())
    history = [trainer._step(batch)["loss"] for _ in range(30)]
    assert history[-1] < 0.7 * history[0]


def test_the_loss_has_a_closed_form(folder, tmp_path):
    trainer = Trainer(tmp_path / "run", folder, budget=Budget(steps=1), recipe=RECIPE)
    mask = torch.zeros(1, 4, 4)
    mask[0, :2] = 1
    found = trainer.terms(torch.zeros(1, 4, 4), {"mask": mask})
    assert found["entropy"].item() == pytest.approx(np.log(2), rel=1e-6)
    assert found["overlap"].item() == pytest.approx(1 - (2 * 4 + 1) / (8 + 8 + 1), rel=1e-6)
    sure = trainer.terms(40 * (2 * mask - 1), {"mask": mask})
    assert sure["entropy"].item() < 1e-6 and sure["overlap"].item() < 1e-6


def test_bad_input(tmp_path, folder):
    with pytest.raises(InputError, match="no views"):
        Trainer(tmp_path / "run", tmp_path, budget=Budget(steps=1))
    with pytest.raises(InputError, match="multiple of 32"):
        Recipe(side=40)
    with pytest.raises(InputError, match="batch is 0"):
        Recipe(batch=0)


def test_views_are_made_from_a_data_set_as_the_package_sees_it(tmp_path):
    from materialist.procedural.dataset import options_for, produce

    data = tmp_path / "set"
    produce(data, options_for(size=64, seed=11, spp=4, device="cpu"), count=2)
    assert views.produce(data, tmp_path / "views") == 2
    made = views.load(tmp_path / "views")
    assert len(made) == 2 and made[0].rgb.shape == (64, 64, 3) and made[0].rgb.dtype == np.uint8
    length = np.linalg.norm(made[0].normal.astype(float) / 127, axis=-1)
    assert np.abs(length[made[0].depth > 0] - 1).max() < 0.03
    assert {v for view in made for v in np.sign(np.unique(view.thing))} >= {-1, 1}
    before = (tmp_path / "views" / "0000000.npz").stat().st_mtime_ns
    views.produce(data, tmp_path / "views")
    assert (tmp_path / "views" / "0000000.npz").stat().st_mtime_ns == before, "what is there is kept"
    shutil.copytree(data, tmp_path / "elsewhere")
    assert views.produce(tmp_path / "elsewhere", tmp_path / "views") == 2, "a set may move"
    (tmp_path / "views" / views.SOURCE).unlink()
    views.produce(data, tmp_path / "views")
    assert (tmp_path / "views" / views.SOURCE).is_file(), "what was made before this was noted is known by its things"


def test_views_of_another_set_are_refused(tmp_path):
    from materialist.procedural.dataset import options_for, produce

    sets = tmp_path / "first", tmp_path / "second"
    for seed, data in enumerate(sets):
        produce(data, options_for(size=32, seed=seed, spp=1, device="cpu"), count=1)
    run = tmp_path / "run" / "views"
    views.produce(sets[0], run)
    before = (run / "0000000.npz").read_bytes()
    with pytest.raises(InputError, match=r"views holds views of another data set than .*second"):
        views.produce(sets[1], run)
    (run / views.SOURCE).unlink()
    with pytest.raises(InputError, match="another data set"):
        views.produce(sets[1], run)
    assert (run / "0000000.npz").read_bytes() == before


def test_a_set_without_a_description_is_known_by_its_first_sample(tmp_path):
    from made_samples import write_set

    for seed in (1, 2):
        data = write_set(tmp_path / f"set{seed}", count=1, fov=40.0 + seed)
        for path in (data / "samples").iterdir():
            with np.load(path) as arrays:
                np.savez(path, **arrays, thing=np.ones(arrays["depth"].shape, np.int16))
    assert views.produce(tmp_path / "set1", tmp_path / "views") == views.produce(tmp_path / "set1", tmp_path / "views")
    with pytest.raises(InputError, match="another data set"):
        views.produce(tmp_path / "set2", tmp_path / "views")


def test_a_damaged_view_is_named(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "views")
    os.truncate(tmp_path / "views" / "0000001.npz", 500)
    with pytest.raises(InputError, match=r"0000001\.npz cannot be read .*; delete it"):
        views.load(tmp_path / "views")


def test_the_command_refuses_before_it_makes_views(tmp_path):
    from made_samples import write_set

    (tmp_path / "run").mkdir()
    checkpoint.save(tmp_path / "run", {"kind": "matnet"})
    command = ["train", "clicks", "-o", tmp_path / "run", "--data", write_set(tmp_path / "set", 1), "--resume"]
    with pytest.raises(InputError, match="holds a run of `train matnet`"):
        CliRunner().invoke(app, [str(word) for word in command], catch_exceptions=False)
    assert not (tmp_path / "run" / "views").exists()


def test_a_set_without_things_says_so(tmp_path):
    from made_samples import write_set

    data = write_set(tmp_path / "set", count=1)
    with pytest.raises(InputError, match="make the set again"):
        views.produce(data, tmp_path / "views")
