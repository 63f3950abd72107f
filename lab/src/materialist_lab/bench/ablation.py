"""`bench ablation`: the paper's tables about its own settings, with cached transport.

The paper's ablations, its protocol on synthetic photos or, with `--photos`, on real ones: `--preset paper` with cached
transport in place of PRB, materials from the predictor under the light that the paper's fit finds for them. PSNR, SSIM
and MSE compare the path-traced re-rendering with the photo, sRGB-encoded; L_re is the loss that is minimised, of the
cached rendering (linear), at the end. `delta`: 200 steps, stopped early as in the paper (5 % in 20 steps); ARM moves
all materials at once, RM&A roughness and metallic first, then albedo. `steps`: half of them on roughness and metallic,
half on all. `init`: the material network's first weights. `field`: what the materials are written as, 200 steps;
`w/o R, M`: roughness and metallic not predicted but 0.5, the smallest L_re on the way. `fov`: true maps and light on
the mesh of the true depth at a wrong field of view, and the same under another light (relit); of real photos, light and
materials are fitted (200 steps) at factors on the field of view that is read or assumed. `weight`, of `--preset
default` in place of the paper's: how much the albedo costs that leaves its prior, and the prior itself; the albedo
against the truth is sRGB-encoded, after one factor.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import torch

from materialist import metrics
from materialist.buffers import placed
from materialist.edits.core.renderer import rendered
from materialist.errors import InputError
from materialist.fit.albedo import solve_albedo
from materialist.fit.fields import ALL, Rows
from materialist.fit.invert import FitSetup, FitState, prepare, replaced
from materialist.fit.losses import encoded_error, rendering_loss
from materialist.fit.materials import fit_materials, material_field, remapped
from materialist.fit.settings import DEFAULT, PAPER, MaterialSettings, MaterialStage, Schedule
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.types import Array, Photo, Prediction
from materialist_lab.bench.batch import chosen
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row, names
from materialist_lab.bench.edits import sample_and_light, true_scene
from materialist_lab.bench.report import Column, Report
from materialist_lab.metrics.maps import score
from materialist_lab.procedural.synthetic import SyntheticSample

FIELDS = {"mlp": "MLP", "unet": "U-Net", "maps": "direct"}
EACH = ("roughness", "metallic"), ("albedo", "roughness", "metallic")


@dataclass(frozen=True, kw_only=True)
class AblationBench(Benchmark):
    """The paper's tables; with `data`, objects come from DATA/meshes and light from DATA/envmaps, or photos."""

    columns = (
        Column("psnr", "PSNR", "higher", 2),
        Column("ssim", "SSIM", "higher"),
        Column("mse", "MSE", "lower", 4),
        Column("loss", "L_re", "lower", 4),
        Column("relit_psnr", "relit PSNR", "higher", 2),
        Column("albedo_psnr", "albedo PSNR", "higher", 2),
        Column("steps", "steps", "", 0),
    )

    deltas: ClassVar = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)  # paper, table delta_ab
    steps: ClassVar = (50, 200, 1000, 2000)  # paper, table steps_ab
    inits: ClassVar = 5  # first weights
    fovs: ClassVar = (0.8, 1.0, 1.2)  # factors on the true field of view
    short: ClassVar = 200  # steps of every other table, paper
    weights: ClassVar = (0.01, 0.1, 0.2, 0.3, 0.7, 2.0)  # of the albedo's prior

    tables: str = option("delta,steps,init,field,fov", "With commas; also weight.", kind="name")
    scenes: int = option(3, "How many photos.", **COUNT)
    photos: bool = option(
        False,
        "Real photos, spread over those of DATA/photos; without DATA examples.",
        kind="switch",
    )
    size: int = option(64, "Their width and height.", **SIZE)
    predictor: str = option(
        "bundled", "Of first materials and depth; `truth` takes the true ones.", kind="name"
    )
    longest: int = option(
        1000, "Steps in which the smallest L_re is looked for; the paper has 3000.", **COUNT
    )
    spp: int = option(128, "Paths a pixel of pictures that are compared.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        chosen_tables = names("tables", self.tables, TABLES)
        for photo in self._real(data) if self.photos else self._synthetic(data):
            for name in chosen_tables:
                for row in TABLES[name](photo):
                    yield {**row, "sample": photo.photo.path}

    def _real(self, data: Path | None) -> "Iterator[_Photo]":
        if self.predictor == "truth":
            raise InputError(
                "The predictor 'truth' has no maps of real photos; choose another, or leave out --photos."
            )
        with TemporaryDirectory() as place:
            for location in chosen(data, self.scenes, Path(place)):
                yield _Photo(self, read_photo(location, size=self.size))

    def _synthetic(self, data: Path | None) -> "Iterator[_Photo]":
        for k in range(self.scenes):
            sample, other = sample_and_light(k, 0, k, size=self.size, data=data, seed=self.seed)
            yield _Photo(self, sample.photo, sample, other)


class _Photo:
    """One photo: its prior, and the paper's light for it."""

    def __init__(
        self,
        bench: AblationBench,
        photo: Photo,
        sample: SyntheticSample | None = None,
        other: Array | None = None,
    ):
        """`other` [h, 2h, 3] is the light of the relit pictures of a synthetic photo."""
        self.bench = bench
        self.photo = photo
        self.sample = sample
        self.other = other

    @cached_property
    def prior(self) -> Prediction:
        if self.bench.predictor == "truth" and self.sample is not None:
            return self.sample.truth
        predictor: Any = get_predictor(self.bench.predictor, device=self.bench.device)
        return predictor.predict(self.photo, seed=self.bench.seed)

    @cached_property
    def fitted(self) -> tuple[Any, FitState]:
        """Mesh, path tracer and traced transport of the prior, and it with the light that the paper's fit finds."""
        shared: dict[str, Any] = {"seed": self.bench.seed, "device": self.bench.device}
        fitting: Any = prepare(FitSetup(self.photo, self.prior, PAPER, **shared))
        state = fitting.start()
        fitting.fit_light(state, self.prior.materials)
        return fitting, state

    def materials(
        self, method: str, settings: MaterialSettings, *, seed: int = 0, blind: bool = False
    ) -> Row:
        """The row of one fit of the materials; `blind` starts from R = M = 0.5 and tells the smallest L_re."""
        fitting, state = self.fitted
        engine: Any = fitting.engine
        prior = fitting.start().maps
        if blind:
            prior[:, 3:] = 0.5
        held = prior if blind else remapped(prior)
        problem = fitting.material_problem(state)
        photo = placed(self.photo.linear.reshape(-1, 3))[engine.pixels]
        seen: list[float] = []

        def render(maps: torch.Tensor, rows: Rows = ALL) -> torch.Tensor:
            radiance = problem(maps, rows)
            with torch.no_grad():
                error = encoded_error(
                    radiance, photo[rows], settings.encoding, white=settings.white
                )
                seen.append(float(rendering_loss(error)))
            return radiance

        model = material_field(held, settings, engine.pixels, self.photo.camera, seed=seed)
        results = fit_materials(render, photo, model, held, settings)
        with torch.no_grad():
            maps = model()
            render(maps)
        materials = replaced(self.prior.materials, engine.pixels, maps)
        picture = fitting.render(materials, state.envmap, self.bench.spp, self.bench.seed + 1)
        loss = min(seen) if blind else seen[-1]
        return {
            **self.against_photo(method, picture),
            "loss": loss,
            "steps": sum(r.steps for r in results),
        }

    def against_photo(self, method: str, picture: Array) -> Row:
        """A row of a picture [H, W, 3] against the photo, clipped as that is."""
        compared = {
            name: getattr(metrics, name)(picture, self.photo.linear)
            for name in ("psnr", "ssim", "mse")
        }
        return {"method": method, **compared}


def _stages(
    targets: tuple[tuple[str, ...], ...], steps: int, **early: Any
) -> tuple[MaterialStage, ...]:
    """Stages that share the steps evenly; without `early` they run to the end."""
    schedule = Schedule(
        learning_rate=3e-4, max_steps=max(1, steps // len(targets)), **(early or {"patience": 0})
    )
    return tuple(MaterialStage(target, schedule) for target in targets)


def _delta(photo: _Photo) -> Iterator[Row]:
    """Table delta_ab."""
    for name, targets in (("ARM", EACH[1:]), ("RM&A", (EACH[0], ("albedo",)))):
        for delta in photo.bench.deltas:
            stages = _stages(targets, photo.bench.short, patience=20, min_improvement=0.05)
            yield photo.materials(
                f"delta {delta:g}, {name}", replace(PAPER.materials, delta=delta, stages=stages)
            )


def _steps(photo: _Photo) -> Iterator[Row]:
    """Table steps_ab."""
    for steps in photo.bench.steps:
        yield photo.materials(
            f"{steps} steps", replace(PAPER.materials, stages=_stages(EACH, steps))
        )


def _init(photo: _Photo) -> Iterator[Row]:
    """Figure ab_init: first weights of the material network."""
    settings = replace(PAPER.materials, stages=_stages(EACH, photo.bench.short))
    for seed in range(photo.bench.inits):
        yield photo.materials(f"init {seed}", settings, seed=seed)


def _field(photo: _Photo) -> Iterator[Row]:
    """Figure net_ab and table min_L_re."""
    for field, name in FIELDS.items():
        settings = replace(
            PAPER.materials, field=field, stages=_stages(EACH[1:], photo.bench.short)
        )
        yield photo.materials(f"{name}, {photo.bench.short} steps", settings)
    for field in ("maps", "mlp"):
        settings = replace(
            PAPER.materials, field=field, stages=_stages(EACH[1:], photo.bench.longest)
        )
        yield photo.materials(f"{FIELDS[field]} w/o R, M", settings, blind=True)


def _fov(photo: _Photo) -> Iterator[Row]:
    """Table fov_syn_ab."""
    bench = photo.bench
    sample = photo.sample
    other = photo.other
    for factor in bench.fovs:
        camera = replace(photo.photo.camera, fov=factor * photo.photo.camera.fov)
        name = f"fov x {factor:g}"
        if sample is None or other is None:
            settings = replace(PAPER.materials, stages=_stages(EACH[1:], bench.short))
            yield _Photo(bench, replace(photo.photo, camera=camera)).materials(name, settings)
            continue
        seen = replace(sample, photo=replace(photo.photo, camera=camera))
        scene = true_scene(seen, completion="planes", seed=bench.seed)
        rendering: dict[str, Any] = {
            "spp": bench.spp,
            "seed": bench.seed + 1,
            "device": bench.device,
        }
        row = photo.against_photo(name, rendered(scene, **rendering))
        relit = rendered(replace(scene, envmap=other), **rendering)
        truth = sample.scene.render(other, spp=bench.spp, seed=bench.seed + 3)
        yield {**row, "relit_psnr": metrics.psnr(relit, truth)}


def _weight(photo: _Photo) -> Iterator[Row]:
    """How far the albedo may leave its prior: the default fit's one choice between maps and re-rendering."""
    bench = photo.bench
    setup = FitSetup(photo.photo, photo.prior, DEFAULT, seed=bench.seed, device=bench.device)
    fitting = prepare(setup)
    # --- The light by the prior's materials, as in an inversion ---
    state = fitting.start()
    fitting.fit_light(state, photo.prior.materials)
    problem = fitting.material_problem(state)
    target = placed(photo.photo.linear.reshape(-1, 3))[fitting.engine.pixels]
    # --- The prior, and the albedo of each weight ---
    albedos = {"albedo of the prior": state.maps}
    for weight in bench.weights:
        settings = replace(DEFAULT.materials, weights=(weight, 1.0, 1.0))
        albedos[f"albedo's weight {weight:g}"], _ = solve_albedo(
            problem, target, state.maps, settings
        )
    for method, maps in albedos.items():
        materials = replaced(photo.prior.materials, fitting.engine.pixels, maps)
        picture = fitting.render(materials, state.envmap, bench.spp, bench.seed + 1)
        row = photo.against_photo(method, picture)
        if photo.sample is not None:
            known = replace(photo.prior, materials=materials)
            row["albedo_psnr"] = score(known, photo.sample.truth)["albedo_psnr"]
        yield row


TABLES: dict[str, Callable[[_Photo], Iterator[Row]]] = {
    "delta": _delta,
    "steps": _steps,
    "init": _init,
    "field": _field,
    "fov": _fov,
    "weight": _weight,
}
