"""Photos with a rendered thing in them whose share of every pixel is known, and how well its border is found."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import mitsuba as mi
import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.composite.matte import matte, unmixed
from materialist.edits.insert.meshes import read_model
from materialist.geometry.silhouette import disc
from materialist.io.photo import read_photo
from materialist.render.pixels import first_hits
from materialist.render.scene import seen_shape
from materialist.types import Array, Body, Camera, Photo
from materialist_lab.procedural.options import captures

COLOURS = ((0.5, 0.06, 0.04), (0.7, 0.66, 0.58), (0.05, 0.12, 0.35), (0.2, 0.14, 0.08))
"""Linear albedo of the things, in turn: some stand out, some are like wood and walls."""
EXTENT = 0.45
"""Longest side of a thing, share of the photo's height."""
SHARP = 0.7
"""Standard deviation of the blur of lens and sensor, native pixels."""
OUT_OF_FOCUS = 4.0
"""The same of a thing that is out of focus, as the foot of a pawn in a close-up."""
NOISE = 0.01
"""Standard deviation of the sensor's noise, sRGB-encoded."""
BORDER = 8
"""Native pixels on both sides of a border within which a matte is judged."""
PAINT = (0.35, 0.8, 1.3)
"""Factors on the colour of a thing that is painted anew."""
TOLERANCE = 2.0
"""Native pixels within which two borders agree."""


@dataclass(frozen=True)
class KnownComposite:
    """A photo with a rendered thing in it."""

    name: str
    photo: Photo
    share: Array
    """[H0, W0] float32 in [0, 1]: of the thing in each native pixel."""
    light: Array
    """[H0, W0, 3] float32 linear: what the thing adds to the photo, its share times its colour."""

    @property
    def mask(self) -> Array:
        """[H, W] bool: pixels of working size that are mostly of the thing."""
        size = self.photo.linear.shape[1::-1]
        return np.asarray(cv2.resize(self.share, size, interpolation=cv2.INTER_AREA)) > 0.5

    def errors(self, mask: Array) -> dict[str, float]:
        """How far the matte of a mask [H, W] bool, and the thing painted anew by it, are from the truth."""
        picture = self.photo.original
        share = matte(mask, picture)
        mixed = ((self.share > 0.001) & (self.share < 0.999)).astype(np.uint8)
        near = cv2.dilate(mixed, disc(BORDER)) > 0
        # --- The thing in another paint: its own colour times PAINT, the rest as it is ---
        paint = np.array(PAINT, np.float32) - 1
        scale = picture.shape[1] / mask.shape[1]
        front, _ = unmixed(share, picture, scale)
        painted = picture + share[..., None] * front * paint
        truth = picture + self.light * paint
        away = linear_to_srgb(np.maximum(painted, 0)) - linear_to_srgb(np.maximum(truth, 0))
        wrong = share - self.share
        return {
            "border": boundary_f(share > 0.5, self.share > 0.5),
            "sad": float(np.abs(wrong).sum()) / 1000,
            "mse": 1000 * float((wrong[near] ** 2).mean()),
            "fringe": 255 * float(np.sqrt((away[near] ** 2).mean())),
        }


def known_composites(
    data: Path, names: Sequence[str], size: int, seed: int, blur: float = SHARP
) -> Iterator[KnownComposite]:
    """A thing of DATA's meshes that no network has learnt from in each of these photos of DATA.

    blur: standard deviation, native pixels, of the Gaussian over the thing's border and colours.
    """
    meshes = captures(data / "meshes", "**/*.ply", True)
    for k, name in enumerate(names):
        rng = np.random.default_rng([seed, k])
        photo = read_photo(str(data / "photos" / name), size=size)
        mesh = meshes[k % len(meshes)]
        share, colour = _rendered(mesh, photo, np.array(COLOURS[k % len(COLOURS)]), rng)
        # --- Over the photo, in linear light, through the lens and onto the sensor ---
        covered = _blurred(share[..., None], blur)
        light = _blurred(share[..., None] * colour, blur)
        mixed = light + (1 - covered) * _blurred(photo.original, SHARP)
        native = _as_taken(mixed, rng)
        linear = cv2.resize(native, photo.linear.shape[1::-1], interpolation=cv2.INTER_AREA)
        shown = replace(photo, original=native, linear=np.asarray(linear), source=None)
        yield KnownComposite(f"{mesh.stem} in {Path(name).stem}", shown, covered[..., 0], light)


