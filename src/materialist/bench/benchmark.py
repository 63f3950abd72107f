"""What every benchmark has: options as the fields of a frozen dataclass, and a clock."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from materialist.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Benchmark(ABC):
    """One benchmark; its fields are the options of `materialist bench NAME`."""

    least: ClassVar[dict[str, int]] = {}
    """Smallest value of options that are counts or sizes; 0 where nothing is said."""

    seed: int = 0
    device: str = "auto"

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            low = self.least.get(name, 0)
            if isinstance(value, int) and not isinstance(value, bool) and value < low:
                raise InputError(f"--{name} is {value}; give at least {low}.")
        latency = getattr(self, "latency", 0)
        if 0 < latency < 64:
            raise InputError(f"--latency is {latency}; give 0, or 64 pixels or more.")

    @abstractmethod
    def run(self, data: Path | None, output: Path) -> None:
        """Measure with the files of `data`, and write the report into the folder `output` as rows come in."""

    def settings(self, data: Path | None, **more: Any) -> dict[str, Any]:
        """What the report says was asked for: the options, the folder's name, and what a benchmark found out."""
        given = {name: None if value == "" else value for name, value in asdict(self).items()}
        return {**given, "data": None if data is None else data.name, **more}


class Clock:
    """Wall and processor seconds since it was made; other programs hardly change the latter."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        """`seconds` and `cpu_seconds`."""
        return {"seconds": time.perf_counter() - self._wall, "cpu_seconds": time.process_time() - self._cpu}
