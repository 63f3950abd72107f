"""Views of shapes as RefractionNet gets them, and the folder that holds those of a set.

A view is a window around the object, its maps as imperfect as predicted ones. The photo is shaded simply: Lambert's law
under an ambient gradient and one or two distant lights, a highlight at times, no shadows. What is behind the object is
not drawn, since the network is not shown it.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from materialist.camera import unit
from materialist.errors import InputError
from materialist.predict.refraction.crop import (
    MARGIN,
    SIDE,
    View,
    Window,
    refraction_features,
    to_window,
)
from materialist.types import Array, Progress
from materialist_lab.data.samples import claim_folder, make_missing, read_arrays
from materialist_lab.procedural.objects.glassware import SPLITS, Shape, make_shape
from materialist_lab.procedural.thickness.ray_paths import Paths, ShapeTracer, towards

DESCRIPTION = "views.json"
FORMAT = 3


@dataclass(frozen=True)
class ViewPlan:
    """What a set holds."""

    shapes: int = 640
    views: int = 24
    """Views of each shape."""
    split: str = "train"
    """'train', or 'heldout': shapes that no training set has."""
    seed: int = 0


def produce(folder: Path, plan: ViewPlan, progress: Progress = lambda *_: None) -> None:
    """Make the views that FOLDER lacks; shape i depends on the plan's split and seed and on i alone.

    Raises InputError when FOLDER holds a set of another plan or other things, OutputError when it cannot be written.
    """
    claim_folder(
        folder,
        DESCRIPTION,
        {"format": FORMAT, **asdict(plan)},
        ("format", "views", "split", "seed"),
    )
    paths = [folder / f"{index:05d}.npz" for index in range(plan.shapes)]
    make_missing(paths, lambda index: make_views(index, plan), "shapes", progress)


def make_views(index: int, plan: ViewPlan) -> dict[str, Array]:
    """Views of shape `index`: maps [V, CHANNELS, S, S] and target [V, 5, S, S] float16, hollow [V] bool."""
    shape = make_shape(index, plan.split, plan.seed)
    rng = np.random.default_rng([plan.seed, SPLITS[plan.split], index, 1])
    return draw_views(shape, ShapeTracer(shape.solid), rng, plan.views)


def draw_views(
    shape: Shape, tracer: ShapeTracer, rng: np.random.Generator, count: int, *, exact: bool = False
) -> dict[str, Array]:
    """Random views of the shape as `make_views` has them; see `draw_view`."""
    maps, target = zip(*(draw_view(shape, tracer, rng, exact=exact) for _ in range(count)))
    return {
        "maps": np.stack(maps),
        "target": np.stack(target),
        "hollow": np.full(count, shape.hollow),
    }


def load_views(folder: Path) -> dict[str, Array]:
    """All views of a set, as `make_views` has them. Raises InputError when FOLDER holds no set, or a damaged file."""
    files = sorted(folder.glob("[0-9]*.npz"))
    if not files or not (folder / DESCRIPTION).is_file():
        raise InputError(
            f"{folder} holds no views to learn from; make some: materialist train refraction."
        )
    parts = [read_arrays(file, "maps", "target", "hollow") for file in files]
    return {name: np.concatenate([p[name] for p in parts]) for name in ("maps", "target", "hollow")}


MIN_COVERED = 0.02
"""Part of the window that an object must cover; thinner views are drawn anew."""
SIDES = (24, 160)
"""Pixels on a side of the picture from which the window is cut."""
OFF = (0.03, 0.015)
"""Standard deviations of how much larger and how far aside the window is than it should be, as parts of its side."""


@dataclass(frozen=True)
class CameraPose:
    """The camera, in the frame of a stretched and sheared shape."""

    stretch: Array
    """[3, 3] applied to the shape."""
    to_camera: Array
    """[3, 3] rotation."""
    centre: Array
    """[3] the shape's middle in the camera frame."""


