"""What the scenes are made of."""

import numpy as np
import pytest

from materialist.color import luminance
from materialist.procedural import materials, outdoors, packing, rooms, skies, tiles, workshops
from materialist.procedural.lights import directions
from materialist.procedural.objects import furniture, machines, things, wheels
from materialist.procedural.objects import solids as s
from materialist.procedural.sample import balance, exposure


def volume(solid):
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_slabs_are_closed_boxes_with_outward_normals(radius):
    size = np.array([1.0, 0.6, 2.0])
    solid = s.slab(size, radius)
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    np.testing.assert_allclose(high - low, size)
    assert low[1] == pytest.approx(0)
    if radius == 0:
        assert volume(solid) == pytest.approx(size.prod())
    assert 0.93 * size.prod() < volume(solid) <= size.prod() * 1.0001
    outward = ((solid.vertices - [0, 0.3, 0]) * solid.normals).sum(-1)
    assert (outward > 0).all()
    np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=-1), 1)


def test_texture_coordinates_of_slabs_are_metres():
    solid = s.slab(np.array([2.0, 1.0, 0.5]))
    edge = np.linalg.norm(solid.vertices[solid.faces[:, 1]] - solid.vertices[solid.faces[:, 0]], axis=-1)
    across = np.linalg.norm(solid.uv[solid.faces[:, 1]] - solid.uv[solid.faces[:, 0]], axis=-1)
    np.testing.assert_allclose(across, edge)


def test_pots_are_open_vessels_of_positive_volume():
    solid = s.pot(np.array([(0.5, 0.0), (1.0, 0.5), (0.8, 1.0)]), 0.05)
    assert 0 < volume(solid) < 0.5
    assert len(solid.faces) < 5000


def test_sheets_face_right_times_up():
    solid = s.sheet((0, 0, 0), np.array([2.0, 0, 0]), np.array([0, 0, -3.0]), 4)
    np.testing.assert_allclose(solid.normals, np.tile([0, 1, 0], (25, 1)))
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0).all()


def test_the_bank_of_tiles_is_fixed_and_seamless():
    bank, where = tiles.bank()
    assert bank.dtype == np.uint8
    assert len(bank) == len(where) * tiles.VARIANTS
    # Patterns of whole periods: the step over the border is no larger than the steps inside.
    for kind in ("cloudy", "marble", "wood", "weave", "ornament", "spots", "grass"):
        for k in where[kind]:
            tile = bank[k].astype(float)
            seam, inside = np.abs(tile[0] - tile[-1]).mean(), np.abs(np.diff(tile, axis=0)).mean(axis=(1, 2)).max()
            assert seam <= 1.3 * inside + 2, kind


def test_materials_are_physical():
    rng = np.random.default_rng(0)
    makers = [materials.wall_paint, materials.wallpaper, materials.wood, materials.floor_boards, materials.tiled,
              materials.stone, materials.brick, materials.fabric, materials.metal, materials.ceramic, materials.plastic,
              materials.foliage, materials.ground, materials.facade, materials.skin, materials.any_object]  # fmt: skip
    for make in makers:
        for _ in range(40):
            one = make(rng)
            assert all(0 < c <= 0.95 for colour in one.colours for c in colour), make.__name__
            assert all(0 < r <= 1 for r in one.roughness), make.__name__
            assert all(0 <= v <= 1 for v in one.metallic), make.__name__
            assert one.row((0, 0)).shape == (packing.MATERIAL,)


def test_colours_of_materials_vary():
    rng = np.random.default_rng(1)
    seen = np.array([materials.any_object(rng).colours[0] for _ in range(400)])
    assert luminance(seen).std() > 0.15
    assert np.percentile(luminance(seen), 5) < 0.08
    assert np.percentile(luminance(seen), 95) > 0.6


@pytest.mark.parametrize("maker", [m for m, _ in (*furniture.ALONG_WALLS, *furniture.IN_THE_MIDDLE)])
def test_furniture_stands_on_the_floor_within_its_footprint(maker):
    for k in range(3):
        piece = maker(np.random.default_rng(k), ())
        points = np.concatenate([p.solid.vertices for p in piece.parts])
        assert -0.02 < points[:, 1].min() < 0.2
        assert points[:, 1].max() < 4
        solid = np.concatenate([p.solid.vertices for p in piece.parts[:1]])
        assert np.abs(solid[:, 0]).max() <= piece.width / 2 + 0.15


def test_things_do_not_stand_in_each_other():
    taken = []
    things.scattered(np.random.default_rng(0), 8, (0.5, 0.5), (0.1, 0.2), taken=taken)
    assert len(taken) > 3
    for k, (x, z, r) in enumerate(taken):
        for a, b, q in taken[:k]:
            assert np.hypot(x - a, z - b) > 0.84 * (r + q)


