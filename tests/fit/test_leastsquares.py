"""The light of least squares against a slow solver, and against a light that is known."""

from dataclasses import replace

import numpy as np
import torch

from materialist.fit.leastsquares import explained, nonnegative
from materialist.fit.settings import DEFAULT


def test_the_light_is_that_of_nonnegative_least_squares():
    from scipy.optimize import nnls

    rng = np.random.default_rng(0)
    matrix = rng.random((3, 60, 12)).astype(np.float32)
    truth = np.maximum(rng.normal(0.3, 1, (3, 12)), 0)
    target = np.einsum("cqt,ct->cq", matrix, truth) + 0.05 * rng.normal(size=(3, 60))
    found = torch.full((3, 12), 0.5)
    for _ in range(60):
        found = nonnegative(torch.from_numpy(matrix), torch.from_numpy(target.astype(np.float32)), found)
    for c in range(3):
        best, _ = nnls(matrix[c].astype(float), target[c])
        np.testing.assert_allclose(found[c], best, atol=0.03)


def test_a_photo_of_a_light_is_explained_by_it():
    rng = np.random.default_rng(1)
    matrix = torch.from_numpy(rng.random((3, 200, 16), np.float32) / 16)
    rest = torch.full((200, 3), 0.05)
    light = torch.from_numpy(rng.random((3, 16), np.float32))
    photo = torch.einsum("cqt,ct->qc", matrix, light) + rest
    error, found = explained(matrix, rest, photo, replace(DEFAULT.light, clipped=False))
    assert error < 0.01 and found.min() >= 0
    wrong, _ = explained(matrix, rest, photo.flip(0), replace(DEFAULT.light, clipped=False))
    assert wrong > 3 * error
    # A clipped channel is no error where the rendering outshines it.
    clipped = photo.clone()
    clipped[:50] = 1.0
    assert explained(matrix, rest, clipped, DEFAULT.light)[0] > error
    bright = explained(matrix * 40, rest, torch.ones_like(photo), DEFAULT.light)[0]
    assert bright < 1e-3
