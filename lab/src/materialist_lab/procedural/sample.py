"""One labelled picture: a random world, rendered, denoised and exposed like a photograph."""

from collections.abc import Callable

import cv2
import numpy as np

from materialist.color import linear_to_srgb, luminance
from materialist.render.denoise import denoise
from materialist.render.variant import setup
from materialist.types import Array, Camera
from materialist_lab.data.samples import LIGHT_ROWS
from materialist_lab.procedural import packing
from materialist_lab.procedural.defocus import defocused
from materialist_lab.procedural.options import SPLITS, DataSetOptions
from materialist_lab.procedural.staged.furnished import furnished_room
from materialist_lab.procedural.staged.laid import laid_table
from materialist_lab.procedural.staged.outside import outside
from materialist_lab.procedural.staged.single import single
from materialist_lab.procedural.staged.stock import Stock, stock
from materialist_lab.procedural.tracer import CENTRE, SampleTracer
from materialist_lab.procedural.world import World

DENOISING = "balanced"
"""Quality of the filter: less than half of the time of 'high'."""
LIGHT_SPP = 128
"""Rays per texel of the stored light."""
LIGHT_HIDDEN = 0.1
"""Weight of the sky behind visible surfaces in the stored light, for kinds of worlds under an open sky."""
ATTEMPTS = 6
"""Largest number of worlds that are drawn until a camera sees enough; the last one is taken as it is."""
MAKERS: dict[str, tuple[Callable[[np.random.Generator, Stock], World], float]] = {
    "furnished": (furnished_room, 0.25),
    "laid": (laid_table, 0.3),
    "single": (single, 0.35),
    "outside": (outside, 0.1),
}
"""Kind of scene -> its maker, and its share of the pictures."""
OPEN_KINDS = ("single", "outside")
"""Kinds of worlds under an open sky."""
SINGLE_COVERS = (0.08, 0.92)
"""Smallest and largest share of a picture that a single thing may cover."""


def make_sample(index: int, options: DataSetOptions) -> dict[str, Array]:
    """The arrays of sample `index`, as they are stored (docs/training_data.md); the same for the same arguments.

    Raises SetupError where Mitsuba or the denoiser is missing.
    """
    setup(options.device)  # before a mesh is read, which would choose for itself
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([options.seed, index, attempt, *SPLITS[options.split]])
        world = make_world(rng, options)
        camera = Camera(options.size, options.size, world.view.fov)
        tracer = SampleTracer(packing.pack(world, rng), camera, device=options.device)
        probe = tracer.probe()
        if attempt == ATTEMPTS - 1 or worth_seeing(world, probe):
            break
    return _developed(world, probe, tracer, rng, options)


def make_world(rng: np.random.Generator, options: DataSetOptions) -> World:
    """A random scene of the kinds' shares, or of the one kind that the options name."""
    kind = options.only or str(rng.choice(list(MAKERS), p=[share for _, share in MAKERS.values()]))
    make, _ = MAKERS[kind]
    return make(rng, stock_of(options))


def stock_of(options: DataSetOptions) -> Stock:
    """Models and photographs for the options; read once a process."""
    return stock(
        options.archives,
        options.photographs,
        options.cache,
        held_out=options.split == "heldout",
        meshes=options.mesh_files,
        captures=options.envmap_files,
    )


def worth_seeing(world: World, probe: dict[str, Array]) -> bool:
    """Whether a view shows several things at a distance, or a single one well, rather than the inside of a cupboard."""
    # One ray a pixel is enough here.
    owner = probe["owner"][..., 0]
    depth = probe["depth"][..., 0]
    seen = owner >= 0
    if world.kind == "single":
        subject = np.array([part.thing is not None for part in world.parts])
        covered = float((seen & subject[owner.astype(int)]).mean())
        return SINGLE_COVERS[0] < covered < SINGLE_COVERS[1]
    # Half a dozen things of a visible size.
    _, counts = np.unique(owner[seen], return_counts=True)
    if seen.mean() < 0.3 or (counts > owner.size / 400).sum() < 6:
        return False
    # Not mostly something close to the lens, nor one thing that fills the picture.
    near = np.median(depth[seen]) * 0.25
    return bool((depth[seen] < near).mean() < 0.3 and counts.max() / owner.size < 0.75)


