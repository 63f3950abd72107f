"""Large things of many parts: two-wheelers, carts, machines, ladders, stacks. Base on y = 0, metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import street_things, things
from materialist.procedural.objects.things import Parts
from materialist.procedural.objects.wheels import by, disc, paint, rubber, two_wheeler, wheel
from materialist.procedural.world import Part


def big_thing(rng: np.random.Generator, meshes: tuple[Path, ...] = ()) -> Parts:
    """Something between half a metre and two, along X."""
    return _KINDS[rng.choice(len(_KINDS), p=_SHARES)](rng, meshes)


def cart(rng, meshes=()) -> Parts:
    """A trolley, wheelbarrow or pram: a tray or a tub on wheels, a handle, a load."""
    w, d, r = rng.uniform(0.6, 1.3), rng.uniform(0.4, 0.7), rng.uniform(0.06, 0.2)
    frame, body = m.metal(rng), paint(rng)
    level = r * 2 + rng.uniform(0, 0.3)
    parts = [Part(s.moved(s.slab(np.array([w, rng.uniform(0.03, 0.3), d]), 0.02), (0, level, 0)), body)]
    for x in (-0.4 * w, 0.4 * w):
        for z in (-0.45 * d, 0.45 * d):
            parts += wheel(rng, np.array([x, r, z]), r, 0.0, True)
            parts.append(Part(s.tube([(x, r, z), (x, level, z)], 0.015, 6), frame))
    tall = rng.uniform(0.3, 0.7)
    near, grip, z = -w / 2, -w / 2 - 0.15, d / 2
    hoop = np.array([(near, level, -z), (grip, level + tall, -z), (grip, level + tall, z), (near, level, z)])
    parts.append(Part(s.tube(hoop, 0.016, 8), frame))
    load = things.scattered(rng, int(rng.integers(0, 4)), (w / 2, d / 2), (0.15, 0.5), meshes)
    return parts + things.placed(load, (0, level + 0.3, 0))


def machine(rng, meshes=()) -> Parts:
    """A body with things bolted to it: boxes, drums, wheels, hoses, rods."""
    size = rng.uniform([0.4, 0.4, 0.4], [1.4, 1.5, 0.9])
    looks = [paint(rng), m.metal(rng), rubber(rng), paint(rng)]
    parts = [
        Part(
            s.moved(
                s.slab(size * [1, rng.uniform(0.4, 0.9), 1], rng.choice([0.0, 0.05])), (0, rng.choice([0, 0.1]), 0)
            ),
            looks[0],
        )
    ]
    for _ in range(int(rng.integers(5, 22))):
        look, at = looks[rng.integers(4)], rng.uniform(-0.55, 0.55, 3) * size + [0, 0.55 * size[1], 0]
        part, kind = size.mean() * rng.uniform(0.06, 0.5, 3), rng.integers(4)
        if kind == 0:
            solid = s.slab(part, 0.01)
        elif kind == 1:
            solid = s.moved(
                disc(part[0] / 2, part[1]), tip=np.pi / 2 * rng.integers(2), turn=np.pi / 2 * rng.integers(2)
            )
        elif kind == 2:
            far = at + rng.normal(size=3) * 0.3 * size
            middle = (at + far) / 2 + [0, rng.normal() * 0.15, 0]
            parts.append(Part(s.tube([at, middle, far], rng.uniform(0.01, 0.035), 8), look))
            continue
        else:
            parts += wheel(rng, at, max(part[0], 0.1), float(rng.choice([0, np.pi / 2])), True)
            continue
        parts.append(Part(s.moved(solid, at), look))
    return _standing(parts)


def ladder(rng, meshes=()) -> Parts:
    """A ladder, its foot apart or leaning."""
    tall, w, look = rng.uniform(1.3, 2.2), rng.uniform(0.35, 0.5), m.metal(rng) if rng.random() < 0.6 else m.wood(rng)
    parts: Parts = []
    for sign in (1, -1) if rng.random() < 0.6 else (1,):
        top, foot = np.array([0, tall, 0]), np.array([0, 0, sign * rng.uniform(0.25, 0.6)])
        for x in (-w / 2, w / 2):
            parts.append(Part(s.tube([foot + by(x, 0, 0), top + by(x * 0.8, 0, 0)], 0.02, 6), look))
        for t in np.arange(0.12, 0.98, 0.28 / tall):
            at = foot + t * (top - foot)
            parts.append(Part(s.moved(s.slab(np.array([w, 0.025, 0.07])), at), look))
    return parts


def bench(rng, meshes=()) -> Parts:
    """A seat of slats with a back."""
    w, h, look = rng.uniform(0.6, 1.6), rng.uniform(0.4, 0.48), m.wood(rng) if rng.random() < 0.8 else paint(rng)
    slat = lambda size, at: Part(s.moved(s.slab(np.asarray(size, float), 0.004), at), look)  # noqa: E731
    parts = [slat((w, 0.02, 0.08), (0, h, z)) for z in np.arange(-0.2, 0.21, 0.1)]
    parts += [slat((0.06, h, 0.06), (x, 0, z)) for x in (-w / 2 + 0.04, w / 2 - 0.04) for z in (-0.2, 0.2)]
    back = rng.uniform(0.35, 0.55)
    parts += [slat((0.06, back, 0.04), (x, h, -0.22)) for x in (-w / 2 + 0.04, w / 2 - 0.04)]
    if rng.random() < 0.5:
        parts += [slat((w, 0.07, 0.02), (0, h + y, -0.22)) for y in np.arange(0.1, back, 0.12)]
    else:
        parts += [slat((0.04, back, 0.02), (x, h, -0.22)) for x in np.arange(-w / 2 + 0.12, w / 2 - 0.1, 0.12)]
    return [*parts, slat((w, 0.06, 0.03), (0, h + back - 0.02, -0.22))]


def stack(rng, meshes=()) -> Parts:
    """Cartons, crates and sacks on top of each other, on a pallet now and then."""
    parts, top, w = [], 0.0, rng.uniform(0.4, 0.9)
    if rng.random() < 0.4:
        wood = m.wood(rng, gloss=False)
        parts += [Part(s.moved(s.slab(np.array([0.1, 0.12, 0.8])), (x, 0, 0)), wood) for x in (-0.45, 0, 0.45)]
        parts += [
            Part(s.moved(s.slab(np.array([1.1, 0.025, 0.09])), (0, 0.12, z)), wood) for z in np.arange(-0.36, 0.4, 0.18)
        ]
        top = 0.145
    card = _carton(rng)
    for _ in range(int(rng.integers(1, 6))):
        size = w * rng.uniform([0.7, 0.3, 0.6], [1.1, 0.8, 1.0])
        look = card if rng.random() < 0.5 else _carton(rng) if rng.random() < 0.5 else m.any_object(rng)
        parts.append(
            Part(s.moved(s.slab(size, 0.01), (rng.normal() * 0.06, top, rng.normal() * 0.05), rng.normal() * 0.2), look)
        )
        top += size[1]
    return parts


def statue(rng, meshes=()) -> Parts:
    """A captured mesh as large as a person or a dog; something turned where there are none."""
    if not meshes:
        return things.vase(rng, rng.uniform(0.4, 0.9))
    return things.captured(rng, rng.uniform(0.6, 1.7), meshes)


def person(rng, meshes=()) -> Parts:
    """Somebody who stands there."""
    return street_things.person(rng)


def rack(rng: np.random.Generator, width: float, height: float, meshes: tuple[Path, ...] = ()) -> Parts:
    """Open shelving, its back to -Z: posts, boards, loaded with cartons, boxes and things."""
    depth, kind = rng.uniform(0.35, 0.6), rng.random()
    frame = m.metal(rng) if kind < 0.25 else paint(rng) if kind < 0.6 else m.wood(rng)
    board = frame if rng.random() < 0.5 else m.wood(rng)
    parts = [Part(s.moved(s.slab(np.array([0.04, height, 0.04])), (x * width / 2, 0, z * depth / 2)), frame)
             for x in (-1, 1) for z in (-1, 1)]  # fmt: skip
    levels = np.linspace(0.1, height - 0.05, int(rng.integers(3, 6)))
    for low, high in zip(levels, [*levels[1:], levels[-1] + 0.5]):
        parts.append(Part(s.moved(s.slab(np.array([width, 0.03, depth])), (0, low, 0)), board))
        x = -width / 2 + 0.05
        while x < width / 2 - 0.15 and rng.random() < 0.93:
            size = np.array(
                [rng.uniform(0.1, 0.5), rng.uniform(0.3, 0.9) * (high - low), depth * rng.uniform(0.5, 0.95)]
            )
            size[0] = min(size[0], width / 2 - x)
            if rng.random() < 0.7:
                look = _carton(rng) if rng.random() < 0.5 else m.any_object(rng)
                load = [Part(s.slab(size, 0.008), look)]
            else:
                load = things.thing(rng, min(size[0], size[1]) * 0.8, meshes)
            parts += things.placed(load, (x + size[0] / 2, low + 0.032, 0), rng.normal() * 0.05)
            x += size[0] + rng.uniform(0.01, 0.12)
    return parts


def _carton(rng) -> m.Material:
    base = m.hsv(rng.uniform(0.07, 0.1), rng.uniform(0.3, 0.55), rng.uniform(0.45, 0.75))
    return m.Material(0, (base,) * 3, 0.1, (rng.uniform(0.7, 0.95),) * 2)


def _standing(parts: Parts) -> Parts:
    low = min(float(p.solid.vertices[:, 1].min()) for p in parts)
    return things.placed(parts, (0, -low, 0))


_TABLE = (
    (two_wheeler, 0.3), (machine, 0.17), (cart, 0.1), (stack, 0.12), (statue, 0.12), (bench, 0.07), (ladder, 0.05),
    (person, 0.07),
)  # fmt: skip
_KINDS = [kind for kind, _ in _TABLE]
_SHARES = np.array([share for _, share in _TABLE]) / sum(share for _, share in _TABLE)
