"""LPIPS (Zhang et al. 2018) where its package and the weights of its backbone are installed; nothing is downloaded."""

from functools import cache
from pathlib import Path
from typing import Any

from materialist.types import Array


def lpips(a: Array, b: Array) -> float | None:
    """LPIPS (AlexNet) of two linear pictures [H, W, 3] or maps [H, W], sRGB-encoded; None where it is not installed."""
    network = backbone("alex")
    if network is None:
        return None
    import numpy as np
    import torch

    from materialist.color import linear_to_srgb

    def tensor(x: Array):
        x = np.repeat(x[..., None], 3, -1) if x.ndim == 2 else x
        return torch.from_numpy(linear_to_srgb(np.clip(x, 0, 1)) * 2 - 1).permute(2, 0, 1)[None]

    with torch.inference_mode():
        return float(network(tensor(a), tensor(b)))


@cache
def backbone(name: str) -> Any:
    """The lpips package's network on `alex` or `vgg`, frozen; None unless package and backbone are here."""
    import torch

    # Torchvision would download weights that are missing.
    files = {"alex": "alexnet*", "vgg": "vgg16*"}[name]
    if not list((Path(torch.hub.get_dir()) / "checkpoints").glob(files)):
        return None
    try:
        from lpips import LPIPS  # type: ignore[import-not-found]
    except ImportError:
        return None
    return LPIPS(net=name, verbose=False).eval().requires_grad_(False)
