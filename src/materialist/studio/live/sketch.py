"""Sketches of what the live preview does not shade: bodies with their texture and a contact shadow, and lamps."""

import cv2
import numpy as np

from materialist.camera import project, unit, unproject
from materialist.edits.core.surfaces import texels
from materialist.envmap import environment, row_solid_angle, sh_basis, texel_directions
from materialist.studio import SETTINGS
from materialist.types import Array, Body, Lamp, Scene

_TEXTURED_FACES = 1500
"""A body with a texture is drawn with at least so many triangles: each has one colour."""
_SHADOW = 0.85
"""Share of the light from all around that a body's contact shadow takes at most."""
_WIDER = 1.2
"""An ellipsoid of the box of a body, larger by this, hides about as much as what fills the corners of that box."""
_COSINE = np.pi * np.array([1.0, *[2 / 3] * 3, *[1 / 4] * 5])
"""Irradiance of a spherical harmonic of degree 0, 1, 2: the clamped cosine's factor."""
_SKY = (32, 64)
"""Rows and columns of the light as bodies reflect it."""


def draw_bodies(picture: Array, scene: Scene) -> Array:
    """[H, W, 3] linear picture with the scene's bodies drawn where they are nearer than the surface."""
    sky = cv2.resize(scene.envmap, _SKY[::-1], interpolation=cv2.INTER_AREA)
    points = unproject(scene.depth, scene.camera)
    for body in scene.bodies:
        picture = picture * _contact(body, points, scene)[..., None]
    # The farthest first: nearer ones are drawn over them.
    for body in sorted(scene.bodies, key=lambda body: float(body.vertices[:, 2].mean())):
        colour, depth = _drawn(body, scene, sky)
        behind = (scene.depth > 0) & (scene.depth * 1.02 < depth)
        # Glass is sketched as see-through.
        share = 1 - 0.7 * body.surface.transmission
        picture = np.where(
            ((depth > 0) & ~behind)[..., None], picture + share * (colour - picture), picture
        )
    return picture.astype(np.float32)


def light_lamps(picture: Array, scene: Scene) -> Array:
    """[H, W, 3] linear picture with what the scene's lamps add to its matt surfaces, and their glow; no shadows."""
    materials = scene.materials
    matt = materials.albedo * (1 - materials.metallic[..., None])
    points = unproject(scene.depth, scene.camera)
    for lamp in scene.lamps:
        lit = matt / np.pi * _irradiance_of(lamp, points, scene.normal)
        picture = picture + np.where(scene.depth[..., None] > 0, lit, 0)
        _draw_lamp(picture, lamp, scene)
    return picture.astype(np.float32)


def _irradiance_of(lamp: Lamp, points: Array, normals: Array) -> Array:
    """[..., 3] of a lamp at points [..., 3] with normals [..., 3]."""
    way = np.asarray(lamp.position, np.float32) - points
    # No nearer than its own surface.
    squared = np.maximum((way**2).sum(-1), lamp.radius**2)
    cosine = np.maximum((way * normals).sum(-1), 0) / np.sqrt(squared)
    return (cosine / squared)[..., None] * np.asarray(lamp.power, np.float32) / (4 * np.pi)


def _draw_lamp(picture: Array, lamp: Lamp, scene: Scene) -> None:
    """Draw a lamp itself, white in its colour, into a picture that is ours."""
    place, away = project(np.asarray(lamp.position)[None], scene.camera)
    if away[0] <= 0:
        return
    radius = max(1, round(scene.camera.focal * lamp.radius / float(away[0])))
    x, y = (int(value) for value in np.clip(place[0], -1e5, 1e5))
    height, width = scene.depth.shape
    # Behind what is nearer it is not seen.
    if 0 <= x < width and 0 <= y < height and not 0 < scene.depth[y, x] < away[0]:
        power = np.asarray(lamp.power)
        tone = power / max(float(power.max()), 1e-9) * 1.5
        cv2.circle(picture, (x, y), radius, tuple(tone.tolist()), -1)


