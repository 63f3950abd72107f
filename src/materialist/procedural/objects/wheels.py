"""Bicycles and motorcycles, and what they are made of: wheels, drums, bands, lacquer, rubber. Base on y = 0, metres."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import shapes, things
from materialist.procedural.objects import solids as s
from materialist.procedural.objects.things import Parts
from materialist.procedural.world import Part
from materialist.types import Array

_HALF_TURN = np.linspace(0, np.pi, 14)


def by(x: float, y: float, z: float) -> Array:
    """[3] a vector."""
    return np.array([x, y, z])


def two_wheeler(rng, meshes=()) -> Parts:
    """A bicycle or motorcycle, to the left or right, its front wheel turned."""
    motor = rng.random() < 0.65
    r, length = rng.uniform(0.27, 0.36), rng.uniform(1.2, 1.6) if motor else rng.uniform(1.0, 1.15)
    lacquer, metal, dark = paint(rng), m.metal(rng), rubber(rng)
    back, front = np.array([-length / 2, r, 0]), np.array([length / 2, r, 0])
    head = np.array([length / 2 - rng.uniform(0.2, 0.35), rng.uniform(0.75, 0.95), 0])
    seat = np.array([-length * rng.uniform(0.15, 0.3), rng.uniform(0.65, 0.8) if motor else rng.uniform(0.8, 0.95), 0])
    pedal = np.array([rng.uniform(-0.1, 0.1), r * rng.uniform(0.8, 1.0), 0])
    thick = rng.uniform(0.02, 0.035) if motor else rng.uniform(0.012, 0.022)
    frame = metal if rng.random() < 0.3 else lacquer
    bars = [(seat, pedal), (pedal, head), (seat, head), (pedal, back), (seat, back)]
    parts = [Part(s.tube([a, b], thick, 8), frame) for a, b in bars]
    top = head + by(-0.05, rng.uniform(0.1, 0.25), 0)
    steer = rng.normal() * 0.35
    for z in (-0.07, 0.07):
        parts.append(
            Part(s.tube([front + by(0, 0, z), head + by(0, 0, z), top + by(0, 0, z)], 0.7 * thick + 0.006, 8), metal)
        )
    parts += wheel(rng, back, r, 0.0, motor) + wheel(rng, front, r, steer, motor)
    grip, sweep = rng.uniform(0.28, 0.4), rng.uniform(-0.2, 0.1)
    bar = np.array(
        [(sweep, 0.05, -grip), (0.03, 0.02, -0.5 * grip), (0, 0, 0), (0.03, 0.02, 0.5 * grip), (sweep, 0.05, grip)]
    )
    parts.append(Part(s.moved(s.tube(bar, 0.014, 7), top, turn=steer), metal))
    for z in (-grip, grip):
        parts.append(Part(s.tube([top + by(sweep, 0.05, z * 0.75), top + by(sweep, 0.05, z)], 0.021, 8), dark))
    saddle = np.array([rng.uniform(0.4, 0.75), rng.uniform(0.08, 0.14), 0.26] if motor else [0.28, 0.07, 0.16])
    parts.append(Part(s.moved(shapes.superquadric(saddle, 0.6, 0.7, 24), seat + by(-0.05, saddle[1] / 2, 0)), dark))
    if motor:
        parts += _engine(rng, seat, head, pedal, back, r, lacquer, metal, dark)
    return things.placed(parts, (0, 0, 0), float(rng.choice([0, np.pi])))


def _engine(rng, seat, head, pedal, back, r, lacquer, metal, dark) -> Parts:
    """What a motorcycle has more: tank, engine, exhaust, mudguards, lamps."""
    middle = (seat + head) / 2
    tank = np.array(
        [np.linalg.norm(head - seat) * rng.uniform(0.6, 0.9), rng.uniform(0.18, 0.28), rng.uniform(0.2, 0.32)]
    )
    tip = np.arctan2(head[1] - seat[1], head[0] - seat[0])
    solid = shapes.superquadric(tank, rng.uniform(0.5, 1), rng.uniform(0.5, 1), 28)
    c, k = np.cos(tip), np.sin(tip)
    tilted = s.warped(solid, lambda p: p @ np.array([[c, k, 0], [-k, c, 0], [0, 0, 1]]))
    parts = [Part(s.moved(tilted, middle + by(0, 0.06, 0)), lacquer)]
    for _ in range(int(rng.integers(4, 10))):
        size = rng.uniform(0.06, 0.28, 3)
        at = pedal + rng.uniform([-0.25, -0.1, -0.12], [0.3, 0.3, 0.12])
        body = (
            s.slab(size, 0.02)
            if rng.random() < 0.5
            else s.moved(disc(size[0] / 2, size[1]), tip=np.pi / 2 * rng.integers(2))
        )
        parts.append(Part(s.moved(body, at), metal if rng.random() < 0.6 else dark))
    for z in (-0.16, 0.16)[: int(rng.integers(1, 3))]:
        pipe = np.array(
            [
                pedal + by(0.25, 0.15, z),
                pedal + by(0.2, -0.08, z),
                (pedal + back) / 2 + by(0, -0.08, z),
                back + by(-0.25, 0.05, z),
            ]
        )
        parts.append(Part(s.tube(pipe, np.array([0.02, 0.022, 0.04, 0.045]), 10), metal))
    for hub, turn in ((back, 0.6), (np.array([-back[0], r, 0]), 0.3)):
        t = _HALF_TURN * rng.uniform(0.5, 0.8) + turn
        guard = hub + (r + 0.03) * np.stack([np.cos(t), np.sin(t), 0 * t], -1)
        parts.append(Part(strip(guard, rng.uniform(0.1, 0.16)), lacquer if rng.random() < 0.7 else metal))
    lamp = s.moved(s.ball(20), head + by(0.12, 0.08, 0), scale=rng.uniform(0.07, 0.11))
    return [
        *parts,
        Part(lamp, metal),
        Part(s.moved(s.slab(np.array([0.06, 0.08, 0.14]), 0.02), back + by(-0.3, 0.25, 0)), paint(rng)),
    ]


def wheel(rng, hub, r: float, turn: float, fat: bool) -> Parts:
    """Tyre, rim, spokes and hub of a wheel that stands upright and rolls along X."""
    scale = min(1.0, r / 0.27)  # small wheels are thinner
    tyre = scale * (rng.uniform(0.045, 0.07) if fat else rng.uniform(0.014, 0.028))
    rim, made = m.metal(rng), [Part(_ring(r - tyre, tyre, 10), rubber(rng))]
    made.append(Part(_ring(r - 2 * tyre, 0.012 * scale, 6), rim))
    count, broad = (
        (int(rng.integers(4, 9)), 0.016) if fat and rng.random() < 0.7 else (int(rng.integers(12, 24)), 0.003)
    )
    for a in np.arange(count) * 2 * np.pi / count:
        end = (r - 2 * tyre) * np.array([np.cos(a), np.sin(a), 0])
        made.append(Part(s.tube([0.1 * end, end], broad * scale, 5), rim))
    hub_radius = scale * (rng.uniform(0.04, 0.13) if fat else 0.03)
    made.append(Part(s.moved(disc(hub_radius, 0.12 * scale), tip=np.pi / 2), rim))
    return things.placed(made, hub, turn)


def _ring(radius: float, thick: float, n: int) -> s.Solid:
    """A torus about the Z axis."""
    phi = np.linspace(0, 2 * np.pi, n + 1)
    ring = shapes.lathe(np.stack([radius + thick * np.cos(phi), thick * np.sin(phi)], -1), 40)
    return s.moved(s.metric(ring, np.pi * radius, 2 * np.pi * thick), tip=np.pi / 2)


def paint(rng) -> m.Material:
    """Lacquer of any colour, dull or shiny."""
    colour, r = m.any_colour(rng), rng.uniform(0.08, 0.5)
    return m.Material(0, (colour,) * 3, 0.0, (r, r), (float(rng.choice([0.0, 0.0, 0.4])),) * 2)


def rubber(rng) -> m.Material:
    r = rng.uniform(0.5, 0.9)
    return m.Material(0, (m.hsv(rng.random(), 0.05, rng.uniform(0.05, 0.3)),) * 3, 0.1, (r, r))


def disc(r: float, thick: float) -> s.Solid:
    """A drum about the Y axis."""
    h = thick / 2
    return shapes.lathe(np.array([(1e-3, -h), (r, -h), (r, h), (1e-3, h)]), 24)


def strip(line, width: float) -> s.Solid:
    """A band of that width along Z over a line [P, 3] in the plane of X and Y."""
    across = np.array([[[0, 0, -width / 2]], [[0, 0, width / 2]]])
    vertices = (np.asarray(line)[None] + across).transpose(1, 0, 2).reshape(-1, 3)
    faces = s._grid_faces(len(line), 2)
    along = np.arange(len(line)) * 0.05
    uv = np.stack(np.broadcast_arrays([0, width], along[:, None]), -1).reshape(-1, 2)
    return s.Solid(vertices, faces, s.smooth_normals(vertices, faces), uv)
