"""Large things of many parts: two-wheelers, carts, machines, ladders, stacks, racks. Base on y = 0, metres."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import furniture, street_things, things
from materialist.procedural.objects import shapes as s
from materialist.procedural.world import Parts, ScenePart, block, orb, placed, rod, standing


def wheel(rng, hub, r: float, turn: float, fat: bool) -> Parts:
    """Tyre, rim, spokes and hub of a wheel that stands upright and rolls along X."""
    scale = min(1.0, r / 0.27)  # small wheels are thinner
    tyre = scale * (rng.uniform(0.045, 0.07) if fat else rng.uniform(0.014, 0.028))
    count, thick = (
        (int(rng.integers(4, 9)), 0.016) if fat and rng.random() < 0.7 else (int(rng.integers(12, 24)), 0.003)
    )
    rim, hub_radius = m.metal(rng), scale * (rng.uniform(0.04, 0.13) if fat else 0.03)
    parts = [ScenePart(s.moved(s.torus(r - tyre, tyre, 10), tip=np.pi / 2), m.rubber(rng))]
    for solid in (s.torus(r - 2 * tyre, 0.012 * scale, 6), s.drum(hub_radius, 0.12 * scale)):
        parts.append(ScenePart(s.moved(solid, tip=np.pi / 2), rim))
    for a in np.arange(count) * 2 * np.pi / count:
        end = (r - 2 * tyre) * np.array([np.cos(a), np.sin(a), 0])
        parts.append(rod([0.1 * end, end], thick * scale, rim, 5))
    return placed(parts, hub, turn)


def _bolted(rng, count: int, low, high, looks) -> Parts:
    """Blocks, drums and hoses, anywhere in the box between two corners [3]."""
    parts, extent = [], np.subtract(high, low)
    for _ in range(count):
        look, at = looks[rng.integers(len(looks))], rng.uniform(low, high)
        size, kind = extent.mean() * rng.uniform(0.06, 0.45, 3), rng.integers(3)
        if kind == 0:
            parts.append(block(size, at, look, 0.01))
        elif kind == 1:
            turn, tip = np.pi / 2 * rng.integers(2, size=2)
            parts.append(ScenePart(s.moved(s.drum(size[0] / 2, size[1]), at, turn, tip), look))
        else:
            far = at + rng.normal(size=3) * 0.25 * extent
            middle = (at + far) / 2 + [0, rng.normal() * 0.15 * extent[1], 0]
            parts.append(rod([at, middle, far], extent.mean() * rng.uniform(0.01, 0.03), look))
    return parts


def two_wheeler(rng, meshes=()) -> Parts:
    """A bicycle or motorcycle, to the left or right, its front wheel turned."""
    motor = rng.random() < 0.65
    r, length = rng.uniform(0.27, 0.36), rng.uniform(1.2, 1.6) if motor else rng.uniform(1.0, 1.15)
    lacquer, metal, dark = m.lacquer(rng), m.metal(rng), m.rubber(rng)
    back, front = np.array([-length / 2, r, 0]), np.array([length / 2, r, 0])
    head = np.array([length / 2 - rng.uniform(0.2, 0.35), rng.uniform(0.75, 0.95), 0])
    seat = np.array([-length * rng.uniform(0.15, 0.3), rng.uniform(0.65, 0.8) if motor else rng.uniform(0.8, 0.95), 0])
    pedal = np.array([rng.uniform(-0.1, 0.1), r * rng.uniform(0.8, 1.0), 0])
    thick, frame = rng.uniform(0.012, 0.022) * (1 + 0.6 * motor), metal if rng.random() < 0.3 else lacquer
    bars = ((seat, pedal), (pedal, head), (seat, head), (pedal, back), (seat, back))
    top, steer = np.add(head, (-0.05, rng.uniform(0.1, 0.25), 0)), rng.normal() * 0.35
    parts = [rod(bar, thick, frame) for bar in bars]
    parts += [rod(np.add([front, head, top], (0, 0, z)), 0.7 * thick + 0.006, metal) for z in (-0.07, 0.07)]
    parts += wheel(rng, back, r, 0.0, motor) + wheel(rng, front, r, steer, motor)
    grip, sweep = rng.uniform(0.28, 0.4), rng.uniform(-0.2, 0.1)
    bar = s.tube([(sweep, 0.05, -grip), (0, 0, -0.2 * grip), (0, 0, 0.2 * grip), (sweep, 0.05, grip)], 0.014, 7)
    parts.append(ScenePart(s.moved(bar, top, turn=steer), metal))
    parts += [rod(np.add(top, [(sweep, 0.05, z * 0.75), (sweep, 0.05, z)]), 0.021, dark) for z in (-grip, grip)]
    saddle = np.array([rng.uniform(0.4, 0.75), rng.uniform(0.08, 0.14), 0.26] if motor else [0.28, 0.07, 0.16])
    parts.append(ScenePart(s.moved(s.superquadric(saddle, 0.6, 0.7, 24), np.add(seat, (-0.05, 0.03, 0))), dark))
    if motor:
        parts += _motor(rng, seat, head, pedal, back, r, (lacquer, metal, dark))
    return placed(parts, (0, 0, 0), float(rng.choice([0, np.pi])))


def _motor(rng, seat, head, pedal, back, r, looks) -> Parts:
    """Tank, mudguards, lamp, engine and exhaust of a motorcycle."""
    lacquer, metal, _ = looks
    extent = np.array([np.linalg.norm(head - seat), 1, 1]) * rng.uniform([0.6, 0.18, 0.2], [0.9, 0.28, 0.32])
    tank = s.superquadric(extent, rng.uniform(0.5, 1), rng.uniform(0.5, 1), 28)
    parts = [ScenePart(s.moved(tank, (seat + head) / 2), lacquer), orb(np.add(head, (0.12, 0.08, 0)), 0.09, metal, 20)]
    for hub, turn in ((back, 0.6), (back * [-1, 1, 1], 0.3)):
        t = np.linspace(0, np.pi, 14) * rng.uniform(0.5, 0.8) + turn
        guard = hub + (r + 0.03) * np.stack([np.cos(t), np.sin(t), 0 * t], -1)
        parts.append(ScenePart(s.strip(guard, rng.uniform(0.1, 0.16)), lacquer if rng.random() < 0.7 else metal))
    for z in (-0.16, 0.16)[: int(rng.integers(1, 3))]:
        bends = [(0.25, 0.15, z), (0.2, -0.08, z), (0, -0.08, z), (-0.25, 0.05, z)]
        pipe = np.add([pedal, pedal, (pedal + back) / 2, back], bends)
        parts.append(rod(pipe, [0.02, 0.022, 0.04, 0.045], metal, 10))
    low, high = np.add(pedal, [(-0.25, -0.1, -0.12), (0.3, 0.3, 0.12)])
    return parts + _bolted(rng, int(rng.integers(5, 12)), low, high, looks)


def cart(rng, meshes=()) -> Parts:
    """A trolley, wheelbarrow or pram: a tray or a tub on wheels, a handle, a load."""
    w, d, r, thick, tall = rng.uniform([0.6, 0.4, 0.06, 0.03, 0.3], [1.3, 0.7, 0.2, 0.3, 0.7])
    frame, level = m.metal(rng), r * 2 + rng.uniform(0, 0.3)
    parts = [block((w, thick, d), (0, level, 0), m.lacquer(rng), 0.02)]
    for x, z in ((x * w, z * d) for x in (-0.4, 0.4) for z in (-0.45, 0.45)):
        parts += wheel(rng, np.array([x, r, z]), r, 0.0, True)
        parts.append(rod([(x, r, z), (x, level, z)], 0.015, frame, 6))
    near, far, z, high = -w / 2, -w / 2 - 0.15, d / 2, level + tall
    parts.append(rod([(near, level, -z), (far, high, -z), (far, high, z), (near, level, z)], 0.016, frame))
    load = things.scattered(rng, int(rng.integers(0, 4)), (w / 2, d / 2), (0.15, 0.5), meshes)
    return parts + placed(load, (0, level + thick, 0))


def machine(rng, meshes=()) -> Parts:
    """A body with things bolted to it: boxes, drums, hoses, wheels."""
    size = rng.uniform([0.4, 0.4, 0.4], [1.4, 1.5, 0.9])
    looks = [m.lacquer(rng), m.metal(rng), m.rubber(rng), m.lacquer(rng)]
    parts = [block(size * [1, rng.uniform(0.4, 0.9), 1], (0, 0.05, 0), looks[0], rng.choice([0.0, 0.05]))]
    low, high = size * [-0.55, 0, -0.55], size * [0.55, 1.1, 0.55]
    parts += _bolted(rng, int(rng.integers(5, 18)), low, high, looks)
    for _ in range(int(rng.integers(0, 4))):
        parts += wheel(
            rng, rng.uniform(low, high), size.mean() * rng.uniform(0.1, 0.4), rng.choice([0, np.pi / 2]), True
        )
    return standing(parts)


def ladder(rng, meshes=()) -> Parts:
    """A ladder, its feet apart or leaning."""
    tall, w, look = rng.uniform(1.3, 2.2), rng.uniform(0.35, 0.5), m.one_of(rng, m.metal, m.wood)
    parts: Parts = []
    for sign in (1, -1) if rng.random() < 0.6 else (1,):
        top, foot = np.array([0, tall, 0]), np.array([0, 0, sign * rng.uniform(0.25, 0.6)])
        parts += [rod(np.add([foot, top], [(x, 0, 0), (x * 0.8, 0, 0)]), 0.02, look, 6) for x in (-w / 2, w / 2)]
        steps = np.arange(0.12, 0.98, 0.28 / tall)
        parts += [block((w, 0.025, 0.07), foot + t * (top - foot), look) for t in steps]
    return parts


def bench(rng, meshes=()) -> Parts:
    """A seat of slats with a back."""
    (w, h, back), look = rng.uniform([0.6, 0.4, 0.35], [1.6, 0.48, 0.55]), m.one_of(rng, m.wood, m.wood, m.lacquer)
    slats: list[tuple] = [((w, 0.02, 0.08), (0, h, z)) for z in np.arange(-0.2, 0.21, 0.1)]
    slats += [((w, 0.07, 0.02), (0, h + y, -0.22)) for y in np.arange(0.1, back, 0.12)]
    for x in (-w / 2 + 0.04, w / 2 - 0.04):
        slats += [((0.06, h, 0.06), (x, 0, 0.2)), ((0.06, h + back, 0.06), (x, 0, -0.22))]
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


def rack(rng, meshes=()) -> Parts:
    """Open shelving of posts and boards, loaded with cartons, boxes and things."""
    width, height, depth = rng.uniform([0.7, 1.2, 0.35], [2.2, 2.1, 0.6])
    frame = m.one_of(rng, m.metal, m.lacquer, m.wood)
    board = frame if rng.random() < 0.5 else m.wood(rng)
    posts = [(x * width / 2, 0, z * depth / 2) for x in (-1, 1) for z in (-1, 1)]
    parts = [block((0.04, height, 0.04), at, frame) for at in posts]
    levels = np.linspace(0.1, height - 0.05, int(rng.integers(3, 6)))
    for low, gap in zip(levels, [*np.diff(levels), 0.5]):
        parts.append(block((width, 0.03, depth), (0, low, 0), board))
        x = -width / 2 + 0.05
        while x < width / 2 - 0.15 and rng.random() < 0.93:
            size = rng.uniform([0.1, 0.3, 0.5], [0.5, 0.9, 0.95]) * [1, gap, depth]
            size[0] = min(size[0], width / 2 - x)
            load = [block(size, (0, 0, 0), m.one_of(rng, m.card, m.any_object), 0.008)]
            if rng.random() < 0.3:
                load = things.thing(rng, min(size[0], size[1]) * 0.8, meshes)
            parts += placed(load, (x + size[0] / 2, low + 0.032, 0), rng.normal() * 0.05)
            x += size[0] + rng.uniform(0.01, 0.12)
    return parts


KINDS = (
    (0.3, two_wheeler), (0.17, machine), (0.1, cart), (0.12, stack), (0.12, statue), (0.07, bench), (0.05, ladder),
    (0.07, street_things.person),
)  # fmt: skip
ALONG_WALLS = (
    (0.5, rack), (0.08, furniture.cupboard), (0.07, furniture.shelf), (0.09, bench), (0.17, stack), (0.09, ladder)
)  # fmt: skip
