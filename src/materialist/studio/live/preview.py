"""Pictures of a scene while a slider moves: `edits.preview.Preview` on its thread, and sketches of what it lacks.

It lives in a process of its own, which `studio.live.process` starts and asks.
"""

import threading
import time
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist.edits.core.notes import warned
from materialist.edits.core.operation import PreviewMode
from materialist.edits.core.renderer import is_relit
from materialist.edits.core.surfaces import KEY
from materialist.edits.material.normals import with_metal_normals
from materialist.edits.recipe import Step, apply, options_of, region_of
from materialist.edits.remove.filling import remembered
from materialist.errors import InputError
from materialist.geometry.membrane import nearest
from materialist.io.package import with_rerender
from materialist.jobs.limited import Limits, run_limited
from materialist.option_kinds import Colour
from materialist.studio import SETTINGS, tasks
from materialist.studio.edit_list import is_shaded, kept, key_of, step_summary
from materialist.studio.live import glass
from materialist.studio.live.sketch import draw_bodies, light_lamps
from materialist.types import Array, Scene

REACH = 0.01
"""Share of the longer side over which light is compared around a filling (by eye)."""
FLOOR = 0.004
"""Radiance, about one level of 8 bits, by which a ratio of dark pixels stays finite."""
MOST = 8.0
"""Most by which a filling is brightened."""


def _use_one_thread() -> None:
    """Arrays of one picture are small: more threads of torch would mostly wait, and wait busily."""
    import torch

    torch.set_num_threads(1)


_THREAD = ThreadPoolExecutor(1, thread_name_prefix="live", initializer=_use_one_thread)
"""The one thread that traces and shades: the renderer's variant belongs to a thread, and so do torch's helpers."""


