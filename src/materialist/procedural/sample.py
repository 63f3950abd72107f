"""One labelled picture: a random world, rendered, denoised and exposed like a photograph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from materialist.color import linear_to_srgb, luminance
from materialist.errors import InputError
from materialist.procedural import outdoors, packing, rooms
from materialist.procedural.world import World
from materialist.render.denoise import denoise
from materialist.types import Array, Camera

PROBE = 4
"""Label rays a pixel and axis."""
ATTEMPTS = 6
"""Cameras that see too little are thrown away at most that often."""
_KINDS: tuple[tuple[str, Callable[..., World], float], ...] = (
    ("room", rooms.room, 0.45),
    ("table", rooms.table_top, 0.175),
    ("still-life", outdoors.still_life, 0.15),
    ("outdoor", outdoors.outdoor, 0.225),
)
"""Name, maker and share of a set."""
KINDS = tuple(name for name, *_ in _KINDS)
SPLITS: dict[str, tuple[int, ...]] = {"train": (), "heldout": (1,)}
"""What a split adds to the key of a sample's randomness, so that no two splits show the same scenes."""


HELD_OUT = frozenset((
    "binoculars", "capsule", "fandisk", "lightbulb", "spot_cow", "train",
    "aristea_wreck_puresky", "brown_photostudio_06", "dikhololo_night", "kiara_dawn", "museum", "st_fagans_interior",
    "venice_sunset",
))  # fmt: skip
"""Stems of the meshes and HDR captures that no training set may use, and which the split 'heldout' uses alone."""


@dataclass(frozen=True)
class Options:
    """What decides, with the number of a sample, what it shows.

    Raises InputError for values or folders that cannot be used.
    """

    size: int = 256
    """Pixels on a side."""
    seed: int = 0
    spp: int = 16
    """Samples per pixel before denoising."""
    split: str = "train"
    meshes: Path | None = None
    """Folder with .ply files."""
    envmaps: Path | None = None
    """Folder with .exr files."""
    device: str = "auto"
    only: str = ""
    """One of KINDS, where all samples are to be of it."""

    def __post_init__(self) -> None:
        if not 32 <= self.size <= 2048 or self.size % 4:
            raise InputError(f"The size is {self.size}; give 32 to 2048 pixels, a multiple of 4.")
        if not 1 <= self.spp <= 4096:
            raise InputError(f"spp is {self.spp}; give 1 to 4096 samples per pixel.")
        if self.seed < 0:
            raise InputError(f"The seed is {self.seed}; give 0 or more.")
        if self.only and self.only not in KINDS:
            raise InputError(f"There is no kind '{self.only}' of scene; give one of {', '.join(KINDS)}, or none.")
        if self.split not in SPLITS:
            raise InputError(f"The split is {self.split!r}; choose one of {', '.join(SPLITS)}.")
        _ = self.mesh_files, self.envmap_files  # which raise where a folder cannot be used

    @cached_property
    def mesh_files(self) -> tuple[Path, ...]:
        """The meshes that the split may use, sorted by name."""
        return self._files(self.meshes, ".ply")

    @cached_property
    def envmap_files(self) -> tuple[Path, ...]:
        """The HDR captures that the split may use, sorted by name."""
        return self._files(self.envmaps, ".exr")

    def _files(self, folder: Path | None, ending: str) -> tuple[Path, ...]:
        if folder is None:
            return ()
        if not Path(folder).is_dir():
            raise InputError(f"There is no folder {folder} to take {ending} files from; give one that exists.")
        wanted = [p for p in Path(folder).rglob(f"*{ending}") if (p.stem in HELD_OUT) == (self.split == "heldout")]
        if not wanted:
            raise InputError(f"{folder} holds no {ending} file for the split {self.split!r}; give another or none.")
        return tuple(sorted(wanted, key=lambda p: (p.name, str(p))))


def make_sample(index: int, options: Options) -> dict[str, Array]:
    """The arrays of sample `index`, as they are stored (docs/training_data.md); the same for the same arguments.

    Raises SetupError where Mitsuba or the denoiser is missing.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([options.seed, index, attempt, *SPLITS[options.split]])
        world = make_world(rng, options)
        probe, tracer = _look(world, rng, options)
        if attempt == ATTEMPTS - 1 or worth_seeing(probe):
            break
    return _developed(world, probe, tracer, rng, options)


def make_world(rng: np.random.Generator, options: Options) -> World:
    """A random scene of the kinds' shares, or of the one kind that the options name."""
    names, makers, shares = zip(*_KINDS)
    weight = np.array([float(name == options.only) for name in names] if options.only else shares)
    return makers[rng.choice(len(makers), p=weight / weight.sum())](rng, options.mesh_files, options.envmap_files)


def _look(world: World, rng: np.random.Generator, options: Options):
    from materialist.procedural.tracer import SampleTracer

    camera = Camera(options.size, options.size, world.view.fov)
    tracer = SampleTracer(packing.pack(world, rng), camera, device=options.device)
    return tracer.probe(PROBE), tracer


