"""What a predictor is, and how one is chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Protocol, runtime_checkable

from materialist.errors import InputError
from materialist.types import Photo, Prediction

SKY_NOTE = "of the picture was taken for sky and has no surface."
NEUTRAL_ROUGHNESS = 0.5
"""The paper's neutral start where nothing is known (section "Predicted Material Properties on Envmap Estimation")."""
NEUTRAL_METALLIC = 0.1
"""As above."""


@runtime_checkable
class Predictor(Protocol):
    """Turns a photograph into a prior: materials, normals and depth (paper, section "MatNet")."""

    @property
    def name(self) -> str:
        """What the report calls it."""
        ...

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """Maps of the photo's working size, in the conventions of `Prediction`; the same seed gives the same maps."""
        ...


@runtime_checkable
class Prepared(Protocol):
    """A predictor that is told, before it is used, which of its maps are wanted."""

    gives: tuple[str, ...]
    """The maps that it has."""

    def prepare(self, wanted: Collection[str]) -> None:
        """Find what these maps need. Raises WeightsError where it is not there."""
        ...


def get_predictor(spec: str = "auto", *, device: str = "auto", **parts: str | None) -> Predictor:
    """The predictor named by `spec`, with single maps from others where `parts` says so.

    Args:
        spec: one of `CHOICES`; docs/predictors.md says what each needs.
        device: 'auto', 'cpu' or 'cuda', for those that are networks.
        parts: albedo, roughness, metallic, normal or depth = the spec that this map comes from, as in
            `get_predictor("matnet", albedo="marigold")`; None means `spec`.

    Raises:
        InputError: an unknown name, or a folder that is not there.
        SetupError: an optional library is missing.
        WeightsError: weights are missing or damaged. Nothing is ever downloaded here.
    """
    named = {name: part for name, part in parts.items() if part is not None}
    if named:
        from materialist.predict.mix import MixedPredictor

        return MixedPredictor(named, spec, device=device)
    source = open_source(spec, device)
    if not isinstance(source, Predictor):
        gives = ", ".join(source.gives)
        options = " ".join(f"--{name} {spec}" for name in source.gives)
        raise InputError(f"'{spec}' gives only {gives}: use it for these beside another predictor, with {options}.")
    if isinstance(source, Prepared):
        source.prepare(source.gives)
    return source


def open_source(spec: str, device: str = "auto"):
    """The whole or partial predictor named by `spec`, as it is. Raises as `get_predictor`."""
    name, _, argument = spec.partition(":")
    if name not in _OPEN or (argument and name in ("auto", "classical")):
        raise InputError(f"There is no predictor '{spec}'; choose one of {CHOICES}.")
    return _OPEN[name](argument, device)


def _classical(argument: str, device: str) -> Predictor:
    from materialist.predict.classical import ClassicalPredictor

    return ClassicalPredictor()


def _maps(argument: str, device: str) -> Predictor:
    from materialist.predict.maps import MapsPredictor

    return MapsPredictor(argument)


def _bundled(argument: str, device: str) -> Predictor:
    from materialist.predict.bundled.predictor import BundledPredictor

    return BundledPredictor(argument, device=device)


def _auto(argument: str, device: str) -> Predictor:
    from materialist.predict.bundled import WEIGHTS

    if WEIGHTS.is_file():
        return _bundled("", device)
    from materialist.predict.classical import ClassicalPredictor

    return ClassicalPredictor(note=f"This installation has no weights of the bundled network ({WEIGHTS.name}).")


def _matnet(argument: str, device: str) -> Predictor:
    from materialist.predict.matnet.predictor import MatNetPredictor

    return MatNetPredictor(argument, device=device)


def _marigold(argument: str, device: str):
    from materialist.predict.marigold import Marigold, MarigoldPart

    return MarigoldPart(argument, device=device) if argument else Marigold(device=device)


def _depth_anything(argument: str, device: str):
    from materialist.predict.depth_anything import DepthAnything

    return DepthAnything(argument, device=device)


def _moge(argument: str, device: str):
    from materialist.predict.moge import MogeFolder

    return MogeFolder(argument)


_OPEN: dict[str, Callable] = {
    "auto": _auto,
    "classical": _classical,
    "bundled": _bundled,
    "maps": _maps,
    "matnet": _matnet,
    "marigold": _marigold,
    "depth-anything": _depth_anything,
    "moge": _moge,
}
"""Name before the colon -> what opens it, given what stands behind the colon and the device."""

CHOICES = "auto, bundled[:FILE], classical, matnet[:FILE], marigold, depth-anything, moge:DIR, maps:DIR"
