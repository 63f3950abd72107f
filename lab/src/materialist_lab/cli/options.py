"""Options that the training commands share."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from materialist.cli.options import Computing
from materialist.option_kinds import OperationOptions, option


@dataclass(frozen=True, kw_only=True)
class Training(Computing):
    """How long a network is trained, and where the run goes on."""

    steps: int | None = option(None, "Train this many steps more.", kind="whole")
    minutes: float | None = option(None, "Train this many minutes more.")
    resume: bool = option(False, "Go on with the run in RUN, if there is one.", kind="switch")
    every: float = option(180, "Seconds between checkpoints.")


@dataclass(frozen=True, kw_only=True)
class Learning(OperationOptions):
    """How a network learns, where that differs from its recipe."""

    batch: int | None = option(None, "Samples a step; default: the recipe's.", kind="whole")
    side: int | None = option(
        None,
        "Side of all crops, pixels; default: the recipe's, small ones first.",
        kind="whole",
        flag="--size",
    )
    rate: float | None = option(None, "Peak learning rate; default: the recipe's.")
    bfloat16: bool | None = option(
        None,
        "Compute in bfloat16; default: where the processor has instructions for it.",
        kind="switch",
        flag="--bfloat16/--no-bfloat16",
    )
    init: Path | None = option(
        None,
        "Weights to begin from: those of a run; matnet --config paper: Depth Anything or DINOv2.",
        kind="file",
    )

    def recipe(self, defaults: Any) -> Any:
        """The recipe `usual` with what was given."""
        return defaults.changed(
            batch=self.batch, side=self.side, rate=self.rate, bfloat16=self.bfloat16
        )
