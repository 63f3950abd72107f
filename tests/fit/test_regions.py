"""Regions of one albedo."""

import numpy as np
import torch

from materialist.fit.fields import MaterialRegions
from materialist.fit.regions import albedo_regions
from materialist.types import Camera


def test_a_region_is_joined_and_of_one_colour():
    """Red left and right of a white middle, in a picture with a row of sky: three regions, alike by their places."""
    height, width = 24, 36
    picture = np.full((height, width, 3), 0.8, np.float32)
    picture[:, :12] = picture[:, 24:] = (0.5, 0.02, 0.02)
    pixels = np.arange(width, height * width)
    region = albedo_regions(picture.reshape(-1, 3)[pixels], pixels, Camera(width, height))
    assert region.shape == pixels.shape and set(region) == {0, 1, 2}
    column = pixels % width
    for part in (column < 12, (column >= 12) & (column < 24), column >= 24):
        assert len(set(region[part])) == 1


def test_roughness_and_metallic_change_by_region_and_albedo_by_pixel():
    prior = 0.1 + 0.8 * torch.rand(6, 5, generator=torch.Generator().manual_seed(0))
    field = MaterialRegions(prior, torch.tensor([0, 0, 1, 1, 2, 2]))
    torch.testing.assert_close(field(), prior)
    (field() * torch.arange(1.0, 31).view(6, 5)).sum().backward()
    assert field.albedo.grad.shape == (6, 3) and field.change.grad.shape == (3, 2)
    torch.testing.assert_close(field.change.grad[1], torch.tensor([14.0 + 19, 15 + 20]))
    with torch.no_grad():
        field.change[1] = torch.tensor([0.05, 2.0])
    torch.testing.assert_close(field().detach()[2:4, 3], prior[2:4, 3] + 0.05)
    assert (field().detach()[2:4, 4] == 1).all()
    field.albedo.data[0] = 3
    with torch.no_grad():
        field.confine()
    assert (field.albedo[0] == 1).all()
