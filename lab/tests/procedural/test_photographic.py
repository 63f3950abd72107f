"""Photos of pictures: values of a photo, gains that are told."""

import numpy as np
import torch

from materialist_lab.procedural import photographic


def test_development_keeps_a_photo_a_photo():
    """Values in [0, 1], and gains that tell what the picture was multiplied by."""
    image = torch.full((64, 3, 32, 32), 0.2)
    photo, gains = photographic.developed(image, torch.Generator().manual_seed(0))
    assert photo.min() >= 0 and photo.max() <= 1
    brightness = photo.mean((1, 2, 3)).log()
    gain = gains.mean((1, 2, 3)).log()
    assert np.corrcoef(brightness, gain)[0, 1] > 0.5
    again, _ = photographic.developed(image, torch.Generator().manual_seed(0))
    torch.testing.assert_close(again, photo)


def test_a_picture_of_any_size_is_a_photo_of_its_size():
    picture = np.kron(np.random.default_rng(0).random((5, 5, 3)), np.ones((10, 10, 1)))[:37]
    for seed in range(8):
        photo, gains = photographic.photographic(picture, np.random.default_rng(seed))
        again, _ = photographic.photographic(picture, np.random.default_rng(seed))
        assert photo.shape == picture.shape and gains.shape == (3,)
        np.testing.assert_array_equal(photo, again)
        assert np.corrcoef(photo.ravel(), picture.ravel())[0, 1] > 0.8
