"""Is a package whole, and are two the same."""

from dataclasses import replace

import numpy as np
import pytest
from made_scene import make_scene

from materialist.batches.results import package_hash
from materialist.errors import SceneError
from materialist.io.package import save_scene
from materialist.types import FitReport


def test_the_hash_is_of_the_arrays_and_the_camera_and_not_of_the_time(tmp_path):
    scene = make_scene()
    rougher = np.nextafter(scene.materials.roughness, np.float32(2))
    others = {
        "same": {
            "report": FitReport((), {"total_seconds": 9.0}),
            "photo": replace(scene.photo, path="other.png"),
        },
        "roughness": {"materials": replace(scene.materials, roughness=rougher)},
        "depth": {"depth": scene.depth + np.float32(1)},
        "fov": {"camera": replace(scene.camera, fov=40.0)},
    }
    save_scene(scene, tmp_path / "a")
    for name, changes in others.items():
        save_scene(replace(scene, **changes), tmp_path / name)
        assert (package_hash(tmp_path / name) == package_hash(tmp_path / "a")) == (
            name == "same"
        ), name


def test_a_package_that_is_not_whole_has_no_hash(tmp_path):
    save_scene(make_scene(), tmp_path / "a")
    (tmp_path / "a/scene.json").unlink()
    with pytest.raises(SceneError, match="no whole scene package"):
        package_hash(tmp_path / "a")
