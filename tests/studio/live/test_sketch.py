"""Sketches of bodies and lamps under the scene's own light."""

from dataclasses import replace

import numpy as np
from studio_scenes import room

from materialist.studio.live.preview import lit_as_around
from materialist.studio.live.sketch import draw_bodies, light_lamps
from materialist.types import Body, Lamp, Surface

SQUARE = np.float32([[-0.3, -0.3, -1], [0.3, -0.3, -1], [0.3, 0.3, -1], [-0.3, 0.3, -1]])
FACES = np.int32([[0, 1, 2], [0, 2, 3]])
UV = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]])


def square(albedo, metallic=0.0):
    grey = np.full((1, 1), 0.5, np.float32)
    surface = Surface(np.float32(albedo), grey, np.full((1, 1), metallic, np.float32))
    return Body(SQUARE, FACES, np.tile(np.float32([0, 0, 1]), (4, 1)), UV, surface)


def drawn(body, **changes):
    scene = replace(room(), bodies=(body,), **changes)
    return draw_bodies(np.full((*scene.depth.shape, 3), 0.25, np.float32), scene)


def test_a_body_is_as_bright_as_the_light_makes_it():
    even = np.full((16, 32, 3), 0.4, np.float32)
    picture = drawn(square([[[0.5, 0.5, 0.5]]]), envmap=even)
    # White light of one radiance L gives a matt surface the radiance albedo L, and its coat 4 % of L.
    np.testing.assert_allclose(picture[24, 32], 0.4 * 0.54, rtol=0.02)
    twice = drawn(square([[[0.5, 0.5, 0.5]]]), envmap=2 * even)
    np.testing.assert_allclose(twice[24, 32], 2 * picture[24, 32], rtol=1e-3)
    mirror = drawn(square([[[1, 1, 1]]], metallic=1.0), envmap=even)
    np.testing.assert_allclose(mirror[24, 32], 0.4, rtol=0.02)


def test_a_texture_is_seen_with_its_top_up():
    stripes = np.float32([[[0.9, 0, 0]], [[0, 0, 0.9]]])
    picture = drawn(square(stripes), envmap=np.full((16, 32, 3), 0.5, np.float32))
    above, below = picture[14, 32], picture[34, 32]
    assert above[0] > 4 * above[2] and below[2] > 4 * below[0]


def test_what_a_body_stands_before_is_darker_near_it():
    near = drawn(replace(square([[[0.5] * 3]]), vertices=SQUARE - np.float32([0, 0, 1.95])))
    far = drawn(square([[[0.5] * 3]]))
    # On the wall at 3, beside the square: close before it there is a shadow, far before it none.
    assert near[24, 43].max() < 0.22 and far[40, 3].min() > 0.245
    assert near[24, 43].max() < near[24, 50].max() < near[24, 60].max() <= 0.25


def test_a_lamp_lights_what_faces_it_by_the_square_of_its_distance():
    scene = room()
    black = np.zeros((*scene.depth.shape, 3), np.float32)
    lamp = Lamp((0.0, 0.0, -2.0), (1.0, 0.5, 0.2), 0.01)
    wall = replace(scene, depth=np.full_like(scene.depth, 3), lamps=(lamp,))
    lit = light_lamps(black, wall)
    expected = wall.materials.albedo[40, 32] / np.pi * np.array(lamp.power) / (4 * np.pi)
    column, row = 32, 40
    away = 3 / wall.camera.focal
    x, y = (column + 0.5 - 32) * away, (24 - row - 0.5) * away
    squared = x * x + y * y + 1
    np.testing.assert_allclose(lit[row, column], expected / squared**1.5, rtol=0.02)
    assert (lit[:4] > 0).any() and light_lamps(black, replace(scene, lamps=())).max() == 0


def test_a_filling_is_as_bright_as_what_lies_around_it():
    photo = np.full((40, 40, 3), 0.4, np.float32)
    filled = np.zeros((40, 40), bool)
    filled[10:30, 12:28] = True
    # Twice as bright to the left, half as bright to the right; what is lit where it is filled says nothing.
    gain = np.where(np.arange(40) < 20, 2, 0.5).astype(np.float32)[None, :, None]
    lit = np.where(filled[..., None], 9, photo * gain).astype(np.float32)
    shown = lit_as_around(photo, lit, photo, filled)
    np.testing.assert_allclose(shown[20, 14], 0.8, rtol=0.03)
    np.testing.assert_allclose(shown[20, 26], 0.2, rtol=0.03)
    np.testing.assert_allclose(lit_as_around(photo, photo, photo, filled), photo, rtol=1e-5)
