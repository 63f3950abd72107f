"""What ClickNet learns from: pictures of `train data` as photographs, their predicted maps, and what is one thing."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from materialist.color import linear_to_srgb
from materialist.errors import InputError, OutputError
from materialist.io.samples import SampleFolder, read_arrays, read_sample, write_arrays
from materialist.predict.clicks.features import features
from materialist.predict.weights import sha256
from materialist.procedural.dataset import identity
from materialist.types import Array

Progress = Callable[[str, int, int], None]
SOURCE = "views.json"
"""Of which data set the views beside it are."""
FEWEST = 60
"""Pixels of a view below which a thing is not clicked on."""
DEEP = 2.5
"""Pixels inside a thing at which it is clicked on, where it is as large."""
THINGS = 0.85
"""Share of clicks on things; the others are on walls, floors and the like."""
MORE = 0.25
"""Share of lessons with several clicks."""
LEAST_CROP = 0.4
"""Smallest part of a view's side that a lesson shows."""
WORSE = 0.5
"""Share of lessons whose maps are made worse: the bundled network learnt from such pictures, and knows photos less."""
BLUR = (0.008, 0.1)
"""Blur of such maps, as a part of the side, from and to."""
WAVES = 0.25
"""Largest amplitude of waves laid over their normals, and over the logarithm of their depth as a part of its spread."""


@dataclass(frozen=True)
class View:
    """One photograph as the package would see it, and its things."""

    rgb: Array
    """[H, W, 3] uint8 sRGB."""
    normal: Array
    """[H, W, 3] int8, 127 for 1: predicted."""
    depth: Array
    """[H, W] float16: predicted."""
    thing: Array
    """[H, W] int16: number of what is seen, negative for walls and the like, 0 for nothing."""


def produce(data: Path, folder: Path, progress: Progress = lambda *_: None) -> int:
    """Make the views that FOLDER lacks, by the bundled network; returns how many are there.

    Raises InputError for a data set without things (made before they were kept) and for a FOLDER with views of another
    set, OutputError for one that cannot be written.
    """
    from materialist.predict.bundled.predictor import BundledPredictor
    from materialist.procedural.photographic import photographic
    from materialist.types import Camera, Photo

    source = SampleFolder(data)
    _claim(folder, source)
    predictor = BundledPredictor()
    for number, path in enumerate(source.paths):
        target = folder / path.name
        if not target.exists():
            thing, rng = _things(path), np.random.default_rng([int(path.stem), 4])
            linear = np.clip(photographic(read_sample(path).image, rng), 0, 1).astype(np.float32)
            camera = Camera(linear.shape[1], linear.shape[0], float(read_arrays(path, "fov")["fov"]))
            found = predictor.predict(Photo(linear, camera, linear, False, "option", path.name, b"", ()))
            made = {
                "rgb": (linear_to_srgb(linear) * 255 + 0.5).astype(np.uint8), "thing": thing,
                "normal": np.rint(found.normal * 127).astype(np.int8), "depth": found.depth.astype(np.float16),
            }  # fmt: skip
            write_arrays(target, made)
        progress("views", number + 1, len(source.paths))
    return len(source.paths)


def _claim(folder: Path, source: SampleFolder) -> None:
    """Note in the folder of which set its views are. Raises InputError where they are of another one."""
    said, file = _identity(source), folder / SOURCE
    views, noted = sorted(folder.glob("[0-9]*.npz")), _noted(file)
    if views and (not _of(views[0], source) if noted is None else noted != said):
        raise InputError(f"{folder} holds views of another data set than {source.folder}; name another folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".part")
        partial.write_text(json.dumps(said, indent=1) + "\n", "utf-8")
        partial.replace(file)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}.") from error


def _identity(source: SampleFolder) -> dict[str, Any]:
    """What tells the set from others: what decided how it was made, or its first sample where that is not known."""
    try:
        return identity(source.folder)
    except InputError:
        return {"first": sha256(source.paths[0])}


def _noted(file: Path) -> Any:
    """What a folder says of its set; None where it says nothing."""
    try:
        return json.loads(file.read_text("utf-8"))
    except (OSError, ValueError):
        return None


def _of(view: Path, source: SampleFolder) -> bool:
    """Whether a view shows the things of the set's sample of that name."""
    path = source.folder / "samples" / view.name
    return path.is_file() and np.array_equal(read_arrays(view, "thing")["thing"], _things(path))


def _things(path: Path) -> Array:
    """What is one thing in a sample. Raises InputError where it does not say."""
    arrays = read_arrays(path)
    if "thing" not in arrays:
        raise InputError(f"{path} does not say what is one thing; make the set again: train data.")
    return arrays["thing"]


