"""What a predictor is: names of the maps, and the interfaces that every predictor implements."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from materialist.types import Array, Materials, Photo, Prediction

MAPS = ("albedo", "roughness", "metallic", "normal", "depth")
NEUTRAL_ROUGHNESS = 0.5
"""The paper's neutral start (section "Predicted Material Properties on Envmap Estimation")."""
NEUTRAL_METALLIC = 0.1
"""The paper's neutral start, as above."""
SKY_NOTE = "of the picture was taken for sky and has no surface."
"""End of the warning that a predictor gives where its depth is 0."""


@runtime_checkable
class Predictor(Protocol):
    """Turns a photograph into a prior: materials, normals and depth (paper, section "MatNet")."""

    @property
    def name(self) -> str:
        """The name of the predictor in the report."""
        ...

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """All maps at the photo's working size, in the conventions of `Prediction`; equal seeds give equal maps."""
        ...


@dataclass(frozen=True)
class Part:
    """Some of the maps of a photograph."""

    maps: dict[str, Array]
    """Name -> [H, W, 3] or [H, W] float32, in the conventions of `Prediction`."""
    sources: dict[str, str]
    """Name -> origin of the map, for the scene's provenance."""
    warnings: tuple[str, ...] = ()


class PartPredictor(Protocol):
    """Gives some of the maps, and computes only the wanted ones.

    A PartPredictor may also have `prepare(wanted)`, which raises SetupError or WeightsError before the first photo
    where a library or a network is missing.
    """

    @property
    def gives(self) -> tuple[str, ...]:
        """Names of the maps that the predictor can give."""
        ...

    @property
    def name(self) -> str:
        """The name of the predictor in the report."""
        ...

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> Part:
        """The wanted maps at the photo's working size.

        `normal` [H, W, 3], where known, sets the scale of a relative depth (docs/predictors.md, "Relative depth").
        """
        ...


def whole(source: PartPredictor, photo: Photo, *, seed: int = 0) -> Prediction:
    """All five maps of one source."""
    part = source.parts(photo, MAPS, seed=seed)
    materials = Materials(*(part.maps[name] for name in MAPS[:3]))
    return Prediction(materials, part.maps["normal"], part.maps["depth"], source.name, part.warnings, part.sources)
