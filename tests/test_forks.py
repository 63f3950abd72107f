"""A fork of a process that has computed is refused with a sentence, where it would hang for ever."""

import subprocess
import sys

from edit_scenes import flat_scene

from materialist.io.package import save_scene

SCRIPT = """
import os, sys
import materialist as mt
# Loaded here, and not in each child.
functions = mt.invert, mt.select, mt.render_scene, mt.composite
scene = mt.load_scene(sys.argv[1])
child = os.fork()
mt.select(scene, mask=scene.depth > 0)
if child == 0:
    os._exit(0)
if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0:
    sys.exit("a fork before anything was computed")
calls = {
    "invert": lambda: mt.invert("example:coffee"),
    "select": lambda: mt.select(scene, click=(5, 5)),
    "render_scene": lambda: mt.render_scene(scene, spp=2),
    "composite": lambda: mt.composite(scene, scene),
}
for name, call in calls.items():
    child = os.fork()
    if child == 0:
        try:
            call()
            os._exit(1)
        except mt.SetupError as error:
            os._exit(0 if "forked" in str(error) and "spawn" in str(error) else 2)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0:
        sys.exit(name)
"""


def test_a_fork_is_refused_where_its_parent_has_computed(tmp_path):
    """Before that, both may compute."""
    save_scene(flat_scene(), tmp_path / "a.scene")
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "a.scene")]
    run = subprocess.run(command, timeout=120, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
