"""What a removal leaves to the composite: shade goes on under the rim of a body."""

from dataclasses import replace

import numpy as np
from edit_scenes import rendered_scene


def test_shade_goes_on_under_the_rim_of_a_body_where_a_replaced_surface_ends():
    """The last pixel of what was replaced lies under the foot of a body, and has none of its kind beside it."""
    from materialist.edits.composite.into_photo import into_photo
    from materialist.edits.composite.layers import Layers
    from materialist.edits.composite.native_layer import NativeLayer

    photo = rendered_scene(4).photo
    shape = photo.linear.shape[:2]
    grey = replace(photo, linear=np.full_like(photo.linear, 0.6), original=np.full_like(photo.original, 0.6))
    changed, inside, everywhere = np.zeros(shape, bool), np.zeros(shape, np.float32), np.ones(shape, bool)
    changed[:21] = True
    inside[10:20, 14:34] = 1
    inside[20, 14:34] = 0.25
    changed[20, :14] = changed[20, 34:] = False
    share = np.kron(inside >= 1, np.ones((4, 4))).astype(np.float32)
    base = np.full_like(grey.linear, 0.6)
    edited = np.where(inside[..., None] > 0, 5, 0.3).astype(np.float32)  # all in shade, but for the body
    layers = Layers(base, edited, everywhere, changed, native=NativeLayer(inside, share, 0 * grey.original))
    out = into_photo(grey, layers)
    np.testing.assert_allclose(out[80:84, 64:128], 0.3, atol=0.02)
