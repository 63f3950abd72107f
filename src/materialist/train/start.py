"""Exported weights that a training begins from."""

from __future__ import annotations

from pathlib import Path

from torch import nn

from materialist.predict.own_weights import shared
from materialist.predict.weights import load_weights, read_state


def fill(network: nn.Module, init: Path) -> None:
    """Give the network the weights in `init`, which a training wrote; where they are of a network without an encoder,
    what the encoder's features add stays nothing.

    Raises WeightsError for a file that is damaged or of another architecture.
    """
    known = read_state(init)
    if not any(name.startswith("told.") for name in known):
        known = {k: v for k, v in network.state_dict().items() if k.startswith("told.")} | dict(known)
    load_weights(network, known | shared(network), init)
