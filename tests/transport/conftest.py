"""The variant is chosen before any test module imports Dr.Jit."""

import pytest

from materialist.render.variant import setup

setup("cpu")


@pytest.fixture(scope="package", autouse=True)
def one_thread():
    """Small tensors: waking threads costs more than the work."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)
