"""From a photo of any size to maps: what happens around the bundled network."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import torch
from scipy.ndimage import binary_propagation
from skimage.morphology import remove_small_holes, remove_small_objects

from materialist.camera import rays_at, unit
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.geometry.integrate import integrated
from materialist.geometry.manhattan import drawn_to_axes, manhattan_axes
from materialist.geometry.membrane import nearest
from materialist.predict import resample
from materialist.predict.bundled.edges import GuidedFilter, grabcut, weighted_median
from materialist.predict.bundled.network import SPREADS, BundledNetwork
from materialist.predict.network import STRIDE
from materialist.types import Array, Materials, Prediction

_MIRROR = np.array([-1, 1, 1], np.float32)


@dataclass(frozen=True)
class InferenceSettings:
    """How the network sees a photo and how its answers become a prior."""

    sides: tuple[int, ...] = (192, 384)  # longest sides that it sees, pixels; from 16 pictures
    edge_side: int = 768  # longest side at which edges are sought in the photo, pixels; by eye
    edge_reach: float = 0.03  # error of its edges, part of the longest side; from 20 pictures
    median_depth: float = 3.0  # scene units; suits rooms in metres: a photo tells no scale
    max_depth_ratio: float = 50.0  # of a depth to the median, either way

    # Sky, by the logit of there being a surface.
    likely_sky: float = 0.0  # below it a pixel is likely sky; derived
    sure_sky: float = -5.0  # below it a pixel is surely sky; tuned on 8 photos
    sure_surface: float = 2.0  # above it a pixel is surely a surface; by eye
    max_silent_unsure: float = 0.03  # share that may be sky from which a note says so; by eye
    min_island: float = 0.0005  # share below which a speck of sky or surface is filled; by eye


SETTINGS = InferenceSettings()


def infer_bundled(
    network: BundledNetwork,
    linear: Array,
    rays: Array,
    *,
    device: Any = "cpu",
    on_materials: Callable[[Materials], Any] | None = None,
) -> Prediction:
    """Maps of a photo [H, W, 3] float32 linear, white about 1, at its own size, as a Prediction without a name.

    The network, in evaluation mode on `device`, sees the photo, clipped to [0, 1], and its mirror image at two sizes;
    its answers are averaged and enlarged, depth with the photo's edges. rays: [H, W, 2] float32 x and y of the
    camera rays at z = -1. Albedo is linear, depth has a fixed median and is 0 where there is no surface; light where
    the network knows it. on_materials: called with the materials, which are there long before the depth; before them
    with those of its first, smallest answer.
    """
    linear = np.clip(linear, 0, 1).astype(np.float32)
    size = linear.shape[:2]

    def tell(maps: dict[str, Array]) -> None:
        if on_materials is not None:
            on_materials(_materials(maps, size))

    # --- What the network answers, at its own size ---
    maps, light, spread = _mean_answer(network, linear, rays, device, on_first=tell)
    surface = _without_specks(_surface(maps["mask"], resample.values(linear, maps["mask"].shape)))
    if not surface.any():
        surface[:] = True
    unsure = _unsure_sky(maps["mask"], surface)
    depth = _scaled(maps["depth"], surface)
    # --- At the photo's size: materials by enlarging, depth with the photo's edges ---
    materials = _materials(maps, size)
    if on_materials is not None:
        on_materials(materials)
    depth, normal = with_edges(depth, maps["normal"], linear, rays)
    depth *= SETTINGS.median_depth / np.median(depth[depth > 0])
    normal = np.where((depth > 0)[..., None], unit(normal), np.array([0, 0, 1], np.float32)).astype(
        np.float32
    )
    # --- Notes on what was taken for sky ---
    sky = float((depth == 0).mean())
    notes: tuple[str, ...] = (
        (f"{sky:.0%} of the picture was taken for sky and has no surface.",) if sky else ()
    )
    if unsure > SETTINGS.max_silent_unsure:
        notes += (
            f"{unsure:.0%} of the picture, at its top, may be sky and was taken for a far surface.",
        )
    spread = {name: resample.values(values, size) for name, values in spread.items()}
    return Prediction(materials, normal, depth, warnings=notes, light=light, spread=spread)


def _materials(maps: dict[str, Array], size: tuple[int, int]) -> Materials:
    """Those of the network's maps, at the photo's size (H, W)."""
    albedo, roughness, metallic = (
        resample.values(maps[n], size) for n in ("albedo", "roughness", "metallic")
    )
    return Materials(
        srgb_to_linear(np.clip(albedo, 0, 1)), np.clip(roughness, 0, 1), np.clip(metallic, 0, 1)
    )


def with_edges(depth: Array, normal: Array, linear: Array, rays: Array) -> tuple[Array, Array]:
    """Depth [h, w] and normals [h, w, 3] brought to the size of the photo [H, W, 3], depth with its edges.

    rays: [H, W, 2] x and y of the photo's rays at z = -1.
    """
    size = linear.shape[:2]
    middle = resample.with_longer_side(size, min(SETTINGS.edge_side, max(size)))
    # --- The guide: the photo at the size at which edges are sought ---
    photo = linear_to_srgb(resample.values(linear, middle))
    reach = max(2, round(SETTINGS.edge_reach * max(middle)))
    guide = GuidedFilter(photo, radius=reach)
    depth = resample.depth(depth, middle)
    normal = resample.normals(normal, middle)
    depth = with_sky(depth, guide)
    known = depth > 0
    # Medians take each pixel to one side of an edge; in log depth, so that near and far count
    # alike.
    coarse = np.log(np.where(known, depth, 1)).astype(np.float32)
    seen = resample.values(np.ascontiguousarray(rays), middle)
    sharp = weighted_median(coarse, guide, known)
    depth = np.where(known, np.exp(sharp), 0)
    # Floors and walls follow the directions of the photo's straight edges, and depth follows the normals.
    axes = manhattan_axes(photo, normal, depth, seen)
    normal = drawn_to_axes(normal, depth, seen, axes)
    depth = integrated(depth, normal, seen)
    if middle != size:
        depth = resample.depth(depth, size)
        normal = resample.normals(normal, size)
    return depth, normal


def with_sky(depth: Array, guide: GuidedFilter) -> Array:
    """Depth [h, w], 0 for sky, whose sky ends where the photo's does; surface beyond it is as deep as the nearest."""
    known = depth > 0
    if known.all():
        return depth
    surface = guide.share(known.astype(np.float32)) > 0.5
    return (
        np.where(surface, depth[nearest(known)], 0).astype(np.float32) if surface.any() else depth
    )


