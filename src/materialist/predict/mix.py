"""A prior put together from several predictors, map by map."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from materialist.predict.protocol import MAPS, Part, Predictor
from materialist.types import Array, Photo


class MixedPredictor(Predictor):
    """Every map from its own source.

    Args:
        chosen: map -> spec of its source.
        sources: spec -> predictor.
    """

    def __init__(self, chosen: Mapping[str, str], sources: Mapping[str, Predictor]):
        self.sources = sources
        self.shares = {spec: [name for name in MAPS if chosen[name] == spec] for spec in sources}
        self.depth_spec = chosen["depth"]
        self.field_of_view = sources[self.depth_spec].field_of_view

    @property
    def name(self) -> str:
        """Every source with its maps, as in 'albedo: marigold; roughness, metallic, normal, depth: bundled'."""
        return "; ".join(f"{', '.join(names)}: {self.sources[spec].name}" for spec, names in self.shares.items())

    def prepare(self, wanted: Collection[str]) -> None:
        """Prepare the sources of the wanted maps."""
        for spec, names in self.shares.items():
            if not set(names).isdisjoint(wanted):
                self.sources[spec].prepare(names)

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> Part:
        """The wanted maps of all sources together. Each source runs once."""
        maps: dict[str, Array] = {}
        sources: dict[str, str] = {}
        warnings: tuple[str, ...] = ()
        # The source of the depth comes last: a known normal map helps to scale a relative depth.
        for spec in sorted(self.sources, key=lambda spec: spec == self.depth_spec):
            names = [name for name in self.shares[spec] if name in wanted]
            if names:
                part = self.sources[spec].parts(photo, names, seed=seed, normal=maps.get("normal", normal))
                maps |= part.maps
                sources |= part.sources
                warnings += part.warnings
        return Part(maps, sources, warnings)
