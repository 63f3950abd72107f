"""ClickNet, trained on pictures of `train data` as photographs with the maps that the bundled network finds in them."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.camera import unit
from materialist.color import linear_to_srgb
from materialist.errors import InputError
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.clicks.features import Box, click_features
from materialist.predict.clicks.network import ClickNet
from materialist.predict.network import UNetArchitecture
from materialist.types import Array, Camera, Photo, Progress
from materialist_lab.data.samples import (
    SampleFolder,
    claim_folder,
    make_missing,
    read_arrays,
    read_sample,
)
from materialist_lab.procedural.cutouts import cutout_files, load_cutout, paste
from materialist_lab.procedural.dataset import identity
from materialist_lab.procedural.photographic import photographic
from materialist_lab.train.task import Batch, Recipe, Task

DESCRIPTION = "views.json"
"""Of which data set the views beside it are."""
RECIPE = Recipe(side=224, batch=16, rate=1.5e-3, growth=((0.5, 128),))
HELD_OUT = 48
"""Views, the last ones, that are only scored, where there are ten times as many."""
PASTED = 2
"""Views with cut-outs of each picture."""
CLICKS = 3
"""Clicks on each held-out view."""
DRAWS = 100
"""Views tried for one with something to click on."""


@dataclass(frozen=True)
class ClickDraw:
    """How clicks and crops are drawn; all tuned by eye."""

    fewest_pixels: int = 60  # of a view; smaller things are not clicked on
    # pixels from the border of a thing to a click, where the thing is as large
    depth_inside: float = 2.5
    things: float = 0.85  # share of clicks on things; the others are on walls, floors and the like
    several: float = 0.25  # share of those with clicks that have two or three
    boxed: float = 0.35  # share of examples with a box
    # what each side of a box is too far out, shorter sides, from and to
    loose: tuple[float, float] = (-0.03, 0.2)
    smallest_crop: float = 0.4  # smallest part of a view's side that an example shows
    # share with worse maps: the bundled network knows these pictures better than photos
    worsened: float = 0.5
    blur: tuple[float, float] = (0.008, 0.1)  # of worse maps, as a part of the side, from and to
    waves: float = 0.25  # largest amplitude of waves on worse normals and, times its spread, on worse log depth


DRAW = ClickDraw()


View = dict[str, Array]
"""One photograph as the package would see it: rgb [H, W, 3] uint8 sRGB; predicted normal [H, W, 3] int8, 127 for 1, and
depth [H, W] float16; thing [H, W] int16, number of what is seen, negative for walls and the like, 0 for nothing."""


def produce_views(
    data: Path, folder: Path, cutouts: Path | None = None, progress: Progress = lambda *_: None
) -> None:
    """Make the views that FOLDER lacks, by the bundled network: one of each picture, PASTED more with cut-outs.

    `cutouts` is a folder of things photographed or drawn, with transparency around them; None for none. Raises
    InputError for a data set without a description or without things, cut-outs that cannot be read, and a FOLDER with
    views of another set, OutputError for one that cannot be written.
    """
    source = SampleFolder(data)
    # What tells these views from those of another data set or other cut-outs.
    said = identity(data) | {"cutouts": 0}
    pasted: list[Array] = []
    if cutouts is not None:
        pasted = [
            cutout for path in cutout_files(cutouts) if (cutout := load_cutout(path)) is not None
        ]
        if not pasted:
            raise InputError(
                f"No picture in {cutouts} has transparency around a thing large enough to learn from."
            )
        said["cutouts"] = len(pasted)
    claim_folder(folder, DESCRIPTION, said, tuple(said))
    predictor = BundledPredictor()
    kinds = 1 + PASTED if pasted else 1

    def view(number: int) -> View:
        path = source.paths[number // kinds]
        kind = number % kinds
        # A seed of its own for each view: it is the same in whatever order they are made.
        arrays = read_arrays(path, "thing", "fov")
        rng = np.random.default_rng([int(path.stem), 4, kind])
        image = read_sample(path).image
        thing = arrays["thing"]
        if kind:
            # Before the camera's processing, which cut-outs and picture then share.
            image, thing = paste(image, thing, pasted, rng)
        linear, _ = photographic(image, rng)
        camera = Camera(linear.shape[1], linear.shape[0], float(arrays["fov"]))
        # The maps that `select` will have, mistakes included; not the true ones.
        predicted = predictor.predict(
            Photo(linear, camera, linear, False, "option", path.name, b"", ())
        )
        return {
            "rgb": (linear_to_srgb(linear) * 255 + 0.5).astype(np.uint8),
            "thing": thing,
            "normal": np.rint(predicted.normal * 127).astype(np.int8),
            "depth": predicted.depth.astype(np.float16),
        }

    names = [
        f"{path.stem}{f'-{kind}' if kind else ''}.npz"
        for path in source.paths
        for kind in range(kinds)
    ]
    make_missing([folder / name for name in names], view, "views", progress)


def load_click_views(folder: Path) -> list[View]:
    """All views of a folder, in the order of their names. Raises InputError for one that is damaged."""
    return [
        read_arrays(path, "rgb", "normal", "depth", "thing")
        for path in sorted(folder.glob("[0-9]*.npz"))
    ]


def draw_click(view: View, side: int, rng: np.random.Generator) -> tuple[Array, Array] | None:
    """([C, side, side] features, [side, side] bool) of a part of a view, and clicks or a box; None without things.

    The part is mirrored or not and recoloured, its maps are made worse at times; some examples have several clicks.
    """
    # --- A square part of the view, at the side of an example ---
    height, width = view["thing"].shape
    size = round(min(height, width) * rng.uniform(DRAW.smallest_crop, 1.0))
    top = rng.integers(height - size + 1)
    left = rng.integers(width - size + 1)
    part = np.s_[top : top + size, left : left + size]
    smooth = cv2.INTER_AREA if size > side else cv2.INTER_LINEAR

    def scaled(name: str, method: int) -> Array:
        values = view[name] if name == "thing" else view[name].astype(np.float32)
        return np.asarray(
            cv2.resize(np.ascontiguousarray(values[part]), (side, side), interpolation=method)
        )

    thing = scaled("thing", cv2.INTER_NEAREST)
    depth = scaled("depth", cv2.INTER_NEAREST)
    rgb = scaled("rgb", smooth) / 255
    normal = unit(scaled("normal", smooth))
    # --- Mirrored: x of the normals changes sign ---
    if rng.random() < 0.5:
        thing = thing[:, ::-1]
        depth = depth[:, ::-1]
        rgb = rgb[:, ::-1]
        normal = normal[:, ::-1] * [-1, 1, 1]
    # --- A thing, and clicks on it where depth is known ---
    chosen = _chosen(thing, rng)
    if chosen is None:
        return None
    mask = thing == chosen
    count = int(rng.integers(2, 4)) if rng.random() < DRAW.several else 1
    known = mask & (depth > 0)
    box = None
    clicks = [
        place
        for _ in range(count)
        if (place := click_in(known, rng, DRAW.depth_inside)) is not None
    ]
    if not clicks:
        return None
    # --- Or a box around it ---
    if rng.random() < DRAW.boxed:
        clicks = []
        box = box_around(mask, rng)
    # --- Worse maps, other colours ---
    if rng.random() < DRAW.worsened:
        normal, depth = worse(normal, depth, rng)
    rgb = np.clip(rgb * rng.uniform(0.8, 1.2) * rng.uniform(0.92, 1.08, 3), 0, 1)
    return click_features(rgb, normal, depth, clicks, box), mask


def worse(normal: Array, depth: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Normals [H, W, 3] and depth [H, W] as of a photo that the network understands badly: blurred, with slow waves.

    Pixels without depth keep none.
    """
    side = max(depth.shape)
    known = depth > 0

    def blur(v, s):
        return cv2.GaussianBlur(np.ascontiguousarray(v, np.float32), (0, 0), s * side)

    # Normalised convolution: only pixels with depth count in the blur.
    sigma = float(np.exp(rng.uniform(*np.log(DRAW.blur))))
    logarithm = np.log(np.where(known, depth, 1)) * known
    share = np.maximum(blur(known, sigma), 1e-3)
    even = blur(logarithm, sigma) / share
    # Three waves for the normal, one for depth, whose size goes with the spread of depth.
    waves = blur(rng.normal(size=(*depth.shape, 4)), rng.uniform(0.06, 0.2))
    waves = waves * (rng.uniform(0, DRAW.waves) / max(float(waves.std()), 1e-6))
    spread = float(even[known].std()) if known.any() else 0.0
    bent = np.where(known, np.exp(even + waves[..., 3] * spread), 0).astype(np.float32)
    return unit(blur(normal * known[..., None], sigma) / share[..., None] + waves[..., :3]), bent


