"""Bicycles and motorcycles, and wheels. Base on y = 0, metres."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import shapes
from materialist.procedural.objects import solids as s
from materialist.procedural.objects.parts import Parts, block, orb, placed, rod
from materialist.procedural.world import ScenePart


def two_wheeler(rng, meshes=()) -> Parts:
    """A bicycle or motorcycle, to the left or right, its front wheel turned."""
    motor = rng.random() < 0.65
    r, length = rng.uniform(0.27, 0.36), rng.uniform(1.2, 1.6) if motor else rng.uniform(1.0, 1.15)
    lacquer, metal, dark = m.lacquer(rng), m.metal(rng), m.rubber(rng)
    back, front = np.array([-length / 2, r, 0]), np.array([length / 2, r, 0])
    head = np.array([length / 2 - rng.uniform(0.2, 0.35), rng.uniform(0.75, 0.95), 0])
    seat = np.array([-length * rng.uniform(0.15, 0.3), rng.uniform(0.65, 0.8) if motor else rng.uniform(0.8, 0.95), 0])
    pedal = np.array([rng.uniform(-0.1, 0.1), r * rng.uniform(0.8, 1.0), 0])
    thick = rng.uniform(0.02, 0.035) if motor else rng.uniform(0.012, 0.022)
    frame = metal if rng.random() < 0.3 else lacquer
    bars = ((seat, pedal), (pedal, head), (seat, head), (pedal, back), (seat, back))
    parts = [rod(bar, thick, frame) for bar in bars]
    top, steer = np.add(head, (-0.05, rng.uniform(0.1, 0.25), 0)), rng.normal() * 0.35
    for z in (-0.07, 0.07):
        parts.append(rod(np.add([front, head, top], (0, 0, z)), 0.7 * thick + 0.006, metal))
    parts += wheel(rng, back, r, 0.0, motor) + wheel(rng, front, r, steer, motor)
    grip, sweep = rng.uniform(0.28, 0.4), rng.uniform(-0.2, 0.1)
    bar = [(sweep, 0.05, -grip), (0.03, 0.02, -0.5 * grip), (0, 0, 0), (0.03, 0.02, 0.5 * grip), (sweep, 0.05, grip)]
    parts.append(ScenePart(s.moved(s.tube(bar, 0.014, 7), top, turn=steer), metal))
    parts += [rod(np.add(top, [(sweep, 0.05, z * 0.75), (sweep, 0.05, z)]), 0.021, dark) for z in (-grip, grip)]
    saddle = np.array([rng.uniform(0.4, 0.75), rng.uniform(0.08, 0.14), 0.26] if motor else [0.28, 0.07, 0.16])
    solid = shapes.superquadric(saddle, 0.6, 0.7, 24)
    parts.append(ScenePart(s.moved(solid, np.add(seat, (-0.05, saddle[1] / 2, 0))), dark))
    if motor:
        parts += _tank_and_guards(rng, seat, head, back, r, lacquer, metal)
        parts += _engine(rng, pedal, back, metal, dark)
    return placed(parts, (0, 0, 0), float(rng.choice([0, np.pi])))


def _tank_and_guards(rng, seat, head, back, r, lacquer, metal) -> Parts:
    """Tank, mudguards and lamps of a motorcycle."""
    tank = np.array([np.linalg.norm(head - seat), 1, 1]) * rng.uniform([0.6, 0.18, 0.2], [0.9, 0.28, 0.32])
    solid = shapes.superquadric(tank, rng.uniform(0.5, 1), rng.uniform(0.5, 1), 28)
    tip = np.arctan2(head[1] - seat[1], head[0] - seat[0])
    c, k = np.cos(tip), np.sin(tip)
    tilted = s.warped(solid, lambda p: p @ np.array([[c, k, 0], [-k, c, 0], [0, 0, 1]]))
    parts = [ScenePart(s.moved(tilted, (seat + head) / 2 + [0, 0.06, 0]), lacquer)]
    for hub, turn in ((back, 0.6), (back * [-1, 1, 1], 0.3)):
        t = np.linspace(0, np.pi, 14) * rng.uniform(0.5, 0.8) + turn
        guard = hub + (r + 0.03) * np.stack([np.cos(t), np.sin(t), 0 * t], -1)
        parts.append(ScenePart(s.strip(guard, rng.uniform(0.1, 0.16)), lacquer if rng.random() < 0.7 else metal))
    parts.append(orb(np.add(head, (0.12, 0.08, 0)), rng.uniform(0.07, 0.11), metal, 20))
    return [*parts, block((0.06, 0.08, 0.14), np.add(back, (-0.3, 0.25, 0)), m.lacquer(rng), 0.02)]


def _engine(rng, pedal, back, metal, dark) -> Parts:
    """Blocks, drums and exhaust pipes of a motorcycle."""
    parts = []
    for _ in range(int(rng.integers(4, 10))):
        size, at = rng.uniform(0.06, 0.28, 3), pedal + rng.uniform([-0.25, -0.1, -0.12], [0.3, 0.3, 0.12])
        drum = s.moved(s.drum(size[0] / 2, size[1]), tip=np.pi / 2 * rng.integers(2))
        body = s.slab(size, 0.02) if rng.random() < 0.5 else drum
        parts.append(ScenePart(s.moved(body, at), metal if rng.random() < 0.6 else dark))
    for z in (-0.16, 0.16)[: int(rng.integers(1, 3))]:
        ends = np.add(pedal, (0.25, 0.15, z)), np.add(pedal, (0.2, -0.08, z)), (pedal + back) / 2 + [0, -0.08, z]
        parts.append(rod([*ends, np.add(back, (-0.25, 0.05, z))], [0.02, 0.022, 0.04, 0.045], metal, 10))
    return parts


def wheel(rng, hub, r: float, turn: float, fat: bool) -> Parts:
    """Tyre, rim, spokes and hub of a wheel that stands upright and rolls along X."""
    scale = min(1.0, r / 0.27)  # small wheels are thinner
    tyre = scale * (rng.uniform(0.045, 0.07) if fat else rng.uniform(0.014, 0.028))
    hub_radius = scale * (rng.uniform(0.04, 0.13) if fat else 0.03)
    broad = fat and rng.random() < 0.7
    count, thick = (int(rng.integers(4, 9)), 0.016) if broad else (int(rng.integers(12, 24)), 0.003)
    rim = m.metal(rng)
    round_parts = ((s.torus(r - tyre, tyre, 10), m.rubber(rng)), (s.torus(r - 2 * tyre, 0.012 * scale, 6), rim),
                   (s.drum(hub_radius, 0.12 * scale), rim))  # fmt: skip
    parts = [ScenePart(s.moved(solid, tip=np.pi / 2), look) for solid, look in round_parts]
    for a in np.arange(count) * 2 * np.pi / count:
        end = (r - 2 * tyre) * np.array([np.cos(a), np.sin(a), 0])
        parts.append(rod([0.1 * end, end], thick * scale, rim, 5))
    return placed(parts, hub, turn)
