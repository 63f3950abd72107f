"""The mean of two weights of one network (Wortsman et al. 2022, "Model soups")."""

from pathlib import Path

from materialist.errors import InputError
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.network import shared_tensors

FROM_ZERO = "patch_terms."
"""Prefix of layers that begin with zeros: weights that lack them are as good as such zeros."""


def write_mean(first: Path, second: Path, output: Path, share: float) -> None:
    """Write `share` of the tensors in `second` and the rest of those in `first`, with the architecture of `second`.

    Layers that `first` lacks come from `second`, those that begin with zeros by their share. Raises WeightsError for
    files that are no weights of the bundled network, InputError where they do not fit together.
    """
    if not 0 <= share <= 1:
        raise InputError(f"--share is {share:g}; give a number from 0 to 1.")
    before, _ = BundledNetwork.load(first)
    after, facts = BundledNetwork.load(second)
    old = before.state_dict()
    new = after.state_dict()
    missing = sorted(set(old) - set(new) - set(shared_tensors(before)))
    if missing:
        raise InputError(f"{second} lacks {missing[0]} of {first}; give the newer weights second.")
    for name, tensor in new.items():
        if name in old and old[name].shape != tensor.shape:
            raise InputError(f"{name} has another size in {first} than in {second}.")
        if name in old:
            new[name] = share * tensor + (1 - share) * old[name]
        elif name.startswith(FROM_ZERO):
            new[name] = share * tensor
    after.load_state_dict(new)
    after.save(output, facts | {"mean": {"share": share, "with": first.name}})
