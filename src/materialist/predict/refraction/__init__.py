"""RefractionNet: how thick an object is behind what a photo shows of it (paper, Thickness Prior Prediction)."""

from materialist.predict.refraction.thickness import WEIGHTS, Thickness, best_thickness, thickness

__all__ = ["WEIGHTS", "Thickness", "best_thickness", "thickness"]
