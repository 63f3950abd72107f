"""`bench photo-alone`: what a user gets who has a photo and nothing else, on synthetic photographs never trained on.

Every second photo shows procedural objects under procedural light; the others (with `--data`) show captured meshes
under captured light, of those that no training set may use. Colours are as often as things have them. The photo and its
field of view are given. Rows: `untouched` is the photo as it was; `fitted` is the inversion with the predictor;
`+ light`, `+ albedo`, `+ geometry` and `+ albedo, geometry` are the same with that much of the truth in place of what
was predicted (the true light replaces the fitted one); `ceiling` is the edit with the true maps, light and depth;
`paper` is the inversion by `--engine path --preset paper`: PRB at 64 spp, the MLP at 512 x 256, its stopping rules.

`maps` rows compare `prior` and `fitted` maps with the truth: albedo after one factor (sRGB PSNR), roughness, normals
(degrees), log depth (RMSE), and the light's spherical harmonics after one factor (relative error, 1 is as bad as
darkness). The others are edits, as in `bench edit`, by PSNR inside: `relight` and `metal` (copper) after one factor on
the picture, since the brightness of a light cannot be told from that of surfaces; `insert` also with `screen space`
shadows of the fitted light; `glass` is the largest object turned to glass, `remove` the picture without it. `shadow` is
the PSNR where the true picture changes outside: in shadows and reflections. sheet.png: photo, truth, and the pictures
of the rows after `untouched`; `metal: normals of the maps` is the edit without the normals of round bodies. With
`--jugs`, photos of one jug in a room come last. An edit that the program refuses leaves the photo as it was.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist import metrics, pipeline
from materialist.edits.composite.composite import composite
from materialist.errors import InputError
from materialist.fit.settings import PAPER
from materialist.option_kinds import option
from materialist.types import Array, Prediction, Scene
from materialist_lab.bench import glass_scenes
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row, names, timed
from materialist_lab.bench.edits import KINDS, Edit, edits, sample_and_light, true_scene
from materialist_lab.bench.report import CEILING, Column, Report, side_by_side
from materialist_lab.bench.screen_space import screen_space
from materialist_lab.metrics.maps import aligned_psnr, best_scale, score
from materialist_lab.procedural.synthetic import SyntheticSample

SCENE_SEED = 38_000
"""Of the arrangements, apart from the seeds of all other benchmarks."""
SCALED = ("relight", "metal")
"""Edits whose picture is compared after one factor."""
TRACED = ("insert", "glass", "remove")
"""Edits that change shadows and reflections outside."""
GIVEN = ("light", "albedo", "geometry", "albedo, geometry")
"""What of the truth a row may be given."""


@dataclass(frozen=True, kw_only=True)
class PhotoAloneBench(Benchmark):
    """Invert and edit photos with nothing but the photo given."""

    columns = (
        Column("inside", "PSNR inside", "higher", 2),
        Column("shadow", "PSNR in shadow", "higher", 2),
        Column("albedo", "albedo PSNR", "higher", 2),
        Column("roughness", "roughness PSNR", "higher", 2),
        Column("normal", "normals, degrees", "lower", 1),
        Column("depth", "log depth RMSE", "lower"),
        Column("light", "SH error, relative", "lower"),
        Column("rerender", "re-rendering PSNR", "higher", 2),
        *(
            Column(f"{name}_l1", f"{name} L1 from prior", "")
            for name in ("albedo", "roughness", "metallic")
        ),
        Column("seconds", "fit s", "lower", 1),
    )

    scenes: int = option(24, "Photos.", **COUNT_OR_0)
    jugs: int = option(0, "Photos of one jug each, besides.", **COUNT_OR_0)
    size: int = option(256, "Their width and height.", **SIZE)
    kinds: str = option(",".join(KINDS[:6]), "Edits, with commas.", kind="name")
    predictor: str = option("bundled", "Where the maps come from.", kind="name")
    completion: str = option("auto", "That of `invert`.", kind="name")
    decompose: bool = option(
        False, "Adds the rows that are given a part of the truth.", kind="switch"
    )
    paper: int = option(
        0,
        "Adds rows by the paper's own algorithm, of at most so many steps a stage; 0: none.",
        **COUNT_OR_0,
    )
    spp: int = option(128, "Paths a pixel of composites.", **COUNT)
    truth_spp: int = option(256, "Paths a pixel of the truth.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        kinds = names("kinds", self.kinds, KINDS)
        for sample, light in self._samples(data):
            scenes = {}
            # --- Inversions, and how far their maps are from the truth ---
            for name, fitted, cost in self._fitted(sample):
                scenes[name] = fitted
                if name == "fitted":
                    yield {
                        "method": "maps: prior",
                        "sample": sample.name,
                        **_map_figures(fitted.prior, sample),
                    }
                maps = replace(
                    fitted.prior,
                    materials=fitted.materials,
                    normal=fitted.normal,
                    depth=fitted.depth,
                )
                yield {
                    "method": f"maps: {name}",
                    "sample": sample.name,
                    **_map_figures(maps, sample),
                    "light": light_error(fitted.envmap, sample.envmap),
                    **cost,
                }
            # --- Edits of each of them against the edited truth ---
            before = sample.scene.render(sample.envmap, spp=self.truth_spp, seed=5)
            for edit in edits(sample, light, kinds):
                for row in self._compared(edit, sample, before, scenes, report):
                    yield {**row, "sample": sample.name}

    def _samples(self, data: Path | None) -> Iterator[tuple[SyntheticSample, Array]]:
        """Photos, and the other light that each is shown under."""
        for scene in range(self.scenes):
            yield unseen_sample(scene, data, self.size)
        for k, jug in enumerate(glass_scenes.jugs(self.jugs, SCENE_SEED)):
            stage = glass_scenes.GlassScene(jug, self.size, SCENE_SEED)
            yield glass_scenes.photo_and_light(stage, k, data, self.truth_spp)

    def _fitted(self, sample: SyntheticSample) -> Iterator[tuple[str, Scene, dict[str, float]]]:
        """Names of rows, their scenes, and figures of those that are inversions."""
        shared: dict[str, Any] = {
            "completion": self.completion,
            "seed": self.seed,
            "device": self.device,
        }

        # Every inversion with its cost and how far its maps are from the prior's.
        def inverted(**options: Any) -> tuple[Scene, dict[str, float]]:
            result, cost = timed(pipeline.invert, sample.photo, **shared, **options)
            left = {
                f"{key[9:]}_l1": v
                for key, v in result.report.metrics.items()
                if key.startswith("prior_l1_")
            }
            return result, {
                **cost,
                **left,
                "rerender": metrics.psnr(result.rerender, sample.photo.linear),
            }

        # --- From the photo alone, and by the paper's algorithm ---
        scene, cost = inverted(predictor=self.predictor)
        yield "fitted", scene, cost
        if self.paper:
            yield (
                "paper",
                *inverted(
                    predictor=self.predictor, engine="path", settings=PAPER.at_most(self.paper)
                ),
            )
        if not self.decompose:
            return
        # --- With a part of the truth given: what that part costs ---
        for known in GIVEN:
            if known == "light":
                # Light times albedo is what the photo fixes: the true light fits the albedo's
                # scale.
                scale = best_scale(
                    sample.truth.materials.albedo, scene.materials.albedo, sample.truth.depth > 0
                )
                yield (
                    "+ light",
                    replace(scene, envmap=(sample.envmap / max(scale, 1e-3)).astype(np.float32)),
                    {},
                )
            else:
                yield f"+ {known}", *inverted(prior=with_truth(scene.prior, sample.truth, known))
        yield CEILING, true_scene(sample), {}

    def _compared(
        self,
        edit: Edit,
        sample: SyntheticSample,
        before: Array,
        scenes: dict[str, Scene],
        report: Report,
    ) -> Iterator[Row]:
        """Rows of one edit, and its strip of the sheet; `before` is the true picture of the photo."""
        after = edit.truth.render(edit.envmap, spp=self.truth_spp, seed=5)
        # The true picture tells where an edit shows.
        region = edit.region(before, after), edit.traces(before, after)
        shown = [sample.photo.linear, after]
        yield {
            "method": f"{edit.kind}: untouched",
            **self._scores(edit, sample.photo.linear, after, *region),
        }
        for name, scene in scenes.items():
            try:
                edited = edit.change(scene)
                picture = composite(scene, edited, spp=self.spp, seed=self.seed, device=self.device)
            # An edit that refuses counts as the photo left alone.
            except InputError:
                edited = scene
                picture = sample.photo.linear
            if (edit.kind, name) == ("metal", "fitted"):
                plain = edit.change(scene, normals="maps")
                other = composite(scene, plain, spp=self.spp, seed=self.seed, device=self.device)
                shown.append(other)
                yield {
                    "method": "metal: normals of the maps",
                    **self._scores(edit, other, after, *region),
                }
            if (edit.kind, name) == ("insert", "fitted"):
                # The baseline: shadows in screen space, without a mesh.
                photo = sample.photo.linear
                flat = (
                    photo
                    if edited is scene
                    else screen_space(photo, edited, picture, device=self.device)
                )
                shown.append(flat)
                yield {"method": "insert: screen space", **self._scores(edit, flat, after, *region)}
            shown.append(picture)
            method = f"{CEILING} {edit.kind}" if name == CEILING else f"{edit.kind}: {name}"
            yield {"method": method, **self._scores(edit, picture, after, *region)}
        report.sheet.append(side_by_side(*shown))

    def _scores(
        self, edit: Edit, picture: Array, truth: Array, inside: Array, traces: Array
    ) -> dict[str, float]:
        # Albedo and light share a factor that the photo does not tell.
        if edit.kind in SCALED:
            figures = {"inside": aligned_psnr(picture, truth, inside)}
        else:
            figures = {"inside": metrics.psnr(picture, truth, mask=inside)}
        if edit.kind in TRACED and traces.any():
            figures["shadow"] = metrics.psnr(picture, truth, mask=traces)
        return figures


def unseen_sample(scene: int, data: Path | None, size: int) -> tuple[SyntheticSample, Array]:
    """Photo `scene` of the benchmark, and the other light that it is shown under; captures for odd numbers."""
    source = data if scene % 2 else None
    return sample_and_light(scene, 0, scene, size=size, data=source, seed=SCENE_SEED, unseen=True)


def with_truth(prior: Prediction, truth: Prediction, known: str) -> Prediction:
    """The prior with the true albedo, the true depth and normals, or both."""
    if "albedo" in known:
        prior = replace(prior, materials=replace(prior.materials, albedo=truth.materials.albedo))
    if "geometry" in known:
        prior = replace(prior, depth=truth.depth, normal=truth.normal)
    return prior


def _map_figures(maps: Prediction, sample: SyntheticSample) -> dict[str, float]:
    """Maps against the truth."""
    keys = {
        "albedo_psnr": "albedo",
        "roughness_psnr": "roughness",
        "normal_angle": "normal",
        "depth_si_log_rmse": "depth",
    }
    figures = score(maps, sample.truth)
    return {key: figures[name] for name, key in keys.items() if name in figures}


def light_error(estimate: Array, truth: Array) -> float:
    """Relative error of the spherical harmonics of a light [h, 2h, 3], after the factor that makes it least."""
    # argmin_s |s a - b|^2 = a . b / a . a.
    a = metrics.sh_coefficients(estimate)
    b = metrics.sh_coefficients(truth)
    return metrics.sh_error_relative(estimate * (np.sum(a * b) / max(np.sum(a * a), 1e-12)), truth)
