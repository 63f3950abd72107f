"""Figures of environment maps against closed forms."""

import numpy as np
import pytest

from materialist_lab.metrics.envmaps import envmap_metrics


def test_values_above_one_count_in_the_linear_error_alone():
    figures = envmap_metrics(np.full((16, 32, 3), 2.0), np.full((16, 32, 3), 7.0))
    assert figures["envmap_mse"] == pytest.approx(25.0)
    assert figures["envmap_psnr"] == float("inf")
