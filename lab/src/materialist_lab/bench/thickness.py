"""`bench thickness`: how far RefractionNet and the symmetry prior are from true thickness and true backs.

`solid` is the mean absolute error of the thickness over its mean, of each view; `walls` that of the walls of hollow
shapes; `back` the mean angle between the found and the true normals where the camera rays leave the object. Means over
views. `held-out`: procedural shapes that no training set has, their maps bent and blurred as predicted ones are.
Captured meshes (`DIR/meshes/GROUP`, `--data`): exact maps. `symmetry` is the paper's prior: front and back alike,
mirrored across the view of the object's middle.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from materialist.errors import InputError
from materialist.option_kinds import option
from materialist.predict.refraction.network import RefractionNet
from materialist.predict.refraction.thickness import WEIGHTS
from materialist.render.variant import setup
from materialist.types import Array
from materialist_lab.bench.benchmark import COUNT, Benchmark, Row
from materialist_lab.bench.report import Column, Report
from materialist_lab.procedural.objects.glassware import Shape, centred
from materialist_lab.procedural.objects.shapes import load
from materialist_lab.procedural.options import captures
from materialist_lab.procedural.thickness.dataset import ViewPlan, draw_views, make_views
from materialist_lab.procedural.thickness.errors import errors
from materialist_lab.procedural.thickness.ray_paths import ShapeTracer


@dataclass(frozen=True, kw_only=True)
class ThicknessBench(Benchmark):
    """Score RefractionNet and the symmetry prior; `device` is not used: the network is small."""

    columns = (
        Column("solid", "solid", "lower"),
        Column("hollow", "walls", "lower"),
        Column("back", "back, degrees", "lower", 1),
    )

    shapes: int = option(64, "Held-out shapes.", **COUNT)
    views: int = option(8, "Views of each.", **COUNT)
    mesh_views: int = option(4, "Views of each captured mesh.", **COUNT)
    weights: str = option("", "A .safetensors file instead of the package's.", kind="name")

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is not None and not (data / "meshes").is_dir():
            raise InputError(
                f"{data} holds no folder 'meshes'; give one that does, or leave out --data."
            )
        setup("cpu")
        network, _ = RefractionNet.load(Path(self.weights) if self.weights else WEIGHTS)
        plan = ViewPlan(self.shapes, self.views, "heldout", self.seed)
        # --- Shapes of the held-out split, made worse as predicted maps are ---
        for k in range(self.shapes):
            yield from _rows("held-out", f"shape {k}", network, make_views(k, plan))
        # --- Captured meshes, shown exactly ---
        for group in (
            sorted(p for p in (data / "meshes").iterdir() if p.is_dir()) if data is not None else ()
        ):
            for k, file in enumerate(captures(group, "**/*.ply")):
                shape = Shape(centred(load(file)), hollow=False, upright=True)
                rng = np.random.default_rng([self.seed, k])
                views = draw_views(
                    shape, ShapeTracer(shape.solid), rng, self.mesh_views, exact=True
                )
                yield from _rows(f"{group.name} meshes", file.stem, network, views)


def _rows(group: str, name: str, network: Any, views: dict[str, Array]) -> Iterator[Row]:
    """A row a view for the network and for the prior."""
    # Column -> key of `errors`; the prior knows nothing of walls.
    each = errors(network, views)
    of_network = {"solid": "solid", "hollow": "hollow", "back": "back"}
    of_prior = {"solid": "symmetry", "back": "back_symmetry"}
    for k in range(len(each["solid"])):
        for method, names in (("RefractionNet", of_network), ("symmetry", of_prior)):
            figures = {
                key: float(each[source][k]) for key, source in names.items() if source in each
            }
            # Views without a wall or a back have NaN there.
            figures = {key: value for key, value in figures.items() if np.isfinite(value)}
            yield {"method": f"{group}: {method}", "sample": f"{name} view {k}", **figures}