class LivePreview:
    """A fitted scene, its preview (seconds to build, unless `file` has its tables), and the last edited scenes."""

    def __init__(self, scene: Scene, file: Path | None = None, package: Path | None = None):
        """package: where the scene lies; things then fall in a process of their own."""
        self.scene = scene
        self._package = package
        self._asked = float("-inf")
        """When a picture was last asked for, or there could be one, by the monotonic clock."""
        self.prepared = threading.Event()
        """Whether everything is there for fine pictures, also under another light."""
        self._kept: dict[str, Any] = {}
        """What steps make: scenes, and what a sketch needs of glass."""
        self._shaded: tuple[Scene, tuple[bool, bool], Array] | None = None
        """The last scene that was shaded, with which rays, and its picture."""
        self._preview: Future[Any] = _THREAD.submit(_build, scene, file)
        _THREAD.submit(self._prepare, self._preview)

    def _prepare(self, built: Future[Any]) -> None:
        """Get ready for another light part by part, while nobody moves a slider: a part takes longer than a picture."""
        if self._asked == float("-inf"):
            # First comes what a pointer needs (`views.look_ahead`).
            self._asked = time.monotonic()
        # Later, while somebody moves a slider; else the next part now.
        quiet = SETTINGS.quiet_seconds - (time.monotonic() - self._asked)
        if quiet > 0:
            later = threading.Timer(quiet, _THREAD.submit, (self._prepare, built))
            later.daemon = True
            later.start()
        elif built.exception() is None and built.result().prepare():
            _THREAD.submit(self._prepare, built)
        else:
            if built.exception() is None:
                from materialist.render.variant import give_back

                give_back()
            self.prepared.set()

    @property
    def ready(self) -> bool:
        return self._preview.done()

    @property
    def fine(self) -> bool:
        """Whether pictures have all their rays by now."""
        preview = self._preview
        built = preview.done() and preview.exception() is None
        return built and not preview.result().coarse

    def wait(self) -> None:
        """Wait for the preview. Raises the error of its building, if there was one."""
        self._preview.result()

    def take_rerender(self) -> None:
        """Take the re-rendering of the package, and its report, which an inversion has added since it was opened."""
        assert self._package is not None
        self.scene = with_rerender(self.scene, self._package)
        # What a request in flight still makes goes into the old one.
        self._kept = {}

    def edited(self, steps: tuple[Step, ...]) -> Scene:
        """The scene after the steps without glass, whose body another process builds.

        Raises InputError, also for glass with values out of range.
        """
        for step in steps:
            if glass.is_traced(step):
                self._glass(step)
        return self._after(tuple(step for step in steps if not glass.is_traced(step)))

    def _after(self, steps: tuple[Step, ...]) -> Scene:
        """The scene after the steps; the last scenes are kept, so moving the last step replays none before it."""
        # The longest list that starts alike and is kept; from there step by step.
        store = self._kept
        counts = range(len(steps), 0, -1)
        known = next((n for n in counts if key_of(steps[:n]) in store), 1)
        scene = self.scene
        for n in range(known, len(steps) + 1):
            make = partial(self._applied, scene, steps[:n])
            scene = kept(store, steps[:n], make, SETTINGS.scenes_kept)
        while len(store) > 1 and _bytes_of_bodies(store.values()) > SETTINGS.kept_bytes:
            del store[next(iter(store))]
        return scene

    def _applied(self, before: Scene, steps: tuple[Step, ...]) -> Scene:
        """The scene `before` with the last of the steps. Raises InputError with the step's summary."""
        step = steps[-1]
        try:
            is_slow = step.operation.preview is PreviewMode.SIMULATED
            if is_slow and not step.skipped and self._package is not None:
                return self._fallen(before, steps)
            # What a removal hides was filled by a job, into the folder of the edits.
            with remembered(step.folder):
                return apply(self.scene, [step], onto=before)
        except InputError as error:
            reason = str(error).removeprefix(f"Step 1 ({step.kind}): ")
            raise InputError(f"'{step_summary(step)}' cannot be applied. {reason}") from error

    def _fallen(self, before: Scene, steps: tuple[Step, ...]) -> Scene:
        """The scene `before` after the fall in the last step, simulated in a limited process: meshes are untrusted."""
        limits = Limits(SETTINGS.opening_memory, SETTINGS.fall_seconds)
        place = str(self._package)
        added = run_limited(tasks.fallen, limits, scene=place, steps=steps)
        # Only what the fall added crosses between the processes.
        edits = [*before.provenance.get("edits", []), *added["edits"]]
        after = replace(
            before,
            bodies=(*before.bodies, *added["bodies"]),
            provenance={**before.provenance, "edits": edits},
        )
        return warned(after, *added["warnings"])

    def _glass(self, step: Step) -> tuple[Array, Colour]:
        """Region [H, W] bool and tint of a glass step; builds nothing. Raises InputError where it cannot be."""

        def region_and_tint():
            return (region_of(self.scene, step), options_of(step).tint)

        return kept(self._kept, (step,), region_and_tint, SETTINGS.scenes_kept)

    def picture(
        self,
        steps: tuple[Step, ...],
        panes: glass.Panes,
        *,
        coarse: bool = False,
    ) -> Array:
        """[H, W, 3] float32 linear: the edits in the photo at working size. Waits for the preview.

        Glass is sketched where there is no pane of it yet.
        """
        if not steps:
            return self.scene.photo.linear
        shaded = self.shaded(steps, coarse=coarse)
        return self.laid_over(shaded, self.edited(steps), steps, panes)

    def shaded(self, steps: tuple[Step, ...], *, coarse: bool = False) -> Array:
        """[H, W, 3]: the surfaces of the photo after the steps, without what is laid over them."""
        preview = self._preview.result()
        self._asked = time.monotonic()
        edited = self.edited(steps)
        scene = self._surfaces(steps)
        # A thing or a lamp that moves changes nothing of them.
        known = self._shaded
        fine = (preview.coarse, coarse)
        if known is None or known[1] != fine or not _look_alike(known[0], scene):
            picture = _THREAD.submit(preview.picture, scene, coarse=coarse).result()
            known = self._shaded = (scene, fine, picture)
        picture = known[2]
        # --- What was taken away is filled as in the photo ---
        if edited.photo is not self.scene.photo:
            filled = self.filled(edited)
            fill = edited.photo.linear
            if is_relit(self.scene, scene):
                fill = lit_as_around(fill, picture, self.scene.photo.linear, filled)
            picture = np.where(filled[..., None], fill, picture)
        return picture

    def filled(self, edited: Scene) -> Array:
        """[H, W] bool: where the photo of an edited scene is filled in."""
        return (edited.photo.linear != self.scene.photo.linear).any(-1)

    def rows(
        self, steps: tuple[Step, ...], region: Array, metal: Array | None = None
    ) -> dict[str, Array]:
        """`Preview.rows` of the scene after the steps, with the normals of metal under a mask [H, W] bool."""
        preview = self._preview.result()
        self._asked = time.monotonic()
        scene = self._surfaces(steps)
        if metal is not None:
            scene = with_metal_normals(scene, metal)
        return _THREAD.submit(preview.rows, scene, region).result()

    def _surfaces(self, steps: tuple[Step, ...]) -> Scene:
        """The scene as it is shaded: the cache knows only the surfaces of the fit."""
        edited = self.edited(steps)
        if edited.geometry.mesh.vertices is self.scene.geometry.mesh.vertices:
            return edited
        return self.edited(tuple(step for step in steps if is_shaded(step)))

    def laid_over(
        self,
        picture: Array,
        edited: Scene,
        steps: tuple[Step, ...],
        panes: glass.Panes,
        *,
        lamps: bool = True,
    ) -> Array:
        """A picture [H, W, 3] with the lamps' light, glass and bodies of an edited scene, in which they are made.

        Where all glass has a pane it is a linear function of each pixel.
        """
        known = [(step, panes.get(glass.place(step))) for step in steps if glass.is_traced(step)]
        relit = bool(edited.lamps) or is_relit(self.scene, edited)
        # --- Lamps: their light without its shadows ---
        if edited.lamps and lamps:
            picture = light_lamps(picture, edited)
        # --- Glass: its ground first, then bodies, then the glass before them ---
        for step, pane in known:
            if pane is None:
                picture = sketch_glass(picture, *self._glass(step))
            else:
                ground = pane.picture
                if relit and pane.filled.any():
                    # By what is there, not by `picture`, of which this stays a linear function.
                    lit = self.shaded(steps)
                    lit = light_lamps(lit, edited) if edited.lamps else lit
                    ground = lit_as_around(ground, lit, self.scene.photo.linear, pane.filled)
                picture = lay_over(picture, ground, pane.filled)
        if edited.bodies:
            picture = draw_bodies(picture, edited)
        for _, pane in known:
            if pane is not None:
                picture = lay_over(picture, pane.picture, pane.share)
        return picture


