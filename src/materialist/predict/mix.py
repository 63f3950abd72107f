"""A prior put together from several predictors, map by map."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from materialist.errors import InputError
from materialist.predict.base import SKY_NOTE, Predictor, open_source
from materialist.predict.normals import normals_from_depth
from materialist.types import Array, Materials, Photo, Prediction

MAPS = ("albedo", "roughness", "metallic", "normal", "depth")
FOLLOW_DEPTH = 2
"""Radius of the window, pixels, over which normals are derived from a depth that has none of its own."""


@dataclass(frozen=True)
class Part:
    """Some of the maps of a photograph."""

    maps: dict[str, Array]
    """Name -> [H, W, 3] or [H, W] float32, in the conventions of `Prediction`."""
    sources: dict[str, str]
    """Name -> where it comes from, for the scene's provenance."""
    warnings: tuple[str, ...] = field(default=())


class PartPredictor(Protocol):
    """Gives some of the maps, and computes only those that are wanted."""

    @property
    def gives(self) -> tuple[str, ...]:
        """Names of the maps it can give."""
        ...

    @property
    def name(self) -> str:
        """What the report calls it."""
        ...

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> Part:
        """The wanted maps, of the photo's working size.

        `normal` [H, W, 3], where known, helps those whose depth has no scale (docs/predictors.md, "Relative depth").
        """
        ...


class MixedPredictor:
    """Single maps from named sources, everything else from another predictor.

    Args:
        parts: map -> spec of its source.
        rest: spec of the predictor of all other maps; not opened when none are left.

    Raises:
        InputError: a map that does not exist, or a source that does not give it; and what opening a source raises.
    """

    def __init__(self, parts: Mapping[str, str], rest: str = "auto", *, device: str = "auto"):
        unknown = [name for name in parts if name not in MAPS]
        if unknown:
            raise InputError(f"There is no map '{unknown[0]}'; a predictor can be named for {', '.join(MAPS)}.")
        chosen = {name: parts.get(name, rest) for name in MAPS}
        self.sources = {spec: open_source(spec, device) for spec in dict.fromkeys(chosen.values())}
        self.wanted = {spec: [name for name in MAPS if chosen[name] == spec] for spec in self.sources}
        self.depth_spec, self.normal_spec = chosen["depth"], chosen["normal"]
        for spec, source in self.sources.items():
            lacking = [name for name in self.wanted[spec] if name not in getattr(source, "gives", MAPS)]
            if lacking:
                raise InputError(
                    f"'{spec}' gives only {', '.join(source.gives)}, not {lacking[0]}; name another source for it."
                )
            if hasattr(source, "prepare"):
                source.prepare(self.wanted[spec])

    @property
    def name(self) -> str:
        """Every source with its maps, as in 'albedo: marigold; rest: classical'."""
        return "; ".join(f"{', '.join(names)}: {self.sources[spec].name}" for spec, names in self.wanted.items())

    @property
    def field_of_view(self) -> float | None:
        """Horizontal, degrees, where the source of the depth knows it."""
        return getattr(self.sources[self.depth_spec], "field_of_view", None)

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """The maps of all sources together.

        Normals of a source that derives them from its own depth are derived from the chosen depth instead, and so are
        those that their source does not know.
        """
        derived = self.normal_spec != self.depth_spec and _follows_depth(self.sources[self.normal_spec])
        # The source of the depth comes last: a measured normal map helps to scale a relative depth.
        order = sorted(self.sources, key=lambda spec: spec == self.depth_spec)
        maps: dict[str, Array] = {}
        sources: dict[str, str] = {}
        warnings: list[str] = []
        for spec in order:
            guide = None if derived else maps.get("normal")
            # What it would derive from a depth of its own, which it need not have, is not asked for.
            wanted = [name for name in self.wanted[spec] if not (derived and name == "normal")]
            if not wanted:
                continue
            part = _parts(self.sources[spec], photo, wanted, seed, guide)
            maps |= part.maps
            sources |= part.sources
            warnings += part.warnings
        if derived:
            maps["normal"] = normals_from_depth(maps["depth"], photo.camera, radius=FOLLOW_DEPTH)
            sources["normal"] = f"derived from the depth of {self.sources[self.depth_spec].name}"
        _check_sizes(maps, photo)
        maps["normal"] = _filled(maps["normal"], maps["depth"], photo)
        materials = Materials(maps["albedo"], maps["roughness"], maps["metallic"])
        ordered = {name: sources[name] for name in MAPS}
        return Prediction(materials, maps["normal"], maps["depth"], self.name, tuple(warnings), ordered)


def whole(source: PartPredictor, photo: Photo, *, seed: int = 0) -> Prediction:
    """All five maps of one source, as a Prediction."""
    part = source.parts(photo, MAPS, seed=seed)
    materials = Materials(*(part.maps[name] for name in MAPS[:3]))
    return Prediction(materials, part.maps["normal"], part.maps["depth"], source.name, part.warnings, part.sources)


def _parts(source, photo: Photo, wanted: list[str], seed: int, normal: Array | None) -> Part:
    """The wanted maps of a source of either kind."""
    if hasattr(source, "parts"):
        return source.parts(photo, wanted, seed=seed, normal=normal)
    assert isinstance(source, Predictor)
    found = source.predict(photo, seed=seed)
    maps = {**vars(found.materials), "normal": found.normal, "depth": found.depth}
    sources = {name: found.sources.get(name, found.predictor) for name in wanted}
    warnings = found.warnings
    if "depth" not in wanted:  # what it took for sky may be a surface of the source of the depth
        maps["normal"] = np.where((found.depth > 0)[..., None], found.normal, 0).astype(np.float32)
        warnings = tuple(note for note in warnings if not note.endswith(SKY_NOTE))
    return Part({name: maps[name] for name in wanted}, sources, warnings)


def _filled(normal: Array, depth: Array, photo: Photo) -> Array:
    """[H, W, 3] unit normals; where they are unknown (zero), those of the depth."""
    unknown = np.linalg.norm(normal, axis=-1, keepdims=True) < 0.5
    if not unknown.any():
        return normal
    return np.where(unknown, normals_from_depth(depth, photo.camera, radius=FOLLOW_DEPTH), normal)


def _follows_depth(source) -> bool:
    """Whether the source's normals are derived from its own depth, and so mean nothing beside another one."""
    return bool(getattr(source, "normals_follow_depth", False))


def _check_sizes(maps: dict[str, Array], photo: Photo) -> None:
    size = photo.linear.shape[:2]
    for name, values in maps.items():
        if values.shape[:2] != size or not np.isfinite(values).all():
            raise InputError(
                f"The {name} map is {values.shape[:2]} or not finite; the photo is {size} (rows, columns)."
            )