def _mean_answer(
    network: BundledNetwork,
    linear: Array,
    rays: Array,
    device: Any,
    on_first: Callable[[dict[str, Array]], None],
) -> tuple[dict[str, Array], Array | None, dict[str, Array]]:
    """Means of the network's maps over sizes and over the photo and its mirror image, at the largest of the sizes.

    Beside them the light as `Prediction.light` and the spread as `Prediction.spread`, of means of logarithms. on_first:
    called with the maps of the smallest size, which are there first.
    """
    sizes = sorted({resample.with_longer_side(linear.shape[:2], side) for side in SETTINGS.sides})
    answers = []
    for size in sizes:
        photo = resample.values(linear, size)
        seen = rays_at(rays, *photo.shape[:2])
        answers.append(_run(network, photo, seen, device))
        if size == sizes[0] and len(sizes) > 1:
            on_first(answers[0])
        # The mirror image: x turns round in rays and normals.
        mirrored = (
            np.ascontiguousarray(photo[:, ::-1]),
            np.ascontiguousarray(seen[:, ::-1] * _MIRROR[:2]),
        )
        turned_back = {
            name: np.ascontiguousarray(m[:, ::-1])
            for name, m in _run(network, *mirrored, device).items()
        }
        answers.append(turned_back | {"normal": turned_back["normal"] * _MIRROR})
    for answer in answers:  # what depth is relative to is every answer's own
        answer["depth"] = answer["depth"] - np.median(answer["depth"])
    # --- Means: of light and spread in their logarithm, of maps at the largest size ---
    lights = [answer.pop("light") for answer in answers if "light" in answer]
    light = np.exp(np.mean(lights, axis=0)).astype(np.float32) if lights else None
    size = sizes[-1]
    maps = {
        name: np.mean([resample.values(answer[name], size) for answer in answers], axis=0)
        for name in answers[0]
    }
    expected = np.exp(maps.pop("spread")).astype(np.float32) if "spread" in maps else None
    spread = {}
    if expected is not None:
        spread = {name: np.ascontiguousarray(expected[..., k]) for k, name in enumerate(SPREADS)}
    return maps, light, spread


