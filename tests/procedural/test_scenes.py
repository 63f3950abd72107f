"""What the scenes are made of."""

import numpy as np
import pytest
from shape_measures import volume

from materialist.color import luminance
from materialist.procedural import lights, materials, outdoors, packing, rooms, tiles
from materialist.procedural.objects import furniture, machines, things
from materialist.procedural.objects import shapes as s
from materialist.procedural.sample import balance, exposure


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_slabs_are_closed_boxes_with_outward_normals(radius):
    size = np.array([1.0, 0.6, 2.0])
    solid = s.slab(size, radius)
    np.testing.assert_allclose(np.ptp(solid.vertices, axis=0), size)
    assert solid.vertices[:, 1].min() == pytest.approx(0)
    assert (1 if radius == 0 else 0.93) * size.prod() - 1e-9 < volume(solid) <= size.prod() * 1.0001
    assert (((solid.vertices - [0, 0.3, 0]) * solid.normals).sum(-1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=-1), 1)


def test_texture_coordinates_of_slabs_are_metres():
    solid = s.slab(np.array([2.0, 1.0, 0.5]))
    edge = np.linalg.norm(solid.vertices[solid.faces[:, 1]] - solid.vertices[solid.faces[:, 0]], axis=-1)
    across = np.linalg.norm(solid.uv[solid.faces[:, 1]] - solid.uv[solid.faces[:, 0]], axis=-1)
    np.testing.assert_allclose(across, edge)


def test_round_solids_have_their_volume():
    assert 0 < volume(s.pot(np.array([(0.5, 0.0), (1.0, 0.5), (0.8, 1.0)]), 0.05)) < 0.5
    assert volume(s.drum(0.5, 2.0)) == pytest.approx(np.pi / 2, rel=0.03)
    assert volume(s.torus(1.0, 0.2, 24)) == pytest.approx(2 * np.pi**2 * 0.04, rel=0.03)
    assert (s.disc(1.0).normals[:, 1] > 0.99).all()


def test_sheets_face_right_times_up():
    solid = s.sheet((0, 0, 0), (2, 0, 0), (0, 0, -3), 4)
    np.testing.assert_allclose(solid.normals, np.tile([0, 1, 0], (25, 1)))
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0).all()


def test_the_bank_of_tiles_is_fixed_and_seamless():
    bank, where = tiles.bank()
    assert bank.dtype == np.uint8 and len(bank) == len(where) * tiles.VARIANTS
    # Patterns of whole periods: the step over the border is no larger than the steps inside.
    for kind in ("cloudy", "marble", "wood", "weave", "ornament", "spots", "grass"):
        for k in where[kind]:
            tile = bank[k].astype(float)
            seam, inside = np.abs(tile[0] - tile[-1]).mean(), np.abs(np.diff(tile, axis=0)).mean(axis=(1, 2)).max()
            assert seam <= 1.3 * inside + 2, kind


def test_materials_are_physical():
    rng = np.random.default_rng(0)
    families = {k: v for k, v in vars(materials).items() if isinstance(v, materials.Finish)}
    makers = families | {"fabric": materials.fabric, "metal": materials.metal, "any": materials.any_object}
    assert len(families) > 15
    for name, make in makers.items():
        for _ in range(30):
            one = make(rng)
            assert all(0 < c <= 0.95 for colour in one.colours for c in colour), name
            assert all(0 < r <= 1 for r in one.roughness) and all(0 <= v <= 1 for v in one.metallic), name
            assert one.row((0, 0)).shape == (packing.MATERIAL,)


def test_colours_of_materials_vary():
    rng = np.random.default_rng(1)
    seen = luminance(np.array([materials.any_object(rng).colours[0] for _ in range(400)]))
    assert seen.std() > 0.15 and np.percentile(seen, 5) < 0.08 and np.percentile(seen, 95) > 0.6


@pytest.mark.parametrize("maker", [m for _, m in (*furniture.ALONG_WALLS, *furniture.IN_THE_MIDDLE[1:2])])
def test_furniture_stands_on_the_floor_within_its_footprint(maker):
    for k in range(2):
        piece = maker(np.random.default_rng(k), ())
        points = np.concatenate([p.solid.vertices for p in piece])
        assert -0.02 < points[:, 1].min() < 0.2 and points[:, 1].max() < 4


