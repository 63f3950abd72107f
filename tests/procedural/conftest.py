"""Samples that several tests share: rendering is the costly part."""

import pytest


@pytest.fixture(scope="session")
def mitsuba():
    """Mitsuba with the CPU variant chosen."""
    from materialist.render.variant import setup

    return setup("cpu")


@pytest.fixture(scope="session")
def sample(mitsuba):
    """A small sample: scene 0 (a table top under the sky), not square."""
    from materialist.procedural.synthetic import make_sample

    return make_sample(0, 0, 0, size=(40, 56), seed=0, spp=64)
