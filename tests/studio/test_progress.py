"""Progress of a job in words, and as a bar."""

import pytest

from materialist.jobs.queue import RUNNING, Job, JobQueue
from materialist.jobs.worker import DONE, FAILED
from materialist.studio import progress, tasks


def test_the_bar_never_runs_back(tmp_path):
    job = Job("invert", "me", tmp_path, tasks.invert, state=RUNNING)
    shares = []
    stages = [("read", 0), ("predict", 0), ("light", 60), ("light", 120), ("light", 1), ("trace", 9)]
    for stage, done in (*stages, ("materials", 5), ("light", 3), ("rerender", 0)):
        job.stage, job.done, job.total = stage, done, 120
        shares.append(progress.share(job))
    assert shares == sorted(shares) and 0 < shares[2] < shares[3] < shares[6] < shares[-1] < 1


@pytest.mark.parametrize(
    ("stage", "text"), [("light", "Finding the light"), ("light 2", "Finding the light"), ("odd", "Odd")]
)
def test_stages_in_words(stage, text):
    assert progress.words(stage) == text


def test_the_end_is_said_and_cannot_carry_html(tmp_path):
    queue, job = JobQueue(1), Job("final", "me", tmp_path, tasks.final, state=DONE, ended=0.0)
    assert "Done in" in list(progress.follow(queue, job))[-1]
    job.state, job.message = FAILED, "<script>alert(1)</script>"
    assert "<script>" not in progress.shown(queue, job) and 'role="alert"' in progress.shown(queue, job)
    queue.close()
