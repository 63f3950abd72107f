"""Reading samples, and the ways in which one can be broken."""

import made_samples
import numpy as np
import pytest

from materialist.errors import InputError
from materialist_lab.data.datasets import open_sources
from materialist_lab.data.samples import read_sample


def test_a_sample_in_our_conventions(tmp_path):
    sample = open_sources([made_samples.write_set(tmp_path)]).read(1)
    surface = sample.mask > 0
    assert sample.image.shape == (48, 64, 3) and sample.depth.dtype == np.float32
    assert 0.3 < surface.mean() < 1, "the made scene has ground and sky"
    # All points lie on the plane that they were made from.
    points = np.dstack([sample.rays, -np.ones((48, 64))]) * sample.depth[..., None]
    np.testing.assert_allclose((points @ made_samples.NORMAL)[surface], -1.2, rtol=2e-3)
    np.testing.assert_allclose(
        sample.normal[surface], np.broadcast_to(made_samples.NORMAL, (surface.sum(), 3)), atol=0.01
    )
    assert (sample.normal[~surface] == 0).all() and (sample.depth[~surface] == 0).all()
    rest = sample.image - sample.albedo * (1 - sample.metallic[..., None]) * sample.shading
    dielectric = surface & (sample.metallic == 0)
    np.testing.assert_allclose(rest[dielectric], 0.05, atol=2e-3)


def test_several_sets_are_one(tmp_path):
    folders = [
        made_samples.write_set(tmp_path / name, count) for name, count in (("a", 2), ("b", 3))
    ]
    source = open_sources(folders)
    assert len(source) == 5
    assert [source.number(k) for k in range(5)] == [0, 1, 0, 1, 2]
    np.testing.assert_array_equal(source.read(4).albedo, open_sources([folders[1]]).read(2).albedo)
    made_samples.write_set(tmp_path / "a", 4)
    source.refresh()
    assert [source.number(k) for k in range(len(source))] == [0, 1, 2, 3, 0, 1, 2]
    assert source.seed() == [5, 5]
    with pytest.raises(InputError, match="no data folder"):
        open_sources([*folders, tmp_path / "nowhere"])


def test_damaged_samples_are_named(tmp_path):
    made_samples.write_set(tmp_path, 1)
    path = tmp_path / "samples" / "0000000.npz"
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"0000000\.npz"):
        read_sample(path)
    arrays = made_samples.arrays()
    del arrays["depth"]
    np.savez(path, **arrays)
    with pytest.raises(InputError, match="no array 'depth'"):
        read_sample(path)
