"""The bundled network: a small convolutional one, trained on generated pictures, whose weights ship in the package."""

from pathlib import Path

WEIGHTS = Path(__file__).with_name("weights.safetensors")
"""Where the package has the weights of its network."""
