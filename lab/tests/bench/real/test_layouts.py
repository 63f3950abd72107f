"""Readers of `bench real`: one tiny folder of each layout."""

import made_real
import numpy as np
import pytest

from materialist.errors import InputError
from materialist_lab.bench.real.layouts import LAYOUTS, located
from materialist_lab.bench.real.lights import mean_direction
from materialist_lab.bench.real.photos import Reading

BY_FOLDER = {layout.folder: layout for layout in LAYOUTS}


@pytest.fixture
def photos(tmp_path):
    """The photos of a layout's tiny folder, by the name of the folder."""

    def read(folder, **options):
        made_real.WRITERS[folder](tmp_path / folder)
        layout = BY_FOLDER[folder]
        items = located(tmp_path)[layout.name]
        reading = Reading(**{"size": 512, "lamps": 0, **options})
        return [real for item in items for real in layout.photos(item, reading)]

    return read


def test_every_layout_has_a_folder_here():
    assert set(made_real.WRITERS) == set(BY_FOLDER)


@pytest.mark.parametrize("folder", BY_FOLDER)
def test_a_layout_is_recognised_by_what_is_in_it(tmp_path, folder):
    """In DIR/FOLDER, and in DIR itself; and for no other one."""
    made_real.WRITERS[folder](tmp_path / folder)
    for place in (tmp_path, tmp_path / folder):
        assert [name for name, items in located(place).items() if items] == [BY_FOLDER[folder].name]


def test_objects_under_lamps(photos):
    views = photos("real_light")
    assert [real.name for real in views] == ["ball light_00", "ball light_01", "ball light_02"]
    first = views[0]
    assert first.photo.camera.fov == 10 and first.photo.linear.shape == (24, 32, 3)
    np.testing.assert_allclose(first.photo.linear[~first.mask], 0.02, atol=0.01)  # linear values
    assert first.mask.sum() > 200 and np.array_equal(first.mask, first.albedo.any(-1))
    np.testing.assert_allclose(mean_direction(first.other.envmap), made_real.LAMPS[2], atol=0.02)
    np.testing.assert_array_equal(first.other.picture, views[2].photo.linear)
    np.testing.assert_array_equal(views[2].other.picture, first.photo.linear)
    shading = np.maximum(first.normal @ np.array(made_real.LAMPS[0]), 0)[..., None]
    np.testing.assert_allclose(first.photo.linear, 0.02 + first.albedo * shading, atol=0.003)


def test_some_of_the_lamps_and_a_smaller_size(photos):
    views = photos("real_light", lamps=2, size=16)
    assert [real.name for real in views] == ["ball light_00", "ball light_02"]
    for array in (
        views[0].photo.linear,
        views[0].normal,
        views[0].albedo,
        views[0].mask,
        views[0].other.picture,
    ):
        assert array.shape[:2] == (12, 16)
    assert views[0].photo.camera.width == 16


def test_a_room_with_a_depth_camera(photos):
    (real,) = photos("real_room")
    assert real.photo.camera.fov == 63.3 and real.mask is None and real.inside.all()
    np.testing.assert_allclose(real.depth, made_real.floor(), atol=0.001)


def test_a_garage_by_its_disparity(photos):
    (real,) = photos("photos/indoor")
    assert not real.depth[:, :4].any()
    np.testing.assert_allclose(real.depth[:, 4:], 994.978 * 0.193001 / (20 + 31.086), rtol=1e-5)
    assert real.photo.camera.focal == pytest.approx(994.978, rel=1e-4)


def test_published_maps_stand_for_the_truth(photos):
    (real,) = photos("official_indoor")
    np.testing.assert_allclose(real.albedo, 0.4, atol=1e-3)
    assert (
        real.photo.camera.fov == 35
        and real.normal.any(-1).all()
        and real.source == "published maps"
    )


def test_nyu_counts_its_crop(photos):
    (real,) = photos("nyu", size=640)
    known = real.depth > 0
    assert (
        real.name == "bathroom 00045" and known[45:471, 41:601].all() and known.sum() == 426 * 560
    )
    np.testing.assert_allclose(real.depth[known], 2.5, atol=1e-3)


def test_diode_counts_what_is_valid(photos):
    (real,) = photos("diode")
    assert not real.depth[0].any() and (real.depth[1:] > 0).all() and real.photo.camera.fov == 60


def test_iiw_has_judgements(photos):
    (real,) = photos("iiw")
    assert real.judgements.name == "17.json" and real.depth is None and real.other is None


def test_interiorverse_is_read_as_it_is_everywhere(photos):
    (real,) = photos("interiorverse")
    assert real.photo.camera.fov == pytest.approx(85, rel=1e-5) and real.mask.all()
    np.testing.assert_allclose(real.depth, 2.0, rtol=1e-3)
    np.testing.assert_allclose(real.albedo, 0.25, rtol=1e-3)


def test_wildrelight_pairs_the_lights_that_are_farthest(photos):
    first, second, third = photos("wildrelight")
    assert first.name == "park time0_hdr" and first.photo.hdr
    np.testing.assert_array_equal(first.other.picture, third.photo.linear)
    np.testing.assert_array_equal(third.other.picture, first.photo.linear)
    assert second.other.envmap.shape == (16, 32, 3)
    assert mean_direction(first.other.envmap)[0] > 0.5  # its sun is to the right


def test_multi_illumination_has_its_light_from_the_mirror_ball(photos):
    first, second = photos("multi_illumination")
    assert first.name == "everett_dining1 dir_0_mip2"
    assert second.photo.linear.mean() > 1.2 * first.photo.linear.mean()
    to_first, to_second = (mean_direction(real.other.envmap) for real in (second, first))
    assert to_first[0] < -0.3 < 0.3 < to_second[0] and abs(to_first[1]) < 0.1


@pytest.mark.parametrize(
    ("folder", "file", "content", "words"),
    [
        ("real_light", "ball/lights.json", b"[]", "one list of directions"),
        ("real_light", "ball/lights.json", b'{"a": ["up"]}', "one list of directions"),
        ("real_light", "ball/light_01.png", None, r"no photo at .*light_01\.png"),
        ("real_light", "ball/mask.png", None, "mask"),
        ("photos/indoor", "motorcycle_garage_disp.npz", b"nothing", "no array"),
        ("wildrelight", "park/photo/time1_hdr.exr", None, r"no photo at .*time1_hdr\.exr"),
        ("diode", "val/indoors/scene_00019/scan_00183/00019_00183_depth.npy", None, "no array"),
    ],
)
def test_what_is_broken_is_named(tmp_path, folder, file, content, words):
    made_real.WRITERS[folder](tmp_path)
    (tmp_path / file).unlink()
    if content is not None:
        (tmp_path / file).write_bytes(content)
    layout = BY_FOLDER[folder]
    with pytest.raises(InputError, match=words):
        for item in layout.items(tmp_path):
            list(layout.photos(item, Reading(512, 0)))


def test_one_light_is_no_pair(tmp_path):
    made_real.write_object(tmp_path / "ball")
    (tmp_path / "ball" / "lights.json").write_text('{"directions": [[0, 0, 1]]}')
    layout = BY_FOLDER["real_light"]
    with pytest.raises(InputError, match="fewer than two lights"):
        list(layout.photos(tmp_path / "ball", Reading(512, 0)))
