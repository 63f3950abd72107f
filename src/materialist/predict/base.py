"""What a predictor is, and how one is chosen by name."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from materialist.errors import InputError, SetupError
from materialist.types import Photo, Prediction

NEUTRAL_ROUGHNESS = 0.5
"""The paper's neutral start where nothing is known (section "Predicted Material Properties on Envmap Estimation")."""
NEUTRAL_METALLIC = 0.1
"""As above."""

CHOICES = "auto, classical, maps:DIR"
_NOT_YET = ("bundled", "matnet", "marigold")


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


def get_predictor(spec: str = "auto") -> Predictor:
    """The predictor named by `spec`: 'auto', 'classical' or 'maps:DIR'.

    Raises SetupError for predictors whose weights are not part of this installation, InputError for unknown names
    and for a DIR that is not a folder.
    """
    name, _, argument = spec.partition(":")
    if name == "maps":
        from materialist.predict.maps import MapsPredictor

        return MapsPredictor(argument)
    if spec in ("auto", "classical"):
        from materialist.predict.classical import ClassicalPredictor

        return ClassicalPredictor()
    if name in _NOT_YET:
        raise SetupError(
            f"The predictor '{name}' is not part of this version; use --predictor classical, or run that network "
            "elsewhere and read its maps with --predictor maps:DIR."
        )
    raise InputError(f"There is no predictor '{spec}'; choose one of {CHOICES}.")
