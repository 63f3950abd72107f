"""The bank of texture tiles: seamless four-channel patterns that materials colour in.

A tile says where a material's colours and finishes go, not what they are; one fixed bank serves every scene, so that
the path tracer's kernel and its largest buffer never change. Channels, all in [0, 1]: 0 first to second colour,
1 towards the third colour, 2 brightness grain (0.5 none), 3 first to second roughness.
"""

from functools import lru_cache

import numpy as np

from materialist.types import Array

SIZE = 256
"""Pixels on a side of a tile."""
VARIANTS = 6
"""Tiles of each kind."""


@lru_cache(maxsize=1)
def bank() -> tuple[Array, dict[str, range]]:
    """([N, SIZE, SIZE, 4] uint8 tiles, kind -> the numbers of its tiles); the same in every process."""
    tiles: list[Array] = []
    where: dict[str, range] = {}
    for k, (kind, make) in enumerate(_KINDS.items()):
        where[kind] = range(len(tiles), len(tiles) + VARIANTS)
        for v in range(VARIANTS):
            # A seed of its own for each tile: a new kind at the end changes none of the others.
            channels = make(np.random.default_rng([41, k, v]))
            tiles.append(np.stack([np.broadcast_to(c, (SIZE, SIZE)) for c in channels], -1))
    return (np.clip(np.stack(tiles), 0, 1) * 255 + 0.5).astype(np.uint8), where


def noise(rng: np.random.Generator, slope: float, stretch: tuple[float, float] = (1, 1)) -> Array:
    """Periodic noise [SIZE, SIZE] of spectrum 1 / f**slope, in [0, 1], mean 0.5, deviation 0.2.

    A `stretch` (down, right) above 1 draws the noise out along that axis.
    """
    down = np.fft.fftfreq(SIZE)[:, None]
    right = np.fft.rfftfreq(SIZE)[None]
    f = np.hypot(down * stretch[0], right * stretch[1])
    # White noise, coloured in the Fourier domain, is periodic: its tiles have no seams.
    f[0, 0] = 1
    spectrum = np.fft.rfft2(rng.normal(size=(SIZE, SIZE))) / f**slope
    spectrum[0, 0] = 0
    field = np.fft.irfft2(spectrum)
    return np.clip(0.5 + field / (5 * field.std()), 0, 1)


X, Y = np.meshgrid((np.arange(SIZE) + 0.5) / SIZE, (np.arange(SIZE) + 0.5) / SIZE)
"""Coordinates [SIZE, SIZE] in (0, 1), to the right and down."""


def _step(x: Array, soft: float = 0.01) -> Array:
    """0 below zero and 1 above it, with a ramp of that width."""
    return np.clip(x / soft + 0.5, 0, 1)


def _from_line(x: Array) -> Array:
    """Distance to the nearest whole number."""
    return np.abs(x - np.round(x))


# --- The kinds of tile: each returns its four channels, arrays or numbers ---


def _plain(rng):
    """One colour with fine grain."""
    grain = noise(rng, rng.uniform(0.6, 1.6))
    return 0.0, 0.0, grain, noise(rng, 1.5)


def _cloudy(rng):
    """Plaster, concrete, leather, worn paint: soft patches."""
    soft = noise(rng, rng.uniform(1.2, 2.0))
    patches = 1.2 * _step(noise(rng, 1.4) - 0.78, 0.1)
    return soft, patches, noise(rng, 0.7), noise(rng, 1.6)


def _speckle(rng):
    """Terrazzo, granite, gravel, asphalt."""
    fine = noise(rng, rng.uniform(0.3, 0.9))
    coarse = noise(rng, rng.uniform(0.9, 1.3))
    grains = _step(coarse - 0.55, 0.1)
    specks = _step(fine - rng.uniform(0.7, 0.8), 0.05)
    return grains, specks, noise(rng, 0.4), coarse


