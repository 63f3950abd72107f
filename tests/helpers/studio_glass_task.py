"""A stand-in for `studio.live.glass.trace`, as worker processes load it by name."""

import os
import time

import numpy as np

from materialist.errors import InputError
from materialist.studio.live.glass import Pane


def trace(report, scene, others, step):
    """A pane whose colour is the index of refraction; 1.9 takes for ever, 1.8 kills the process, 1.7 fails."""
    ior = float(step.options["ior"])
    with open(os.environ["GLASS_LOG"], "a") as log:
        log.write(f"{os.getpid()} {ior}\n")
    report("build", 0, 1)
    if ior == 1.9:
        time.sleep(60)
    if ior == 1.8:
        os._exit(1)
    if ior == 1.7:
        raise InputError("The camera sees nothing of the object; mark another one.")
    time.sleep(0.2)
    report("trace", 0, 1)
    return Pane(
        np.full((1, 2, 3), ior, np.float32), np.float32([[1, 0.2]]), np.array([[False, True]])
    )
