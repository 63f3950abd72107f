"""`bench real`: photographs with measured truth, the layouts that they come in, and what is measured on them."""

from materialist_lab.bench.real.judge import RealBench

__all__ = ["RealBench"]
