"""Data for the tests of training, which run on one thread."""

import made_samples
import pytest


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """A set of four tiny labelled pictures; tests only read it."""
    return made_samples.write_set(tmp_path_factory.mktemp("data"), 4)


@pytest.fixture(scope="module", autouse=True)
def threads(one_thread):
    """Small networks."""
