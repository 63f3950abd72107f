"""Relief by bent normals, pictures on surfaces, and blur by the lens."""

from dataclasses import replace

import numpy as np
import pytest
from made_worlds import X, Z, plain, still

from materialist.types import Camera
from materialist_lab.procedural import packing, relief, sample, tiles, tracer
from materialist_lab.procedural.defocus import defocused
from materialist_lab.procedural.materials import ColourPicture, Material
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import ScenePart, World, look

SIZE = 32


def labels(material, size=SIZE, fov=20, height=2.0):
    """Labels of a level ground of 2 m under a camera that looks straight down, -Z upwards in the picture."""
    ground = ScenePart(s.sheet((-1, 0, 1), 2 * X, -2 * Z), material)
    world = World([ground], still().envmap, look((0, height, 1e-4), (0, 0, 0), fov))
    packed = packing.pack(world, np.random.default_rng(0))
    return sample.labels_of(
        tracer.SampleTracer(packed, Camera(size, size, fov), device="cpu").probe()
    )


def test_solid_noise_is_periodic_and_of_slope_one():
    bank = relief.solid_bank()
    slabs = bank.reshape(len(relief.SOLID), relief.SLAB, relief.SIDE, relief.SIDE, 4)
    np.testing.assert_array_equal(slabs[:, 0], slabs[:, -2])
    np.testing.assert_array_equal(slabs[:, -1], slabs[:, 1])
    np.testing.assert_allclose((slabs[:, 1:-1, ..., :3] ** 2).sum(-1).mean((1, 2, 3)), 1, rtol=1e-4)


def test_heights_repeat_and_pass_through_the_field():
    kind = relief.SOLID[0]
    places = np.array([[3, 5, 7]]) / relief.SIDE
    assert relief.height(kind, places)[0] == pytest.approx(
        relief.heights()[kind][3, 5, 7], abs=1e-3
    )
    assert relief.height(kind, places + 2)[0] == pytest.approx(
        relief.height(kind, places)[0], abs=1e-3
    )


@pytest.mark.parametrize("kind", relief.SOLID)
def test_normals_are_bent_as_much_as_the_relief_says(kind):
    bumpy = replace(plain((0.5, 0.5, 0.5)), relief=relief.Relief(kind, (0.4, 0.4, 0.4), 0.3))
    normal = labels(bumpy, 64)["normal"]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, atol=1e-5)
    assert abs(normal[..., :2].mean()) < 0.06
    tangent = np.linalg.norm(normal[..., :2], axis=-1) / normal[..., 2]
    # Two of the three slopes of the noise lie in the ground; the mean over a pixel takes some of them.
    assert 0.08 < np.sqrt((tangent**2).mean()) < 0.45


def test_flat_material_keeps_the_normal_of_its_mesh():
    np.testing.assert_allclose(labels(plain((0.5, 0.5, 0.5)))["normal"][..., 2], 1, atol=1e-5)


def test_joints_of_bricks_slope_down():
    """Beside a joint the normal points into it: the height's slope by finite differences of the tile."""
    tile = tiles.bank()[1]["tiling"][0]
    bricks = Material(tile, ((0.5,) * 3,) * 3, emboss=0.01, repeat=(0.5, 0.5), offset=(0.0, 0.0))
    seen = labels(bricks, 96)["normal"]
    field = tiles.bank()[0][tile].astype(float) / 255
    height = 0.01 * (0.3 * field[..., 2] - field[..., 1])
    # Matt and of one colour: only the relief changes the normals.
    # The ground's texture coordinates are metres from its corner (-1, 1), v towards -Z: (x, y) of the picture.
    camera = Camera(96, 96, 20)
    x = (np.arange(96) + 0.5 - 48) / camera.focal * 2
    y = (48 - np.arange(96) - 0.5) / camera.focal * 2
    u, v = np.meshgrid(x + 1, y + 1)
    step = 0.5 / tiles.SIZE

    def at(u, v):
        return height[(v / step % tiles.SIZE).astype(int), (u / step % tiles.SIZE).astype(int)]

    # The gradient of the stored height by central differences, in metres a metre.
    slope = np.stack([at(u + step, v) - at(u - step, v), at(u, v + step) - at(u, v - step)], -1) / (
        2 * step
    )
    # A normal (x, y, z) belongs to the slopes -x / z and -y / z.
    bent = -seen[..., :2] / seen[..., 2:]
    steep = np.abs(slope) > 0.3
    assert steep.sum() > 100
    assert np.corrcoef(slope[steep], bent[steep])[0, 1] > 0.6


