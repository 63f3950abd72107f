import pytest
from export_scenes import room

from materialist_lab.bench import export


@pytest.mark.slow
def test_what_was_written_looks_as_the_scene_does(measured, monkeypatch):
    pytest.importorskip("pxr", reason="needs usd-core: pip install 'materialist-photo[usd]'")
    monkeypatch.setattr(export.pipeline, "invert", lambda *_, **__: room())
    monkeypatch.setattr(export, "find_blender", lambda _: None)
    again, ours, principled, glb, usd, none = measured("export", spp=64, device="cpu").rows
    assert ours["ours"] > again["ours"] - 0.5 and none["method"].startswith("Blender: none found")
    assert (
        min(glb["ours"], usd["ours"]) > principled["ours"] - 0.5 > 25.5
    )  # 8 bits a map, a light of 8 bits
