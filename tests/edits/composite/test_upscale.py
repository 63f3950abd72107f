"""The hook for a super-resolution of the plain rendering."""

import numpy as np
import pytest
from edit_scenes import rendered_scene

from materialist.edits.composite.composite import composite
from materialist.edits.light.relight import relight
from materialist.errors import InputError


def test_the_plain_rendering_goes_through_the_hook():
    scene = rendered_scene(native=2)
    edited = relight(scene, ambient=0.5)
    double = lambda picture, size: np.kron(picture, np.ones((2, 2, 1))) - (size[0] == 0)  # noqa: E731
    plain = composite(scene, edited, spp=4, full_render=True)
    large = composite(scene, edited, spp=4, full_render=True, upscale=double)
    np.testing.assert_allclose(large, np.kron(plain, np.ones((2, 2, 1))), rtol=1e-6)


def test_a_hook_that_does_not_fit_is_told():
    scene = rendered_scene(native=2)
    edited = relight(scene, ambient=0.5)
    with pytest.raises(InputError, match="full_render"):
        composite(scene, edited, spp=4, upscale=lambda picture, size: picture)
    with pytest.raises(InputError, match="upscale gave"):
        composite(scene, edited, spp=4, full_render=True, upscale=lambda picture, size: picture)
