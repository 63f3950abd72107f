"""Materialist: physically based editing of a single photograph.

    import materialist as mt

    scene = mt.invert("kitchen.jpg")
    mt.save_scene(scene, "kitchen.scene")

Everything public is named in `__init__.pyi` and loaded on first use, so that `import materialist` stays quick.
"""

import os

import lazy_loader

__version__ = "0.1.0"

# Torch's OpenMP threads otherwise spin while they wait, and take the processors from whatever runs beside them. OpenMP
# reads this when torch is loaded; a choice of the user's own stays.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
