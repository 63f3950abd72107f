"""`bench ablation`: the paper's tables about its own settings, on synthetic photos, with cached transport."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from materialist import metrics
from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.errors import InputError
from materialist.fit.engine import prepared_envmap
from materialist.fit.invert import FULL, FitSetup, Inversion
from materialist.fit.light import envmap_field, fit_light
from materialist.fit.losses import l1_l2, residual
from materialist.fit.materials import fit_materials, material_field, remapped
from materialist.fit.settings import PAPER, MaterialSettings, MaterialStage, Schedule
from materialist.procedural.synthetic import SyntheticSample, make_sample
from materialist.types import Array, Materials, Prediction

if TYPE_CHECKING:
    import torch

NOTE = """The paper's ablations, its protocol on our synthetic photos: `--preset paper` with cached transport in place
of PRB, materials from the predictor under the light that the paper's fit finds for them. PSNR, SSIM and MSE compare the
path-traced re-rendering with the photo, sRGB-encoded; L_re is the loss that is minimised, of the cached rendering
(linear), at the end. `delta`: 200 steps, stopped early as in the paper (5 % in 20 steps); ARM moves all materials at
once, RM&A roughness and metallic first, then albedo. `steps`: half of them on roughness and metallic, half on all.
`init`: the material network's first weights. `field`: what the materials are written as, 200 steps; `w/o R, M`:
roughness and metallic not predicted but 0.5, the smallest L_re on the way. `fov`: true maps and light on the mesh of
the true depth at a wrong field of view, and the same under another light (relit). `light`: true materials, seconds
until L_re falls to the goal; a dash where it never did."""

COLUMNS = (
    Column("psnr", "PSNR", "higher", 2),
    Column("ssim", "SSIM", "higher"),
    Column("mse", "MSE", "lower", 4),
    Column("loss", "L_re", "lower", 4),
    Column("relit_psnr", "relit PSNR", "higher", 2),
    Column("reached", "s to the goal", "lower", 1),
    Column("steps", "steps", "", 0),
)
FIELDS = {"mlp": "MLP", "unet": "U-Net", "maps": "direct"}
LIGHTS = {"mlp": "envmap, MLP", "texels": "envmap, texels", "sh": "SH coefficients"}
EACH = ("roughness", "metallic"), ("albedo", "roughness", "metallic")
EARLY = {"patience": 20, "min_improvement": 0.05}


@dataclass(frozen=True, kw_only=True)
class AblationBench(Benchmark):
    """The `tables` (names separated by commas) on `scenes` photos of `size` pixels.

    `predictor` makes the first materials and the depth; `truth` takes the true ones. `longest` is how many steps the
    smallest L_re is looked for (the paper: 3000), `goal` the L_re of the `light` table. With `data`, objects come from
    DATA/meshes and light from DATA/envmaps. Raises InputError for a table that is not there.
    """

    least: ClassVar = {"scenes": 1, "size": 16, "spp": 1, "longest": 1}

    deltas: ClassVar = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)  # paper, table delta_ab
    steps: ClassVar = (50, 200, 1000, 2000)  # paper, table steps_ab
    inits: ClassVar = 5  # first weights
    fovs: ClassVar = (0.8, 1.0, 1.2)  # factors on the true field of view
    short: ClassVar = 200  # steps of every other table, paper

    tables: str = "delta,steps,init,field,fov,light"
    scenes: int = 3
    size: int = 64
    predictor: str = "bundled"
    longest: int = 1000
    goal: float = 0.03
    spp: int = 128

    def run(self, data: Path | None, output: Path) -> None:
        from materialist.render.variant import setup

        wanted = [name.strip() for name in self.tables.split(",") if name.strip()]
        for name in wanted:
            if name not in TABLES:
                raise InputError(f"There is no table '{name}'; choose from {', '.join(TABLES)}.")
        if not wanted:
            raise InputError(f"--tables is empty; choose from {', '.join(TABLES)}.")
        setup(self.device)
        rows: list[dict[str, Any]] = []
        report = Report("Ablations", NOTE, self.settings(data), COLUMNS, rows, ("psnr", "loss"))
        for k in range(self.scenes):
            sample = make_sample(k, 0, k, size=self.size, data=data, seed=self.seed)
            bench = _Photo(self, sample, k, data)
            for name in wanted:
                for row in TABLES[name](bench):
                    rows.append({**row, "sample": sample.name})
                    write(report, output)


class _Photo:
    """One photo: its prior, and the paper's light for it."""

    def __init__(self, bench: AblationBench, sample: SyntheticSample, number: int, data: Path | None):
        import torch

        self.sample, self.number, self.data = sample, number, data
        self.bench, self.predictor, self.longest, self.goal = bench, bench.predictor, bench.longest, bench.goal
        self.spp, self.seed, self.device = bench.spp, bench.seed, bench.device
        self.camera = sample.photo.camera
        self.photo = torch.from_numpy(sample.photo.linear.reshape(-1, 3))

    @cached_property
    def prior(self) -> Prediction:
        """What the predictor says of the photo."""
        if self.predictor == "truth":
            return self.sample.truth
        from materialist.bench.predictors import opened

        return opened(self.predictor, self.device).predict(self.sample.photo, seed=self.seed)

    def prepared(self, prior: Prediction) -> Any:
        """Mesh, path tracer and traced transport of a prior."""
        height = self.sample.envmap.shape[0]
        setup = FitSetup(
            self.sample.photo, prior, PAPER, FULL, envmap_height=height, seed=self.seed, device=self.device
        )  # fmt: skip
        prepared: Any = Inversion(setup).prepare()
        prepared.fit.engine.cache.trace()
        return prepared

    @cached_property
    def fitted(self) -> tuple[Any, Array]:
        """The engine of the prior, and the light that the paper's fit finds for it."""
        prepared = self.prepared(self.prior)
        engine, light = prepared.fit.engine, envmap_field(PAPER.light, seed=self.seed)
        fit_light(engine.light_problem(self.prior.materials), self.photo, light, PAPER.light, seed=self.seed)
        return prepared, prepared_envmap(light(PAPER.light.height), self.sample.envmap.shape[0])

    def materials(
        self, method: str, settings: MaterialSettings, *, seed: int = 0, blind: bool = False
    ) -> dict[str, Any]:
        """The row of one fit of the materials; `blind` starts from R = M = 0.5 and tells the smallest L_re."""
        import torch

        prepared, envmap = self.fitted
        engine: Any = prepared.fit.engine
        prior = _maps(self.prior.materials, engine.pixels)
        if blind:
            prior[:, 3:] = 0.5
        held = prior if blind else remapped(prior)
        problem, photo = engine.material_problem(envmap), self.photo[engine.pixels]
        seen: list[float] = []

        def render(maps: torch.Tensor) -> torch.Tensor:
            radiance = problem.render(maps)
            with torch.no_grad():
                seen.append(float(l1_l2(residual(radiance, photo, settings.encoding, clipped=settings.clipped))))
            return radiance

        # What is given is remapped already.
        model = material_field(held, replace(settings, remap=False), engine.pixels, self.camera, seed=seed)
        results = fit_materials(replace(problem, render=render), photo, model, held, settings, None)
        with torch.no_grad():
            maps = model()
            render(maps)
        picture = prepared.fit.reference(_materials(maps, engine.pixels, self.prior), envmap, self.spp, self.seed + 1)
        loss = min(seen) if blind else seen[-1]
        return {**self.against_photo(method, picture), "loss": loss, "steps": sum(r.steps for r in results)}

    def against_photo(self, method: str, picture: Array) -> dict[str, Any]:
        """A row of a picture [H, W, 3] against the photo, clipped as that is."""
        photo = self.sample.photo.linear
        return {
            "method": method, "psnr": metrics.psnr(picture, photo), "ssim": metrics.ssim(picture, photo),
            "mse": metrics.mse(picture, photo),
        }  # fmt: skip