def _rendered(
    mesh: Path, photo: Photo, albedo: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Share [H0, W0] of a turned mesh in the lower middle of a photo, and its colour [H0, W0, 3] under a lamp."""
    camera = photo.camera
    (body,) = read_model(mesh).parts
    turn = Rotation.from_euler("yx", [rng.uniform(0, 360), 20], degrees=True)
    placed = _placed(body, turn, camera, rng.uniform(-0.15, 0.15))
    scene = mi.load_dict(
        {
            "type": "scene",
            "embree_use_robust_intersections": True,
            "body0": seen_shape(mi, placed, {"type": "diffuse"}),
        }
    )
    sight = first_hits(scene, camera, {"body0": None}, photo.original.shape[:2])
    # --- A lamp above, and even light: no path is traced ---
    lamp = np.array([0.4, 0.8, 0.45])
    facing = np.maximum(sight.normal @ (lamp / np.linalg.norm(lamp)), 0)[..., None]
    colour = np.where(sight.share[..., None] > 0, albedo * (0.35 + 0.8 * facing), 0)
    sheen = 0.3 * facing**40
    return sight.share, (colour + sheen).astype(np.float32)


def _placed(body: Body, turn: Rotation, camera: Camera, aside: float) -> Body:
    """The body at depth 10, a share of the picture's height large, `aside` of the middle by a share of the width."""
    corners = turn.apply(body.vertices.astype(np.float64))
    middle = (corners.min(0) + corners.max(0)) / 2
    height = 10 * camera.height / camera.focal
    factor = EXTENT * height / float(np.ptp(corners, axis=0).max())
    shift = np.array([aside * height * camera.width / camera.height, -0.12 * height, -10])
    vertices = ((corners - middle) * factor + shift).astype(np.float32)
    normals = turn.apply(body.normals.astype(np.float64)).astype(np.float32)
    return replace(body, vertices=vertices, normals=normals)


def _blurred(picture: Array, sigma: float) -> Array:
    """A native picture [H0, W0, C] under a Gaussian of `sigma` pixels."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma)).reshape(picture.shape)


def _as_taken(picture: Array, rng: np.random.Generator) -> Array:
    """Linear [H0, W0, 3] with a sensor's noise, in 8 bits."""
    noisy = linear_to_srgb(picture) + rng.normal(0, NOISE, picture.shape)
    levels = np.round(np.clip(noisy, 0, 1) * 255) / 255
    return srgb_to_linear(levels.astype(np.float32))


def boundary_f(predicted: Array, true: Array, tolerance: float = TOLERANCE) -> float:
    """F measure of the border of a mask [H, W] bool against that of the true one, within a tolerance in pixels."""
    borders = [_border(mask) for mask in (predicted, true)]
    if not all(border.any() for border in borders):
        return 0.0
    near = [distance_transform_edt(~border) <= tolerance for border in borders]
    precision = float(near[1][borders[0]].mean())
    recall = float(near[0][borders[1]].mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)


def colour_errors(share: Array, true: Array, photo: Array, reach: float) -> tuple[float, float]:
    """(old colour left inside of a border, new colour spilt beyond it), shares of all colour inside and near it.

    Of an edit of the hue by a matte [H0, W0] of an object [H0, W0] bool: colour is the difference of the channels,
    sRGB-encoded, of the photo [H0, W0, 3] linear; near: within `reach` pixels of the border.
    """
    encoded = linear_to_srgb(photo)
    colour = encoded.max(-1) - encoded.min(-1)
    near = distance_transform_edt(true) + distance_transform_edt(~true) < reach
    whole = max(float(colour[near & true].sum()), 1e-9)
    left = ((1 - share) * colour)[near & true].sum()
    spilt = (share * colour)[near & ~true].sum()
    return float(left / whole), float(spilt / whole)


def _border(mask: Array) -> Array:
    """[H, W] bool: pixels of a mask beside one outside of it; the picture's rim is no border."""
    padded = np.pad(mask.astype(np.uint8), 1, mode="edge")
    inner = cv2.erode(padded, np.ones((3, 3), np.uint8))
    return mask & (inner[1:-1, 1:-1] == 0)
