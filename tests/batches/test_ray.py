"""Batches on a Ray cluster of this machine alone."""

import pytest
from made_batch import photos, run

from materialist.errors import SetupError

pytest.importorskip("ray")


@pytest.mark.slow
def test_a_cluster_gives_what_worker_processes_give(tmp_path):
    source = photos(tmp_path / "in", "a", "b", "impossible", "deadly", "deadly-once")
    (tmp_path / "edits.yaml").write_text("- relight:\n    rotate: 90\n")
    cluster = run(source, tmp_path / "cluster", ray="local")
    state = {row["name"]: (row["status"], row["attempts"]) for row in cluster.rows}
    assert state == {
        "a": ("done", 1),
        "b": ("done", 1),
        "deadly-once": ("done", 2),
        "impossible": ("failed", 1),
        "deadly": ("failed", 3),
    }
    (source / "deadly.png").unlink()
    assert cluster.hash == run(photos(source, "a"), tmp_path / "local").hash


def test_a_cluster_that_is_not_there_is_told(tmp_path):
    with pytest.raises(SetupError, match=r"Ray cluster at '127\.0\.0\.1:1' does not answer"):
        run(photos(tmp_path / "in", "a"), tmp_path / "runs", ray="127.0.0.1:1")