def load(folder: Path) -> list[View]:
    """All views of a folder, in the order of their names. Raises InputError for one that is damaged."""
    names = ("rgb", "normal", "depth", "thing")
    return [View(**read_arrays(path, *names)) for path in sorted(folder.glob("[0-9]*.npz"))]


def lesson(view: View, side: int, rng: np.random.Generator) -> tuple[Array, Array] | None:
    """([C, side, side] features, [side, side] bool) of a random part of a view and a click in it; None without things.

    The part is mirrored or not, recoloured, and some clicks are several.
    """
    import cv2

    height, width = view.thing.shape
    size = round(min(height, width) * rng.uniform(LEAST_CROP, 1.0))
    top, left = rng.integers(height - size + 1), rng.integers(width - size + 1)
    part = np.s_[top : top + size, left : left + size]
    nearest = lambda v: cv2.resize(np.ascontiguousarray(v), (side, side), interpolation=cv2.INTER_NEAREST)  # noqa: E731
    way = cv2.INTER_AREA if size > side else cv2.INTER_LINEAR
    smooth = lambda v: cv2.resize(np.ascontiguousarray(v, np.float32), (side, side), interpolation=way)  # noqa: E731
    thing, depth = (np.asarray(nearest(v)) for v in (view.thing[part], view.depth[part].astype(np.float32)))
    rgb, normal = smooth(view.rgb[part]) / 255, _unit(smooth(view.normal[part]))
    if rng.random() < 0.5:
        thing, depth, rgb = thing[:, ::-1], depth[:, ::-1], rgb[:, ::-1]
        normal = normal[:, ::-1] * [-1, 1, 1]
    chosen = _chosen(thing, rng)
    if chosen is None:
        return None
    mask = thing == chosen
    count = int(rng.integers(2, 4)) if rng.random() < MORE else 1
    clicks = [place for _ in range(count) if (place := click_in(mask & (depth > 0), rng)) is not None]
    if not clicks:
        return None
    if rng.random() < WORSE:
        normal, depth = worse(normal, depth, rng)
    rgb = np.clip(rgb * rng.uniform(0.8, 1.2) * rng.uniform(0.92, 1.08, 3), 0, 1)
    return features(rgb, normal, depth, clicks), mask


def worse(normal: Array, depth: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Normals [H, W, 3] and depth [H, W] as of a photo that the network understands badly: blurred, with slow waves.

    What has no depth keeps none.
    """
    import cv2

    side, known = max(depth.shape), depth > 0
    blur = lambda v, s: cv2.GaussianBlur(np.ascontiguousarray(v, np.float32), (0, 0), s * side)  # noqa: E731
    sigma = float(np.exp(rng.uniform(*np.log(BLUR))))
    logarithm = np.log(np.where(known, depth, 1)) * known
    share = np.maximum(blur(known, sigma), 1e-3)
    even = blur(logarithm, sigma) / share
    waves = blur(rng.normal(size=(*depth.shape, 4)), rng.uniform(0.06, 0.2))
    waves = waves * (rng.uniform(0, WAVES) / max(float(waves.std()), 1e-6))
    spread = float(even[known].std()) if known.any() else 0.0
    bent = np.where(known, np.exp(even + waves[..., 3] * spread), 0).astype(np.float32)
    return _unit(blur(normal * known[..., None], sigma) / share[..., None] + waves[..., :3]), bent


def _unit(normal: Array) -> Array:
    """[H, W, 3] of length 1."""
    return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)


def click_in(mask: Array, rng: np.random.Generator) -> tuple[int, int] | None:
    """(column, row) of a random pixel of a mask [H, W] bool, away from its border where it is large enough."""
    import cv2

    away = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
    places = np.argwhere(away > min(DEEP, 0.5 * float(away.max())))
    if not len(places):
        return None
    row, column = places[rng.integers(len(places))]
    return int(column), int(row)


def _chosen(thing: Array, rng: np.random.Generator) -> int | None:
    """The number of something to click on: things rather than walls, large ones somewhat rather than small ones."""
    numbers, count = np.unique(thing[thing != 0], return_counts=True)
    large = count >= FEWEST
    numbers, count = numbers[large], count[large]
    if not len(numbers):
        return None
    things = numbers > 0
    weight = np.sqrt(count)
    for kind, share in ((things, THINGS), (~things, 1 - THINGS)):
        if kind.any():
            weight[kind] *= share / weight[kind].sum()
    return int(rng.choice(numbers, p=weight / weight.sum()))