@pytest.mark.parametrize(
    "maker", [rooms.room, rooms.table_top, outdoors.still_life, outdoors.outdoor, workshops.workshop]
)
def test_worlds_can_be_packed(maker):
    for k in range(4):
        rng = np.random.default_rng([5, k])
        packed = packing.pack(maker(rng, (), ()), rng)
        for array in (packed.vertices, packed.face, packed.material, packed.env, packed.env_density, packed.portals):
            assert np.isfinite(array).all()
        assert packed.shares.sum() == pytest.approx(1)
        assert len(packed.faces) < 400_000


@pytest.mark.parametrize("maker", [rooms.room, workshops.workshop])
def test_cameras_stand_inside_their_room(maker):
    for k in range(10):
        rng = np.random.default_rng([6, k])
        world = maker(rng, (), ())
        points = np.concatenate([p.solid.vertices for p in world.parts])
        assert (world.view.position > points.min(0)).all()
        assert (world.view.position < points.max(0)).all()
        assert np.linalg.det(world.view.to_scene) == pytest.approx(1)


@pytest.mark.parametrize("maker", [maker for maker, _ in machines._TABLE])
def test_large_things_stand_on_the_floor_and_fit_into_a_room(maker):
    for k in range(6):
        points = np.concatenate([p.solid.vertices for p in maker(np.random.default_rng([8, k]))])
        assert np.isfinite(points).all()
        assert -0.03 < points[:, 1].min() < 0.035  # feet of bars, soles of shoes
        assert 0.3 < np.ptp(points, axis=0).max() < 3.2


def test_carts_of_any_size_roll_on_the_floor():
    for k in range(40):
        points = np.concatenate([p.solid.vertices for p in machines.cart(np.random.default_rng([10, k]))])
        assert abs(points[:, 1].min()) < 0.005


def test_tyres_are_round_all_along():
    """No segment is pinched: every face stays away from the middle of the tube."""
    solid = wheels.wheel(np.random.default_rng(2), np.zeros(3), 0.3, 0.0, True)[0].solid
    middle = solid.vertices[solid.faces].mean(1)
    radius = (np.hypot(solid.vertices[:, 0], solid.vertices[:, 1]).max(), np.abs(solid.vertices[:, 2]).max())
    off = np.hypot(np.hypot(middle[:, 0], middle[:, 1]) - (radius[0] - radius[1]), middle[:, 2])
    assert off.min() > 0.85 * radius[1]
    out = (solid.normals * solid.vertices).sum(-1)
    assert (out[np.hypot(solid.vertices[:, 0], solid.vertices[:, 1]) > radius[0] - 0.5 * radius[1]] > 0).all()


def test_wheels_touch_the_floor_at_both_ends():
    for k in range(6):
        points = np.concatenate([p.solid.vertices for p in wheels.two_wheeler(np.random.default_rng([9, k]))])
        low = points[points[:, 1] < 0.02]
        assert low[:, 0].min() < -0.3
        assert low[:, 0].max() > 0.3


def test_density_of_the_sky_integrates_to_one():
    world = outdoors.outdoor(np.random.default_rng(3), (), ())
    packed = packing.pack(world, np.random.default_rng(0))
    edges = np.cos(np.linspace(0, np.pi, packing.ENV_ROWS + 1))
    angle = np.repeat((edges[:-1] - edges[1:]) * np.pi / packing.ENV_ROWS, 2 * packing.ENV_ROWS)
    assert (packed.env_density * angle).sum() == pytest.approx(1, abs=1e-4)


def test_skies_have_a_mean_of_one_and_are_lighter_above():
    for k in range(6):
        envmap = skies.levelled(skies.sky(np.random.default_rng(k)))
        d = directions(len(envmap))
        weight = np.sqrt(np.maximum(1 - d[..., 1] ** 2, 0))
        assert (luminance(envmap) * weight).sum() / weight.sum() == pytest.approx(1, rel=0.02)
        assert luminance(envmap[: len(envmap) // 2]).mean() > luminance(envmap[len(envmap) // 2 :]).mean()


def test_exposure_ignores_the_lamp_in_the_picture():
    rng = lambda: np.random.default_rng(0)  # noqa: E731
    room = np.full((32, 32, 3), 0.01)
    lamp = room.copy()
    lamp[:4, :8] = 50.0
    assert exposure(lamp, rng()) > 0.5 * exposure(room, rng())
    assert 0.05 < 0.01 * exposure(room, rng()) < 0.8


def test_balance_makes_coloured_light_whiter():
    shading = np.tile(np.array([1.4, 1.0, 0.5]), (16, 16, 1))
    for k in range(20):
        gains = balance(shading, np.random.default_rng(k))
        after = np.ptp(np.log(gains * shading[0, 0]))
        assert after < np.ptp(np.log(shading[0, 0])) + 0.15
