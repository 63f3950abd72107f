"""`bench whdr`: does the albedo order surfaces by brightness as people do (paper, Table 2: WHDR with delta = 0.1)?

Data: Intrinsic Images in the Wild (Bell et al. 2014), one NAME.png and NAME.json a picture. In the JSON,
`intrinsic_points` have id, x, y (in [0, 1]) and opaque, and `intrinsic_comparisons` have point1, point2, darker ('1',
'2' or 'E') and darker_score. WHDR is the weighted part of the judgements that the albedo contradicts: 0 is perfect, and
an albedo that is the same everywhere only agrees with the 'E's.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Pace, Report, write
from materialist.errors import InputError
from materialist.types import Array

DELTA = 0.1
"""Relative difference from which two albedos count as different (Bell et al. 2014, and the paper)."""
LEAST = 1e-10
"""Smallest brightness that a ratio is taken of."""
BASELINES = ("constant", "photo")
"""Albedos that need no predictor: the same everywhere, and the photo itself."""
COLUMNS = (
    Column("whdr", "WHDR", "lower", 4),
    Column("judgements", "judgements", digits=0),
    Column("seconds", "s", "lower", 2),
)
NOTE = (
    "Part of the human judgements of Intrinsic Images in the Wild (weighted by their confidence) that the albedo "
    "contradicts; delta = {delta:g}; brightness is the mean of linear red, green and blue; mean over pictures. "
    "`constant` and `photo` are the albedo that is the same everywhere and the photo itself."
)


@dataclass(frozen=True, kw_only=True)
class WhdrBench(Benchmark):
    """Score predictors (comma-separated) on the pictures in `data`.

    `every` takes every how-manieth picture in the order of names, from the first on (5 is the usual test split of
    Narihira et al.), `limit` at most so many (0: all), `size` is the longer side that the predictor works at.
    """

    predictor: str = "auto"
    size: int = 512
    limit: int = 0
    every: int = 1
    delta: float = DELTA

    def run(self, data: Path | None, output: Path) -> None:
        if data is None:
            raise InputError("This benchmark needs the IIW data set: --data DIR with NAME.png and NAME.json.")
        pairs = find(data)[:: max(1, self.every)]
        pairs = pairs[: self.limit] if self.limit else pairs
        from materialist.bench.predictors import opened, specs_of

        sources = {spec: opened(spec, self.device) for spec in specs_of(self.predictor)}
        rows: list[dict[str, Any]] = []
        lost: dict[str, str] = {}
        pace = Pace()
        settings = self.settings(data, pictures=len(pairs))
        report = Report("WHDR", NOTE.format(delta=self.delta), settings, COLUMNS, rows, plotted=("whdr",))
        for spec in (*BASELINES, *sources):
            for picture, judged in pairs:
                if picture.name in lost:
                    continue
                try:
                    rows.append(_row(spec, sources.get(spec), picture, judged, self.size, self.delta, self.seed))
                except InputError as error:
                    lost[picture.name] = str(error)
                    settings |= {"pictures": len(pairs) - len(lost), "unreadable": "; ".join(lost.values())}
                if pace.due():
                    write(report, output)
        if not rows:
            raise InputError(next(iter(lost.values())))
        write(report, output)


def find(folder: Path) -> list[tuple[Path, Path]]:
    """(picture, judgements) of every picture in the folder, sorted by name; raises InputError when there is none."""
    found = []
    for judged in sorted(folder.glob("*.json")):
        picture = next((p for s in ("png", "jpg") if (p := judged.with_suffix(f".{s}")).is_file()), None)
        if picture is not None:
            found.append((picture, judged))
    if not found:
        raise InputError(f"{folder} holds no picture with judgements (NAME.png and NAME.json, as IIW has them).")
    return found


def whdr(albedo: Array, judgements: dict[str, Any], delta: float = DELTA) -> tuple[float, int]:
    """WHDR of a linear albedo [H, W, 3], and how many judgements counted; NaN when none does.

    Judgements count when both points are opaque, the answer is '1', '2' or 'E', and its score is positive.
    """
    height, width = albedo.shape[:2]
    points = {p["id"]: p for p in judgements["intrinsic_points"]}
    wrong = total = 0.0
    count = 0
    for comparison in judgements["intrinsic_comparisons"]:
        answer, weight = comparison["darker"], comparison["darker_score"]
        pair = [points[comparison[name]] for name in ("point1", "point2")]
        if answer not in ("1", "2", "E") or not weight or weight <= 0 or not all(p["opaque"] for p in pair):
            continue
        places = [(min(int(p["y"] * height), height - 1), min(int(p["x"] * width), width - 1)) for p in pair]
        first, second = (max(LEAST, float(albedo[place].mean())) for place in places)
        said = "1" if second / first > 1 + delta else "2" if first / second > 1 + delta else "E"
        wrong += weight * (said != answer)
        total += weight
        count += 1
    return (wrong / total if total else float("nan")), count


def _row(spec: str, source: Any, picture: Path, judged: Path, size: int, delta: float, seed: int) -> dict[str, Any]:
    """One picture by one method."""
    from materialist.bench.predictors import predicted
    from materialist.io.photo import read_photo

    photo = read_photo(picture, size=size)
    if source is None:
        albedo, seconds = (np.ones_like(photo.linear) if spec == "constant" else photo.linear), float("nan")
    else:
        prediction, seconds = predicted(source, photo, seed)
        albedo = prediction.materials.albedo
    error, count = whdr(albedo, _read(judged), delta)
    return {"method": spec, "sample": picture.stem, "whdr": error, "judgements": count, "seconds": seconds}


def _read(path: Path) -> dict[str, Any]:
    """The judgements in a file; raises InputError when they are not in IIW's layout."""
    try:
        content = json.loads(path.read_text("utf-8"))
        known = {point["id"] for point in content["intrinsic_points"]}
        for comparison in content["intrinsic_comparisons"]:
            for name in ("point1", "point2"):
                if comparison[name] not in known:
                    raise InputError(f"{path}: a comparison is of point {comparison[name]}, which is not in the file.")
            _ = comparison["darker"], comparison["darker_score"]
        for point in content["intrinsic_points"]:
            _ = float(point["x"]), float(point["y"]), point["opaque"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} does not hold judgements in IIW's layout ({error}).") from error
    return content
