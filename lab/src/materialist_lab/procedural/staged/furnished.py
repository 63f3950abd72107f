"""Rooms furnished with real models at true size: by the walls, around tables, on shelves and on walls."""

from dataclasses import replace

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import materials as m
from materialist_lab.procedural import rooms, walls, world
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.relief import Relief
from materialist_lab.procedural.staged.finishes import covered, pictured
from materialist_lab.procedural.staged.pieces import backdrop_of, furnished_piece, piece
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import (
    Parts,
    ScenePart,
    World,
    block,
    bounds,
    moved,
    one_thing,
    placed,
)

BY_WALLS = (
    "sofa",
    "storage",
    "storage",
    "shelf",
    "shelf",
    "table",
    "bed",
    "thing",
    "chair",
    "lamp",
)
"""Roles of what stands by walls, one named twice as often."""
IN_THE_MIDDLE = ("thing", "chair", "table", "person", "sofa")
MIRRORS = 0.05
"""Share of mirrors among what hangs on walls."""


def furnished_room(rng: np.random.Generator, stock: Stock) -> World:
    """A furnished room seen by somebody who stands or sits in it."""
    size = rng.uniform([2.8, 3.2, 2.35], [6.5, 7.5, 3.2])
    standing = rooms.Furniture(size)
    # The group at a table stands first: it needs the most room.
    group = _group(rng, stock) if rng.random() < 0.75 else []
    if group:
        x, z = rng.uniform(-0.25, [0.25, 0.15]) * size[:2]
        standing.add(placed(group, (x, 0, z), rng.choice([0, np.pi / 2]) + rng.normal(0, 0.1)))
    standing.along_walls(rng, some_pieces(rng, stock, int(rng.integers(7, 17)), BY_WALLS))
    standing.in_the_middle(rng, some_pieces(rng, stock, int(rng.integers(0, 5)), IN_THE_MIDDLE))
    return furnished_world(
        rng, size, stock, standing.parts, rooms.view_of(rng, size, standing), "furnished"
    )


def some_pieces(
    rng: np.random.Generator,
    stock: Stock,
    count: int,
    roles: tuple[str, ...] = ("sofa", "storage", "shelf", "thing"),
) -> list[Parts]:
    """That many models of the roles, with things on them."""
    # One clutter for all: a room is tidy or is not.
    clutter = rng.uniform(0, 8)
    models = [stock.model(rng, str(rng.choice(roles)), high=3.2) for _ in range(count)]
    return [furnished_piece(rng, model, stock, clutter) for model in models if model is not None]


def furnished_world(
    rng: np.random.Generator,
    size: Array,
    stock: Stock,
    furniture: Parts,
    view: world.Viewpoint,
    kind: str,
) -> World:
    """The room around its furniture: walls, floor, windows, what hangs there, rugs and lamps."""
    parts, portals, envmap = rooms.shell(rng, size, stock.captures, _on_wall(stock))
    parts = _recovered(rng, parts, stock) + furniture
    parts = parts + _rug(rng, stock, size) + _from_ceiling(rng, stock, size)
    parts += rooms.lamps(rng, size, portals, envmap)
    # The view through the windows: a photograph, or the envmap.
    backdrop = None
    if portals and rng.random() < 0.5:
        backdrop = backdrop_of(rng, stock, float(envmap.mean()), 0.5)
    return World(parts, envmap, view, portals, kind, backdrop)


