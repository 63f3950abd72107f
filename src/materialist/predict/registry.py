"""Predictors by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from materialist.errors import InputError
from materialist.predict.protocol import MAPS, Predictor

CHOICES = "auto, bundled[:FILE], matnet[:FILE], marigold, depth-anything, moge:DIR, maps:DIR, constant"


def get_predictor(spec: str = "auto", *, device: str = "auto", **parts: str | None) -> Predictor:
    """The predictor named by `spec`, with single maps from others where `parts` says so.

    Args:
        spec: one of `CHOICES`; docs/predictors.md says what each needs.
        device: 'auto', 'cpu' or 'cuda', for predictors that are networks.
        parts: albedo, roughness, metallic, normal or depth = the spec of the source of this map alone, as in
            `get_predictor("matnet", albedo="marigold")`; None means `spec`.

    Raises:
        InputError: an unknown name, or a folder that is not there.
        SetupError: an optional library is missing.
        WeightsError: weights are missing or damaged. Nothing is ever downloaded here.
    """
    named = {name: part for name, part in parts.items() if part is not None}
    if not named:
        source = _open(spec, device)
        if not isinstance(source, Predictor):
            gives = ", ".join(source.gives)
            options = " ".join(f"--{name} {spec}" for name in source.gives)
            raise InputError(f"'{spec}' gives only {gives}: use it for these beside another predictor, with {options}.")
        if hasattr(source, "prepare"):
            source.prepare(MAPS)
        return source
    from materialist.predict.mix import MixedPredictor

    if unknown := [name for name in named if name not in MAPS]:
        raise InputError(f"There is no map '{unknown[0]}'; a predictor can be named for {', '.join(MAPS)}.")
    chosen = {name: named.get(name, spec) for name in MAPS}
    return MixedPredictor(chosen, {one: _open(one, device) for one in dict.fromkeys(chosen.values())})


def _open(spec: str, device: str) -> Any:
    """The Predictor or PartPredictor named by `spec`. Raises as `get_predictor`."""
    name, _, argument = spec.partition(":")
    if name not in _OPENERS or (argument and name in ("auto", "constant")):
        raise InputError(f"There is no predictor '{spec}'; choose one of {CHOICES}.")
    return _OPENERS[name](argument, device)


def _constant(argument: str, device: str) -> Any:
    from materialist.predict.constant import ConstantPredictor

    return ConstantPredictor()


def _maps(argument: str, device: str) -> Any:
    from materialist.predict.maps import MapsPredictor

    return MapsPredictor(argument)


def _bundled(argument: str, device: str) -> Any:
    from materialist.predict.bundled.predictor import BundledPredictor

    return BundledPredictor(argument, device=device)


def _matnet(argument: str, device: str) -> Any:
    from materialist.predict.matnet.predictor import MatNetPredictor

    return MatNetPredictor(argument, device=device)


def _marigold(argument: str, device: str) -> Any:
    from materialist.predict.marigold import Marigold, MarigoldPart

    return MarigoldPart(argument, device=device) if argument else Marigold(device=device)


def _depth_anything(argument: str, device: str) -> Any:
    from materialist.predict.depth_anything import DepthAnything

    return DepthAnything(argument, device=device)


def _moge(argument: str, device: str) -> Any:
    from materialist.predict.moge import MogeFolder

    return MogeFolder(argument)


_OPENERS: dict[str, Callable[[str, str], Any]] = {
    "auto": _bundled,
    "bundled": _bundled,
    "matnet": _matnet,
    "marigold": _marigold,
    "depth-anything": _depth_anything,
    "moge": _moge,
    "maps": _maps,
    "constant": _constant,
}
"""Name before the colon -> function of the text behind the colon and the device."""
