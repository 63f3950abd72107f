"""MobileSAM's masks of known shapes."""

import numpy as np
import pytest

from materialist.predict.sam import masks as sam


def picture(size=(120, 160)):
    """A shaded red disc with a white dot on grey, [H, W, 3] sRGB; the masks of disc and dot."""
    rows, columns = np.indices(size)
    disc = np.hypot(rows - 60, columns - 60) < 32
    dot = np.hypot(rows - 55, columns - 52) < 8
    shade = (1.1 - columns / 300)[..., None]
    rgb = np.where(disc[..., None], [0.75, 0.2, 0.15], [0.5, 0.5, 0.48]) * shade
    rgb = np.where(dot[..., None], 0.95, rgb)
    return rgb.astype(np.float32), disc, dot


def overlap(mask, other):
    return (mask & other).sum() / (mask | other).sum()


def test_a_click_has_a_mask_of_the_part_and_one_of_the_whole():
    rgb, disc, dot = picture()
    logits, expected = sam.masks(rgb, [(52, 55)])
    assert logits.shape == (3, 120, 160) and expected.shape == (3,)
    assert max(overlap(mask > 0, dot) for mask in logits) > 0.85
    assert max(overlap(mask > 0, disc) for mask in logits) > 0.9


@pytest.mark.parametrize(
    "where", [{"clicks": [(75, 70)]}, {"clicks": [(75, 70), (45, 75)]}, {"box": (28, 28, 92, 92)}]
)
def test_the_best_mask_is_the_disc(where):
    rgb, disc, _ = picture()
    logits, expected = sam.masks(rgb, **where)
    assert overlap(logits[expected.argmax()] > 0, disc) > 0.9


def test_a_photo_is_encoded_once(monkeypatch):
    rgb, _, _ = picture()
    first = sam.embedding(rgb)
    monkeypatch.setattr(sam, "run", lambda path, _: pytest.fail(f"{path.name} ran again"))
    assert sam.embedding(rgb) is first


@pytest.mark.parametrize("size", [(40, 300), (300, 40), (9, 9)])
def test_photos_of_any_shape(size, monkeypatch):
    """The encoder, which takes seconds, reads the same square of all of them."""

    def without_encoder(path, inputs, **options):
        if path != sam.ENCODER:
            return run(path, inputs, **options)
        assert inputs["picture"].shape == (1, 3, sam.SIDE, sam.SIDE)
        assert np.isfinite(inputs["picture"]).all()
        return [np.zeros((1, 256, 64, 64), np.float32)]

    run = sam.run
    monkeypatch.setattr(sam, "run", without_encoder)
    rgb = np.random.default_rng(0).random((*size, 3), np.float32)
    logits, _ = sam.masks(rgb, [(size[1] - 1, size[0] - 1)])
    assert logits.shape == (3, *size) and np.isfinite(logits).all()
