"""Normals of what stands under a mask."""

from dataclasses import replace

import numpy as np
from edit_scenes import balls

from materialist.camera import unit
from materialist.solids import parts
from materialist.solids.parts import outline_normals

UP = np.array([0.0, 1, 0])


def test_a_mask_of_more_objects_than_one_looks_at_keeps_its_normals(monkeypatch):
    scene, number = balls(((-0.5, -0.2, -3), 0.4), ((0.5, -0.2, -3), 0.4))
    flatter = unit(scene.normal + np.array([0, 0, 1]))

    def turned():
        normal = outline_normals(scene.depth, flatter, number >= 0, scene.camera, UP)
        return (normal != flatter.astype(np.float32)).any()

    assert turned()
    monkeypatch.setattr(parts, "SETTINGS", replace(parts.SETTINGS, max_round=1))
    assert not turned()


def test_a_mask_without_a_surface_keeps_its_normals():
    scene, _ = balls(((-0.5, -0.2, -3), 0.4))
    nothing = np.zeros(scene.depth.shape, bool)
    normal = outline_normals(scene.depth, scene.normal, nothing, scene.camera, UP)
    np.testing.assert_array_equal(normal, scene.normal)
