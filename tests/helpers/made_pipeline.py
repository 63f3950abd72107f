"""A stand-in for the pipeline, so that the command line is tested without minutes of fitting."""

from dataclasses import replace
from typing import Any

import numpy as np
from made_scene import make_mesh, make_scene

import materialist
from materialist.types import Geometry, Photo, Scene


def scene_of(photo: Photo) -> Scene:
    """A made-up scene of the photo's size."""
    shape = photo.linear.shape[:2]
    scene = make_scene(*shape)
    mesh = make_mesh(scene.depth, scene.normal, photo.camera)
    return replace(
        scene,
        photo=photo,
        camera=photo.camera,
        geometry=Geometry(mesh, scene.geometry.plane_label),
        rerender=photo.linear,
    )


def install(monkeypatch: Any, failure: BaseException | None = None) -> list[dict[str, Any]]:
    """Put the stand-in in the pipeline's place; returns the list of calls it will see."""
    calls: list[dict[str, Any]] = []

    def invert(photo: Photo, options: Any, *, progress: Any, on_stage: Any, stop: Any) -> Scene:
        calls.append({"photo": photo, "options": options, "progress": progress})
        for step in range(3):
            progress("light", step + 1, 3)
            assert not stop()
        if failure is not None:
            raise failure
        return scene_of(photo)

    def render_scene(scene: Scene, **options: Any) -> np.ndarray:
        calls.append({"scene": scene, **options})
        return scene.rerender

    monkeypatch.setattr(materialist, "invert", invert)
    monkeypatch.setattr(materialist, "render_scene", render_scene)
    return calls
