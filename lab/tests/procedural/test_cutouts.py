"""Things cut out of photographs: what is used of a file, and where they lie in a picture."""

from dataclasses import replace

import made_cutouts
import numpy as np
import pytest
from PIL import Image

from materialist.errors import InputError
from materialist_lab.procedural import cutouts


def test_a_cut_out_has_no_margin_and_linear_colours(tmp_path):
    made_cutouts.write_disc(tmp_path / "disc.png")
    cutout = cutouts.load_cutout(tmp_path / "disc.png")
    assert cutout.shape == (60, 60, 4)
    np.testing.assert_allclose(cutout[30, 30], [0.7157, 0.01298, 0.00700, 1], rtol=0.01)
    assert cutout[0, 0, 3] == 0


def test_files_without_a_thing_are_passed_over(tmp_path):
    made_cutouts.write_disc(tmp_path / "small.png", size=40)
    Image.new("RGB", (90, 90), "red").save(tmp_path / "whole.png")
    Image.new("RGBA", (90, 90)).save(tmp_path / "empty.png")
    assert [cutouts.load_cutout(path) for path in cutouts.cutout_files(tmp_path)] == [None] * 3
    (tmp_path / "torn.png").write_bytes((tmp_path / "whole.png").read_bytes()[:60])
    with pytest.raises(InputError, match=r"torn\.png cannot be read"):
        cutouts.load_cutout(tmp_path / "torn.png")
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match=r"holds no \.png or \.webp"):
        cutouts.cutout_files(tmp_path / "none")


def test_the_picture_changes_where_the_thing_is(tmp_path, monkeypatch):
    """Without shadows, the map of things and the picture change in the same pixels, apart from soft edges."""
    monkeypatch.setattr(cutouts, "SETTINGS", replace(cutouts.SETTINGS, shadow=0.0))
    made_cutouts.write_disc(tmp_path / "disc.png")
    disc = cutouts.load_cutout(tmp_path / "disc.png")
    before = np.full((96, 128, 3), 0.2, np.float32)
    thing = np.full((96, 128), -3, np.int16)
    sizes = []
    for seed in range(20):
        after, labels = cutouts.paste(before, thing, [disc], np.random.default_rng(seed))
        new = labels > 0
        assert (
            set(np.unique(labels)) - {-3} <= set(range(1, cutouts.SETTINGS.max_cutouts + 1))
            and new.any()
        )
        np.testing.assert_array_equal(labels[~new], -3)
        changed = np.abs(after - before).max(-1) > 1e-3
        assert (new & ~changed).sum() == 0 and (changed & ~new).sum() < 0.4 * new.sum() + 40
        sizes.append(new.mean())
    assert np.all(before == 0.2) and np.all(thing == -3)
    assert max(sizes) > 4 * min(sizes)