def _look_alike(scene: Scene, other: Scene) -> bool:
    """Whether shading, which knows no bodies, makes the same picture of two edits of a scene."""
    maps = [(*vars(one.materials).values(), one.envmap, one.normal) for one in (scene, other)]
    return (
        bool(scene.lamps) == bool(other.lamps)
        and scene.provenance.get(KEY) == other.provenance.get(KEY)
        and all(one is two or np.array_equal(one, two) for one, two in zip(*maps, strict=True))
    )


def _build(scene: Scene, file: Path | None) -> Any:
    from materialist.edits.preview import Preview

    return Preview(scene, file)


def load_renderer(device: str) -> None:
    """Load what previews need for a device, on their thread."""
    _THREAD.submit(_load, device).result()


def _load(device: str) -> None:
    from materialist.edits.preview import load
    from materialist.render.variant import setup

    if device != "auto":
        setup(device)
    load()


def _bytes_of_bodies(kept_values: Iterable[Any]) -> int:
    """Bytes of the meshes of the bodies in edited scenes, each counted once; other values hold none."""
    scenes = [value for value in kept_values if isinstance(value, Scene)]
    bodies = {id(body): body for scene in scenes for body in scene.bodies}
    return sum(
        array.nbytes
        for body in bodies.values()
        for array in vars(body).values()
        if isinstance(array, np.ndarray)
    )


def sketch_glass(picture: Array, region: Array, tint: Colour) -> Array:
    """[H, W, 3] with the object under a region [H, W] bool blurred and tinted, until its glass is traced."""
    spread = 1 + int(1.5 * np.sqrt(region.sum()))  # pixels
    blurred = cv2.blur(picture, (spread, spread))
    return np.where(region[..., None], blurred * np.asarray(tint, np.float32), picture)


def lit_as_around(fill: Array, lit: Array, photo: Array, filled: Array) -> Array:
    """[H, W, 3] a filling, taken from the photo, as much brighter or darker as what lies around it has become.

    lit, photo: [H, W, 3] the picture under another light and the photo; filled: [H, W] bool, where they say nothing.
    """
    if filled.all():
        return fill
    around = ~filled
    sigma = REACH * max(filled.shape)
    now, before = (
        cv2.GaussianBlur(np.where(around[..., None], values, 0), (0, 0), sigma)
        for values in (lit, photo)
    )
    gain = np.clip((now + FLOOR) / (before + FLOOR), 0, MOST)[nearest(around)]
    return fill * cv2.GaussianBlur(gain, (0, 0), sigma)


def lay_over(picture: Array, piece: Array, share: Array) -> Array:
    """[H, W, 3] with another picture laid over it, by its share [H, W]."""
    return picture + share[..., None] * (piece - picture)
