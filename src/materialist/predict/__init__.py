"""Predictors: from one photograph to the prior of the fit."""

from materialist.predict.base import NEUTRAL_METALLIC, NEUTRAL_ROUGHNESS, Predictor, get_predictor

__all__ = ["NEUTRAL_METALLIC", "NEUTRAL_ROUGHNESS", "Predictor", "get_predictor"]
