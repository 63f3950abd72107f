"""The joint filter: it smooths along a surface and nowhere else."""

import numpy as np
import torch
from transport_scenes import furnished_room, windowed_sky

from materialist.fit.engine import TransportEngine
from materialist.transport.cache import ROUGHNESS_LEVELS, CacheSettings, Tables
from materialist.transport.filter import Guide, filter_tables, joint_filter

H = 12
W = 10


def flat_guide() -> Guide:
    """A plane that faces the camera, a pixel one unit wide."""
    ys, xs = np.indices((H, W), np.float32)
    position = np.stack([xs, -ys, np.full((H, W), -5, np.float32)], -1)
    return Guide(position, np.tile(np.float32([0, 0, 1]), (H, W, 1)), np.ones((H, W), np.float32))


def noise(channels: int = 2):
    return torch.rand(H, W, channels, generator=torch.Generator().manual_seed(0))


def test_plane_gets_the_plain_box_average():
    """Inside, the filter equals a 5 x 5 average with half weight on the rim."""
    values = noise(1)
    tap = np.array([0.5, 1, 1, 1, 0.5]) / 4
    expected = np.zeros((H, W))
    for i in range(2, H - 2):
        for j in range(2, W - 2):
            expected[i, j] = (
                values[i - 2 : i + 3, j - 2 : j + 3, 0].numpy() * np.outer(tap, tap)
            ).sum()
    filtered = joint_filter(values, flat_guide())[..., 0].numpy()
    np.testing.assert_allclose(filtered[2:-2, 2:-2], expected[2:-2, 2:-2], rtol=1e-5)


def test_nothing_crosses_a_step_in_depth():
    guide = flat_guide()
    guide.position[:, 5:, 2] -= 40
    values = torch.zeros(H, W, 1)
    values[:, 5:] = 1
    torch.testing.assert_close(joint_filter(values, guide), values)


def test_sharp_levels_are_left_alone_and_noise_falls():
    """Filtered tables come closer to tables with sixteen times the samples."""
    camera, geometry, _ = furnished_room(64)
    black = np.zeros((camera.height, camera.width, 3), np.float32)
    engines = [
        TransportEngine(geometry, camera, black, cache=CacheSettings(64 * k, 8 * k))
        for k in (1, 16)
    ]
    envmap = windowed_sky()
    raw, reference = (e.cache.gather(envmap, None) for e in engines)
    smooth = filter_tables(engines[0].cache, raw, engines[0].guide)
    assert isinstance(smooth, Tables)
    for k, level in enumerate(ROUGHNESS_LEVELS):
        assert smooth.specular[k].equal(raw.specular[k]) == (level < 0.2)

    def error(t):
        return float((t.diffuse[:, :3] - reference.diffuse[:, :3]).square().median())

    assert error(smooth) < 0.1 * error(raw)
