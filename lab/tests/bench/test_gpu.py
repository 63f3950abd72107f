import json
from pathlib import Path
from types import SimpleNamespace

from materialist_lab import bench
from materialist_lab.bench import gpu


def test_each_device_is_a_column(tmp_path, monkeypatch):
    def measured(*arguments):
        device = next(
            text.removeprefix("--device=") for text in arguments if text.startswith("--device=")
        )
        Path(arguments[3]).mkdir()
        rows = [{"method": "edit", "sample": "cup", device: len(device)}]
        Path(arguments[3], "report.json").write_text(json.dumps({"rows": rows}))

    monkeypatch.setattr(
        gpu.torch,
        "cuda",
        SimpleNamespace(is_available=lambda: True, get_device_name=lambda: "a card"),
    )
    monkeypatch.setattr(gpu, "usable_gpus", lambda: 1)
    monkeypatch.setattr(gpu, "materialist", measured)
    report = (bench.run("gpu", output=tmp_path / "both") / "report.md").read_text()
    assert "| edit | 2 | 3.000 | 4.000 |" in report and "card a card" in report