def _stages(names: tuple[tuple[str, ...], ...], steps: int, **early: Any) -> tuple[MaterialStage, ...]:
    """Stages that share the steps evenly; without `early` they run to the end."""
    schedule = Schedule(learning_rate=3e-4, max_steps=max(1, steps // len(names)), **(early or {"patience": 0}))
    return tuple(MaterialStage(targets, schedule) for targets in names)


def _delta(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Table delta_ab."""
    for name, targets in (("ARM", EACH[1:]), ("RM&A", (EACH[0], ("albedo",)))):
        for delta in photo.bench.deltas:
            settings = replace(PAPER.materials, delta=delta, stages=_stages(targets, photo.bench.short, **EARLY))
            yield photo.materials(f"delta {delta:g}, {name}", settings)


def _steps(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Table steps_ab."""
    for steps in photo.bench.steps:
        yield photo.materials(f"{steps} steps", replace(PAPER.materials, stages=_stages(EACH, steps)))


def _init(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Figure ab_init: first weights of the material network."""
    for seed in range(photo.bench.inits):
        yield photo.materials(
            f"init {seed}", replace(PAPER.materials, stages=_stages(EACH, photo.bench.short)), seed=seed
        )


def _field(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Figure net_ab and table min_L_re."""
    for field, name in FIELDS.items():
        settings = replace(PAPER.materials, field=field, stages=_stages(EACH[1:], photo.bench.short))
        yield photo.materials(f"{name}, {photo.bench.short} steps", settings)
    for field in ("maps", "mlp"):
        settings = replace(PAPER.materials, field=field, stages=_stages(EACH[1:], photo.longest))
        yield photo.materials(f"{FIELDS[field]} w/o R, M", settings, blind=True)


def _fov(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Table fov_syn_ab."""
    from materialist.geometry.build import build_geometry
    from materialist.render.scene import RenderScene

    sample, truth = photo.sample, photo.sample.truth
    size = truth.depth.shape
    other = make_sample(photo.number, 0, photo.number + 1, size=size, data=photo.data, seed=photo.seed).envmap
    relit = sample.render(other, spp=photo.spp, seed=photo.seed + 3)
    for factor in photo.bench.fovs:
        camera = replace(photo.camera, fov=factor * photo.camera.fov)
        geometry = build_geometry(truth.depth, truth.normal, camera, completion=FULL, seed=photo.seed)
        mesh = RenderScene(geometry, camera, device=photo.device)
        mesh.set_materials(truth.materials)
        mesh.set_envmap(sample.envmap)
        row = photo.against_photo(f"fov x {factor:g}", mesh.render(spp=photo.spp, seed=photo.seed + 1))
        mesh.set_envmap(other)
        picture = mesh.render(spp=photo.spp, seed=photo.seed + 1)
        yield {**row, "relit_psnr": metrics.psnr(picture, relit)}


def _light(photo: _Photo) -> Iterator[dict[str, Any]]:
    """Table sh: how fast the light explains the photo, true materials given."""
    engine = photo.prepared(photo.sample.truth).fit.engine
    problem = engine.light_problem(photo.sample.truth.materials)
    schedule = Schedule(max_steps=max(photo.bench.short, photo.longest), patience=0)
    for field, name in LIGHTS.items():
        settings = replace(PAPER.light, field=field, height=256 if field == "mlp" else 32, schedule=schedule)
        light = envmap_field(settings, seed=photo.seed)
        result = fit_light(problem, photo.photo, light, settings, seed=photo.seed)
        under = next((k for k, loss in enumerate(result.losses, 1) if loss <= photo.goal), None)
        row = {"method": f"light: {name}", "loss": min(result.losses), "steps": under or result.steps}
        yield row if under is None else {**row, "reached": result.seconds * under / result.steps}


TABLES: dict[str, Callable[[_Photo], Iterator[dict[str, Any]]]] = {
    "delta": _delta, "steps": _steps, "init": _init, "field": _field, "fov": _fov, "light": _light
}  # fmt: skip


def _maps(materials: Materials, pixels: torch.Tensor) -> torch.Tensor:
    """[P, 5] of the pixels."""
    import torch

    parts = (materials.albedo, materials.roughness[..., None], materials.metallic[..., None])
    return torch.from_numpy(np.concatenate(parts, -1).reshape(-1, 5).astype(np.float32))[pixels]


def _materials(maps: torch.Tensor, pixels: torch.Tensor, prior: Prediction) -> Materials:
    """Maps [P, 5] in their pixels; elsewhere the prior's."""
    import torch

    shape = prior.depth.shape
    every = _maps(prior.materials, torch.arange(shape[0] * shape[1]))
    image = every.index_copy(0, pixels, maps).numpy().reshape(*shape, 5)
    return Materials(np.ascontiguousarray(image[..., :3]), image[..., 3].copy(), image[..., 4].copy())
