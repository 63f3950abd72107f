"""Views of captured meshes, for the figures."""

import numpy as np
import pytest
import trimesh

from materialist.errors import InputError
from materialist.predict.refraction.crop import MASK
from materialist.procedural.thickness.errors import of_meshes


def test_views_of_a_ball_have_the_chords_of_a_ball(tmp_path):
    (tmp_path / "deeper").mkdir()
    trimesh.creation.icosphere(3, 0.7).export(tmp_path / "deeper" / "ball.ply")
    found = of_meshes(tmp_path, views=2)["ball"]
    assert found["maps"].shape[0] == found["target"].shape[0] == 2 and not found["hollow"].any()
    inside = (found["maps"][:, MASK] > 0.5) & (found["target"][:, 0] > 0)
    # Mean over greatest chord of a ball seen from afar is 2 / 3, and stretching keeps it.
    for chord, seen in zip(found["target"][:, 0].astype(np.float64), inside, strict=True):
        assert chord[seen].mean() / chord[seen].max() == pytest.approx(2 / 3, rel=0.05)


def test_a_folder_without_meshes_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no \.ply"):
        of_meshes(tmp_path)
