"""What is said of composites that hardly differ from their photo."""

import numpy as np
from edit_scenes import flat_scene

from materialist.edits.core.notes import effect_notes
from materialist.edits.light.relight import relight
from materialist.edits.material.material import edit


def test_a_light_without_effect_is_named_and_nothing_else():
    scene = flat_scene()
    dimmed, photo = relight(scene, ambient=0.5), scene.photo.original
    (note,) = effect_notes(scene, dimmed, photo * np.float32(0.99))
    assert "of 255 levels" in note and "lamp" in note
    assert effect_notes(scene, dimmed, photo * np.float32(0.5)) == []
    painted = edit(scene, np.ones(scene.depth.shape, bool), hue=120)
    assert effect_notes(scene, painted, photo) == []