def _developed(
    world: World, probe, tracer, rng: np.random.Generator, options: DataSetOptions
) -> dict[str, Array]:
    # --- The picture and its shading, denoised ---
    noisy, white = tracer.render(spp=options.spp, seed=int(rng.integers(2**31)))
    normal = probe["normal"].mean(2)
    image = denoise(noisy, albedo=probe["albedo"].mean(2), normal=normal, quality=DENOISING)
    # The shading is of white surfaces: a guide of their texture would print it into the shading.
    covered = (probe["owner"] >= 0).mean(2, dtype=np.float32)
    shading = denoise(
        white, albedo=np.repeat(covered[..., None], 3, -1), normal=normal, quality=DENOISING
    )
    # --- Exposure and white balance, as a camera sets them ---
    labels = labels_of(probe)
    lit = labels["mask"] if world.backdrop is not None else None
    gain = exposure(image, rng, lit) * balance(shading, rng)
    if world.backdrop is not None:
        image = over_backdrop(world.backdrop, image, covered)
    image = image * gain
    # --- Defocus ---
    view = world.view
    sharp = view.aperture == 0
    if not sharp:
        image = defocused(image, labels["depth"], tracer.camera, view.aperture, view.focus)
    # --- The light that reaches what is seen ---
    hidden = LIGHT_HIDDEN if world.kind in OPEN_KINDS else 0
    light = tracer.light(
        probe, rows=LIGHT_ROWS, spp=LIGHT_SPP, seed=int(rng.integers(2**31)), hidden=hidden
    )

    def byte(x):
        return (np.clip(x, 0, 1) * 255 + 0.5).astype(np.uint8)

    def half(x):
        return np.clip(x, 0, 6e4).astype(np.float16)

    # A blurred picture is no product of its sharp maps, so that its surfaces cannot be recoloured by its shading.
    shaded = {"shading": half(shading * gain)} if sharp else {}
    return shaded | {
        "image": half(image),
        "albedo": byte(linear_to_srgb(labels["albedo"])),
        "roughness": byte(labels["roughness"]),
        "metallic": byte(labels["metallic"]),
        "normal": np.rint(labels["normal"] * 127).astype(np.int8),
        "depth": half(labels["depth"]),
        "mask": labels["mask"].astype(np.uint8),
        "fov": np.float32(world.view.fov),
        "light": half(light * [*gain, 1]),
        "thing": things_of(world, probe),
        "kind": np.array(world.kind),
    }


def things_of(world: World, probe: dict[str, Array]) -> Array:
    """[H, W] int16: the number of the thing at a pixel's centre, negative for walls and the like, 0 for nothing."""
    # Numbers from 1 in the order of the parts; several parts may be one thing.
    number: dict[object, int] = {}
    of_part = [0]
    for k, part in enumerate(world.parts):
        label = number.setdefault(
            ("part", k) if part.thing is None else part.thing, len(number) + 1
        )
        of_part.append(-label if part.thing is None else label)
    owner = probe["owner"][..., CENTRE].astype(int)
    return np.array(of_part, np.int16)[owner + 1]


def labels_of(probe: dict[str, Array]) -> dict[str, Array]:
    """Maps [H, W, ...] of a probe [H, W, N, ...]: of the surface at the pixel's centre, its texture averaged over the
    rays of the pixel that see the same part; all 0 where there is no surface."""
    owner = probe["owner"][..., CENTRE]
    mask = owner >= 0
    same = ((probe["owner"] == owner[..., None]) & mask[..., None]).astype(np.float32)
    share = same / np.maximum(same.sum(-1, keepdims=True), 1)
    out = {k: (probe[k] * share).sum(2) for k in ("roughness", "metallic")}
    out["albedo"] = (probe["albedo"] * share[..., None]).sum(2)
    out["normal"] = _mean_normal(probe, same)
    out["depth"] = probe["depth"][..., CENTRE] * mask
    out["mask"] = mask
    return out


def _mean_normal(probe: dict[str, Array], same: Array) -> Array:
    """[H, W, 3] unit normals: means over the rays `same` [H, W, N] that see about the depth of the centre's."""
    centre = probe["depth"][..., CENTRE, None]
    near = same * (np.abs(probe["depth"] - centre) < 0.03 * centre)
    total = (probe["normal"] * near[..., None]).sum(2)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    middle = probe["normal"][:, :, CENTRE]
    mean = np.where(length > 0.3, total / np.maximum(length, 1e-6), middle)
    return mean * (same.sum(-1, keepdims=True) > 0)


def over_backdrop(backdrop: Array, image: Array, covered: Array) -> Array:
    """The image [H, W, 3] with a backdrop [h, w, 3] where its surfaces do not cover the pixels [H, W]."""
    h, w = covered.shape
    behind = cv2.resize(backdrop, (w, h), interpolation=cv2.INTER_LINEAR)
    # Pixels without surface show the envmap, which the backdrop hides.
    share = np.where(covered > 0, 1, 0)[..., None]
    return (image * share * covered[..., None] + behind * (1 - covered[..., None])).astype(
        np.float32
    )


def exposure(image: Array, rng: np.random.Generator, surface: Array | None = None) -> float:
    """Factor that exposes linear radiance [H, W, 3] as cameras do, give or take: middle grey, some highlights lost.

    surface: [H, W] bool, what alone is measured; all by default.
    """
    light = luminance(image)
    if surface is not None and surface.any():
        light = light[surface]
    middle = float(np.exp(np.log(np.maximum(light, 1e-4 * light.mean() + 1e-9)).mean()))
    # Lamps in the picture must not make the rest black, nor a bright window.
    high = min(float(np.percentile(light, 93)), 12 * middle)
    aim = (0.17 / max(middle, 1e-9)) ** 0.6 * (0.75 / max(high, 1e-9)) ** 0.4
    return float(np.clip(aim * np.exp(rng.normal(0, 0.3)), 1e-6, 1e6))


def balance(shading: Array, rng: np.random.Generator) -> Array:
    """[3] gains, about 1, that make most of the light's colour white, as the maker of a camera would have it."""
    # The light's colour, as white surfaces show it.
    light = np.median(shading.reshape(-1, 3), 0) + 1e-6 + 1e-3 * shading.mean()
    strength = rng.uniform(0.4, 1.0) if rng.random() < 0.85 else rng.uniform(0.0, 0.4)
    # Camera makers correct most of it, not all.
    gains = (luminance(light) / light) ** strength * np.exp(rng.normal(0, 0.04, 3))
    return np.clip(gains, 0.2, 5).astype(np.float32)