def worth_seeing(probe: dict[str, Array]) -> bool:
    """Whether a view shows several things at a distance, rather than the inside of a cupboard."""
    owner, depth = probe["owner"][..., 0], probe["depth"][..., 0]
    seen = owner >= 0
    _, counts = np.unique(owner[seen], return_counts=True)
    if seen.mean() < 0.3 or (counts > owner.size / 400).sum() < 6:
        return False
    near = np.median(depth[seen]) * 0.25
    return bool((depth[seen] < near).mean() < 0.3 and counts.max() / owner.size < 0.75)


def _developed(world: World, probe, tracer, rng: np.random.Generator, options: Options) -> dict[str, Array]:
    """Render, denoise, expose, quantise."""
    noisy, white = tracer.render(spp=options.spp, seed=int(rng.integers(2**31)))
    normal = probe["normal"].mean(2)
    image = denoise(noisy, albedo=probe["albedo"].mean(2), normal=normal, device=tracer.device)
    # The shading is of white surfaces: a guide of their texture would print it into the shading.
    covered = (probe["owner"] >= 0).mean(2, dtype=np.float32)
    shading = denoise(white, albedo=np.repeat(covered[..., None], 3, -1), normal=normal, device=tracer.device)
    labels = labels_of(probe)
    gain = exposure(image, rng) * balance(shading, rng)
    byte = lambda x: (np.clip(x, 0, 1) * 255 + 0.5).astype(np.uint8)  # noqa: E731
    half = lambda x: np.clip(x, 0, 6e4).astype(np.float16)  # noqa: E731
    return {
        "image": half(image * gain), "shading": half(shading * gain),
        "albedo": byte(linear_to_srgb(labels["albedo"])), "roughness": byte(labels["roughness"]),
        "metallic": byte(labels["metallic"]), "normal": np.rint(labels["normal"] * 127).astype(np.int8),
        "depth": half(labels["depth"]), "mask": labels["mask"].astype(np.uint8), "fov": np.float32(world.view.fov),
        "thing": things_of(world, probe), "kind": np.array(world.kind),
    }  # fmt: skip


def things_of(world: World, probe: dict[str, Array]) -> Array:
    """[H, W] int16: the number of the thing at a pixel's centre, negative for walls and the like, 0 for nothing."""
    number: dict[object, int] = {}
    of_part = [0]
    for k, part in enumerate(world.parts):
        own = number.setdefault(("part", k) if part.thing is None else part.thing, len(number) + 1)
        of_part.append(-own if part.thing is None else own)
    owner = probe["owner"][..., _centre(probe)].astype(int)
    return np.array(of_part, np.int16)[owner + 1]


def labels_of(probe: dict[str, Array]) -> dict[str, Array]:
    """Maps [H, W, ...] of a probe [H, W, N, ...]: of the surface at the pixel's centre, its texture averaged over the
    rays of the pixel that see the same part; all 0 where there is no surface."""
    centre = _centre(probe)
    owner = probe["owner"][..., centre]
    mask = owner >= 0
    same = ((probe["owner"] == owner[..., None]) & mask[..., None]).astype(np.float32)
    share = same / np.maximum(same.sum(-1, keepdims=True), 1)
    out = {k: (probe[k] * share).sum(2) for k in ("roughness", "metallic")}
    out["albedo"] = (probe["albedo"] * share[..., None]).sum(2)
    out["normal"] = probe["normal"][:, :, centre] * mask[..., None]
    out["depth"] = probe["depth"][..., centre] * mask
    out["mask"] = mask
    return out


def _centre(probe: dict[str, Array]) -> int:
    """The number of the ray through the middle of a pixel."""
    side = round(np.sqrt(probe["owner"].shape[2]))
    return side * (side // 2) + side // 2


def exposure(image: Array, rng: np.random.Generator) -> float:
    """Factor that exposes linear radiance [H, W, 3] as cameras do, give or take: middle grey, some highlights lost."""
    light = luminance(image)
    middle = float(np.exp(np.log(np.maximum(light, 1e-4 * light.mean() + 1e-9)).mean()))
    # Lamps in the picture must not make the rest black, nor a bright window.
    high = min(float(np.percentile(light, 93)), 12 * middle)
    aim = (0.17 / max(middle, 1e-9)) ** 0.6 * (0.75 / max(high, 1e-9)) ** 0.4
    return float(np.clip(aim * np.exp(rng.normal(0, 0.3)), 1e-6, 1e6))


def balance(shading: Array, rng: np.random.Generator) -> Array:
    """[3] gains, about 1, that make most of the light's colour white, as the maker of a camera would have it."""
    light = np.median(shading.reshape(-1, 3), 0) + 1e-6 + 1e-3 * shading.mean()
    strength = rng.uniform(0.4, 1.0) if rng.random() < 0.85 else rng.uniform(0.0, 0.4)
    gains = (luminance(light) / light) ** strength * np.exp(rng.normal(0, 0.04, 3))
    return np.clip(gains, 0.2, 5).astype(np.float32)