def _marble(rng):
    """Thin veins: the zeros of a warped sine."""
    warp = noise(rng, 2.2) * rng.uniform(1.5, 4)
    # Whole numbers of waves along both axes keep the tile seamless.
    n = int(rng.integers(1, 4))
    m = int(rng.integers(0, 3))
    distance = np.abs(np.sin(np.pi * (n * X + m * Y + warp)))
    vein = np.exp(-distance * rng.uniform(4, 12))
    return vein, noise(rng, 2.0) * 0.5, noise(rng, 1.0), 0.3


def _wood(rng):
    """Grain along x."""
    warp = noise(rng, 2.3, (1, 4))
    n = int(rng.integers(3, 12))
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (n * Y + rng.uniform(1, 4) * warp))
    fibre = noise(rng, 0.7, (1, 16))
    # The exponent makes the dark late wood of the rings narrow.
    mix = np.clip(0.55 * rings ** rng.uniform(1, 3) + 0.45 * fibre, 0, 1)
    return mix, 0.0, fibre, 0.5 * rings + 0.5 * fibre


def _planks(rng):
    """Floor boards or parquet along x, each of its own shade."""
    rows = int(rng.integers(4, 11))
    columns = int(rng.integers(1, 4))
    r = np.floor(Y * rows).astype(int)
    # Each row is shifted by an amount of its own.
    x = (X + rng.random(rows)[r]) % 1 * columns
    shade = rng.random((rows, columns))[r, np.floor(x).astype(int) % columns]
    # Distances to the seams, both in widths of a plank.
    across = _from_line(Y * rows)
    along = _from_line(x) * rows / columns / 2
    seam = _step(0.035 - np.minimum(across, along), 0.03)
    fibre = noise(rng, 0.9, (1, 14))
    mix = np.clip(0.15 + 0.55 * shade + 0.6 * (fibre - 0.5), 0, 1)
    dark = seam * rng.uniform(0.5, 1)
    return mix, dark, 0.5 + 0.6 * (fibre - 0.5), np.maximum(0.4 * fibre, seam)


