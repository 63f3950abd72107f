"""Maps of a small photo, and the folder that the predictor maps:DIR reads them from."""

from pathlib import Path

import numpy as np

from materialist.io.exr import write_exr

H = 20
W = 32


def good_maps(height: int = H, width: int = W) -> dict[str, np.ndarray]:
    """Distinct, non-symmetric maps of the right kind."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    normal = rng.normal(size=(height, width, 3)) * [0.3, 0.3, 0.1] + [0, 0, 1]
    return {
        "albedo": rng.random((height, width, 3)).astype(np.float32),
        "roughness": (x / width).astype(np.float32),
        "metallic": (y / height).astype(np.float32),
        "normal": (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32),
        "depth": (2 + x / width + y / height).astype(np.float32),
    }


def write(folder: Path, **maps: np.ndarray) -> str:
    for name, values in maps.items():
        write_exr(folder / f"{name}.exr", values)
    return f"maps:{folder}"
