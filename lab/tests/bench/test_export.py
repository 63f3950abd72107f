import os
import subprocess
import sys

import numpy as np
import pytest
from export_scenes import room

from materialist.io.exr import write_exr
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


LIGHT = """<scene version="3.9.0"><emitter type="envmap"><string name="filename" value="a.exr"/></emitter>
<sensor type="perspective"><sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>
</scene>"""
LOAD = """
from pathlib import Path
from materialist.render.variant import setup
setup("cpu")
from materialist_lab.bench.export import loaded
loaded(Path("a.xml"), 4)
"""


@pytest.mark.slow
def test_a_single_thread_loads_a_file(tmp_path):
    (tmp_path / "a.xml").write_text(LIGHT)
    write_exr(tmp_path / "a.exr", np.ones((8, 16, 3), np.float32))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run(
        [sys.executable, "-c", LOAD], cwd=tmp_path, env=environment, check=True, timeout=60
    )
