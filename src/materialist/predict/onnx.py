"""Networks that ship as ONNX files, run by ONNX Runtime on the processor."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.errors import SetupError, WeightsError
from materialist.forks import check_process
from materialist.install import install_command
from materialist.predict.weights import verify_file
from materialist.threads import TORCH_THREADS
from materialist.types import Array

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


REINSTALL = "install materialist again"
"""What to do about a damaged file of the package."""


def run(path: Path, inputs: Mapping[str, Array], *, once: bool = False) -> list[Array]:
    """What a file's network answers to `inputs` by name, in its own order.

    once: it is not kept for another time, which takes its memory and saves a tenth of a second.

    Raises SetupError where ONNX Runtime is missing or in a fork, WeightsError for a file that is missing or damaged.
    """
    check_process()
    loaded = session.__wrapped__(path) if once else session(path)
    import onnxruntime

    options = onnxruntime.RunOptions()
    # Half a gigabyte goes back: a photo is encoded once.
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    return loaded.run(None, dict(inputs), options)


@lru_cache(maxsize=4)
def session(path: Path) -> InferenceSession:
    """A file's network, ready to run; made once for each file. Raises as `run`."""
    try:
        import onnxruntime
    except ImportError as error:
        raise SetupError(
            f"{path.name} needs ONNX Runtime ({error}); install it with: {install_command('onnxruntime')}."
        ) from error
    options = onnxruntime.SessionOptions()
    # How sums are split decides their last bits: one number of threads everywhere.
    options.intra_op_num_threads = TORCH_THREADS
    # Waiting threads sleep: beside another process that computes, spinning costs a fifth.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    # Weights alone are int8: they become float32 again as they are loaded, and nothing else is quantised.
    options.add_session_config_entry("session.disable_quant_qdq", "1")
    options.log_severity_level = 3
    if not path.is_file():
        raise WeightsError(f"{path} is missing; {REINSTALL}.")
    # The runtime reads a damaged or exchanged file without a word, and then answers wrongly.
    verify_file(path, remedy=REINSTALL)
    try:
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime raises classes of its own for each kind of damage
        raise WeightsError(f"{path} is damaged ({error}); {REINSTALL}.") from error
