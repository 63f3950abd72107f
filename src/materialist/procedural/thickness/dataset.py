"""The data set of RefractionNet on disk: one folder with the views of each shape, made once and gone on with."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.samples import claim, read_arrays, write_arrays
from materialist.procedural.objects.glassware import SPLITS, make_shape
from materialist.procedural.thickness.ray_paths import ShapeTracer
from materialist.procedural.thickness.view import draw_example
from materialist.types import Array

Progress = Callable[[str, int, int], None]
DESCRIPTION = "views.json"
FORMAT = 3


@dataclass(frozen=True)
class ViewPlan:
    """What a set holds."""

    shapes: int = 640
    views: int = 24
    """Views of each shape."""
    split: str = "train"
    """'train', or 'heldout': shapes that no training set has."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.shapes < 1 or self.views < 1 or self.seed < 0:
            raise InputError(
                f"shapes is {self.shapes}, views {self.views}, seed {self.seed}; give at least 1, 1 and 0."
            )
        if self.split not in SPLITS:
            raise InputError(f"The split is {self.split!r}; choose one of {', '.join(SPLITS)}.")


def produce(folder: Path, plan: ViewPlan, progress: Progress = lambda *_: None) -> float:
    """Make the views that FOLDER lacks; shape i depends on the plan's split and seed and on i alone. Returns seconds.

    Raises InputError when FOLDER holds a set of another plan or other things, OutputError when it cannot be written.
    """
    claim(folder, DESCRIPTION, {"format": FORMAT, **asdict(plan)}, ("format", "views", "split", "seed"))
    start = time.monotonic()
    for index in range(plan.shapes):
        path = folder / f"{index:05d}.npz"
        if not path.exists():
            write_arrays(path, make_views(index, plan))
        progress("shapes", index + 1, plan.shapes)
    return time.monotonic() - start


def make_views(index: int, plan: ViewPlan) -> dict[str, Array]:
    """Views of shape `index`: maps [V, CHANNELS, S, S] and target [V, 5, S, S] float16, hollow [V] bool."""
    chosen = make_shape(index, plan.split, plan.seed)
    tracer = ShapeTracer(chosen.solid)
    rng = np.random.default_rng([plan.seed, SPLITS[plan.split], index, 1])
    found = [draw_example(chosen, tracer, rng) for _ in range(plan.views)]
    return {
        "maps": np.stack([f.maps for f in found]),
        "target": np.stack([f.target for f in found]),
        "hollow": np.array([f.hollow for f in found]),
    }


def load(folder: Path) -> dict[str, Array]:
    """All views of a set, as `make_views` has them. Raises InputError when FOLDER holds no set, or a damaged file."""
    files = sorted(folder.glob("[0-9]*.npz"))
    if not files or not (folder / DESCRIPTION).is_file():
        raise InputError(f"{folder} holds no views to learn from; make some: materialist train refraction --data-only.")
    parts = [read_arrays(file, "maps", "target", "hollow") for file in files]
    return {name: np.concatenate([p[name] for p in parts]) for name in ("maps", "target", "hollow")}
