"""Batches of pictures keep labels, rays, light and picture true to each other."""

import made_samples
import numpy as np
import torch

from materialist.io.samples import SampleFolder
from materialist.train import pictures
from materialist.train.pictures import AugmentSettings, DevicePictures

SIZE = 64


def made(tmp_path, count=3, settings=None, **options):
    source = SampleFolder(made_samples.write_set(tmp_path, count, height=SIZE, width=SIZE, **options))
    return DevicePictures(source, torch.device("cpu"), settings)


def test_crops_and_mirrors_keep_the_plane(tmp_path):
    """The samples show the plane n . p = -1.2; mirrored ones show its mirror image."""
    batch = made(tmp_path).drawn(32, 16, torch.Generator().manual_seed(0))
    normals = set()
    for k in range(16):
        surface = batch["mask"][k, 0] > 0
        points = torch.cat([batch["rays"][k], -torch.ones(1, 32, 32)]) * batch["depth"][k]
        normal = batch["normal"][k][:, surface].mean(1)
        np.testing.assert_allclose((points[:, surface] * normal[:, None]).sum(0), -1.2, rtol=0.03)
        normals.add(round(float(normal[0]), 2))
    assert normals == {0.0}  # the plane is not inclined sideways
    steps = batch["rays"].diff(dim=-1)[:, 0]
    assert (steps > 0).all()  # columns run to the right


def test_light_is_mirrored_and_exposed_with_its_picture(tmp_path):
    """A light of 3 on the right and 1 on the left of a picture that is brighter on the right."""
    folder = made_samples.write_set(tmp_path, 1, height=SIZE, width=SIZE)
    arrays = made_samples.arrays(SIZE, SIZE)
    light = np.ones((16, 32, 4), np.float16)
    light[:, 16:, :3] = 3
    ramp = np.linspace(0.1, 0.3, SIZE, dtype=np.float16)
    arrays |= {"image": np.broadcast_to(ramp[None, :, None], (SIZE, SIZE, 3)), "light": light}
    del arrays["shading"]
    np.savez(folder / "samples" / "0000000.npz", **arrays)
    batch = DevicePictures(SampleFolder(folder), torch.device("cpu")).drawn(32, 32, torch.Generator().manual_seed(2))
    mirrored = batch["image"][..., :8].mean((1, 2, 3)) > batch["image"][..., -8:].mean((1, 2, 3))
    assert mirrored.any() and not mirrored.all()
    right, left = batch["light"][:, 1, 8, 20], batch["light"][:, 1, 8, 4]
    np.testing.assert_allclose((right / left).log(), torch.where(mirrored, -1.0, 1.0) * np.log(3), rtol=1e-3)
    darker = torch.minimum(right, left).log()
    brightness = batch["image"][:, 1].mean((1, 2)).clamp(1e-3, 1)
    assert np.corrcoef(darker, brightness.log())[0, 1] > 0.7


def test_recolouring_is_the_render_of_the_new_albedo(tmp_path):
    row = {n: t[None].float() for n, t in made(tmp_path)._read(0).items()}
    settings = AugmentSettings(recoloured=1.0, repainted=1.0)
    new = pictures.recolour(row, settings, torch.Generator().manual_seed(0))
    dielectric, surface = 1 - row["metallic"], row["mask"] > 0
    rest = row["image"] - row["albedo"] * dielectric * row["shading"]
    expected = new["albedo"] * dielectric * row["shading"] + rest
    on = surface.expand(-1, 3, -1, -1)
    torch.testing.assert_close(new["image"][on], expected[on], atol=1e-4, rtol=1e-3)
    torch.testing.assert_close(new["image"][~on], row["image"][~on])
    metal = (row["metallic"] > 0.5).expand(-1, 3, -1, -1)
    torch.testing.assert_close(new["albedo"][metal], row["albedo"][metal])
    assert (new["albedo"] - row["albedo"])[on].abs().max() > 0.02 and new["albedo"].max() <= 1
    row["shading"] = torch.full_like(row["shading"], torch.nan)  # a picture whose shading is not known
    new = pictures.recolour(row, settings, torch.Generator().manual_seed(0))
    torch.testing.assert_close(new["albedo"], row["albedo"])
    torch.testing.assert_close(new["image"], row["image"])


def test_the_pool_of_a_card_holds_what_the_files_hold(tmp_path):
    """The pool is filled here in main memory."""
    source = made(tmp_path, 5)
    row = source._read(0)
    source._pool = {n: torch.empty((4, *t.shape), dtype=t.dtype) for n, t in row.items()}
    source.settings = AugmentSettings(capacity=4, readers=1)
    source._fill(source._places)
    assert source._kept == 4  # no more than there is room for
    for k in range(4):
        for name, tensor in source._read(k).items():
            torch.testing.assert_close(source._pool[name][k], tensor, equal_nan=True)
