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


@pytest.fixture(scope="session")
def mitsuba():
    """Mitsuba with the CPU variant chosen."""
    from materialist.render.variant import setup

    return setup("cpu")


@pytest.fixture(scope="session")
def sample(mitsuba):
    """A small synthetic sample: scene 0 (a table top under the sky), not square."""
    from materialist.procedural.synthetic import make_sample

    return make_sample(0, 0, 0, size=(40, 56), seed=0, spp=64)
