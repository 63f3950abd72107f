"""Fixtures for all tests."""

import pytest


@pytest.fixture(scope="module")
def one_thread():
    """Small tensors: waking threads costs more than the work."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)
