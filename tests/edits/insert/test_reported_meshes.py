"""Mesh files that were once read wrongly, with their right values (../shared/data/reported)."""

import pytest
from mesh_measures import area, colours, size

from materialist.edits.insert.meshes import read_model

BOX = [1.0, 1.0, 1.0]
SIZES = {
    "gltf_silent/skin.glb": [1.0, 4.0, 1.0],
    "gltf_silent/sparse.glb": [1.0, 9.5, 1.0],
    "gltf_silent/fan.glb": [1.0, 1.0, 0.0],
    "gltf_silent/fan2.glb": [9.5, 9.5, 1.0],
    "obj_text/bom.obj": [1.0, 2.0, 3.0],
    "obj_text/cr.obj": [1.0, 2.0, 3.0],
    "obj_text/long.stl": BOX,
}
COLOURS = {
    "gltf_normalized_uv/uv_u16.glb": [0, 1, 0],
    "gltf_silent/uv_clamp2.glb": [0, 1, 0],
    "gltf_silent/uv_set1.glb": [1, 1, 1],
    "mesh_colours/col255.obj": [0.578, 0.127, 0.032],
    "mesh_colours/dcol.ply": [0.578, 0.127, 0.032],
    "obj_text/twolib.obj": [0.8, 0.1, 0.1],
}
AREAS = {"ushape.obj": 7, "ushape.ply": 7, "ngon.obj": 10}


@pytest.mark.parametrize("name", SIZES)
def test_sizes(real_data, name):
    assert size(read_model(real_data("data/reported") / name)) == SIZES[name]


@pytest.mark.parametrize("name", COLOURS)
def test_colours(real_data, name):
    (colour,) = colours(read_model(real_data("data/reported") / name))
    assert colour == pytest.approx(COLOURS[name], abs=1e-3)


@pytest.mark.parametrize("name", AREAS)
def test_areas(real_data, name):
    assert area(
        read_model(real_data("data/reported") / "mesh_concave_ngon" / name)
    ) == pytest.approx(AREAS[name])


def test_a_texture_that_is_not_read_is_named(real_data):
    assert read_model(real_data("data/reported") / "gltf_silent/ktx_opt.glb").warnings
