"""The predictor `constant`: the same neutral maps for every photo, as a baseline."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from materialist.predict.protocol import NEUTRAL_METALLIC, NEUTRAL_ROUGHNESS, MapSet, Predictor
from materialist.types import Array, Photo

VALUES = {
    "albedo": (0.5, 0.5, 0.5),
    "roughness": NEUTRAL_ROUGHNESS,
    "metallic": NEUTRAL_METALLIC,
    "normal": (0.0, 0.0, 0.0),
    "depth": 3.0,
}
"""Grey paint, the paper's neutral roughness and metallic, and a plane across the view (depth in scene units)."""


class ConstantPredictor(Predictor):
    """Neutral materials on a plane that faces the camera."""

    source = "constant"

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> MapSet:
        """The wanted maps, with a warning that names them; the normals are unknown, and so follow from the depth."""
        size = photo.linear.shape[:2]
        maps = {}
        for name in wanted:
            value = np.asarray(VALUES[name], np.float32)
            maps[name] = np.broadcast_to(value, (*size, *value.shape)).copy()
        note = f"The constant predictor knows nothing of the photo: {', '.join(wanted)} are neutral everywhere."
        return MapSet(maps, dict.fromkeys(wanted, self.name), (note,))
