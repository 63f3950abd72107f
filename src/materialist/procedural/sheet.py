"""A contact sheet of a data set: what a person looks at first."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.color import linear_to_srgb
from materialist.errors import InputError, OutputError
from materialist.io.samples import read_arrays
from materialist.types import Array

COLUMNS = ("image", "albedo", "roughness", "metallic", "normal", "depth", "shading")


def write_sheet(folder: str | Path, path: str | Path, *, count: int = 24, seed: int = 0) -> int:
    """Draw `count` samples of the set in `folder`, chosen by `seed`, two to a row; returns how many.

    Each shows, left to right, `COLUMNS`. Raises InputError where there are no samples, OutputError when `path` cannot
    be written.
    """
    import cv2

    if Path(path).suffix.lower() != ".png":
        raise OutputError(f"{path} is no .png; a contact sheet is one.")
    files = sorted((Path(folder) / "samples").glob("*.npz"))
    if not files:
        raise InputError(f"{folder} holds no samples; make some: materialist train data -o {folder}.")
    rng = np.random.default_rng(seed)
    chosen = sorted(rng.permutation(len(files))[:count])
    strips = [strip(read_arrays(files[k], *COLUMNS, "mask")) for k in chosen]
    if len(strips) % 2:
        strips.append(np.zeros_like(strips[0]))
    rows = [np.concatenate([a, np.zeros_like(a[:, :8]), b], 1) for a, b in zip(strips[::2], strips[1::2])]
    written = cv2.imwrite(str(path), np.concatenate(rows)[..., ::-1]) if Path(path).parent.is_dir() else False
    if not written:
        raise OutputError(f"{path} cannot be written; name a .png in a folder that exists.")
    return len(chosen)


def strip(sample: dict[str, Array], side: int = 128) -> Array:
    """[side, 7 side, 3] uint8 sRGB: the arrays of one sample beside each other."""
    import cv2

    mask = sample["mask"][..., None] > 0
    depth = sample["depth"].astype(np.float32)
    near = np.percentile(depth[depth > 0], [2, 98]) if (depth > 0).any() else np.array([1.0, 2.0])
    scaled = np.log(np.maximum(depth, 1e-3) / near[0]) / max(np.log(near[1] / near[0]), 1e-6)
    grey = lambda x: np.repeat(x[..., None], 3, -1)  # noqa: E731
    pictures = [
        linear_to_srgb(sample["image"].astype(np.float32)),
        sample["albedo"] / 255,
        grey(sample["roughness"] / 255) * mask,
        grey(sample["metallic"] / 255) * mask,
        (sample["normal"] / 254 + 0.5) * mask,
        grey(np.clip(1 - 0.85 * scaled, 0, 1)) * mask,
        linear_to_srgb(sample["shading"].astype(np.float32) * 0.5),
    ]
    small = [cv2.resize(p.astype(np.float32), (side, side), interpolation=cv2.INTER_AREA) for p in pictures]
    return (np.clip(np.concatenate(small, 1), 0, 1) * 255 + 0.5).astype(np.uint8)
