"""SAM 2 on the page: to be chosen where it is there, else shown with what is missing."""

import importlib.util

import numpy as np
from studio_scenes import room

from materialist.errors import WeightsError
from materialist.studio import selection
from materialist.studio.selection import Selection, sam_missing


def test_what_is_missing_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert "materialist[hub]" in sam_missing()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())

    def nowhere(where):
        raise WeightsError("not here")

    monkeypatch.setattr("materialist.edits.select.sam.folder_of", nowhere)
    assert "materialist models download sam2" in sam_missing()
    monkeypatch.setattr("materialist.edits.select.sam.folder_of", lambda where: tmp_path)
    assert sam_missing() is None


def test_it_is_asked_for_clicks_and_boxes_and_not_for_the_brush(monkeypatch):
    asked = []

    def select(scene, *, method="network", **where):
        asked.append(method)
        return np.ones(scene.depth.shape, bool)

    monkeypatch.setattr(selection, "select", select)
    Selection().click(room(), 5, 5, "new", "sam2")
    Selection().box(room(), [1, 1, 9, 9], "new", "sam2")
    Selection().brush(room(), [[1, 1]], 3, "new")
    assert asked == ["sam2", "sam2", "network"]
