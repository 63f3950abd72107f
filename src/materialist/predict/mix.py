"""A prior put together from several predictors, map by map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from materialist.errors import InputError
from materialist.predict.normals import normals_from_depth
from materialist.predict.protocol import MAPS, SKY_NOTE, Part
from materialist.types import Array, Materials, Photo, Prediction

WINDOW = 2
"""Radius, pixels, of the window in which normals are derived from the depth of another source."""


class MixedPredictor:
    """Every map from its own source.

    Args:
        chosen: map -> spec of its source.
        sources: spec -> Predictor or PartPredictor.

    Raises:
        InputError: a source that does not give its map; and the errors of the sources' `prepare`.
    """

    def __init__(self, chosen: Mapping[str, str], sources: Mapping[str, Any]):
        self.sources = sources
        self.wanted = {spec: [name for name in MAPS if chosen[name] == spec] for spec in sources}
        self.depth_spec, self.normal_spec = chosen["depth"], chosen["normal"]
        for spec, source in sources.items():
            lacking = [name for name in self.wanted[spec] if name not in getattr(source, "gives", MAPS)]
            if lacking:
                raise InputError(
                    f"'{spec}' gives only {', '.join(source.gives)}, not {lacking[0]}; name another source for it."
                )
            if hasattr(source, "prepare"):
                source.prepare(self.wanted[spec])

    @property
    def name(self) -> str:
        """Every source with its maps, as in 'albedo: marigold; roughness, metallic, normal, depth: bundled'."""
        return "; ".join(f"{', '.join(names)}: {self.sources[spec].name}" for spec, names in self.wanted.items())

    @property
    def field_of_view(self) -> float | None:
        """Horizontal, degrees, where the source of the depth knows it."""
        return getattr(self.sources[self.depth_spec], "field_of_view", None)

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """The maps of all sources together.

        Normals are derived from the chosen depth where their source would derive them from a depth of its own, and
        where their source does not know them.
        """
        derived = self.normal_spec != self.depth_spec and getattr(
            self.sources[self.normal_spec], "normals_follow_depth", False
        )
        maps: dict[str, Array] = {}
        sources: dict[str, str] = {}
        warnings: list[str] = []
        # The source of the depth comes last: a measured normal map helps to scale a relative depth.
        for spec in sorted(self.sources, key=lambda spec: spec == self.depth_spec):
            wanted = [name for name in self.wanted[spec] if not (derived and name == "normal")]
            if wanted:
                part = _parts(self.sources[spec], photo, wanted, seed, maps.get("normal"))
                maps |= part.maps
                sources |= part.sources
                warnings += part.warnings
        if derived:
            maps["normal"] = normals_from_depth(maps["depth"], photo.camera, radius=WINDOW)
            sources["normal"] = f"derived from the depth of {self.sources[self.depth_spec].name}"
        maps["normal"] = _filled(maps["normal"], maps["depth"], photo)
        materials = Materials(maps["albedo"], maps["roughness"], maps["metallic"])
        ordered = {name: sources[name] for name in MAPS}
        return Prediction(materials, maps["normal"], maps["depth"], self.name, tuple(warnings), ordered)


def _parts(source: Any, photo: Photo, wanted: list[str], seed: int, normal: Array | None) -> Part:
    """The wanted maps of a Predictor or PartPredictor."""
    if hasattr(source, "parts"):
        return source.parts(photo, wanted, seed=seed, normal=normal)
    found = source.predict(photo, seed=seed)
    maps = {**vars(found.materials), "normal": found.normal, "depth": found.depth}
    warnings = found.warnings
    if "depth" not in wanted:  # sky of this source may be a surface of the source of the depth
        maps["normal"] = np.where((found.depth > 0)[..., None], found.normal, 0).astype(np.float32)
        warnings = tuple(note for note in warnings if not note.endswith(SKY_NOTE))
    return Part({name: maps[name] for name in wanted}, dict.fromkeys(wanted, found.predictor), warnings)


def _filled(normal: Array, depth: Array, photo: Photo) -> Array:
    """[H, W, 3] unit normals; where they are unknown (zero), the normals of the depth."""
    unknown = np.linalg.norm(normal, axis=-1, keepdims=True) < 0.5
    if not unknown.any():
        return normal
    return np.where(unknown, normals_from_depth(depth, photo.camera, radius=WINDOW), normal)
