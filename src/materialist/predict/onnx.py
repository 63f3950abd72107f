"""Networks that ship as ONNX files, run by ONNX Runtime on the processor."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.errors import SetupError, WeightsError
from materialist.install import install_command
from materialist.threads import TORCH_THREADS

if TYPE_CHECKING:
    from onnxruntime import InferenceSession


@lru_cache(maxsize=4)
def session(path: Path) -> InferenceSession:
    """A file's network, ready to run; made once for each file.

    Raises SetupError where ONNX Runtime is missing, WeightsError for a file that is missing or damaged.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise SetupError(
            f"{path.name} needs ONNX Runtime ({error}); install it with: {install_command('onnxruntime')}."
        ) from error
    options = onnxruntime.SessionOptions()
    # How sums are split decides their last bits: one number of threads everywhere.
    options.intra_op_num_threads = TORCH_THREADS
    # Memory goes back after each run: a photo is encoded once.
    options.enable_cpu_mem_arena = False
    options.log_severity_level = 3
    if not path.is_file():
        raise WeightsError(f"{path} is missing; install materialist again.")
    try:
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime raises classes of its own for each kind of damage
        raise WeightsError(f"{path} is damaged ({error}); install materialist again.") from error
