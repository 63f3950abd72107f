"""Where networks compute."""

from __future__ import annotations

from materialist.errors import SetupError


def on_gpu(device: str) -> bool:
    """Whether 'auto', 'cpu' or 'cuda' means the GPU here. Raises SetupError for a CUDA device that is not there."""
    import torch

    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise SetupError("There is no CUDA device that PyTorch can use; choose --device cpu.")
    return device != "cpu" and there