def test_a_picture_lies_upright_on_a_surface():
    """Red grows to the right and green downwards, in 3 x 5 pixels."""
    pixels = np.zeros((3, 5, 3), np.uint8)
    pixels[..., 0] = np.array([40, 80, 120, 160, 200])
    pixels[..., 1] = np.array([60, 120, 180])[:, None]
    pixels[..., 2] = 90
    material = Material(
        0,
        ((1.0, 1.0, 0.5),) * 3,
        0.0,
        repeat=(2, -2),
        offset=(0.0, 0.0),
        picture=ColourPicture(pixels),
    )
    # The picture fills the view exactly.
    albedo = labels(material, 64, fov=2 * np.degrees(np.arctan(0.5)))["albedo"]
    # Pixels are square roots; blue is halved by the material's colour.
    expected = (pixels / 255.0) ** 2 * [1, 1, 0.5]
    for row in range(3):
        for column in range(5):
            y = int((row + 0.5) / 3 * 64)
            x = int((column + 0.5) / 5 * 64)
            np.testing.assert_allclose(
                albedo[y, x], np.maximum(expected[row, column], 0.01), rtol=0.02
            )


def test_pictures_are_packed_once_each():
    first, second = (ColourPicture(np.full((7, 5, 3), value, np.uint8)) for value in (10, 20))
    parts = [
        ScenePart(s.slab((1, 1, 1)), replace(plain((1,) * 3), picture=p))
        for p in (first, second, first, None)
    ]
    world = World(parts, still().envmap, look((0, 1, 3), (0, 0, 0), 40))
    packed = packing.pack(world, np.random.default_rng(0))
    # Column 24 is the picture's place, 25 its width.
    starts = packed.material[:, 24].astype(int)
    assert starts[0] == starts[2] != starts[1] and packed.material[3, 25] == 0
    assert len(packed.pictures) == 3 * packing.PICTURE_START
    place = starts[1] * packing.PICTURE_START
    assert packed.pictures[place] == 20 | 20 << 8 | 20 << 16


def test_a_backdrop_shows_only_where_no_surface_is():
    image = np.full((8, 8, 3), 0.5, np.float32)
    covered = np.zeros((8, 8), np.float32)
    # Covered above, half covered in one row, open below.
    covered[:4], covered[4] = 1, 0.5
    shown = sample.over_backdrop(np.full((4, 4, 3), 2.0, np.float32), image, covered)
    np.testing.assert_allclose(shown[:4], 0.5)
    np.testing.assert_allclose(shown[5:], 2.0)
    assert (shown[4] > 0.9).all() and (shown[4] < 2).all()


def test_the_lens_blurs_what_is_not_in_focus():
    rng = np.random.default_rng(0)
    image = rng.uniform(0, 1, (64, 64, 3)).astype(np.float32)
    depth = np.where(np.arange(64) < 32, 1.0, 3.0) + np.zeros((64, 64))
    camera = Camera(64, 64, 40)
    # The left half is in focus, the right one three times as far.
    blurred = defocused(image, depth, camera, aperture=0.1, focus=1.0)
    np.testing.assert_allclose(blurred[:, :24], image[:, :24], atol=1e-5)
    assert blurred[:, 40:].std() < 0.5 * image[:, 40:].std()
    assert blurred[:, 40:].mean() == pytest.approx(image[:, 40:].mean(), rel=0.03)
    np.testing.assert_array_equal(defocused(image, depth, camera, aperture=1e-6, focus=1.0), image)
