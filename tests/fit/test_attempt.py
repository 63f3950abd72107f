"""`--completion auto`: what completion adds stays, unless the photo is matched clearly better without."""

from types import SimpleNamespace

import numpy as np
import pytest

from materialist import metrics
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.fit.attempt import FLOORS, FULL, Attempt, Begun, Job
from materialist.types import Camera

PHOTO = np.full((8, 8, 3), 0.5, np.float32)


def picture_at(decibel: float) -> np.ndarray:
    """A rendering whose PSNR against PHOTO is about `decibel`."""
    return srgb_to_linear(linear_to_srgb(PHOTO) - np.float32(10 ** (-decibel / 20)))


def job(
    monkeypatch,
    results: dict[str, float],
    *,
    planes: bool = True,
    walls: bool = False,
    errors: tuple = (0.1, 0.1),
    trust: float = 1.0,
) -> tuple[Job, list[str]]:
    """A job whose attempts come to the given PSNR by completion, and the list of those finished.

    `errors`: what the prior leaves unexplained with and without walls.
    """
    finished: list[str] = []

    def begin(self, completion: str) -> Begun:
        normals = np.array([[0, 0.0 if walls and completion == FULL else 1.0, 0]] * 3)
        faces = np.array([[0, 1, 2]])
        vertices = np.array([[9.0, 0, -1]] * 3)  # beside the picture
        mesh = SimpleNamespace(
            face_plane=np.array([0 if planes else -1]), faces=faces, normals=normals, vertices=vertices
        )
        fit = SimpleNamespace(prior_error=lambda: errors[completion != FULL])
        return Begun(completion, SimpleNamespace(mesh=mesh), fit, None, [])

    def finish(self, begun: Begun) -> Attempt:
        finished.append(begun.completion)
        picture = picture_at(results[begun.completion])
        return Attempt(
            begun.completion, begun.geometry, None, None, picture, ({"name": begun.completion, "prior_trust": trust},)
        )

    monkeypatch.setattr(Job, "begin", begin)
    monkeypatch.setattr(Job, "finish", finish)
    settings = SimpleNamespace(trust=0.08)
    rest = (None, settings, "transport", 16, 6.0, None, "default", 0, "cpu", 4, None, lambda *_: None)
    return Job(SimpleNamespace(linear=PHOTO, camera=Camera(8, 8, 40.0)), *rest), finished


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
    assert [stage["name"] for stage in best.stages] == tried
    assert bool(notes) == (kept == "none")
    if notes:
        assert "dB" in notes[0] and f"--completion {FULL}" in notes[0]


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


@pytest.mark.parametrize(("errors", "kept"), [((0.05, 0.03), FLOORS), ((0.05, 0.0495), FULL), ((0.03, 0.05), FULL)])
def test_walls_stay_unless_the_prior_explains_the_photo_better_without(monkeypatch, errors, kept):
    task, made = job(monkeypatch, {FULL: 35, FLOORS: 35}, walls=True, errors=errors)
    best, notes = task.best("auto")
    assert (best.completion, made) == (kept, [kept])
    assert bool(notes) == (kept == FLOORS)
    if notes:
        assert "error 0.030, not 0.050" in notes[0]


def test_only_walls_are_asked_about(monkeypatch):
    task, made = job(monkeypatch, {FULL: 35, FLOORS: 35}, errors=(0.05, 0.01))
    assert task.best("auto")[0].completion == FULL and made == [FULL]
