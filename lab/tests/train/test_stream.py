"""The stream of batches: files that cannot be read, samples that are held out."""

import multiprocessing

import made_runs
import made_samples
import pytest

from materialist.errors import InputError
from materialist_lab.data.samples import SampleFolder
from materialist_lab.train import maps
from materialist_lab.train.stream import epoch

ARGS = {"number": 1, "side": 32, "seed": 0}


def spoil(folder, *names):
    for path in (folder / "samples").iterdir():
        if not names or path.name in names:
            path.write_bytes(b"no sample")


def test_one_bad_file_does_not_end_a_run(tmp_path, caplog):
    task = made_runs.bundled(made_samples.write_set(tmp_path, 4))
    spoil(tmp_path, "0000002.npz")
    assert len(list(epoch(task, batch=4, **ARGS))) == 1
    assert "0000002.npz" in caplog.text


def test_sets_of_pictures_of_different_sizes_are_refused(tmp_path):
    sets = [
        made_samples.write_set(tmp_path / str(edge), 1, height=edge, width=edge)
        for edge in (32, 64)
    ]
    task = made_runs.bundled(sets[0])
    task.source.folders = sets
    with pytest.raises(InputError, match="use sets of one size"):
        list(epoch(task, batch=2, **ARGS))


@pytest.mark.parametrize("workers", [0, 1])
def test_a_set_of_bad_files_ends_a_run_by_one_sentence(tmp_path, workers):
    """Not by a worker's traceback; and no process is left that could keep the command from ending."""
    task = made_runs.bundled(made_samples.write_set(tmp_path, 4))
    spoil(tmp_path)
    with pytest.raises(InputError, match="cannot be read") as caught:
        list(epoch(task, workers=workers, batch=2, **ARGS))
    assert "Traceback" not in str(caught.value)
    del caught
    assert not multiprocessing.active_children()


def test_held_out_samples_are_never_trained_on(tmp_path):
    """Their own numbers, not their places, say which samples are held out."""
    (tmp_path / "samples").mkdir()
    for k in range(90):
        (tmp_path / "samples" / f"{k:07d}.npz").touch()
    source = SampleFolder(tmp_path)
    before = {source.number(k) for k in maps.trained_on(source)}
    assert len(before) == 88 and not {39, 79} & before
    (tmp_path / "samples" / "0000005.npz").unlink()
    source.refresh()
    assert {source.number(k) for k in maps.trained_on(source)} == before - {5}