def draw_view(
    shape: Shape, tracer: ShapeTracer, rng: np.random.Generator, *, exact: bool = False
) -> tuple[Array, Array]:
    """A random view of the shape, cut from a picture of any size as `Window` does at prediction.

    `exact` leaves the shape as it is and shows it at the window's own resolution, its maps without noise. Returns maps
    [CHANNELS, S, S] float16, see `crop.refraction_features`, and target [5, S, S] float16, 0 outside the true mask:
    solid and hollow thickness in units of the object's size, and the normal of the last surface in the frame of
    `crop.to_window`.
    """
    # --- A pose in which the object is large enough in the window ---
    while True:
        pose = draw_pose(rng, upright=shape.upright, plain=exact)
        vertices = shape.solid.vertices @ pose.stretch.T @ pose.to_camera.T + pose.centre
        view = (
            _seen(rng, tracer, pose, window_rays(vertices))
            if exact
            else _cut(rng, tracer, pose, vertices)
        )
        if view.inside.mean() >= MIN_COVERED:
            break
    # --- The truth along the rays of the window ---
    paths, _, back = look(tracer, pose, view.rays)
    hit = np.isfinite(paths.first).reshape(SIDE, SIDE)

    def picture(x):
        return np.where(hit, x.reshape(SIDE, SIDE), 0).astype(np.float32)

    # Lengths are in units of the rays, which are not of length 1.
    lengths = np.stack([picture(paths.solid), picture(paths.material)])
    target = lengths * np.linalg.norm(view.rays, axis=-1) / view.size
    back = np.moveaxis(np.where(hit[..., None], back @ to_window(view.rays).T, 0), -1, 0)
    target = np.concatenate([np.minimum(target, 8), back]).astype(np.float16)
    return refraction_features(view).astype(np.float16), target


def _cut(rng: np.random.Generator, tracer: ShapeTracer, pose: CameraPose, vertices: Array) -> View:
    """A window of a larger or smaller picture, with maps as imperfect as predicted ones."""
    # The picture first, with a margin around the object.
    side = round(float(np.exp(rng.uniform(*np.log(SIDES)))))
    seen = _imperfect(
        rng, _seen(rng, tracer, pose, window_rays(vertices, side, rng.uniform(0.05, 0.15)))
    )
    if not seen.inside.any():
        return seen
    # At prediction the window follows a mask that is a little off.
    larger = float(np.exp(rng.normal(0, OFF[0])))
    aside = rng.normal(0, OFF[1], 2)
    window = Window.around(seen.inside).moved(larger, float(aside[0]), float(aside[1]))
    return window.cut(seen.photo, seen.inside, seen.normal, seen.depth, seen.rays)


def _seen(rng: np.random.Generator, tracer: ShapeTracer, pose: CameraPose, rays: Array) -> View:
    """What rays [S, S, 3] see of the shape."""
    paths, normal, _ = look(tracer, pose, rays)
    inside = np.isfinite(paths.first).reshape(rays.shape[:2])
    depth = np.where(inside, paths.first.reshape(inside.shape), 0).astype(np.float32)
    point = (rays * depth[..., None] - pose.centre) @ pose.to_camera
    return View(_photo(rng, normal, rays, point) * inside[..., None], inside, normal, depth, rays)


def draw_pose(rng: np.random.Generator, *, upright: bool, plain: bool = False) -> CameraPose:
    """A camera that looks at the shape, from above if it stands; `plain` leaves the shape in its own form."""
    # --- The shape: stretched and sheared ---
    stretch = np.eye(3)
    if not plain:
        stretch = np.diag(np.exp(rng.normal(0, 0.25, 3))) + rng.normal(0, 0.08, (3, 3))
    # --- The camera around it ---
    turn = rng.uniform(0, 2 * np.pi)
    tilt = np.radians(rng.uniform(-5, 55)) if upright else np.arcsin(rng.uniform(-0.5, 0.95))
    roll = rng.normal(0, 0.06)
    to_camera = Rotation.from_euler("yxz", [turn, tilt, roll]).as_matrix()
    distance = np.exp(rng.uniform(np.log(1.4), np.log(6)))
    aside = rng.uniform(-0.35, 0.35, 2) * distance * rng.uniform(0, 1)
    return CameraPose(stretch, to_camera, np.array([*aside, -distance]))


def window_rays(vertices: Array, side: int = SIDE, margin: float = MARGIN) -> Array:
    """[S, S, 3] float32 rays through a square window around the shape [V, 3] in the camera frame, S = `side`."""
    # The square around the projected vertices, with a margin.
    place = vertices[:, :2] / -vertices[:, 2:]
    low = place.min(0)
    high = place.max(0)
    half = (high - low).max() / 2 * (1 + 2 * margin) + 1e-6
    x = (np.arange(side) + 0.5) / side * 2 - 1
    centre = (low + high) / 2
    rays = np.empty((side, side, 3), np.float32)
    rays[..., 0] = centre[0] + half * x[None, :]
    rays[..., 1] = centre[1] - half * x[:, None]
    rays[..., 2] = -1
    return rays


