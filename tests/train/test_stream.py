"""The stream of batches: files that cannot be read, samples that are held out."""

import made_runs
import made_samples
import pytest

from materialist.errors import InputError
from materialist.io.samples import SampleFolder
from materialist.train import maps
from materialist.train.stream import epoch

ARGS = {"number": 1, "side": 32, "seed": 0}


def spoil(folder, *names):
    for path in (folder / "samples").iterdir():
        if not names or path.name in names:
            path.write_bytes(b"no sample")


def test_one_bad_file_does_not_end_a_run(tmp_path, caplog):
    examples = made_runs.bundled(made_samples.write_set(tmp_path, 4)).examples
    spoil(tmp_path, "0000002.npz")
    assert len(list(epoch(examples, batch=4, **ARGS))) == 1
    assert "0000002.npz" in caplog.text


def test_a_set_of_bad_files_ends_a_run(tmp_path):
    examples = made_runs.bundled(made_samples.write_set(tmp_path, 4)).examples
    spoil(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        list(epoch(examples, batch=2, **ARGS))


def test_the_error_of_a_loading_worker_is_one_sentence_and_ends_them(tmp_path):
    """Not the worker's traceback; and no process is left that could keep the command from ending."""
    import multiprocessing

    examples = maps.Pictures(SampleFolder(made_samples.write_set(tmp_path, 4)), lambda sample, *_: sample)
    spoil(tmp_path)
    with pytest.raises(InputError, match="cannot be read") as caught:
        list(epoch(examples, workers=1, batch=2, **ARGS))
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
