"""Which meshes and materials an export has."""

import numpy as np
import pytest
from export_scenes import room

from materialist.camera import project
from materialist.exporters.parts import scene_parts


def test_parts_are_the_whole_mesh():
    scene = room()
    parts = scene_parts(scene)
    assert [part.name for part in parts] == ["surface", "plane0", "plane1"]
    assert sum(len(part.mesh.faces) for part in parts) == len(scene.geometry.mesh.faces)
    assert parts[0].materials is scene.materials and not parts[0].constant
    for part in parts[1:]:
        members = scene.geometry.plane_label == int(part.name.removeprefix("plane"))
        assert part.constant
        np.testing.assert_allclose(
            part.materials.albedo[0, 0],
            scene.materials.albedo[members].mean(0, dtype=float),
            rtol=1e-5,
        )
        np.testing.assert_allclose(
            part.materials.roughness[0, 0],
            scene.materials.roughness[members].mean(dtype=float),
            rtol=1e-5,
        )


@pytest.mark.parametrize("most", [400, 1500, 5000])
def test_fewer_triangles_on_the_same_frame(most):
    scene = room()
    parts = scene_parts(scene, most)
    count = sum(len(part.mesh.faces) for part in parts)
    assert 0.3 * most < count <= most
    assert parts[0].materials.albedo.shape == (40, 64, 3)  # the texture keeps its size
    surface = parts[0].mesh
    pixels, _ = project(surface.vertices, scene.camera)
    # The frame is covered to its rim, and a vertex still lies where its texture coordinate says; the continuation
    # under silhouettes has the texture coordinate of a neighbour.
    assert np.abs(pixels.min(0)).max() < 0.01 and np.abs(pixels.max(0) - (64, 40)).max() < 0.01
    distance = np.abs(pixels - surface.uv * (64, 40)).max(1)
    assert np.median(distance) < 0.01
