"""What a predictor is: names of the maps, the base class, the constant predictor, and a prior from several of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from materialist.errors import SetupError
from materialist.predict.normals import normals_from_depth
from materialist.types import Array, Materials, Photo, Prediction

MAPS = ("albedo", "roughness", "metallic", "normal", "depth")
NEUTRAL_ROUGHNESS = 0.5
"""The paper's neutral start (section "Predicted Material Properties on Envmap Estimation")."""
NEUTRAL_METALLIC = 0.1
"""The paper's neutral start, as above."""


@dataclass(frozen=True)
class MapSet:
    """Some of the maps of a photograph."""

    maps: dict[str, Array]
    """Name -> [H, W, 3] or [H, W] float32, in the conventions of `Prediction`; a normal of 0 is unknown."""
    sources: dict[str, str]
    """Name -> origin of the map, for the scene's provenance."""
    warnings: tuple[str, ...] = ()
    light: Array | None = None
    """That of `Prediction`, from the source of the albedo, whose exposure it shares."""
    spread: dict[str, Array] = field(default_factory=dict)
    """That of `Prediction`, of the maps that are here."""


class Predictor(ABC):
    """Turns a photograph into a prior: materials, normals and depth (paper, section "MatNet")."""

    gives: tuple[str, ...] = MAPS
    """Names of the maps that the predictor can give."""
    field_of_view: float | None = None
    """Horizontal, degrees, where the predictor knows it."""

    on_materials: Callable[[Materials], Any] | None = None
    """Called with the materials by a predictor that has them long before the rest."""

    name: str
    """What the report calls it: name, file or folder, and the start of the weights' checksum."""

    @abstractmethod
    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The maps of these names at the photo's working size; equal seeds give equal maps, most ignore the seed.

        `normal` [H, W, 3], where known, sets the scale of a relative depth (docs/predictors.md, "Relative depth").
        """

    def prepare(self, names: Collection[str]) -> None:  # noqa: B027 (most predictors load all they need when made)
        """Raise SetupError or WeightsError before the first photo where a library or a network is missing."""

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """All five maps at the photo's working size. Normals that are unknown are derived from the depth."""
        part = self.parts(photo, MAPS, seed=seed)
        maps = part.maps
        sources = {name: part.sources[name] for name in MAPS}
        normal = maps["normal"]
        # A zero vector means unknown: geometry of the depth's own stands in.
        known = np.linalg.norm(normal, axis=-1, keepdims=True) > 0.5
        if not known.all():
            normal = np.where(
                known, normal, normals_from_depth(maps["depth"], photo.camera, radius=2)
            )
        if not known.any():
            sources["normal"] = f"derived from the depth of {sources['depth']}"
        materials = Materials(maps["albedo"], maps["roughness"], maps["metallic"])
        return Prediction(
            materials,
            normal,
            maps["depth"],
            self.name,
            part.warnings,
            sources,
            part.light,
            part.spread,
        )


CONSTANT = {
    "albedo": (0.5, 0.5, 0.5),
    "roughness": NEUTRAL_ROUGHNESS,
    "metallic": NEUTRAL_METALLIC,
    "normal": (0.0, 0.0, 0.0),
    "depth": 3.0,
}
"""Grey paint, the paper's neutral roughness and metallic, and a plane across the view (depth in scene units)."""


class ConstantPredictor(Predictor):
    """`constant`: neutral materials on a plane that faces the camera, the same for every photo, as a baseline."""

    name = "constant"

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted maps, with a warning that names them; the normals are unknown, and so follow from the depth."""
        size = photo.linear.shape[:2]
        values = {name: np.asarray(CONSTANT[name], np.float32) for name in names}
        maps = {
            name: np.broadcast_to(value, (*size, *value.shape)).copy()
            for name, value in values.items()
        }
        note = f"The constant predictor knows nothing of the photo: {', '.join(names)} are neutral everywhere."
        return MapSet(maps, dict.fromkeys(names, self.name), (note,))


class MixedPredictor(Predictor):
    """Every map from its own source."""

    def __init__(self, chosen: Mapping[str, str], sources: Mapping[str, Predictor]):
        """`chosen`: map -> spec of its source. `sources`: spec -> predictor."""
        self.sources = sources
        self.shares = {spec: [name for name in MAPS if chosen[name] == spec] for spec in sources}
        self.depth_spec = chosen["depth"]
        self.field_of_view = sources[self.depth_spec].field_of_view
        # As in 'albedo: marigold; roughness, metallic, normal, depth: bundled'.
        self.name = "; ".join(
            f"{', '.join(members)}: {sources[spec].name}" for spec, members in self.shares.items()
        )

    def prepare(self, names: Collection[str]) -> None:
        for spec, members in self.shares.items():
            if not set(members).isdisjoint(names):
                self.sources[spec].prepare(members)

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted maps of all sources together. Each source runs once."""
        maps: dict[str, Array] = {}
        sources: dict[str, str] = {}
        warnings: tuple[str, ...] = ()
        light = None
        spread: dict[str, Array] = {}
        # The source of the depth comes last: a known normal map helps to scale a relative depth.
        for spec in sorted(self.sources, key=lambda spec: spec == self.depth_spec):
            members = [name for name in self.shares[spec] if name in names]
            if members:
                part = self.sources[spec].parts(
                    photo, members, seed=seed, normal=maps.get("normal", normal)
                )
                maps |= part.maps
                sources |= part.sources
                warnings += part.warnings
                light = part.light if part.light is not None else light
                spread |= part.spread
        return MapSet(maps, sources, warnings, light, spread)


def on_gpu(device: str) -> bool:
    """Whether 'auto', 'cpu' or 'cuda' means the GPU here. Raises SetupError for a CUDA device that is not there."""
    import torch

    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise SetupError('There is no CUDA device that PyTorch can use; choose `device="cpu"`.')
    return device != "cpu" and there
