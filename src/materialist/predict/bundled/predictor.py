"""The predictor `bundled`: the network that ships with the package; docs/training.md tells how it was made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from materialist.errors import WeightsError
from materialist.predict.bundled import WEIGHTS
from materialist.predict.bundled.inference import infer, rays_of
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.device import on_gpu
from materialist.predict.protocol import SKY_NOTE
from materialist.predict.weights import sha256
from materialist.types import Photo, Prediction


class BundledPredictor:
    """The bundled network, or one of its kind from `train export`.

    Args:
        where: a .safetensors file, or "" for the weights in the package.
        device: 'auto', 'cpu' or 'cuda'.

    Raises:
        WeightsError: the weights are missing, damaged, or for another network.
        SetupError: there is no such device.
    """

    def __init__(self, where: str | Path = "", *, device: str = "auto"):
        path = Path(where).expanduser() if str(where) else WEIGHTS
        if not path.is_file():
            raise WeightsError(
                f"There are no weights of the bundled network at {path}; install materialist again, or train and "
                "export some (materialist train matnet, materialist train export)."
            )
        self.device = torch.device("cuda" if on_gpu(device) else "cpu")
        network, self.facts = BundledNetwork.load(path)
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        own = "" if path == WEIGHTS else f" {path.name}"
        self.source = f"bundled{own} step {self.facts.get('step', '?')} sha256:{sha256(path)[:16]}"

    @property
    def name(self) -> str:
        """What the report calls it: how long it was trained, and the start of its checksum."""
        return self.source

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """The network's maps at the photo's size; deterministic, `seed` changes nothing.

        Any size and aspect. Albedo is linear; depth is up to scale, with median 3; depth is 0 where the network sees
        sky. Raises WeightsError when the weights give values that are not finite.
        """
        rays = rays_of(photo.camera)
        found = infer(self.network, photo.linear, rays, device=self.device)
        m = found.materials
        if not all(np.isfinite(a).all() for a in (m.albedo, m.roughness, m.metallic, found.normal, found.depth)):
            raise WeightsError(f"The network gave values that are not finite; check its weights ({self.source}).")
        notes = []
        sky = float((found.depth == 0).mean())
        if sky > 0:
            notes.append(f"{sky:.0%} {SKY_NOTE}")
        return Prediction(m, found.normal, found.depth, predictor=self.name, warnings=tuple(notes))
