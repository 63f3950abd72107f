"""The built-in predictor: no weights, no learning, a guess from colour, edges and a ground plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.predict.base import NEUTRAL_METALLIC, NEUTRAL_ROUGHNESS, SKY_NOTE
from materialist.predict.layout import guess_depth
from materialist.predict.mix import MAPS, Part
from materialist.predict.normals import normals_from_depth
from materialist.predict.retinex import separate
from materialist.types import Array, Materials, Photo, Prediction

GUESSES = (
    (("normal", "depth"), "geometry is a guess (ground plane, back wall, upright objects)"),
    (("albedo",), "albedo is a colour Retinex estimate"),
    (("roughness",), "roughness is neutral"),
    (("metallic",), "metallic is neutral"),
)
"""Maps -> what is true of them."""


class ClassicalPredictor:
    """Colour Retinex for albedo, a ground-and-objects layout for depth, the paper's neutral roughness and metallic."""

    name = "classical"
    normals_follow_depth = True

    def __init__(self, *, note: str | None = None):
        """`note` says why this predictor runs although another was expected; it leads the warnings."""
        self.note = note

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """Maps of the photo's working size; deterministic, `seed` changes nothing. Works on any photo."""
        return self._predicted(photo, MAPS)

    def parts(
        self, photo: Photo, wanted: Sequence[str], *, seed: int = 0, normal: Array | None = None
    ) -> Part:  # fmt: skip
        """Some of these maps, with warnings of those alone; `seed` and `normal` change nothing."""
        found = self._predicted(photo, wanted)
        maps = {**vars(found.materials), "normal": found.normal, "depth": found.depth}
        return Part({name: maps[name] for name in wanted}, dict.fromkeys(wanted, self.name), found.warnings)

    def _predicted(self, photo: Photo, wanted: Sequence[str]) -> Prediction:
        depth = guess_depth(photo.linear, photo.camera)
        albedo, _ = separate(photo.linear)
        size = photo.linear.shape[:2]
        materials = Materials(
            albedo=albedo,
            roughness=np.full(size, NEUTRAL_ROUGHNESS, np.float32),
            metallic=np.full(size, NEUTRAL_METALLIC, np.float32),
        )
        said = ", ".join(text for names, text in GUESSES if any(name in wanted for name in names))
        warning = (
            f"The built-in classical predictor ran: {said}; maps of a trained network do better (--predictor maps:DIR)."
        )
        warnings = [warning] if self.note is None else [self.note, warning]
        if "depth" in wanted and (depth == 0).any():
            warnings.append(f"{(depth == 0).mean():.0%} {SKY_NOTE}")
        normal = normals_from_depth(depth, photo.camera, radius=2)
        return Prediction(materials, normal, depth, predictor=self.name, warnings=tuple(warnings))
