"""Predictors: from one photograph to the prior of the fit."""

from materialist.predict.protocol import NEUTRAL_METALLIC, NEUTRAL_ROUGHNESS, Predictor
from materialist.predict.registry import CHOICES, get_predictor

__all__ = ["CHOICES", "NEUTRAL_METALLIC", "NEUTRAL_ROUGHNESS", "Predictor", "get_predictor"]
