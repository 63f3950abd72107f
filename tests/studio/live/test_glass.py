"""Glass that follows its sliders: the tracing process, what is asked of it, and what it answers."""

from dataclasses import replace

import numpy as np
import pytest
import studio_glass_task
from made_tasks import until
from studio_scenes import block, package, room

from materialist.edits.glass.glass_preview import GlassPreview
from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.jobs.worker import Reporter
from materialist.studio.live import glass as studio_glass
from materialist.studio.live.glass import GlassClient
from materialist.studio.workspace import write_mask


@pytest.fixture
def log(tmp_path, monkeypatch):
    """A tracing task that answers at once; the file says what it was asked, and which process it was."""
    written = tmp_path / "log.txt"
    written.touch()
    monkeypatch.setenv("GLASS_LOG", str(written))
    monkeypatch.setattr(studio_glass, "trace", studio_glass_task.trace)
    return written


@pytest.fixture
def tracer(log, tmp_path):
    made = GlassClient(tmp_path / "room.scene")
    yield made
    made.stop()


def glass(ior, mask="mask-1.png", **more):
    return Step("glass", {"mask": mask, "ior": str(ior), **more})


def test_the_last_value_wins_and_the_picture_is_kept(tracer, log):
    for ior in (1.1, 1.2, 1.3):
        tracer.ask((), glass(ior))
    assert tracer.state.waiting and tracer.pane(glass(1.3)) is None
    until(lambda: not tracer.state.waiting)
    pane = tracer.pane(glass(1.3))
    assert pane.picture.shape == (1, 2, 3) and pane.picture[0, 0, 0] == pytest.approx(1.3, abs=1e-3)
    np.testing.assert_allclose(pane.share, [[1, 0.2]])
    assert pane.filled.tolist() == [[False, True]]
    assert tracer.fresh((), glass(1.3)) and not tracer.fresh((), glass(1.2))
    assert not tracer.fresh((Step("relight", {"rotate": "9"}),), glass(1.3))
    asked = len(log.read_text().splitlines())
    tracer.ask((), glass(1.3))  # the same wish again
    assert not tracer.state.waiting and len(log.read_text().splitlines()) == asked
    assert (
        len({line.split()[0] for line in log.read_text().splitlines()}) == 1
    )  # one process for all


@pytest.mark.slow
def test_failures_are_told_and_the_next_value_is_tried(tracer):
    tracer.ask((), glass(1.7))
    until(lambda: not tracer.state.waiting)
    assert tracer.state.bad and "sees nothing" in tracer.state.words
    tracer.ask((), glass(1.8))
    until(lambda: not tracer.state.waiting)
    assert tracer.state.bad and "ended by itself" in tracer.state.words
    tracer.ask((), glass(1.8))  # asking again tries again
    until(lambda: not tracer.state.waiting)
    tracer.ask((), glass(1.4))
    until(lambda: not tracer.state.waiting)
    assert not tracer.state.bad and tracer.pane(glass(1.4)) is not None


def report(stages, outdated=False):
    """A task's report that notes its stages."""
    return Reporter(lambda kind, facts: stages.append(facts["stage"]), lambda: outdated)


def test_the_task_answers_with_the_preview_of_the_edit_package(tmp_path, filled_smoothly):
    scene = str(package(tmp_path))
    others = (Step("relight", {"ambient": "0.5"}, tmp_path),)
    given = {
        "mask": write_mask(tmp_path, block()),
        "ior": "1.2",
        "thickness": "symmetry",
        "tint": "1,0.5,0.5",
    }
    first = []
    late = []
    pane = studio_glass.trace(report(first), scene, others, Step("glass", given, tmp_path))
    assert first == ["build", "trace"]
    dim = replace(room(), envmap=room().envmap * 0.5)
    truth = GlassPreview(dim, block(), thickness="symmetry").picture(ior=1.2, tint=(1, 0.5, 0.5))
    np.testing.assert_allclose(pane.picture, truth, rtol=2e-3, atol=1e-4)
    outside = (pane.share == 0) & ~pane.filled
    assert outside.any() and np.array_equal(truth[outside], room().photo.linear[outside])
    assert pane.share.max() == 1 and (pane.share > 0.5).sum() > 0.8 * block().sum()
    newer = Step("glass", {**given, "ior": "1.4"}, tmp_path)
    assert studio_glass.trace(report(late, outdated=True), scene, others, newer) is None
    assert late == ["build"]  # the body is kept, and nothing is traced
    with pytest.raises(InputError, match="must be 4 numbers"):
        studio_glass.trace(
            report([]), scene, others, Step("glass", {"ior": "1.4", "box": "0,0,9"}, tmp_path)
        )
