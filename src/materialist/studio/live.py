"""Pictures of a scene while a slider moves: `edit.preview.Preview` behind the threads that may use it."""

from __future__ import annotations

import json
from collections import OrderedDict
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from materialist.edits.recipe import Step, apply
from materialist.errors import InputError
from materialist.studio import glass
from materialist.studio.ghost import glazed, with_bodies, with_pane
from materialist.studio.stack import summary
from materialist.types import Array, Scene


def _calm() -> None:
    """Arrays of one picture are too small to share out: torch's helpers would mostly wait, and wait busily."""
    import torch

    torch.set_num_threads(1)


_THREAD = ThreadPoolExecutor(1, thread_name_prefix="live", initializer=_calm)
"""The one thread that traces and shades: the renderer's variant belongs to a thread, and so do torch's helpers."""
LIVE = ("edit", "relight")
"""Kinds of steps that the preview shades; the others are sketched."""
_KEPT = 24
"""Edited scenes that are kept: moving the last of several steps must not replay those before."""


class Live:
    """A fitted scene, its preview (which takes seconds to build), and the edited scenes of late."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self._edited: OrderedDict[str, Scene] = OrderedDict()
        self._panes: OrderedDict[str, tuple[Array, glass.Tint]] = OrderedDict()
        self._preview: Future[Any] = _THREAD.submit(_build, scene)

    @property
    def ready(self) -> bool:
        return self._preview.done()

    def wait(self) -> None:
        """Until the preview is there. Raises what went wrong with it."""
        self._preview.result()

    def edited(self, steps: tuple[Step, ...]) -> Scene:
        """The scene after the steps, glass left out: its body takes long, and another process makes it.

        Raises InputError, for values of glass that cannot be as well.
        """
        for step in steps:
            if glass.traced(step):
                self._glass(step)
        steps = tuple(step for step in steps if not glass.traced(step))
        known, start = self.scene, 0
        for count in range(len(steps), 0, -1):
            hit = self._edited.get(_key(steps[:count]))
            if hit is not None:
                known, start = hit, count
                break
        for count in range(start + 1, len(steps) + 1):
            known = _after(self.scene, known, steps[count - 1])
            self._edited[_key(steps[:count])] = known
        while len(self._edited) > _KEPT:
            self._edited.popitem(last=False)
        return known

    def picture(self, steps: tuple[Step, ...], tracer: glass.Tracer | None = None) -> Array:
        """[H, W, 3] float32 linear: the edits in the photo at working size. Waits for the preview.

        Glass is what the tracer has of it, else a sketch.
        """
        if not steps:
            return self.scene.photo.linear
        preview, edited = self._preview.result(), self.edited(steps)
        known = [(step, tracer.pane(step) if tracer else None) for step in steps if glass.traced(step)]
        shaded = edited
        if edited.geometry is not self.scene.geometry:  # the cache knows nothing of what was taken away
            shaded = self.edited(tuple(step for step in steps if step.kind in LIVE))
        picture = _THREAD.submit(preview.picture, shaded, quick=True).result()
        if edited.photo is not self.scene.photo:
            filled = (edited.photo.linear != self.scene.photo.linear).any(-1, keepdims=True)
            picture = np.where(filled, edited.photo.linear, picture)
        for step, pane in known:
            if pane is None:
                picture = with_pane(picture, *self._glass(step))
            else:
                picture = glazed(picture, pane.box, pane.picture, pane.filled)
        if edited.bodies:
            picture = with_bodies(picture, edited)
        for _, pane in known:
            if pane is not None:
                picture = glazed(picture, pane.box, pane.picture, pane.share)
        return picture

    def close(self) -> None:
        """Give the memory back."""
        self._preview.cancel()
        self._preview = Future()
        self._edited.clear()
        self._panes.clear()

    def _glass(self, step: Step) -> tuple[Array, glass.Tint]:
        """Region [H, W] bool and tint of a glass step. Raises InputError where it cannot be."""
        key = _key((step,))
        if key not in self._panes:
            self._panes[key] = glass.checked(self.scene, step)
            while len(self._panes) > _KEPT:
                self._panes.popitem(last=False)
        return self._panes[key]


def _after(scene: Scene, edited: Scene, step: Step) -> Scene:
    """The scene `edited` of `scene` after one more step; an error names it as the list does."""
    try:
        return apply(scene, [step], onto=edited)
    except InputError as error:
        reason = str(error).removeprefix(f"Step 1 ({step.kind}): ").replace(f"{step.folder}/", "")
        raise InputError(f"'{summary(step)}' cannot be applied. {reason}") from error


def _build(scene: Scene) -> Any:
    from materialist.edits.preview import Preview

    return Preview(scene)


def _key(steps: tuple[Step, ...]) -> str:
    return json.dumps([[step.kind, step.options, str(step.folder)] for step in steps], default=str)
