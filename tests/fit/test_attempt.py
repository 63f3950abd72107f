"""`--completion auto`: what completion adds stays, unless the photo is matched clearly better without."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from materialist import metrics
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.fit import attempt
from materialist.fit.attempt import FULL, Attempt, Begun, Job
from materialist.fit.ends import Found
from materialist.geometry.ends import Ends
from materialist.types import Camera

PHOTO = np.full((8, 8, 3), 0.5, np.float32)
END = Ends((0.0, 0.0, 1.0), -3.0, -1.0, 1.0, -1.0, 1.0)


def picture_at(decibel: float) -> np.ndarray:
    """A rendering whose PSNR against PHOTO is about `decibel`."""
    return srgb_to_linear(linear_to_srgb(PHOTO) - np.float32(10 ** (-decibel / 20)))


def job(
    monkeypatch, results: dict[str, float], *, planes: bool = True, found: Found | None = None, trust: float = 1.0,
    first: dict[str, float] | None = None,
) -> tuple[Job, list[str]]:  # fmt: skip
    """A job whose attempts come to the given PSNR by completion, and the list of those finished.

    `found`: what the search for the ends of walls comes to. `first`: how near the first light comes, by completion.
    """
    finished: list[str] = []

    def begin(self, completion: str, ends=()) -> Begun:
        mesh = SimpleNamespace(face_plane=np.array([0 if planes else -1]))
        return Begun(completion, tuple(ends), SimpleNamespace(mesh=mesh), None, None, [], None)

    def finish(self, begun: Begun) -> Attempt:
        finished.append(begun.completion)
        picture = picture_at(results[begun.completion])
        stage = {"name": begun.completion, "prior_trust": trust}
        stages = (*begun.stages, stage) if first else (stage,)
        return Attempt(begun.completion, begun.ends, begun.geometry, None, None, picture, stages)

    def lit(self, begun: Begun) -> tuple[Begun, float]:
        begun.stages.append({"name": f"glance {begun.completion}"})
        return begun, (first or {FULL: 30.0})[begun.completion]

    monkeypatch.setattr(Job, "begin", begin)
    monkeypatch.setattr(Job, "lit", lit)
    monkeypatch.setattr(Job, "finish", finish)
    monkeypatch.setattr(attempt, "find_ends", lambda *_, **__: found)
    settings = SimpleNamespace(trust=0.08)
    rest = (None, settings, "transport", 16, 6.0, None, "default", 0, "cpu", 4, None, lambda *_: None)
    return Job(SimpleNamespace(linear=PHOTO, hdr=False, camera=Camera(8, 8, 40.0)), *rest), finished


def test_the_pictures_of_this_test_are_as_far_off_as_they_say():
    assert metrics.psnr(picture_at(25), PHOTO) == pytest.approx(25, abs=0.1)
    assert metrics.psnr(picture_at(35), PHOTO) == pytest.approx(35, abs=0.1)


@pytest.mark.parametrize(
    ("full", "none", "kept", "tried"),
    [
        (35, 45, FULL, [FULL]),
        (24, 35, "none", [FULL, "none"]),
        (24, 25, FULL, [FULL, "none"]),
        (24, 12, FULL, [FULL, "none"]),
    ],
)
def test_auto_leaves_completion_out_only_where_that_is_clearly_better(monkeypatch, full, none, kept, tried):
    task, made = job(monkeypatch, {FULL: full, "none": none})
    best, notes = task.best("auto")
    assert (best.completion, made) == (kept, tried)
    names = [stage["name"] for stage in best.stages]
    assert sorted(names) == sorted(tried) and names[-1] == kept, "what is told of the fit is told by its last stages"
    assert bool(notes) == (kept == "none")
    if notes:
        assert "dB" in notes[0] and f"--completion {FULL}" in notes[0]


@pytest.mark.parametrize(
    ("full", "none", "kept"),
    [(26, 40, FULL), (22, 24, "none"), (22, 22.5, FULL), (22, 12, FULL), (22, None, FULL), (None, 40, FULL)],
)
def test_the_first_light_tells_before_anything_else_is_fitted(monkeypatch, full, none, kept):
    task, made = job(monkeypatch, {FULL: 30, "none": 30}, first={FULL: full, "none": none})
    best, notes = task.best("auto")
    assert (best.completion, made) == (kept, [kept])
    looked = [f"glance {FULL}"] + ["glance none"] * (full is not None and full < 25)
    assert sorted(s["name"] for s in best.stages) == sorted(["walls", *looked, kept])
    assert bool(notes) == (kept == "none")
    if notes:
        assert f"({full:.1f} dB)" in notes[0] and f"({none:.1f} dB)" in notes[0]


@pytest.mark.parametrize("change", [{"engine": "path"}, {"strategy": "white-light-first"}])
def test_other_fits_have_no_first_light_to_look_at(monkeypatch, change):
    task, made = job(monkeypatch, {FULL: 30, "none": 30}, first={FULL: 10, "none": 24})
    assert replace(task, **change).best("auto")[0].completion == FULL and made == [FULL]


def test_without_planes_there_is_nothing_to_leave_out(monkeypatch):
    task, made = job(monkeypatch, {FULL: 20, "none": 40}, planes=False)
    assert task.best("auto")[0].completion == FULL and made == [FULL]


def test_with_a_prior_that_explains_the_photo_completion_stays(monkeypatch):
    task, made = job(monkeypatch, {FULL: 20, "none": 40}, trust=5.0)
    assert task.best("auto")[0].completion == FULL and made == [FULL]


def test_a_completion_that_was_asked_for_is_kept(monkeypatch):
    task, made = job(monkeypatch, {FULL: 20, "none": 40})
    best, notes = task.best(FULL)
    assert (best.completion, notes, made) == (FULL, (), [FULL])


@pytest.mark.parametrize("told", [True, False])
def test_walls_end_where_the_light_says_if_it_does(monkeypatch, told):
    task, made = job(monkeypatch, {FULL: 35}, found=Found((END,), 0.03, 0.05) if told else None)
    best, notes = task.best("auto")
    assert (best.completion, best.ends, made) == (FULL, (END,) if told else (), [FULL])
    assert bool(notes) == told
    if notes:
        assert "error 0.030, not 0.050" in notes[0] and f"--completion {FULL}" in notes[0]


def test_only_auto_asks_the_light(monkeypatch):
    task, _ = job(monkeypatch, {FULL: 35}, found=Found((END,), 0.03, 0.05))
    assert task.best(FULL)[0].ends == ()
