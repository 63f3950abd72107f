"""Rough sculptural shapes, weathered and with fine meshes, and carved plates."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import trimesh
from scipy.ndimage import gaussian_filter

from materialist.types import Array
from materialist_lab.procedural import materials as m
from materialist_lab.procedural import relief
from materialist_lab.procedural.catalog.reading import from_the_sides
from materialist_lab.procedural.objects import glassware
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.objects.shapes import Solid
from materialist_lab.procedural.staged.finishes import covered, relief_of
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import Parts, ScenePart, one_thing

Maker = Callable[[np.random.Generator, Stock], Solid]
FACES = 6000
"""Fewest triangles of a weathered shape."""


def sculpture(rng: np.random.Generator, stock: Stock) -> Parts:
    """A sculpture about 0.3 m high, standing on y = 0."""
    makers: tuple[tuple[float, Maker], ...] = (
        (0.74, _weathered),
        (0.16, _plate),
        (0.1 if stock.meshes else 0.0, _captured),
    )
    solid = m.pick(rng, makers)(rng, stock)
    families = ["stone", "stone", "ceramic", "ceramic", "wood", "metal", "paint", "leather"]
    family = str(rng.choice(families))
    # No texture coordinates of their own: the texture is projected along the axes.
    solid = from_the_sides(_standing(rng, solid))
    return one_thing([ScenePart(solid, _material(rng, family, stock))])


def _material(rng: np.random.Generator, family: str, stock: Stock) -> m.Material:
    """A picture of a surface or of anything, grey stone, or a finish of the family."""
    draw = rng.random()
    # --- Pictures, where there are any ---
    if draw < 0.3:
        picture = stock.texture(rng, family) or stock.repeating(rng)
        if picture is not None:
            return covered(rng, picture, rng.uniform(0.1, 0.5), family)
    if draw < 0.4:
        picture = stock.repeating(rng)
        if picture is not None:
            return covered(rng, picture, rng.uniform(0.15, 0.6), family)
    # --- Warm grey, or a finish ---
    if draw < 0.55:
        grey = rng.uniform(0.2, 0.8)
        colour = (grey, grey * rng.uniform(0.9, 1), grey * rng.uniform(0.75, 1))
        material = m.uniform(colour, rng.uniform(0.4, 0.95))
    else:
        makers: dict[str, m.Maker] = {
            "stone": m.stone,
            "ceramic": m.ceramic,
            "wood": m.wood,
            "metal": m.metal,
        }
        material = makers.get(family, m.lacquer)(rng)
    # Finishes are made for furniture; a sculpture is smaller.
    shrink = rng.uniform(0.2, 0.6)
    repeat = (material.repeat[0] * shrink, material.repeat[1] * shrink)
    noise = relief_of(rng, family, 0.7)
    return replace(material, repeat=repeat, relief=noise, emboss=rng.uniform(0, 0.001))


def _displaced(rng: np.random.Generator, solid: Solid, amount: float) -> Solid:
    """The solid moved along its normals by noise of two sizes, `amount` its deviation over the solid's size."""
    size = float(np.ptp(solid.vertices, axis=0).max())
    kinds = rng.choice(["rough", "ridges", "hammered", "carved", "folds", "grain", "hair"], 2)
    blocks = size * np.exp(rng.uniform(np.log(0.5), np.log(2.5), 2))
    shift = rng.uniform(0, 1, (2, 3))
    total = sum(
        relief.height(str(kind), solid.vertices / block + offset) * block * weight
        for kind, block, offset, weight in zip(kinds, blocks, shift, (1.0, rng.uniform(0, 0.6)))
    )
    moved = solid.vertices + solid.normals * (total * amount)[:, None]
    return replace(solid, vertices=moved, normals=s.smooth_normals(moved, solid.faces))


def _depth(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform between the two."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _weathered(rng: np.random.Generator, stock: Stock) -> Solid:
    """An animal, a vase, a stone, a turned or twisted thing: a shape of RefractionNet's, rounded and weathered."""
    rough = glassware.any_shape(rng)
    mesh = trimesh.Trimesh(rough.vertices, rough.faces)
    # Vertices enough to show weathering.
    while len(mesh.faces) < FACES:
        mesh = _subdivided(mesh)
    solid = _of(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32))
    return _displaced(rng, solid, _depth(rng, 0.003, 0.025))


