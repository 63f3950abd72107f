"""The variant is chosen before any test module imports Dr.Jit."""

from materialist.render.variant import setup

setup("cpu")