def look(tracer: ShapeTracer, pose: CameraPose, rays: Array) -> tuple[Paths, Array, Array]:
    """Paths of the rays through the shape; normals [S, S, 3] of the first and of the last surface, unit, camera frame.

    The rays are brought into the shape's own frame; lengths along them are the same there.
    """
    back = np.linalg.inv(pose.to_camera @ pose.stretch)
    direction = rays.reshape(-1, 3).astype(np.float64) @ back.T
    paths = tracer.trace(np.broadcast_to(-back @ pose.centre, direction.shape), direction)
    # The inverse transpose, as for every normal.
    flat = rays.reshape(-1, 3)
    first = towards(paths.normal @ back, flat, -1)
    last = towards(paths.exit_normal @ back, flat, 1)
    return (
        paths,
        first.reshape(rays.shape).astype(np.float32),
        last.reshape(rays.shape).astype(np.float32),
    )


def _photo(rng: np.random.Generator, normal: Array, rays: Array, point: Array) -> Array:
    """[S, S, 3] float32 linear in [0, 1]: the shape in some colour, plain or with waves through it."""
    # --- Colour ---
    albedo = rng.uniform(0.1, 0.9, 3) * rng.uniform(0.4, 1)
    if rng.random() < 0.3:
        phase = point @ rng.normal(size=3) * rng.uniform(5, 40) + rng.uniform(0, 6)
        wave = np.sin(phase)[..., None]
        albedo = albedo * np.clip(1 + wave * rng.uniform(0.1, 1.5), 0.3, 1.6)
    # --- Light: an ambient gradient, and one or two distant lamps ---
    up = rng.normal(size=3) * [0.4, 0.2, 0.4] + [0, 1, 0.3]
    light = rng.uniform(0.15, 0.6) * (1 + 0.6 * (normal @ (up / np.linalg.norm(up))))[..., None]
    view = unit(-rays)
    gloss = rng.uniform(0.1, 1.5) if rng.random() < 0.4 else 0.0
    for _ in range(int(rng.integers(1, 3))):
        towards = unit(rng.normal(size=3) + np.array([0, 0.7, 0.7]))
        colour = rng.uniform(0.7, 1.0, 3) * rng.uniform(0.2, 0.9)
        # Blinn and Phong: (n . h)^s, h half way between light and viewer.
        cosine = np.clip(np.sum(normal * unit(towards + view), -1), 0, 1)
        highlight = gloss * cosine ** rng.uniform(20, 200)
        light = light + colour * (np.clip(normal @ towards, 0, None) + highlight)[..., None]
    noise = rng.normal(0, rng.uniform(0, 0.02), normal.shape)
    return np.clip(albedo * light + noise, 0, 1).astype(np.float32)


def _imperfect(rng: np.random.Generator, view: View) -> View:
    """The view with maps as a predictor gives them: bent, flattened or exaggerated, smoothed, a mask that is off."""
    normal = view.normal
    depth = view.depth.copy()
    inside = view.inside
    if not inside.any():
        return view
    # Of the photo nothing changes: its noise is drawn with it.
    size = view.size
    middle = float(np.median(view.depth[inside]))
    side = len(inside)
    # Depth: the wrong scale, and slow waves.
    if rng.random() < 0.6:
        depth = middle + (depth - middle) * rng.uniform(0.85, 1.15)
        depth = depth + size * rng.uniform(0, 0.05) * _smooth_noise(rng, 1, side)[..., 0]
    if rng.random() < 0.6:
        # Normals: slow waves, and smoothing.
        normal = normal + rng.uniform(0, 0.3) * _smooth_noise(rng, 3, side)
    if rng.random() < 0.4:
        sigma = rng.uniform(0.5, 2.0) * max(side / SIDE, 0.5)
        blurred = cv2.GaussianBlur(normal * inside[..., None], (0, 0), sigma)
        normal = np.where(inside[..., None], blurred, normal)
    if rng.random() < 0.35:
        # The mask: too small.
        radius = int(rng.integers(1, max(2, round(2 * side / SIDE)) + 1))
        kernel = np.ones((2 * radius + 1,) * 2, np.uint8)
        smaller = cv2.erode(inside.astype(np.uint8), kernel, borderValue=0) > 0
        inside = smaller if smaller.sum() > 0.5 * inside.sum() else inside
    return View(
        view.photo, inside, unit(normal).astype(np.float32), depth.astype(np.float32), view.rays
    )


def _smooth_noise(rng: np.random.Generator, channels: int, side: int) -> Array:
    """[S, S, channels] float32 with waves about a third of the window long, of amplitude about 1."""
    coarse = rng.normal(size=(5, 5, channels)).astype(np.float32)
    return cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC).reshape(
        side, side, channels
    )
