"""What the scenes are made of."""

import numpy as np
import pytest

from materialist_lab.procedural import materials, packing, rooms
from materialist_lab.procedural.objects import things
from materialist_lab.procedural.sample import exposure
from materialist_lab.procedural.still_life import still_life


def test_materials_are_physical():
    rng = np.random.default_rng(0)
    families = {k: v for k, v in vars(materials).items() if isinstance(v, materials.Finish)}
    makers = families | {
        "fabric": materials.fabric,
        "metal": materials.metal,
        "any": materials.any_object,
    }
    assert len(families) > 15
    for name, make in makers.items():
        for _ in range(30):
            material = make(rng)
            assert all(0 < c <= 0.95 for colour in material.colours for c in colour), name
            assert all(0 < r <= 1 for r in material.roughness) and all(
                0 <= v <= 1 for v in material.metallic
            ), name
            assert material.row((0, 0)).shape == (packing.MATERIAL,)


@pytest.mark.parametrize("maker", [maker for _, maker in things.KINDS])
def test_things_stand_on_the_ground_at_about_their_size(maker):
    for k in range(2):
        points = np.concatenate(
            [p.solid.vertices for p in maker(np.random.default_rng([4, k]), 0.3)]
        )
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


@pytest.mark.parametrize("maker", [rooms.room, still_life])
def test_worlds_can_be_packed_and_are_seen_from_within(maker):
    for k in range(2):
        rng = np.random.default_rng([5, k])
        world = maker(rng, (), ())
        packed = packing.pack(world, rng)
        for array in (
            packed.vertices,
            packed.face,
            packed.material,
            packed.env,
            packed.env_density,
            packed.portals,
        ):
            assert np.isfinite(array).all()
        assert packed.shares.sum() == pytest.approx(1) and len(packed.faces) < 400_000
        assert np.linalg.det(world.view.to_scene) == pytest.approx(1)
        angle = np.repeat(
            (-np.diff(np.cos(np.linspace(0, np.pi, packing.ENV_ROWS + 1)))), 2 * packing.ENV_ROWS
        )
        assert (packed.env_density * angle).sum() * np.pi / packing.ENV_ROWS == pytest.approx(
            1, abs=1e-4
        )
        if maker is rooms.room:
            points = np.concatenate([p.solid.vertices for p in world.parts])
            assert (world.view.position > points.min(0)).all() and (
                world.view.position < points.max(0)
            ).all()


def test_exposure_ignores_the_lamp_in_the_picture():
    def rng():
        return np.random.default_rng(0)

    room = np.full((32, 32, 3), 0.01)
    lamp = room.copy()
    lamp[:4, :8] = 50.0
    assert exposure(lamp, rng()) > 0.5 * exposure(room, rng())
    assert 0.05 < 0.01 * exposure(room, rng()) < 0.8