def _group(rng: np.random.Generator, stock: Stock) -> Parts:
    """A table with chairs at its sides, or a low one before a sofa."""
    table = stock.model(rng, "table", high=2.2)
    if table is None:
        return []
    parts = furnished_piece(rng, table, stock, rng.uniform(3, 12))
    width, height, depth = table.entry.size
    chair = stock.model(rng, "chair" if height > 0.6 else "sofa", high=2.4)
    if chair is None:
        return parts
    seat = piece(rng, chair, stock)
    wide = chair.entry.size[0]
    deep = chair.entry.size[2]
    # A sofa behind a low table, with room for knees.
    if height <= 0.6:
        return parts + placed(seat, (0, 0, -depth / 2 - deep / 2 - 0.35))
    # Up to three chairs at each long side, pushed in more or less, some missing.
    for side in (-1, 1):
        count = int(min(max(width // (wide + 0.1), 0), 3))
        for x in (np.arange(count) + 0.5) * width / max(count, 1) - width / 2:
            if rng.random() < 0.85:
                out = depth / 2 + deep * rng.uniform(0.05, 0.6)
                turn = (0.0 if side < 0 else np.pi) + rng.normal(0, 0.15)
                parts = parts + placed(_copy(seat), (x, 0, side * out), turn)
    return parts


def _copy(parts: Parts) -> Parts:
    """The same parts as another thing."""
    return one_thing([ScenePart(part.solid, part.material) for part in parts])


def _recovered(rng: np.random.Generator, parts: Parts, stock: Stock) -> Parts:
    """Walls, floor and ceiling with pictures of real surfaces on some, and relief on others."""
    floor = (
        stock.texture(rng, str(rng.choice(["wood", "wood", "stone"])))
        if rng.random() < 0.55
        else None
    )
    wall = stock.texture(rng, "stone") if rng.random() < 0.1 else None
    paper = stock.repeating(rng) if wall is None and rng.random() < 0.1 else None
    plaster = (
        Relief("rough", (rng.uniform(0.1, 0.8),) * 3, rng.uniform(0.02, 0.12))
        if rng.random() < 0.4
        else None
    )
    on_floor = covered(rng, floor, rng.uniform(0.8, 2.0), "wood") if floor else None
    hanging = wall or paper
    on_wall = covered(rng, hanging, rng.uniform(0.5, 1.6), "paint") if hanging else None
    if on_wall:
        # One offset for all pieces of the walls: the pattern runs on across them.
        on_wall = replace(on_wall, offset=tuple(rng.random(2).tolist()))
    # Sheets of four vertices that belong to nothing are the room itself: level ones at
    # the bottom the floor, upright ones its walls.
    recovered = []
    for part in parts:
        flat = part.thing is None and len(part.solid.vertices) == 4
        level = flat and abs(float(part.solid.normals[0, 1])) > 0.9
        low = float(part.solid.vertices[:, 1].max()) < 0.01
        material = part.material
        if level and low:
            material = on_floor or replace(material, emboss=rng.uniform(0, 0.004))
        elif flat and not level:
            material = on_wall or replace(material, relief=plaster, emboss=rng.uniform(0, 0.004))
        recovered.append(ScenePart(part.solid, material, part.thing))
    return recovered


def _rug(rng: np.random.Generator, stock: Stock, size: Array) -> Parts:
    """A rug from the catalogue, or a plain or printed one."""
    # Half of the rooms have none.
    if rng.random() < 0.5:
        return []
    model = stock.model(rng, "rug", high=3.0) if rng.random() < 0.4 else None
    at = (rng.normal() * 0.4, 0.002, rng.normal() * 0.5)
    turn = rng.normal(0, 0.3)
    if model is not None:
        return placed(piece(rng, model, stock), at, turn)
    wide, deep = size[:2] * rng.uniform(0.3, 0.6, 2)
    rug = m.woven(rng)
    picture = stock.printed(rng, wide / deep) if rng.random() < 0.3 else None
    if picture is not None:
        rug = replace(pictured(picture, np.ones(3), 0.9), repeat=(wide, deep), offset=(0.5, 0.5))
    fibre = Relief("grain", (0.12,) * 3, rng.uniform(0.1, 0.5))
    flat = block((wide, 0.012, deep), (0, 0, 0), replace(rug, relief=fibre), 0.004)
    return placed([flat], at, turn)


def _on_wall(stock: Stock) -> rooms.Hangings:
    """What hangs on walls: framed photographs, mirrors and models."""

    def hung(rng: np.random.Generator, wall: walls.RoomWall, count: int) -> Parts:
        parts: Parts = []
        for _ in range(count):
            if rng.random() < 0.3:
                parts += _hung_model(rng, stock, wall)
                continue
            width = rng.uniform(0.25, 1.3)
            at = wall.free(rng, width + 0.1)
            parts += [] if at is None else _photograph(rng, stock, at, width)
        return parts

    return hung


def _hung_model(rng: np.random.Generator, stock: Stock, wall: walls.RoomWall) -> Parts:
    """A model that hangs on walls, at the height that the catalogue gives; nothing where it does not fit."""
    model = stock.model(rng, "wall", high=1.5)
    if model is None or model.entry.elevation + model.entry.size[1] > wall.height:
        return []
    at = wall.free(rng, model.entry.size[0] + 0.05)
    if at is None:
        return []
    hung = piece(rng, model, stock, lit=rng.random() < 0.5)
    return moved(hung, (at, model.entry.elevation, 0.002 - bounds(hung)[0][2]))


def _from_ceiling(rng: np.random.Generator, stock: Stock, size: Array) -> Parts:
    """A lamp or fan that hangs from the ceiling."""
    model = stock.model(rng, "ceiling", high=1.5) if rng.random() < 0.35 else None
    if model is None:
        return []
    x, z = rng.uniform(-0.25, 0.2, 2) * size[:2]
    # Its upper end at the ceiling.
    lamp = piece(rng, model, stock, lit=rng.random() < 0.7)
    return placed(lamp, (x, size[2] - model.entry.size[1], z))


def _photograph(rng: np.random.Generator, stock: Stock, at: float, width: float) -> Parts:
    """A framed photograph, poster or mirror of that width, its middle `at` metres along the wall."""
    height = width * float(rng.choice([0.66, 0.75, 1.0, 1.33, 1.5]))
    picture = None if rng.random() < MIRRORS else stock.printed(rng, width / height)
    bottom = max(rng.uniform(1.3, 1.7) - height / 2, 0.7)
    left = at - width / 2
    inner = m.uniform((0.9, 0.9, 0.9), 0.05, 1.0)
    if picture is not None:
        # Behind glass, or matt paper.
        gain = np.ones(3) * rng.uniform(0.8, 1.1)
        rough = float(rng.choice([0.08, rng.uniform(0.3, 0.9)]))
        inner = replace(pictured(picture, gain, rough), repeat=(width, -height), offset=(0.0, 0.0))
    sheet = s.sheet((left, bottom, 0.014), (width, 0, 0), (0, height, 0))
    parts = [ScenePart(sheet, inner)]
    if rng.random() < 0.75:
        look = m.wood(rng) if rng.random() < 0.5 else m.one_of(rng, m.metal, m.lacquer)
        opening = walls.Opening(left, left + width, bottom, bottom + height)
        parts += walls.frame(opening, rng.uniform(0.012, 0.06), 0.03, look)
    return one_thing(parts)
