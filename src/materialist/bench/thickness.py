"""`bench thickness`: how far RefractionNet and the symmetry prior are from true thickness and true backs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.errors import InputError
from materialist.types import Array

NOTE = """`solid` is the mean absolute error of the thickness over its mean, of each view; `walls` that of the walls of
hollow shapes; `back` the mean angle between the found and the true normals where the camera rays leave the object.
Means over views. `held-out`: procedural shapes that no training set has, their maps bent and blurred as predicted ones
are. Captured meshes (`DIR/meshes/GROUP`, `--data`): exact maps. `symmetry` is the paper's prior: front and back alike,
mirrored across the view of the object's middle."""
COLUMNS = (
    Column("solid", "solid", "lower"),
    Column("hollow", "walls", "lower"),
    Column("back", "back, degrees", "lower", 1),
)


@dataclass(frozen=True, kw_only=True)
class ThicknessBench(Benchmark):
    """Score RefractionNet on `shapes` held-out shapes and the meshes of DATA, each seen `views` or `mesh_views` times.

    `weights`: a .safetensors file instead of those in the package. Raises InputError for counts below 1, WeightsError
    where there are no weights. `device` is not used: the network is small.
    """

    least: ClassVar = {"shapes": 1, "views": 1, "mesh_views": 1}

    shapes: int = 64
    views: int = 8
    mesh_views: int = 4
    weights: str = ""

    def run(self, data: Path | None, output: Path) -> None:
        if data is not None and not (data / "meshes").is_dir():
            raise InputError(f"{data} holds no folder 'meshes'; give one that does, or leave out --data.")
        from materialist.predict.refraction import WEIGHTS
        from materialist.predict.refraction.network import RefractionNet
        from materialist.procedural.thickness.dataset import ViewPlan, make_views
        from materialist.procedural.thickness.errors import of_meshes
        from materialist.render.variant import setup

        setup("cpu")
        network, _ = RefractionNet.load(Path(self.weights) if self.weights else WEIGHTS)
        rows: list[dict[str, Any]] = []
        report = Report("Thickness and back of objects", NOTE, self.settings(data), COLUMNS, rows, ("solid", "back"))
        for k in range(self.shapes):
            rows += _rows(
                "held-out",
                f"shape {k}",
                network,
                make_views(k, ViewPlan(self.shapes, self.views, "heldout", self.seed)),
            )
        for group in sorted(p for p in (data / "meshes").iterdir() if p.is_dir()) if data is not None else ():
            for name, found in of_meshes(group, self.mesh_views, self.seed).items():
                rows += _rows(f"{group.name} meshes", name, network, found)
        write(report, output)


def _rows(group: str, name: str, network: Any, lessons: dict[str, Array]) -> list[dict[str, Any]]:
    """A row a view for the network and for the prior."""
    from materialist.procedural.thickness.errors import errors

    each = errors(network, lessons)
    rows = []
    for k in range(len(each["solid"])):
        own = {"solid": "solid", "hollow": "hollow", "back": "back"}
        prior = {"solid": "symmetry", "back": "back_symmetry"}
        for method, names in (("RefractionNet", own), ("symmetry", prior)):
            figures = {key: float(each[source][k]) for key, source in names.items() if source in each}
            figures = {key: value for key, value in figures.items() if np.isfinite(value)}
            rows.append({"method": f"{group}: {method}", "sample": f"{name} view {k}", **figures})
    return rows