def _subdivided(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Four faces for each: rounded by Loop's rule, flat where parts touch (Loop's needs at most two faces an edge)."""
    faces_per_edge = np.bincount(mesh.edges_unique_inverse)
    if faces_per_edge.max() > 2:
        return mesh.subdivide()
    return mesh.subdivide_loop(1)


def _of(vertices: Array, faces: Array) -> Solid:
    """The solid with smooth normals, without texture coordinates."""
    return Solid(vertices, faces, s.smooth_normals(vertices, faces), np.zeros((len(vertices), 2)))


def _plate(rng: np.random.Generator, stock: Stock) -> Solid:
    """A carved plate, coin or tile: relief of noise, ornament or of a picture's brightness."""
    n = 190
    sheet = s.sheet((-0.5, 0, 0), (1, 0, 0), (0, rng.uniform(0.6, 1.4), 0), n)
    rows = n + 1
    crop = stock.crop(rng, 1.0, rows, 0.4) if rng.random() < 0.4 else None
    if crop is not None:
        grey = np.clip(crop.mean(-1), 0, 255) / 255.0
        grey = grey[:rows, :rows] if min(grey.shape) >= rows else np.resize(grey, (rows, rows))
        height = gaussian_filter(grey, 1.5) * rng.uniform(0.05, 0.2)
    else:
        block = rng.uniform(0.4, 1.5)
        # A random plane through a block of solid noise.
        plane = np.full((rows * rows, 1), rng.random())
        places = np.concatenate([sheet.vertices[:, :2] / block, plane], -1)
        kind = str(rng.choice(["carved", "carved", "ridges", "hammered", "folds", "rough"]))
        noise = relief.height(kind, places + rng.random(3)).reshape(rows, rows)
        height = noise * block * _depth(rng, 0.01, 0.05)
    # --- The outline, square or a coin, and a rim ---
    t = np.linspace(-1, 1, rows)
    edge = np.maximum(np.abs(t)[:, None], np.abs(t)[None])
    if rng.random() < 0.4:
        edge = np.hypot(t[:, None], t[None])
        height = np.where(edge < 1, height, -0.1)
    rim = np.clip((edge - rng.uniform(0.8, 0.95)) * 20, 0, 1) * (edge < 1)
    height = height + rim * rng.uniform(-0.04, 0.05)
    # --- The front, on a slab ---
    raised = np.stack([0 * height, 0 * height, height], -1).reshape(-1, 3)
    solid = _of(sheet.vertices + raised, sheet.faces)
    back = s.slab((1.0, float(np.ptp(sheet.vertices[:, 1])), 0.12))
    return s.joined([solid, s.moved(back, (0, 0, -0.18))])


def _captured(rng: np.random.Generator, stock: Stock) -> Solid:
    """A mesh from a file, weathered."""
    solid = s.load(stock.meshes[rng.integers(len(stock.meshes))])
    smooth = _of(solid.vertices, solid.faces)
    # A coarse mesh has no vertices to show weathering with.
    if len(smooth.faces) < 4000:
        return smooth
    return _displaced(rng, smooth, _depth(rng, 0.0003, 0.003))


def _standing(rng: np.random.Generator, solid: Solid) -> Solid:
    """The solid 0.2 to 0.45 m large, turned anyhow, on y = 0."""
    size = float(np.ptp(solid.vertices, axis=0).max())
    tip = rng.normal(0, 0.2) if rng.random() < 0.7 else rng.uniform(0, 2 * np.pi)
    turned = s.moved(
        solid, turn=rng.uniform(-0.6, 0.6), tip=tip, scale=rng.uniform(0.2, 0.45) / size
    )
    low = turned.vertices.min(0)
    high = turned.vertices.max(0)
    return s.grounded(replace(turned, vertices=turned.vertices - (low + high) / 2))
