"""Is a package whole, and are two the same."""

from dataclasses import replace

import numpy as np
import pytest
from made_scene import make_scene

from materialist.batches.results import package_hash
from materialist.errors import SceneError
from materialist.io.package import save_scene
from materialist.types import FitReport


def test_the_hash_is_of_the_arrays_and_not_of_the_time(tmp_path):
    scene = make_scene()
    slower = replace(scene, report=FitReport((), {"total_seconds": 9.0}), photo=replace(scene.photo, path="other.png"))
    for name, one in (("a", scene), ("b", slower)):
        save_scene(one, tmp_path / name)
    assert package_hash(tmp_path / "a") == package_hash(tmp_path / "b")


@pytest.mark.parametrize("what", ["roughness", "depth", "fov"])
def test_any_array_and_the_camera_change_it(tmp_path, what):
    scene = make_scene()
    value = np.nextafter(scene.materials.roughness, np.float32(2))
    other = {
        "roughness": lambda: replace(scene, materials=replace(scene.materials, roughness=value)),
        "depth": lambda: replace(scene, depth=scene.depth + np.float32(1)),
        "fov": lambda: replace(scene, camera=replace(scene.camera, fov=40.0)),
    }[what]()
    save_scene(scene, tmp_path / "a")
    save_scene(other, tmp_path / "b")
    assert package_hash(tmp_path / "a") != package_hash(tmp_path / "b")


def test_a_package_that_is_not_whole_has_no_hash(tmp_path):
    save_scene(make_scene(), tmp_path / "a")
    (tmp_path / "a/scene.json").unlink()
    with pytest.raises(SceneError, match="no whole scene package"):
        package_hash(tmp_path / "a")