@pytest.mark.parametrize("maker", [maker for _, maker in things.KINDS])
def test_things_stand_on_the_ground_at_about_their_size(maker):
    for k in range(2):
        points = np.concatenate([p.solid.vertices for p in maker(np.random.default_rng([4, k]), 0.3)])
        assert np.isfinite(points).all()
        assert -0.03 < points[:, 1].min() < 0.03 and 0.02 < np.ptp(points, axis=0).max() < 1.8


def test_things_do_not_stand_in_each_other():
    parts = things.scattered(np.random.default_rng(0), 8, (0.5, 0.5), (0.1, 0.2))
    groups = {}
    for part in parts:
        groups.setdefault(part.thing, []).append(part.solid.vertices.mean(0))
    middles = np.array([np.mean(g, axis=0)[[0, 2]] for g in groups.values()])
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=-1) + np.eye(len(middles))
    assert len(middles) > 3 and apart.min() > 0.05


@pytest.mark.parametrize("maker", [rooms.room, rooms.table_top, outdoors.still_life, outdoors.outdoor, rooms.workshop])
def test_worlds_can_be_packed_and_are_seen_from_within(maker):
    for k in range(2):
        rng = np.random.default_rng([5, k])
        world = maker(rng, (), ())
        packed = packing.pack(world, rng)
        for array in (packed.vertices, packed.face, packed.material, packed.env, packed.env_density, packed.portals):
            assert np.isfinite(array).all()
        assert packed.shares.sum() == pytest.approx(1) and len(packed.faces) < 400_000
        assert np.linalg.det(world.view.to_scene) == pytest.approx(1)
        angle = np.repeat((-np.diff(np.cos(np.linspace(0, np.pi, packing.ENV_ROWS + 1)))), 2 * packing.ENV_ROWS)
        assert (packed.env_density * angle).sum() * np.pi / packing.ENV_ROWS == pytest.approx(1, abs=1e-4)
        if maker in (rooms.room, rooms.table_top, rooms.workshop):
            points = np.concatenate([p.solid.vertices for p in world.parts])
            assert (world.view.position > points.min(0)).all() and (world.view.position < points.max(0)).all()


@pytest.mark.parametrize("maker", [maker for _, maker in machines.KINDS])
def test_large_things_stand_on_the_floor_and_fit_into_a_room(maker):
    for k in range(3):
        points = np.concatenate([p.solid.vertices for p in maker(np.random.default_rng([8, k]))])
        assert np.isfinite(points).all()
        assert -0.03 < points[:, 1].min() < 0.035  # feet of bars, soles of shoes
        assert 0.3 < np.ptp(points, axis=0).max() < 3.2
        if maker is machines.two_wheeler:
            low = points[points[:, 1] < 0.02]
            assert low[:, 0].min() < -0.3 and low[:, 0].max() > 0.3, "both wheels touch the floor"
        if maker is machines.cart:
            assert abs(points[:, 1].min()) < 0.005


def test_tyres_are_round_all_along():
    """No segment is pinched: every face stays away from the middle of the tube."""
    solid = machines.wheel(np.random.default_rng(2), np.zeros(3), 0.3, 0.0, True)[0].solid
    middle = solid.vertices[solid.faces].mean(1)
    radius = (np.hypot(solid.vertices[:, 0], solid.vertices[:, 1]).max(), np.abs(solid.vertices[:, 2]).max())
    off = np.hypot(np.hypot(middle[:, 0], middle[:, 1]) - (radius[0] - radius[1]), middle[:, 2])
    assert off.min() > 0.85 * radius[1]
    out = (solid.normals * solid.vertices).sum(-1)
    assert (out[np.hypot(solid.vertices[:, 0], solid.vertices[:, 1]) > radius[0] - 0.5 * radius[1]] > 0).all()


def test_skies_have_a_mean_of_one_and_are_lighter_above():
    for k in range(4):
        envmap = lights.levelled(lights.sky(np.random.default_rng(k)))
        d = lights.directions(len(envmap))
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
        assert np.ptp(np.log(gains * shading[0, 0])) < np.ptp(np.log(shading[0, 0])) + 0.15
