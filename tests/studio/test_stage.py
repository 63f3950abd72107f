"""Words for the page, and the tasks of the worker."""

from dataclasses import replace

import numpy as np
from studio_scenes import package, room

from materialist.edits.recipe import read_recipe
from materialist.studio import stage, tasks


def test_the_report_is_plain_and_harmless():
    scene = replace(room(), report=replace(room().report, warnings=("<img src=x> [a](b)",)))
    text = stage.report(scene)
    assert "31.5 dB from the photo" in text and "40.0°" in text and "&lt;img src=x> &#91;a](b)" in text
    assert all(p.dtype == np.uint8 and p.ndim == 3 for p, _ in stage.maps(room())) and len(stage.maps(room())) == 8


def test_taking_away(tmp_path):
    told = lambda stage, done, total: None  # noqa: E731
    scene = package(tmp_path)
    (tmp_path / "edits.yaml").write_text("- edit: {box: [12, 12, 40, 36], hue: 40}\n")
    tasks.take(told, str(scene), tuple(read_recipe(tmp_path / "edits.yaml")), str(tmp_path / "a.zip"), "glb")
    tasks.take(told, str(scene), (), str(tmp_path / "a.html"), "html")
    tasks.mesh(told, str(scene), str(tmp_path / "a.glb"))
    import zipfile

    names = zipfile.ZipFile(tmp_path / "a.zip").namelist()
    assert "a/scene.glb" in names and "a/scene.light.hdr" in names
    assert (tmp_path / "a.html").stat().st_size > 10_000 and (tmp_path / "a.glb").read_bytes()[:4] == b"glTF"
    assert not list(tmp_path.glob(".partial*"))
