"""Workers of a batch: how many, on which GPU, with how many threads."""

import pytest

from materialist.batches import run


@pytest.fixture
def gpus(monkeypatch):
    monkeypatch.setattr("materialist.render.variant.cuda_usable", lambda: True)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3,GPU-5f")


def test_one_worker_a_gpu_or_one_a_processor_as_far_as_memory_reaches(gpus, monkeypatch):
    assert run.visible_gpus() == ["3", "GPU-5f"] and run.default_workers("auto") == 2
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(64)), raising=False)

    def memory():
        return type("Memory", (), {"available": 3 * run.worker_mb(512) * 1e6 + 1})

    monkeypatch.setattr("psutil.virtual_memory", memory)
    assert run.default_workers("cpu") == 3
    assert run.default_workers("cpu", 1024) == 1 < run.default_workers("cpu", 128) == 5
    monkeypatch.setattr("psutil.virtual_memory", lambda: type("Memory", (), {"available": 1e6}))
    assert run.default_workers("cpu") == 1
