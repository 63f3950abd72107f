"""Tiny training runs, in this process or in several."""

import os
from pathlib import Path

import torch

from materialist.io.samples import SampleFolder
from materialist.train.budget import Budget
from materialist.train.launch import Processes, join
from materialist.train.recipes import recipe
from materialist.train.tasks import BundledTask
from materialist.train.trainer import Habits, Trainer

NETWORK = {"widths": [8, 8, 16, 32], "blocks": [1, 1, 1, 1], "attention": 1, "decoder_blocks": [1, 1, 1], "fine": 8}


def trainer(
    data: Path, run: Path, *, steps: int, resume=False, samples=0, processes=None, notes=None, workers=0, **changes
):
    """A run of a network that is a thousand times smaller than the real one."""
    options = {"network": NETWORK, "size": 32, "batch": 2, "warm_up": 2, "bfloat16": False, **changes}
    habits = Habits(checkpoint_seconds=1e9, score_samples=samples, workers=workers, seed=3)
    note = (lambda _: None) if notes is None else notes.append
    return Trainer(
        recipe("bundled", **options), BundledTask(), SampleFolder(data), run, budget=Budget(steps=steps),
        habits=habits, processes=processes or Processes(), resume=resume, note=note,
    )  # fmt: skip


def one_of_two(rank: int, port: int, data: Path, run: Path) -> None:
    """What each of two processes does: train three steps and leave its weights beside the run."""
    os.environ |= {"RANK": str(rank), "WORLD_SIZE": "2", "LOCAL_RANK": str(rank)}
    os.environ |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    torch.set_num_threads(1)
    processes = join("cpu")
    run_of_mine = trainer(data, run, steps=3, processes=processes)
    run_of_mine.run()
    torch.save(run_of_mine.network.state_dict(), run / f"weights{rank}.pt")
    processes.leave()