def _run(network: BundledNetwork, photo: Array, rays: Array, device: Any) -> dict[str, Array]:
    """The network's maps at the size of `photo` [h, w, 3]: [h, w] or [h, w, 3] float32."""
    height, width = photo.shape[:2]
    # --- Padded to whole strides ---
    below = -height % STRIDE
    right = -width % STRIDE
    padded = np.pad(photo, ((0, below), (0, right), (0, 0)), mode="edge")
    # Rays are linear in the pixel, and their point reflection at the border goes on as such.
    extended = np.pad(rays, ((0, below), (0, right), (0, 0)), mode="reflect", reflect_type="odd")
    tensors = [torch.from_numpy(x).permute(2, 0, 1)[None].to(device) for x in (padded, extended)]
    with torch.inference_mode():
        maps = network(tensors[0].contiguous(memory_format=torch.channels_last), tensors[1])
    # --- Back to arrays, without the padding ---
    rows = {name: m[0] if name == "light" else m[0, :, :height, :width] for name, m in maps.items()}
    arrays = {name: m.permute(1, 2, 0).float().cpu().numpy() for name, m in rows.items()}
    return {
        n: np.ascontiguousarray(a[..., 0] if a.shape[-1] == 1 else a) for n, a in arrays.items()
    }


def _scaled(log_depth: Array, surface: Array) -> Array:
    """Depth [h, w] with the median of the settings over the surface, 0 elsewhere."""
    relative = log_depth - np.median(log_depth[surface])
    limit = np.log(SETTINGS.max_depth_ratio)
    return np.where(
        surface, SETTINGS.median_depth * np.exp(np.clip(relative, -limit, limit)), 0
    ).astype(np.float32)


def _surface(logit: Array, photo: Array) -> Array:
    """[h, w] bool from the logit of there being a surface: sky is what is joined to what surely is, and looks like it.

    Between sure sky and sure surface the colours of the photo [h, w, 3], linear, decide (GrabCut, Rother et al. 2004):
    a cloud is sky, the dark between trees is not. Where nothing is sure nothing is sky: white walls and windows look
    like it, and a hole in a room costs more than a sky that is a far surface.
    """
    sure = logit < SETTINGS.sure_sky
    labels = np.where(logit < SETTINGS.likely_sky, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[sure] = cv2.GC_FGD
    labels[logit > SETTINGS.sure_surface] = cv2.GC_BGD
    # Sky grows from what is sure: blue or white patches elsewhere in the picture stay surface.
    return ~binary_propagation(sure, mask=grabcut(photo, labels)) if sure.any() else ~sure


def _unsure_sky(logit: Array, surface: Array) -> float:
    """Share of the picture that is surface [h, w] bool, likely sky by the logit, and joined to the upper border."""
    likely = surface & (logit < SETTINGS.likely_sky)
    top = np.zeros_like(likely)
    top[0] = likely[0]
    return float(binary_propagation(top, mask=likely).mean())


def _without_specks(surface: Array) -> Array:
    """The surface [h, w] bool without tiny islands of either kind."""
    max_size = max(4, int(SETTINGS.min_island * surface.size)) - 1
    islands_filled = remove_small_objects(surface, max_size=max_size)
    return remove_small_holes(islands_filled, max_size=max_size)
