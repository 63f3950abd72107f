"""Batches of pictures keep labels, rays, light and picture true to each other."""

import made_samples
import numpy as np
import torch
from torch.utils.data import default_collate

from materialist_lab.data.samples import SampleFolder
from materialist_lab.train import pictures
from materialist_lab.train.pictures import AugmentSettings

SIZE = 64


def stored(folder, count):
    """A batch of that many samples of a set, each as often as the next."""
    source = SampleFolder(folder)
    return default_collate([pictures.stored(source.read(k % len(source))) for k in range(count)])


def varied(folder, count, seed):
    return pictures.varied(
        stored(folder, count), 32, AugmentSettings(), torch.Generator().manual_seed(seed)
    )


def test_crops_and_mirrors_keep_the_plane(tmp_path):
    """The samples show the plane n . p = -1.2; mirrored ones show its mirror image."""
    batch = varied(made_samples.write_set(tmp_path, 3, height=SIZE, width=SIZE), 16, seed=0)
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
    batch = varied(folder, 32, seed=2)
    mirrored = batch["image"][..., :8].mean((1, 2, 3)) > batch["image"][..., -8:].mean((1, 2, 3))
    assert mirrored.any() and not mirrored.all()
    right = batch["light"][:, 1, 8, 20]
    left = batch["light"][:, 1, 8, 4]
    np.testing.assert_allclose(
        (right / left).log(), torch.where(mirrored, -1.0, 1.0) * np.log(3), rtol=1e-3
    )
    darker = torch.minimum(right, left).log()
    brightness = batch["image"][:, 1].mean((1, 2)).clamp(1e-3, 1)
    assert np.corrcoef(darker, brightness.log())[0, 1] > 0.7


def test_recolouring_is_the_render_of_the_new_albedo(tmp_path):
    row = {
        n: t.float()
        for n, t in stored(made_samples.write_set(tmp_path, 1, height=SIZE, width=SIZE), 1).items()
    }
    settings = AugmentSettings(recoloured=1.0, repainted=1.0)
    new = pictures.recolour(row, settings, torch.Generator().manual_seed(0))
    dielectric = 1 - row["metallic"]
    surface = row["mask"] > 0
    rest = row["image"] - row["albedo"] * dielectric * row["shading"]
    expected = new["albedo"] * dielectric * row["shading"] + rest
    on = surface.expand(-1, 3, -1, -1)
    torch.testing.assert_close(new["image"][on], expected[on], atol=1e-4, rtol=1e-3)
    torch.testing.assert_close(new["image"][~on], row["image"][~on])
    metal = (row["metallic"] > 0.5).expand(-1, 3, -1, -1)
    torch.testing.assert_close(new["albedo"][metal], row["albedo"][metal])
    assert (new["albedo"] - row["albedo"])[on].abs().max() > 0.02 and new["albedo"].max() <= 1
    row["shading"] = torch.full_like(
        row["shading"], torch.nan
    )  # a picture whose shading is not known
    new = pictures.recolour(row, settings, torch.Generator().manual_seed(0))
    torch.testing.assert_close(new["albedo"], row["albedo"])
    torch.testing.assert_close(new["image"], row["image"])
