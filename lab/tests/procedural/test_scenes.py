"""What the scenes are made of."""

import numpy as np

from materialist_lab.procedural import materials, packing
from materialist_lab.procedural.sample import exposure


def test_materials_are_physical():
    rng = np.random.default_rng(0)
    families = {k: v for k, v in vars(materials).items() if isinstance(v, materials.Finish)}
    makers = families | {
        "fabric": materials.fabric,
        "metal": materials.metal,
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


def test_exposure_ignores_the_lamp_in_the_picture():
    def rng():
        return np.random.default_rng(0)

    room = np.full((32, 32, 3), 0.01)
    lamp = room.copy()
    lamp[:4, :8] = 50.0
    assert exposure(lamp, rng()) > 0.5 * exposure(room, rng())
    assert 0.05 < 0.01 * exposure(room, rng()) < 0.8
