"""Tiny training runs of each network."""

from pathlib import Path

import numpy as np

from materialist.predict.bundled.network import BundledArchitecture
from materialist.predict.network import UNetArchitecture
from materialist_lab.data.datasets import open_sources
from materialist_lab.train.bundled import RECIPE, BundledTask
from materialist_lab.train.clicks import RECIPE as CLICKS
from materialist_lab.train.clicks import ClickTask
from materialist_lab.train.refraction import RECIPE as REFRACTION
from materialist_lab.train.refraction import RefractionTask
from materialist_lab.train.schedule import Budget
from materialist_lab.train.trainer import RunOptions, Trainer

NETWORK = BundledArchitecture(
    widths=(8, 8, 16, 32),
    blocks=(1, 1, 1, 1),
    attention=1,
    decoder_blocks=(1, 1, 1),
    fine=8,
    light=16,
)
SMALL = {"side": 32, "batch": 2, "warm_up": 2, "bfloat16": False}
WIDTHS = UNetArchitecture((8, 8, 8, 8, 8), (1, 1, 1, 1, 1))


def bundled(data: Path, *, samples=0, architecture=NETWORK, **changes) -> BundledTask:
    """The bundled network's task, a thousand times smaller than the real one."""
    recipe = RECIPE.changed(**(SMALL | changes))
    return BundledTask(
        open_sources([data]), recipe, score_samples=samples, architecture=architecture
    )


def clicks(views: Path, **changes) -> ClickTask:
    """ClickNet's task with a tiny network."""
    return ClickTask(views, CLICKS.changed(**(SMALL | changes)), architecture=WIDTHS)


def refraction(views: Path, held_out: Path | None = None, **options) -> RefractionTask:
    """RefractionNet's task on small views."""
    return RefractionTask(views, held_out, REFRACTION.changed(**SMALL), **options)


def trainer(task, run: Path, *, steps: int, resume=False, notes=None, **options) -> Trainer:
    """A run that writes no checkpoint before its end."""
    note = (lambda _: None) if notes is None else notes.append
    return Trainer(
        task,
        run,
        budget=Budget(steps=steps),
        options=RunOptions(**{"checkpoint_seconds": 1e9, "seed": 3, **options}),
        resume=resume,
        note=note,
    )


def click_view(seed: int) -> dict:
    """The arrays of a view: a floor with two discs, told by their colours alone."""
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


def write_click_views(folder: Path, count: int = 3) -> Path:
    """A folder of such views."""
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(count):
        np.savez(folder / f"{k:07d}.npz", **click_view(k))
    return folder