def click_in(mask: Array, rng: np.random.Generator, inside: float) -> tuple[int, int] | None:
    """(column, row) of a random pixel of a mask [H, W] bool, `inside` pixels from its border where it is as large."""
    # Half of the largest distance where the thing is thin: there always is a place.
    away = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
    places = np.argwhere(away > min(inside, 0.5 * float(away.max())))
    if not len(places):
        return None
    row, column = places[rng.integers(len(places))]
    return int(column), int(row)


def box_around(mask: Array, rng: np.random.Generator) -> Box:
    """A box around a mask [H, W] bool as somebody might draw it, inside the picture."""
    rows, columns = np.nonzero(mask)
    low = np.array([columns.min(), rows.min()])
    high = np.array([columns.max(), rows.max()]) + 1
    # Both corners are off by amounts of their own.
    off = rng.uniform(*DRAW.loose, (2, 2)) * (high - low).min()
    x0, y0 = np.maximum(np.rint(low - off[0]).astype(int), 0).tolist()
    x1, y1 = np.minimum(np.rint(high + off[1]).astype(int), mask.shape[::-1]).tolist()
    return x0, y0, max(x1, x0 + 1), max(y1, y0 + 1)


def _chosen(thing: Array, rng: np.random.Generator) -> int | None:
    """The number of something to click on: things rather than walls, large ones somewhat rather than small ones."""
    # Numbers are positive for things and negative for walls and the like.
    numbers, count = np.unique(thing[thing != 0], return_counts=True)
    large = count >= DRAW.fewest_pixels
    numbers = numbers[large]
    count = count[large]
    if not len(numbers):
        return None
    # The square root lies between one chance a thing and one a pixel.
    weight = np.sqrt(count)
    for kind, share in ((numbers > 0, DRAW.things), (numbers < 0, 1 - DRAW.things)):
        if kind.any():
            weight[kind] *= share / weight[kind].sum()
    return int(rng.choice(numbers, p=weight / weight.sum()))


