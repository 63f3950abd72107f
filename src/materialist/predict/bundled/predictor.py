"""The predictor `bundled`: the network that ships with the package; docs/training.md tells how it was made."""

from collections.abc import Collection
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.predict.bundled.inference import infer_bundled
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.protocol import MAPS, MapSet, Predictor, on_gpu
from materialist.predict.weights import sha256
from materialist.types import Array, Photo

WEIGHTS = Path(__file__).with_name("weights.safetensors")
"""The weights that ship with the package."""


@lru_cache(maxsize=1)
def _read(path: Path, changed: int, device: torch.device) -> tuple[BundledNetwork, dict[str, Any]]:
    """The network of a file that was last written at a time, and its facts; read once for photos in a row."""
    network, facts = BundledNetwork.load(path)
    return network.to(device, memory_format=torch.channels_last), facts  # type: ignore[call-overload]


class BundledPredictor(Predictor):
    """The network in the package, or one of its kind from `train matnet` in the .safetensors file `where`.

    Raises WeightsError for weights that are missing, damaged, or for another network; SetupError as `on_gpu`.
    """

    def __init__(self, where: str | Path = "", *, device: str = "auto"):
        path = Path(where).expanduser() if str(where) else WEIGHTS
        self.device = torch.device("cuda" if on_gpu(device) else "cpu")
        changed = path.stat().st_mtime_ns if path.is_file() else 0
        self.network, self.facts = _read(path, changed, self.device)
        file_name = "" if path == WEIGHTS else f" {path.name}"
        self.name = (
            f"bundled{file_name} step {self.facts.get('step', '?')} sha256:{sha256(path)[:16]}"
        )

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted of the network's maps at the photo's size; deterministic, `seed` changes nothing.

        Any size and aspect. Albedo is linear; depth is up to scale, with median 3; depth is 0 where the network sees
        sky. Raises WeightsError when the weights give values that are not finite.
        """
        prediction = infer_bundled(
            self.network,
            photo.linear,
            pixel_rays(photo.camera)[..., :2].copy(),
            device=self.device,
            on_materials=self.on_materials,
        )
        # --- Its maps, which must be finite ---
        maps = {
            **vars(prediction.materials),
            "normal": prediction.normal,
            "depth": prediction.depth,
        }
        if not all(np.isfinite(maps[name]).all() for name in MAPS):
            raise WeightsError(
                f"The network gave values that are not finite; check its weights ({self.name})."
            )
        warnings = prediction.warnings
        if "depth" not in names:  # there may be a surface in the depth of another source
            maps["normal"] = np.where(prediction.depth[..., None] > 0, prediction.normal, 0).astype(
                np.float32
            )
            warnings = ()
        # --- Only what is asked for; the light goes with the albedo it was predicted with ---
        light = prediction.light if "albedo" in names else None
        spread = {name: values for name, values in prediction.spread.items() if name in names}
        chosen = {name: maps[name] for name in names}
        return MapSet(chosen, dict.fromkeys(names, self.name), warnings, light, spread)
