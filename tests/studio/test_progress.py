"""Progress of a job in words, and as a bar."""

import pytest

from materialist.jobs.queue import Job, JobQueue
from materialist.jobs.worker import DONE, FAILED
from materialist.studio import progress, tasks


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
