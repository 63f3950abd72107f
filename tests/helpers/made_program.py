"""Walks the commands of the program, and says what a start of it loads."""

import subprocess
import sys

PLUGINS = {"bench", "train"}


def options_of(group, leave_out=PLUGINS, name=""):
    """Name of every command, groups within groups included -> its options; without the names in `leave_out`."""
    if not hasattr(group, "list_commands"):
        return {name: {option for parameter in group.params for option in parameter.opts}}
    found = {}
    for word in group.list_commands(None):
        if word not in leave_out:
            found |= options_of(group.get_command(None, word), leave_out, f"{name} {word}".strip())
    return found


def heavy_after(statement):
    """The slow libraries that are loaded in a new process after a statement of imports."""
    script = (
        f"{statement}\nimport sys\n"
        "heavy = 'torch mitsuba drjit cv2 matplotlib OpenEXR scipy skimage PIL rawpy pillow_heif numpy'.split()\n"
        "sys.stdout.write(' '.join(name for name in heavy if name in sys.modules))"
    )
    child = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return child.stdout.split()
