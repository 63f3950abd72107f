"""A world as flat buffers in the camera frame, for the path tracer to gather from."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.color import luminance
from materialist.envmap import row_solid_angle, texel_directions
from materialist.geometry.boundary import joined_faces
from materialist.types import Array
from materialist_lab.procedural.materials import ColourPicture
from materialist_lab.procedural.objects.shapes import face_normals
from materialist_lab.procedural.world import World

FACE = 28
MATERIAL = 36
PORTAL = 16
"""Floats a row of each table: multiples of four, for wide gathers."""
PICTURE_START = 64
"""Pictures begin at multiples of that many pixels, so that a float32 can hold the place of each."""
MAX_PORTALS = 4
LIGHT_TABLE = 2048
"""Entries to draw a luminous face from."""
ENV_TABLE = 1 << 17
"""Entries to draw a direction of the envmap from."""
ENV_ROWS = 128
"""Rows of the envmap as it is drawn from; lookups use it as given."""


@dataclass(frozen=True)
class Packed:
    """Tables of one world; see `pack`."""

    vertices: Array
    """[V, 3] float32, camera frame, metres."""
    faces: Array
    """[F, 3] uint32."""
    face: Array
    """[F, FACE] float32: three corners of position, normal, uv; material; probability density as a light, 1 / m2."""
    material: Array
    """[M, MATERIAL] float32."""
    pictures: Array
    """[P] uint32 pixels of all pictures, red in the lowest byte."""
    lamps: Array
    """[LIGHT_TABLE] uint32 numbers of faces, each as often as it is to be drawn; all 0 without lamps."""
    env: Array
    """[h, 2h, 3] float32 radiance."""
    env_table: Array
    """[ENV_TABLE] uint32 texels of an ENV_ROWS x 2 ENV_ROWS map."""
    env_density: Array
    """[ENV_ROWS * 2 ENV_ROWS] float32 density per solid angle of a texel's directions."""
    portals: Array
    """[MAX_PORTALS, PORTAL] float32: corner, right, up, inward normal, 1 / (area * number of portals)."""
    shares: Array
    """[3] float32 probabilities of aiming at the envmap, at portals, at lamps."""
    to_scene: Array
    """[3, 3] float32."""
    reach: float
    """Largest coordinate, metres."""


def pack(world: World, rng: np.random.Generator) -> Packed:
    """Buffers of a world; `rng` shifts the tiles of materials."""
    # --- The mesh in the camera frame ---
    rotation = world.view.to_scene
    origin = world.view.position
    place = [(p.solid.vertices - origin) @ rotation for p in world.parts]
    normal = [p.solid.normals @ rotation for p in world.parts]
    vertices = np.concatenate(place).astype(np.float32)
    uv = np.concatenate([p.solid.uv for p in world.parts])
    corner = np.concatenate([vertices, np.concatenate(normal), uv], -1)
    faces = joined_faces([p.solid for p in world.parts])[1].astype(np.uint32)
    owner = np.repeat(np.arange(len(world.parts)), [len(p.solid.faces) for p in world.parts])
    # --- Materials ---
    pictures, starts = _pictures(world)
    rows = [
        p.material.row(tuple(rng.random(2)), starts.get(p.material.picture, 0)) for p in world.parts
    ]
    material = np.stack(rows).astype(np.float32)
    # --- Light ---
    lamps, density = _lamps(vertices, faces, owner, material)
    extra = np.zeros((len(faces), 4), np.float32)
    extra[:, 0] = owner
    extra[:, 1] = density
    face = np.concatenate([corner[faces].reshape(len(faces), 24), extra], -1).astype(np.float32)
    env_table, env_density, sunny = _directions(world)
    portals = _portals(world)
    shares = _shares(world, bool(density.any()), sunny)
    return Packed(
        vertices,
        faces,
        face,
        material,
        pictures,
        lamps,
        world.envmap,
        env_table,
        env_density,
        portals,
        shares,
        rotation.astype(np.float32),
        float(np.abs(vertices).max()),
    )


