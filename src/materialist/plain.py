"""Values as JSON has them."""

import math
from collections.abc import Iterable
from typing import Any


def plain(value: Any) -> Any:
    """JSON's own types: arrays as lists, keys as texts, NaN and infinity, which JSON lacks, as None; else a text."""
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    # JSON knows neither NaN nor infinity.
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    return [plain(item) for item in value] if isinstance(value, Iterable) else str(value)


def is_utf8(text: str) -> bool:
    """Whether a text, such as a file name from the system, can be written as UTF-8."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True
