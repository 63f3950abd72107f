"""`bench whdr`: does the albedo order surfaces by brightness as people do (paper, Table 2: WHDR with delta = 0.1)?

Data: Intrinsic Images in the Wild (Bell et al. 2014), one NAME.png and NAME.json a picture. In the JSON,
`intrinsic_points` have id, x, y (in [0, 1]) and opaque, and `intrinsic_comparisons` have point1, point2, darker ('1',
'2' or 'E') and darker_score. WHDR is the part of the human judgements, weighted by their confidence, that the
albedo contradicts: 0 is perfect. Brightness is the mean of linear red, green and blue; means are over pictures.
`constant` is the albedo that is the same everywhere and only agrees with the 'E's, `photo` the photo itself.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from materialist.errors import InputError
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.types import Array
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row, names, timed
from materialist_lab.bench.report import Column, Report

BASELINES = ("constant", "photo")
"""Albedos that need no predictor: the same everywhere, and the photo itself."""


@dataclass(frozen=True, kw_only=True)
class WhdrBench(Benchmark):
    """Score predictors on the pictures in `data`."""

    columns = (
        Column("whdr", "WHDR", "lower", 4),
        Column("judgements", "judgements", digits=0),
        Column("seconds", "s", "lower", 2),
    )

    predictor: str = option("auto", "Names, with commas.", kind="name")
    size: int = option(512, "Longer side that the predictor works at.", **SIZE)
    limit: int = option(0, "At most so many pictures; 0: all.", **COUNT_OR_0)
    every: int = option(
        1, "Every how-manieth by name; 5 is the usual test split (Narihira et al.).", **COUNT
    )
    delta: float = option(0.1, "Relative difference from which albedos differ.", low=0, high=10)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is None:
            raise InputError(
                "This benchmark needs the IIW data set: --data DIR with NAME.png and NAME.json."
            )
        # --- Pictures with judgements ---
        pairs = find(data)[:: self.every]
        pairs = pairs[: self.limit] if self.limit else pairs
        report.settings["pictures"] = len(pairs)
        # --- Baselines and predictors ---
        sources: dict[str, Any] = dict.fromkeys(BASELINES)
        sources |= {
            spec: get_predictor(spec, device=self.device)
            for spec in names("predictor", self.predictor)
        }
        for spec, source in sources.items():
            for picture, file in pairs:
                photo = read_photo(picture, size=self.size)
                albedo = np.ones_like(photo.linear) if spec == "constant" else photo.linear
                cost: dict[str, float] = {}
                if source is not None:
                    predicted, cost = timed(source.predict, photo, seed=self.seed)
                    albedo = predicted.materials.albedo
                error, count = judged(albedo, file, self.delta)
                row = {"method": spec, "sample": picture.stem, "whdr": error, "judgements": count}
                yield row | {"seconds": cost.get("seconds", np.nan)}


def find(folder: Path) -> list[tuple[Path, Path]]:
    """(picture, judgements) of every picture in the folder, sorted by name; raises InputError when there is none."""
    judged = pairs(folder)
    if not judged:
        raise InputError(
            f"{folder} holds no picture with judgements (NAME.png and NAME.json, as IIW has them)."
        )
    return judged


def pairs(folder: Path) -> list[tuple[Path, Path]]:
    """(picture, judgements) of every picture in the folder, sorted by name."""
    judged = []
    for file in sorted(folder.glob("*.json")):
        picture = next(
            (p for s in ("png", "jpg") if (p := file.with_suffix(f".{s}")).is_file()), None
        )
        if picture is not None:
            judged.append((picture, file))
    return judged


def judged(albedo: Array, file: Path, delta: float = 0.1) -> tuple[float, int]:
    """`whdr` of an albedo by the judgements in a file. Raises InputError where it holds none in IIW's layout."""
    try:
        return whdr(albedo, json.loads(file.read_text("utf-8")), delta)
    except (OSError, ValueError, KeyError, TypeError) as wrong:
        raise InputError(f"{file} does not hold judgements in IIW's layout ({wrong!r}).") from wrong


def whdr(albedo: Array, judgements: dict[str, Any], delta: float = 0.1) -> tuple[float, int]:
    """WHDR of a linear albedo [H, W, 3], and how many judgements counted; NaN when none does.

    Judgements count when both points are opaque, the answer is '1', '2' or 'E', and its score is positive.
    """
    height, width = albedo.shape[:2]
    # --- Weighted disagreement over all judgements that count ---
    points = {p["id"]: p for p in judgements["intrinsic_points"]}
    wrong = total = 0.0
    count = 0
    for comparison in judgements["intrinsic_comparisons"]:
        answer = comparison["darker"]
        weight = comparison["darker_score"]
        pair = [points[comparison[name]] for name in ("point1", "point2")]
        if (
            answer not in ("1", "2", "E")
            or not weight
            or weight <= 0
            or not all(p["opaque"] for p in pair)
        ):
            continue
        # Points are shares of width and height.
        places = [
            (min(int(p["y"] * height), height - 1), min(int(p["x"] * width), width - 1))
            for p in pair
        ]
        first, second = (max(1e-10, float(albedo[place].mean())) for place in places)
        # '1' says that the first point is darker.
        said = "1" if second / first > 1 + delta else "2" if first / second > 1 + delta else "E"
        wrong += weight * (said != answer)
        total += weight
        count += 1
    return (wrong / total if total else float("nan")), count
