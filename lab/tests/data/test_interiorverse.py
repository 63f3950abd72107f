"""InteriorVerse: a tiny folder in its published layout."""

import made_samples
import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.types import Camera
from materialist_lab.data.datasets import InteriorVerse, open_sources


@pytest.fixture
def folder(tmp_path):
    """Two parts, one scene each; the wall faces the camera at 2 metres."""
    for part in ("dataset_85", "dataset_120"):
        scene = tmp_path / part / "L3D1"
        scene.mkdir(parents=True)
        (tmp_path / part / "train.txt").write_text("L3D1\nLOST\n")
        (tmp_path / part / "test.txt").write_text("")
        for name in ("000", "001"):
            _write(scene, name)
    return tmp_path


def _write(scene, name):
    size = (12, 16)

    def grey(v):
        return np.full((*size, 3), v, np.float32)

    depth = np.full(size, 2000, np.float32)
    depth[:2] = np.inf
    normal = grey(0)
    normal[..., 2] = 1
    normal[-1, :, 2] = -1  # seen from behind
    material = grey(0)
    material[..., 0], material[..., 1] = 0.3, 0.7
    mask = np.ones(size, np.float32)
    mask[:, 0] = 0
    maps = {
        "im": grey(4),
        "albedo": grey(0.25),
        "material": material,
        "depth": depth,
        "normal": normal,
        "mask": mask,
    }
    for key, values in maps.items():
        write_exr(scene / f"{name}_{key}.exr", values)


def test_the_layout_in_our_conventions(folder):
    source = open_sources([folder])
    assert isinstance(source, InteriorVerse) and len(source) == 4
    assert source.notes == (
        "2 scenes of the split 'train' are not there (dataset_85/LOST, dataset_120/LOST ...).",
    )
    sample = source.read(0)
    surface = sample.mask > 0
    assert not surface[:2].any() and not surface[:, 0].any() and surface[2:, 1:].all()
    np.testing.assert_allclose(sample.depth[surface], 2.0, rtol=1e-6)
    np.testing.assert_allclose(sample.normal[surface], [[0, 0, 1]] * surface.sum())
    np.testing.assert_allclose(sample.albedo, 0.25, rtol=1e-3)
    np.testing.assert_allclose(sample.roughness, 0.3, rtol=1e-3)
    np.testing.assert_allclose(sample.metallic, 0.7, rtol=1e-3)
    np.testing.assert_allclose(sample.image, 0.9, rtol=1e-3)


def test_the_folder_names_the_field_of_view(folder):
    source = InteriorVerse(folder)
    for index, fov in ((0, 85.0), (2, 120.0)):
        expected = pixel_rays(Camera(16, 12, fov))[..., :2]
        np.testing.assert_allclose(source.read(index).rays, expected, rtol=1e-6)


def test_one_part_alone_and_what_is_wrong(folder, tmp_path):
    assert len(InteriorVerse(folder / "dataset_120")) == 2
    with pytest.raises(InputError, match=r"is InteriorVerse; only sets of materialist train data"):
        open_sources([made_samples.write_set(tmp_path / "own", 1), folder])
    with pytest.raises(InputError, match="no split 'dev'"):
        InteriorVerse(folder, "dev")
    with pytest.raises(InputError, match="no pictures of the InteriorVerse split 'test'"):
        InteriorVerse(folder, "test")
    source = InteriorVerse(folder)
    (folder / "dataset_85" / "L3D1" / "000_depth.exr").unlink()
    with pytest.raises(InputError, match=r"no EXR file at .*000_depth\.exr"):
        source.read(0)
    write_exr(folder / "dataset_85" / "L3D1" / "000_depth.exr", np.ones((5, 5), np.float32))
    with pytest.raises(InputError, match=r"000_depth\.exr is \(5, 5\)"):
        InteriorVerse(folder).read(0)


def test_scores_are_taken_on_the_validation_split(folder):
    from materialist_lab.train.maps import held_out

    assert InteriorVerse(folder).validation() is None, "there is none"
    scene = folder / "dataset_85" / "L3D9"
    scene.mkdir()
    _write(scene, "000")
    write_exr(scene / "000_albedo.exr", np.full((12, 16, 3), 0.75, np.float32))
    (folder / "dataset_85" / "val.txt").write_text("L3D9\n")
    _, samples = held_out(InteriorVerse(folder), 3)
    assert len(samples) == 1 and samples[0].albedo.mean() == pytest.approx(0.75, rel=1e-3)
