import json
from pathlib import Path

import torch

from materialist import bench
from materialist.bench import gpu


def test_a_stage_is_one_row_of_both_devices(tmp_path, monkeypatch):
    def measured(*given):
        """Stands in for the command on one device."""
        device = next(text.removeprefix("--device=") for text in given if text.startswith("--device="))
        assert given[:3] == ("bench", "gpu", "-o") and "--size=48" in given
        folder = Path(given[3])
        folder.mkdir()
        rows = [{"method": stage, "sample": "cup", device: len(device)} for stage in ("edit", "glass")]
        (folder / "report.json").write_text(json.dumps({"rows": rows}))

    monkeypatch.setattr(gpu, "materialist", measured)
    report = bench.run("gpu", output=tmp_path / "cpu", size=48) / "report.md"
    assert "| edit | 1 | 3.000 | – |" in report.read_text() and "card none" in report.read_text()
    monkeypatch.setattr(gpu, "cuda_usable", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "a card")
    report = bench.run("gpu", output=tmp_path / "both", size=48) / "report.md"
    assert "| glass | 1 | 3.000 | 4.000 |" in report.read_text() and "card a card" in report.read_text()
