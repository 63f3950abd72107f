"""Exported weights that a training begins from."""

from __future__ import annotations

from pathlib import Path

from torch import nn

from materialist.predict.network import shared_tensors
from materialist.predict.weights import load_weights, read_state

WITH_ENCODER = ("told.",)
"""What a network without an encoder has not."""


def fill(network: nn.Module, init: Path) -> None:
    """Give the network the weights in `init`, which a training wrote.

    What reads the encoder's features begins anew where the file has none of it; what those add is nothing then.

    Raises WeightsError for a file that is damaged or of another architecture.
    """
    fresh = {name: tensor for name, tensor in network.state_dict().items() if name.startswith(WITH_ENCODER)}
    load_weights(network, fresh | dict(read_state(init)) | shared_tensors(network), init)
