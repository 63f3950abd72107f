"""The predictor `bundled`: the network that ships with the package; docs/training.md tells how it was made."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import torch

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.predict.bundled.inference import infer
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.protocol import MAPS, MapSet, Predictor, on_gpu
from materialist.predict.weights import sha256
from materialist.types import Array, Photo

WEIGHTS = Path(__file__).with_name("weights.safetensors")
"""The weights that ship with the package."""


class BundledPredictor(Predictor):
    """The network in the package, or one of its kind from `train matnet` in the .safetensors file `where`.

    Raises WeightsError for weights that are missing, damaged, or for another network; SetupError as `on_gpu`.
    """

    def __init__(self, where: str | Path = "", *, device: str = "auto"):
        path = Path(where).expanduser() if str(where) else WEIGHTS
        self.device = torch.device("cuda" if on_gpu(device) else "cpu")
        network, self.facts = BundledNetwork.load(path)
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        own = "" if path == WEIGHTS else f" {path.name}"
        self.name = f"bundled{own} step {self.facts.get('step', '?')} sha256:{sha256(path)[:16]}"

    def parts(
        self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted of the network's maps at the photo's size; deterministic, `seed` changes nothing.

        Any size and aspect. Albedo is linear; depth is up to scale, with median 3; depth is 0 where the network sees
        sky. Raises WeightsError when the weights give values that are not finite.
        """
        found = infer(
            self.network, photo.linear, pixel_rays(photo.camera)[..., :2].copy(), device=self.device
        )
        maps = {**vars(found.materials), "normal": found.normal, "depth": found.depth}
        if not all(np.isfinite(maps[name]).all() for name in MAPS):
            raise WeightsError(
                f"The network gave values that are not finite; check its weights ({self.name})."
            )
        warnings = found.warnings
        if "depth" not in wanted:  # there may be a surface in the depth of another source
            maps["normal"] = np.where(found.depth[..., None] > 0, found.normal, 0).astype(
                np.float32
            )
            warnings = ()
        light = found.light if "albedo" in wanted else None
        spread = {name: values for name, values in found.spread.items() if name in wanted}
        chosen = {name: maps[name] for name in wanted}
        return MapSet(chosen, dict.fromkeys(wanted, self.name), warnings, light, spread)