def _bricks(
    rng, rows: tuple[int, int] = (6, 13), aspect: float = 2.5, shift: bool = True, gap: float = 0.06
):
    """Bricks or tiles with joints; `aspect` is their width by their height, `gap` half a joint in heights."""
    # An even number of rows, every other one shifted by half a brick: the tile stays seamless.
    n = 2 * int(rng.integers(rows[0] // 2, rows[1] // 2 + 1))
    m = max(1, round(n / aspect))
    r = np.floor(Y * n).astype(int)
    x = X * m + (0.5 * (r % 2) if shift else 0)
    wobble = 0.03 * (noise(rng, 0.8) - 0.5)
    nearest = np.minimum(_from_line(x) * n / m, _from_line(Y * n))
    joint = _step(gap + wobble - nearest, 0.05)
    shade = rng.random((n, m))[r % n, np.floor(x).astype(int) % m]
    grain = 0.5 + 0.7 * (noise(rng, 0.8) - 0.5)
    return shade, joint, grain, np.maximum(joint, 0.3 * noise(rng, 1.2))


def _tiling(rng):
    """Square or oblong ceramic tiles."""
    aspect = float(rng.choice([1, 1, 2, 0.5]))
    shift = bool(rng.random() < 0.25)
    return _bricks(rng, (2, 10), aspect, shift, rng.uniform(0.02, 0.05))


def _checker(rng):
    """A chessboard with narrow joints."""
    n = 2 * int(rng.integers(1, 6))
    board = (np.floor(X * n) + np.floor(Y * n)) % 2
    edge = np.minimum(_from_line(X * n), _from_line(Y * n))
    joint = 0.6 * _step(0.02 - edge, 0.02)
    return board, joint, 0.5 + 0.6 * (noise(rng, 1.0) - 0.5), 0.2


def _stripes(rng):
    """Upright stripes of two or three colours."""
    n = int(rng.integers(3, 16))
    k = int(rng.integers(2, 5))
    profile = rng.choice([0, 0.5, 1], size=n * k)
    second = rng.choice([0, 0, 0, 1], size=n * k)
    i = np.floor(X * n * k).astype(int)
    return profile[i], second[i], noise(rng, 0.4), noise(rng, 1.0)


def _plaid(rng):
    """Three stripes of their own along both axes."""
    # Eight bands each, repeated four times over the tile.
    bands = np.repeat(rng.random((3, 8)) < 0.4, SIZE // 32, axis=1)
    a, b, c = np.tile(bands, (1, 4)).astype(float)
    mix = 0.5 * a[:, None] + 0.5 * b
    third = 0.7 * c[:, None] * c
    return mix, third, noise(rng, 0.3), 0.5


def _weave(rng):
    """Cloth seen close: crossing threads."""
    n = int(rng.integers(24, 56))
    # Where `over`, the thread along one axis lies on top; each thread is bright along its middle.
    over = (np.floor(X * n * 2) + np.floor(Y * n * 2)) % 2 > 0
    thread = np.abs(np.sin(2 * np.pi * n * np.where(over, X, Y)))
    # Colour that changes along the threads, not across them.
    melange = np.where(over, noise(rng, 0.3, (1, 8)), noise(rng, 0.3, (8, 1)))
    mix = np.clip(melange * rng.uniform(0.2, 1.2), 0, 1)
    return mix, 0.0, 0.25 + 0.45 * thread, 0.5


def _ornament(rng):
    """Wallpaper or print: repeated mirrored motifs."""
    n = int(2 ** rng.integers(1, 4))
    base = noise(rng, rng.uniform(1.5, 2.2))[::n, ::n]
    base = np.tile((base + base[:, ::-1]) / 2, (n, n))
    # The motif is what lies above a quantile, so that it always covers a share of the tile.
    t = np.quantile(base, rng.uniform(0.55, 0.85))
    motif = _step(base - t, 0.04)
    inner = _step(base - t - 0.12, 0.04)
    return motif, inner, noise(rng, 0.6), 0.6 - 0.3 * motif


def _facade(rng):
    """Rows of windows in a wall; channel 1 is the pane, channel 3 where it shines."""
    n = int(rng.integers(2, 5))
    m = int(rng.integers(2, 5))
    x = (X * m) % 1
    y = (Y * n) % 1
    w = rng.uniform(0.18, 0.38)
    h = rng.uniform(0.22, 0.36)
    # Each window about the middle of its cell: a frame, glazing bars, the pane between them.
    from_x = np.abs(x - 0.5)
    from_y = np.abs(y - 0.5)
    frame = _step(np.minimum(w + 0.04 - from_x, h + 0.04 - from_y), 0.02)
    bars = np.minimum(from_x, np.abs(y - 0.5 - rng.uniform(-0.1, 0.1))) < 0.012
    pane = _step(np.minimum(w - from_x, h - from_y), 0.02) * (1 - bars)
    wall = 0.35 * noise(rng, 1.4) * (1 - frame) + frame
    grain = 0.5 + 0.6 * (noise(rng, 1.0) - 0.5) * (1 - pane)
    return wall, pane, grain, pane


def _grass(rng):
    """Upright blades in patches of two greens."""
    blades = noise(rng, 0.5, (3, 1))
    mix = noise(rng, 1.3)
    return mix, _step(noise(rng, 0.9) - 0.7, 0.1), blades, 0.6


def _rust(rng):
    """Worn metal: channel 0 is where it is corroded or painted over."""
    patch = noise(rng, rng.uniform(1.3, 1.9))
    first = _step(patch - rng.uniform(0.5, 0.75), rng.uniform(0.02, 0.2))
    return first, 0.5 * noise(rng, 0.8) * first, noise(rng, 0.8), first


def _brushed(rng):
    """Metal with fine scratches along x."""
    grain = 0.5 + 0.5 * (noise(rng, 0.4, (1, 40)) - 0.5)
    return 0.0, 0.0, grain, noise(rng, 0.8, (1, 40))


_KINDS = {
    "plain": _plain,
    "cloudy": _cloudy,
    "speckle": _speckle,
    "marble": _marble,
    "wood": _wood,
    "planks": _planks,
    "bricks": _bricks,
    "tiling": _tiling,
    "checker": _checker,
    "stripes": _stripes,
    "plaid": _plaid,
    "weave": _weave,
    "ornament": _ornament,
    "facade": _facade,
    "grass": _grass,
    "rust": _rust,
    "brushed": _brushed,
}
