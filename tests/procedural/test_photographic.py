"""Photos of pictures: compression as a JPEG's, gains that are told."""

import cv2
import numpy as np
import pytest
import torch

from materialist.procedural import photographic


@pytest.mark.parametrize("quality", [60, 80, 95])
def test_compression_is_that_of_a_jpeg(quality):
    rng = np.random.default_rng(quality)
    smooth = cv2.GaussianBlur(rng.random((64, 64, 3), np.float32), (0, 0), 2)
    picture = (smooth - smooth.min()) / np.ptp(smooth)
    pixels = (picture * 255 + 0.5).astype(np.uint8)
    _, packed = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    jpeg = cv2.imdecode(packed, cv2.IMREAD_COLOR)[..., ::-1] / 255

    class Always(photographic._Draw):
        def chance(self, probability):
            return torch.ones(1, 1, 1, 1, dtype=torch.bool)

        def uniform(self, low=0.0, high=1.0, channels=1):
            return torch.full((1, 1, 1, 1), float(quality))

    tensor = torch.from_numpy(picture).permute(2, 0, 1)[None]
    ours = photographic._compressed(tensor, Always(1, tensor.device, torch.Generator()))[0].permute(1, 2, 0).numpy()
    assert np.abs(ours - jpeg).mean() < 0.5 * np.abs(jpeg - picture).mean()


def test_development_keeps_a_photo_a_photo():
    """Values in [0, 1], and gains that tell what the picture was multiplied by."""
    image = torch.full((64, 3, 32, 32), 0.2)
    photo, gains = photographic.developed(image, torch.Generator().manual_seed(0))
    assert photo.min() >= 0 and photo.max() <= 1
    brightness, gain = photo.mean((1, 2, 3)).log(), gains.mean((1, 2, 3)).log()
    assert np.corrcoef(brightness, gain)[0, 1] > 0.5
    again, _ = photographic.developed(image, torch.Generator().manual_seed(0))
    torch.testing.assert_close(again, photo)


def test_a_picture_of_any_size_is_a_photo_of_its_size():
    rng = np.random.default_rng(0)
    picture = rng.random((37, 50, 3), np.float32)
    photo, gains = photographic.photographic(picture, np.random.default_rng(1))
    again, _ = photographic.photographic(picture, np.random.default_rng(1))
    assert photo.shape == picture.shape and gains.shape == (3,)
    np.testing.assert_array_equal(photo, again)
    assert np.corrcoef(photo.ravel(), picture.ravel())[0, 1] > 0.8