def _pictures(world: World) -> tuple[Array, dict[ColourPicture | None, int]]:
    """(pixels of all pictures of a world, picture -> its place in units of PICTURE_START)."""
    # Place 0 means no picture.
    pieces = [np.zeros(PICTURE_START, np.uint32)]
    starts: dict[ColourPicture | None, int] = {}
    end = 1
    for part in world.parts:
        picture = part.material.picture
        if picture is None or picture in starts:
            continue
        red, green, blue = (picture.pixels[..., k].astype(np.uint32).ravel() for k in range(3))
        pixels = red | green << 8 | blue << 16
        # Rounded up to whole units, so that the next picture begins at one.
        length = -(-len(pixels) // PICTURE_START)
        pieces.append(np.pad(pixels, (0, length * PICTURE_START - len(pixels))))
        starts[picture] = end
        end += length
    return np.concatenate(pieces), starts


def _lamps(vertices: Array, faces: Array, owner: Array, material: Array) -> tuple[Array, Array]:
    """(table of luminous faces, [F] density 1 / m2), each face drawn by its power."""
    density = np.zeros(len(faces), np.float32)
    # Radiance is emission times albedo; see `Material.row` for the columns.
    glow = luminance(material[:, 20:23] * material[:, 0:3])[owner]
    shining = np.flatnonzero(glow > 0)
    if not len(shining):
        return np.zeros(LIGHT_TABLE, np.uint32), density
    area = 0.5 * np.linalg.norm(face_normals(vertices, faces[shining]), axis=-1)
    shining = shining[area > 1e-12]
    area = area[area > 1e-12]
    chosen, count = resample(glow[shining] * area, LIGHT_TABLE)
    density[shining] = count / LIGHT_TABLE / area
    return shining[chosen].astype(np.uint32), density


def resample(weight: Array, entries: int) -> tuple[Array, Array]:
    """(`entries` indices drawn systematically by weight [N], [N] how often each occurs)."""
    # Systematic: entries at even steps of the cumulative weight.
    edges = np.cumsum(weight, dtype=np.float64)
    places = (np.arange(entries) + 0.5) / entries * edges[-1]
    chosen = np.minimum(np.searchsorted(edges, places), len(weight) - 1)
    return chosen, np.bincount(chosen, minlength=len(weight))


def _directions(world: World) -> tuple[Array, Array, bool]:
    """(table of texels, density per solid angle, whether a small part of the sky gives much of the light)."""
    size = (2 * ENV_ROWS, ENV_ROWS)
    glow = cv2.resize(luminance(world.envmap), size, interpolation=cv2.INTER_AREA).astype(
        np.float64
    )
    angle = np.repeat(row_solid_angle(ENV_ROWS), 2 * ENV_ROWS)
    # A little everywhere: what a lookup meets must have a density.
    weight = np.maximum(glow.ravel(), 1e-6) * angle
    if world.portals:
        weight *= _entering(world)
    # The share of the light that the brightest two hundredth of the texels give.
    top = np.sort(weight)[-len(weight) // 200 :].sum() / max(weight.sum(), 1e-30)
    if weight.sum() <= 0:
        weight = angle
    chosen, count = resample(weight, ENV_TABLE)
    return chosen.astype(np.uint32), (count / ENV_TABLE / angle).astype(np.float32), bool(top > 0.3)


def _entering(world: World) -> Array:
    """[texels] 1 where light from that direction can come in through some portal."""
    d = texel_directions(ENV_ROWS, 2 * ENV_ROWS).reshape(-1, 3)
    inward = [np.cross(p.right, p.up) for p in world.portals]
    return np.any([d @ (n / np.linalg.norm(n)) < 0.05 for n in inward], axis=0).astype(float)


def _portals(world: World) -> Array:
    """[MAX_PORTALS, PORTAL] float32, as `Packed.portals`; unused rows are 0."""
    table = np.zeros((MAX_PORTALS, PORTAL), np.float32)
    used = world.portals[:MAX_PORTALS]
    rotation = world.view.to_scene
    origin = world.view.position
    for k, portal in enumerate(used):
        normal = np.cross(portal.right, portal.up)
        area = np.linalg.norm(normal)
        corner = (portal.corner - origin) @ rotation
        inward = normal / area @ rotation
        row = np.concatenate([corner, portal.right @ rotation, portal.up @ rotation, inward])
        # The density per area of a uniform point on any of them; three zeros fill the row.
        table[k] = [*row, 1 / (area * len(used)), 0, 0, 0]
    return table


def _shares(world: World, lamps: bool, sunny: bool) -> Array:
    """[3] float32 probabilities of aiming at the envmap, at portals and at lamps."""
    sky = float(world.envmap.max()) > 0
    # Behind portals the envmap is aimed at only where a small part of it, as a sun, is bright.
    env = 0.0 if not sky else 1.0 if not world.portals else 0.35 if sunny else 0.05
    portal = 0.65 if world.portals and sky else 0.0
    shares = np.array([env, portal, 0.5 if lamps else 0.0])
    return (shares / max(shares.sum(), 1e-9)).astype(np.float32)