class ClickTask(Task):
    """The network that finds the object at a click."""

    kind: ClassVar[str] = "clicks"

    def __init__(
        self,
        views: Path,
        recipe: Recipe = RECIPE,
        *,
        init: Path | None = None,
        architecture: UNetArchitecture | None = None,
    ):
        """Views to learn from and weights to begin from. Raises InputError for a folder without views."""
        stored = load_click_views(views)
        if not stored:
            raise InputError(f"{views} holds no views to learn from.")
        # A small set is all trained on.
        aside = HELD_OUT if len(stored) >= 10 * HELD_OUT else 0
        super().__init__(recipe, init)
        self.views = stored[: len(stored) - aside]
        self.held_out = stored[len(stored) - aside :]
        self.architecture = architecture

    def count(self) -> int:
        return len(self.views)

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """maps [C, side, side] and mask [side, side] of a click in that view, or in another one if it shows nothing."""
        for _ in range(DRAWS):
            if (click := draw_click(self.views[index], side, rng)) is not None:
                return {"maps": click[0], "mask": click[1].astype(np.float32)}
            index = int(rng.integers(len(self.views)))
        raise InputError("The views show nothing to click on; make them of a larger data set.")

    def make(self) -> ClickNet:
        return ClickNet(self.architecture)

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        return click_losses(network(batch["maps"]).float(), batch["mask"])

    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Mean and median intersection over union of the clicks of examples, on the views kept aside."""
        # On the CPU, away from what the training uses.
        network = copy.deepcopy(network).cpu()
        overlap = []
        for number, view in enumerate(self.held_out):
            # The same clicks at every scoring.
            rng = np.random.default_rng([7, number])
            for maps, mask in filter(
                None, (draw_click(view, self.recipe.side, rng) for _ in range(CLICKS))
            ):
                with torch.inference_mode():
                    answer = network(torch.from_numpy(maps)[None])[0].numpy() > 0
                overlap.append((answer & mask).sum() / (answer | mask).sum())
        return (
            {"iou": float(np.mean(overlap)), "iou_median": float(np.median(overlap))}
            if overlap
            else {}
        )


def click_losses(logits: Tensor, mask: Tensor) -> dict[str, Tensor]:
    """Cross-entropy, and one minus the soft overlap (Dice), of logits [B, S, S] with masks [B, S, S]."""
    share = logits.sigmoid()
    # Dice = 2 |A n B| / (|A| + |B|), with 1 added above and below against empty masks.
    both = 2 * (share * mask).sum((1, 2)) + 1
    return {
        "entropy": F.binary_cross_entropy_with_logits(logits, mask),
        "overlap": (1 - both / (share.sum((1, 2)) + mask.sum((1, 2)) + 1)).mean(),
    }
