"""Worker processes: how many, on which GPU, with how many threads."""

import io

import pytest

from materialist.batches import local
from materialist.batches.job import Job


@pytest.fixture
def gpus(monkeypatch):
    monkeypatch.setattr("materialist.render.variant.cuda_usable", lambda: True)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3,GPU-5f")


def test_one_worker_a_gpu_or_one_a_processor_as_far_as_memory_reaches(gpus, monkeypatch):
    assert local.visible_gpus() == ["3", "GPU-5f"] and local.default_workers("auto") == 2
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(64)), raising=False)

    def memory():
        return type("Memory", (), {"available": 3 * local.worker_mb(512) * 1e6 + 1})

    monkeypatch.setattr("psutil.virtual_memory", memory)
    assert local.default_workers("cpu") == 3
    assert local.default_workers("cpu", 1024) == 1 < local.default_workers("cpu", 128) == 5
    monkeypatch.setattr("psutil.virtual_memory", lambda: type("Memory", (), {"available": 1e6}))
    assert local.default_workers("cpu") == 1


@pytest.mark.parametrize(("size", "measured"), [(256, 839), (512, 1317), (1024, 3486), (2048, 11026)])
def test_a_worker_fits_the_memory_that_is_counted_on(size, measured):
    """Measured: docs/benchmarks.md, `bench invert`."""
    assert measured < local.worker_mb(size) < 1.2 * measured


def test_each_worker_has_one_thread_and_its_gpu(gpus, monkeypatch):
    begun = []

    class Stopped(Exception):
        pass

    def start(command, *, env, **pipes):
        begun.append((command, env))
        raise Stopped

    monkeypatch.setattr("subprocess.Popen", start)
    for device in ("auto", "cpu"):
        pool = local.LocalPool(3, device=device)
        for worker in pool._workers:
            with pytest.raises(Stopped):
                worker.begin(Job("a", "a", "/a", "/r"))
        pool.close()
    chosen = [env["CUDA_VISIBLE_DEVICES"] for _, env in begun]
    assert chosen == ["3", "GPU-5f", "3", *["3,GPU-5f"] * 3]
    assert all(env["OMP_NUM_THREADS"] == "1" for _, env in begun)


def test_the_last_words_of_a_worker_are_told():
    worker = local._Worker(None, None)  # type: ignore[arg-type]
    worker._errors = io.BytesIO(b"first\nLLVM ERROR: Cannot select: fminimum\n")
    told = worker._obituary(-6)
    assert told["reason"].startswith("The worker process was ended by SIGABRT.") and "Cannot select" in told["reason"]
    assert not told["unready"] and worker._obituary(1)["unready"]
