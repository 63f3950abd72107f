"""Large things of many parts: two-wheelers, carts, machines, ladders, stacks. Base on y = 0, metres."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import street_things, things
from materialist.procedural.objects.parts import Parts, block, placed, rod, standing
from materialist.procedural.objects.things import Meshes
from materialist.procedural.objects.wheels import two_wheeler, wheel
from materialist.procedural.world import ScenePart


def big_thing(rng: np.random.Generator, meshes: Meshes = ()) -> Parts:
    """Something between half a metre and two, along X."""
    return m.pick(rng, KINDS)(rng, meshes)


def cart(rng, meshes=()) -> Parts:
    """A trolley, wheelbarrow or pram: a tray or a tub on wheels, a handle, a load."""
    w, d, r, thick, tall = rng.uniform([0.6, 0.4, 0.06, 0.03, 0.3], [1.3, 0.7, 0.2, 0.3, 0.7])
    frame, level = m.metal(rng), r * 2 + rng.uniform(0, 0.3)
    parts = [block((w, thick, d), (0, level, 0), m.lacquer(rng), 0.02)]
    for x, z in ((x * w, z * d) for x in (-0.4, 0.4) for z in (-0.45, 0.45)):
        parts += wheel(rng, np.array([x, r, z]), r, 0.0, True)
        parts.append(rod([(x, r, z), (x, level, z)], 0.015, frame, 6))
    near, far, z = -w / 2, -w / 2 - 0.15, d / 2
    parts.append(
        rod([(near, level, -z), (far, level + tall, -z), (far, level + tall, z), (near, level, z)], 0.016, frame)
    )
    load = things.scattered(rng, int(rng.integers(0, 4)), (w / 2, d / 2), (0.15, 0.5), meshes)
    return parts + placed(load, (0, level + 0.3, 0))


def machine(rng, meshes=()) -> Parts:
    """A body with things bolted to it: boxes, drums, wheels, hoses, rods."""
    size = rng.uniform([0.4, 0.4, 0.4], [1.4, 1.5, 0.9])
    looks = [m.lacquer(rng), m.metal(rng), m.rubber(rng), m.lacquer(rng)]
    parts = [
        block(size * [1, rng.uniform(0.4, 0.9), 1], (0, rng.choice([0, 0.1]), 0), looks[0], rng.choice([0.0, 0.05]))
    ]
    for _ in range(int(rng.integers(5, 22))):
        look, at = looks[rng.integers(4)], rng.uniform(-0.55, 0.55, 3) * size + [0, 0.55 * size[1], 0]
        part, kind = size.mean() * rng.uniform(0.06, 0.5, 3), rng.integers(4)
        if kind == 0:
            parts.append(block(part, at, look, 0.01))
        elif kind == 1:
            tip, turn = np.pi / 2 * rng.integers(2, size=2)
            parts.append(ScenePart(s.moved(s.drum(part[0] / 2, part[1]), at, turn, tip), look))
        elif kind == 2:
            far = at + rng.normal(size=3) * 0.3 * size
            middle = (at + far) / 2 + [0, rng.normal() * 0.15, 0]
            parts.append(rod([at, middle, far], rng.uniform(0.01, 0.035), look))
        else:
            parts += wheel(rng, at, max(part[0], 0.1), float(rng.choice([0, np.pi / 2])), True)
    return standing(parts)


def ladder(rng, meshes=()) -> Parts:
    """A ladder, its foot apart or leaning."""
    tall, w, look = rng.uniform(1.3, 2.2), rng.uniform(0.35, 0.5), m.one_of(rng, m.metal, m.wood)
    parts: Parts = []
    for sign in (1, -1) if rng.random() < 0.6 else (1,):
        top, foot = np.array([0, tall, 0]), np.array([0, 0, sign * rng.uniform(0.25, 0.6)])
        parts += [rod([np.add(foot, (x, 0, 0)), np.add(top, (x * 0.8, 0, 0))], 0.02, look, 6) for x in (-w / 2, w / 2)]
        steps = np.arange(0.12, 0.98, 0.28 / tall)
        parts += [block((w, 0.025, 0.07), foot + t * (top - foot), look) for t in steps]
    return parts


def bench(rng, meshes=()) -> Parts:
    """A seat of slats with a back."""
    (w, h, back), look = rng.uniform([0.6, 0.4, 0.35], [1.6, 0.48, 0.55]), m.one_of(rng, m.wood, m.wood, m.lacquer)
    ends = (-w / 2 + 0.04, w / 2 - 0.04)
    slats: list[tuple] = [((w, 0.02, 0.08), (0, h, z)) for z in np.arange(-0.2, 0.21, 0.1)]
    slats += [((0.06, h, 0.06), (x, 0, z)) for x in ends for z in (-0.2, 0.2)]
    slats += [((0.06, back, 0.04), (x, h, -0.22)) for x in ends]
    if rng.random() < 0.5:
        slats += [((w, 0.07, 0.02), (0, h + y, -0.22)) for y in np.arange(0.1, back, 0.12)]
    else:
        slats += [((0.04, back, 0.02), (x, h, -0.22)) for x in np.arange(-w / 2 + 0.12, w / 2 - 0.1, 0.12)]
    slats.append(((w, 0.06, 0.03), (0, h + back - 0.02, -0.22)))
    return [block(size, at, look, 0.004) for size, at in slats]


def stack(rng, meshes=()) -> Parts:
    """Cartons, crates and sacks on top of each other, on a pallet now and then."""
    parts, top, w, card = [], 0.0, rng.uniform(0.4, 0.9), m.card(rng)
    if rng.random() < 0.4:
        wood, top = m.raw_wood(rng), 0.145
        parts += [block((0.1, 0.12, 0.8), (x, 0, 0), wood) for x in (-0.45, 0, 0.45)]
        parts += [block((1.1, 0.025, 0.09), (0, 0.12, z), wood) for z in np.arange(-0.36, 0.4, 0.18)]
    for _ in range(int(rng.integers(1, 6))):
        size = w * rng.uniform([0.7, 0.3, 0.6], [1.1, 0.8, 1.0])
        look = card if rng.random() < 0.5 else m.one_of(rng, m.card, m.any_object)
        parts.append(block(size, (rng.normal() * 0.06, top, rng.normal() * 0.05), look, 0.01, turn=rng.normal() * 0.2))
        top += size[1]
    return parts


def statue(rng, meshes=()) -> Parts:
    """A captured mesh as large as a person or a dog; a vase where there are none."""
    size = rng.uniform(0.6, 1.7)
    return things.captured(rng, size, meshes) if meshes else things.vase(rng, 0.55 * size)


def person(rng, meshes=()) -> Parts:
    """Somebody who stands there."""
    return street_things.person(rng)


def rack(rng: np.random.Generator, width: float, height: float, meshes: Meshes = ()) -> Parts:
    """Open shelving, its back to -Z: posts, boards, loaded with cartons, boxes and things."""
    depth, frame = rng.uniform(0.35, 0.6), m.one_of(rng, m.metal, m.lacquer, m.wood)
    board = frame if rng.random() < 0.5 else m.wood(rng)
    posts = [(x * width / 2, 0, z * depth / 2) for x in (-1, 1) for z in (-1, 1)]
    parts = [block((0.04, height, 0.04), at, frame) for at in posts]
    levels = np.linspace(0.1, height - 0.05, int(rng.integers(3, 6)))
    for low, high in zip(levels, [*levels[1:], levels[-1] + 0.5]):
        parts.append(block((width, 0.03, depth), (0, low, 0), board))
        x = -width / 2 + 0.05
        while x < width / 2 - 0.15 and rng.random() < 0.93:
            size = rng.uniform([0.1, 0.3, 0.5], [0.5, 0.9, 0.95]) * [1, high - low, depth]
            size[0] = min(size[0], width / 2 - x)
            if rng.random() < 0.7:
                load = [block(size, (0, 0, 0), m.one_of(rng, m.card, m.any_object), 0.008)]
            else:
                load = things.thing(rng, min(size[0], size[1]) * 0.8, meshes)
            parts += placed(load, (x + size[0] / 2, low + 0.032, 0), rng.normal() * 0.05)
            x += size[0] + rng.uniform(0.01, 0.12)
    return parts


KINDS = (
    (0.3, two_wheeler), (0.17, machine), (0.1, cart), (0.12, stack), (0.12, statue), (0.07, bench), (0.05, ladder),
    (0.07, person),
)  # fmt: skip
