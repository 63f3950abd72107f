"""What the benchmarks of predictors share: opening one, timing one."""

from __future__ import annotations

import time
from typing import Any

from materialist.errors import InputError
from materialist.types import Photo, Prediction


def specs_of(text: str) -> list[str]:
    """The predictors of a list with commas, each once. Raises InputError for an empty one."""
    found = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not found:
        raise InputError("--predictor is empty; name at least one.")
    return found


def opened(spec: str, device: str = "auto") -> Any:
    """The predictor of that name; raises as `get_predictor`."""
    from materialist.predict import get_predictor

    return get_predictor(spec, device=device)


def predicted(source: Any, photo: Photo, seed: int) -> tuple[Prediction, float]:
    """The maps and the seconds they took."""
    start = time.perf_counter()
    prediction = source.predict(photo, seed=seed)
    return prediction, time.perf_counter() - start
