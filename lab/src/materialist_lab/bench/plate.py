"""`bench plate`: an object removed from a real photograph, against the photograph without it.

`materialist_indoor1.png` and `_indoor2.png` of the published code show one view without and with an orange jug. The one
without is brought over the other (ALIGNED); the jug's mask is its colour, grown a little. `inside`
is the mask, `around` a ring about it, in which the jug's shadow and reflection lie; PSNR and SSIM on sRGB. `untouched`
is the photo as it was, `diffused` fills the mask from its border (Telea), `remove` is the program's. `holes` rows: in
the photos of DATA nothing stands in the way; the outline of an object of another photo is cut out at a random place,
grown a little, and filled. sheet.png: photo, plate, and the pictures of the rows after `untouched`; then photo, hole
and fillings of some photos.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.ndimage import binary_dilation

from materialist import metrics, pipeline
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.composite.composite import composite
from materialist.edits.remove.filling import filled
from materialist.edits.remove.remove import remove
from materialist.errors import InputError
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.types import Array
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row, timed
from materialist_lab.bench.report import Column, Report, side_by_side
from materialist_lab.bench.select import drawn, outlines

PLATE, PHOTO = (f"photos/tabletop/materialist_indoor{k}.png" for k in (1, 2))
ALIGNED = np.array([[1.17386, 0.00042, 6.523], [0.00028, 1.17358, 3.178]])
"""Pixel of PLATE -> pixel of PHOTO: 245 of 263 SIFT matches agree within 2 pixels."""
MAPS = "official_indoor/maps"
"""The published network's maps of the photo, which are tried, too, where they are."""
TRIES = 1000
"""Holes drawn for one of a size that is asked for."""


@dataclass(frozen=True, kw_only=True)
class PlateBench(Benchmark):
    """Remove the jug of DATA's pair of photos."""

    columns = (
        Column("inside", "PSNR inside", "higher", 2),
        Column("inside_ssim", "SSIM inside", "higher"),
        Column("around", "PSNR around", "higher", 2),
        Column("seconds", "s", "lower", 1),
    )

    size: int = option(512, "Longer side.", **SIZE)
    spp: int = option(128, "Paths a pixel of the composite.", **COUNT)
    smallest: float = option(0.005, "Smallest hole, share of the picture.", low=0, high=1)
    largest: float = option(0.12, "Largest hole, share of the picture.", low=0, high=1)
    shown: int = option(6, "Holes on the sheet.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is None or not ((data / PLATE).is_file() and (data / PHOTO).is_file()):
            raise InputError(
                f"This benchmark needs a pair of photos: --data DIR with {PLATE} and {PHOTO}."
            )
        # --- The plate over the photo, and where it covers it ---
        photo = read_photo(data / PHOTO, size=self.size)
        plate = read_photo(data / PLATE).original
        sides = photo.original.shape[1::-1]
        size = photo.linear.shape[1::-1]
        over = [
            cv2.warpAffine(x, ALIGNED, sides, flags=cv2.INTER_LINEAR)
            for x in (plate, np.ones_like(plate))
        ]
        truth, coverage = (
            np.asarray(cv2.resize(x, size, interpolation=cv2.INTER_AREA)) for x in over
        )
        shown = coverage[..., 0] > 0.999
        # --- The jug, and a ring around it for its shadow and reflection ---
        mask = _widened(orange(photo.linear), max(1, self.size // 170))
        inside = mask & shown
        around = _widened(mask, self.size // 16) & ~mask & shown
        pictures = [photo.linear, truth]

        def row(method: str, picture: Array, **more: float) -> Row:
            pictures.append(picture)
            inner = metrics.psnr(picture, truth, mask=inside)
            outer = metrics.psnr(picture, truth, mask=around)
            figures = {
                "inside": inner,
                "inside_ssim": metrics.ssim(picture, truth, mask=inside),
                "around": outer,
            }
            return {"method": method, "sample": "jug", **figures, **more}

        yield row("untouched", photo.linear)
        # --- Baseline: inpainting by colour alone ---
        yield row("diffused", _diffused(photo.linear, mask))
        # --- Removal with each predictor's maps ---
        sources = {"bundled": "bundled"} | (
            {"published maps": f"maps:{data / MAPS}"} if (data / MAPS).is_dir() else {}
        )
        for name, predictor in sources.items():
            picture, cost = timed(self._removed, photo, predictor, mask)
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
            yield row(f"remove, {name}", picture, seconds=cost["seconds"])
        report.sheet.append(side_by_side(*pictures[:2], *pictures[3:]))
        yield from self._holes(data / "photos", report)

    def _holes(self, folder: Path, report: Report) -> Iterator[Row]:
        """Rows of holes with the outlines of other photos' objects."""
        known = {name: things for name, things in outlines().items() if (folder / name).is_file()}
        things = [thing for objects in known.values() for thing in objects]
        rng = np.random.default_rng(self.seed)
        for name in known:
            truth = read_photo(folder / name, size=self.size).linear
            hole = self._drawn_hole(things, truth.shape[:2], rng)
            spoiled = np.where(hole[..., None], 0.5, truth).astype(np.float32)
            pictures = {
                "diffused": _diffused(spoiled, hole),
                "filled": filled(spoiled, hole, ~hole),
            }
            for method, picture in pictures.items():
                figures = {
                    "inside": metrics.psnr(picture, truth, mask=hole),
                    "inside_ssim": metrics.ssim(picture, truth, mask=hole),
                }
                yield {"method": f"holes: {method}", "sample": name, **figures}
            if len(report.sheet) <= self.shown:
                report.sheet.append(side_by_side(truth, spoiled, *pictures.values()))

    def _drawn_hole(
        self, things: list[dict[str, Any]], shape: tuple[int, ...], rng: np.random.Generator
    ) -> Array:
        """[H, W] bool: an outline at a random place, of a size between `smallest` and `largest` of the picture."""
        for _ in range(TRIES):
            outline = drawn(things[rng.integers(len(things))], shape)
            moved = np.roll(outline, rng.integers(0, shape), (0, 1))
            hole = _widened(moved, max(1, self.size // 100))
            if self.smallest < hole.mean() < self.largest:
                return hole
        raise InputError(
            f"No hole is between {self.smallest} and {self.largest} of a picture; give --smallest and --largest "
            "farther apart."
        )

    def _removed(self, photo: Any, predictor: str, mask: Array) -> Array:
        shared: dict[str, Any] = {"seed": self.seed, "device": self.device}
        scene = pipeline.invert(photo, predictor=predictor, **shared)
        return composite(scene, remove(scene, mask), spp=self.spp, **shared)


def _diffused(photo: Array, hole: Array) -> Array:
    """[H, W, 3] linear photo with the hole [H, W] bool filled from its border (Telea 2004)."""
    shades = np.round(linear_to_srgb(photo) * 255).astype(np.uint8)
    levels = cv2.inpaint(shades, hole.astype(np.uint8), 5, cv2.INPAINT_TELEA)
    return srgb_to_linear(levels.astype(np.float32) / 255)


def _widened(mask: Array, pixels: int) -> Array:
    """The mask [H, W] bool and what is so near to it."""
    return binary_dilation(mask, np.ones((3, 3)), iterations=pixels)


def orange(linear: Array) -> Array:
    """[H, W] bool: the largest connected thing of a photo [H, W, 3] in saturated orange."""
    hue, saturation, _ = cv2.split(cv2.cvtColor(linear_to_srgb(linear), cv2.COLOR_RGB2HSV))
    red = ((hue < 30) & (saturation > 0.75)).astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(red)
    # Label 0 is the background.
    return label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