def _contact(body: Body, points: Array, scene: Scene) -> Array:
    """[H, W] factor of the shadow that a body casts around its foot under light from all around."""
    # The body as an ellipsoid: in a space where that is a unit ball, it hides n.d / d^2 of the sky.
    low, high = body.vertices.min(0), body.vertices.max(0)
    half = (high - low) / 2 * _WIDER
    half = np.maximum(half, max(0.1 * float(half.max()), 1e-6))  # what is flat, too, has a shadow
    way = ((low + high) / 2 - points) / half
    normal = unit(scene.normal * half)
    distance = np.maximum((way**2).sum(-1), 1.0)
    hidden = np.maximum((way * normal).sum(-1), 0) / distance**1.5
    share = _SHADOW * (1 - body.surface.transmission)
    return np.where(scene.depth > 0, 1 - share * np.minimum(hidden, 1), 1).astype(np.float32)


def _drawn(body: Body, scene: Scene, sky: Array) -> tuple[Array, Array]:
    """Colour [H, W, 3] and depth [H, W] (0: nothing) of a body, far triangles drawn first."""
    colour = np.zeros((*scene.depth.shape, 3), np.float32)
    depth = np.zeros(scene.depth.shape, np.float32)
    # --- Triangles on the screen, at most as many as can be drawn at once ---
    stride = -(-len(body.faces) * len(scene.bodies) // SETTINGS.triangles)
    corners = body.vertices[body.faces[::stride]]  # [F, 3, 3]
    places = body.uv[body.faces[::stride]]  # [F, 3, 2]
    if body.surface.albedo.size > 3:
        corners, places = _refined(corners, places)
    pixels, away = project(corners, scene.camera)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = corners.mean(1)
    seen = (away > 0).all(1) & np.any(normal != 0, -1)
    seen &= np.einsum("fi,fi->f", normal, middles) < 0
    order = np.argsort(-away.mean(1))
    order = order[seen[order]]
    if not len(order):
        return colour, depth
    # --- Shading by the light of the scene ---
    tones = np.zeros_like(middles, dtype=np.float32)
    tones[order] = _shaded(body, scene, sky, middles[order], unit(normal[order]), places[order])
    points = np.round(np.clip(pixels, -1e5, 1e5) * 16).astype(np.int32)  # sixteenths of a pixel
    # --- Painter's algorithm ---
    distances = away.mean(1)
    for face in order:
        cv2.fillConvexPoly(colour, points[face], tones[face].tolist(), shift=4)
        cv2.fillConvexPoly(depth, points[face], float(distances[face]), shift=4)
    if stride > 1:
        # Dilation closes the gaps of the triangles that were left out.
        kernel = np.ones((3, 3), np.uint8)
        return np.asarray(cv2.dilate(colour, kernel)), np.asarray(cv2.dilate(depth, kernel))
    return colour, depth


def _refined(corners: Array, places: Array) -> tuple[Array, Array]:
    """Triangles [F, 3, 3] and their texture coordinates [F, 3, 2], each in four until there are enough of them."""
    while len(corners) < _TEXTURED_FACES:
        corners, places = (_quartered(values) for values in (corners, places))
    return corners, places


def _quartered(values: Array) -> Array:
    """[4 F, 3, C] of values [F, 3, C] at the corners of triangles."""
    a, b, c = values[:, 0], values[:, 1], values[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, 1) for part in parts])


def _shaded(
    body: Body, scene: Scene, sky: Array, middles: Array, normals: Array, places: Array
) -> Array:
    """[F, 3] radiance of triangles by the light from all around and the lamps."""
    surface = body.surface
    place = places.mean(1)
    albedo = texels(surface.albedo, place) * np.asarray(surface.tint, np.float32)
    roughness = texels(surface.roughness, place)[:, None]
    metallic = texels(surface.metallic, place)[:, None]
    # --- Matt: irradiance by spherical harmonics, and the lamps ---
    weight = row_solid_angle(len(sky))[:, None, None]
    basis = sh_basis(texel_directions(*sky.shape[:2]), 2)
    coefficients = np.einsum("hwk,hwc->kc", basis * weight, sky)
    light = np.maximum(sh_basis(normals, 2) @ (coefficients * _COSINE[:, None]), 0)
    for lamp in scene.lamps:
        light = light + _irradiance_of(lamp, middles, normals)
    matt = albedo * (1 - metallic) * light / np.pi
    # --- Bright: what it mirrors, between a mirror's picture and the mean around it ---
    view = unit(middles)
    mirrored = view - 2 * (view * normals).sum(-1, keepdims=True) * normals
    sharp = environment(mirrored, sky)
    around = sharp + roughness * (light / np.pi - sharp)
    return (matt + (0.04 + (albedo - 0.04) * metallic) * around).astype(np.float32)
