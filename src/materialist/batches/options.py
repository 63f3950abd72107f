"""How a batch runs: options of `materialist batch`; nothing slow is imported here."""

from dataclasses import dataclass
from pathlib import Path

from materialist.errors import InputError
from materialist.option_kinds import OperationOptions, option
from materialist.options import PATHS

INVERSION = "materialist.pipeline:invert"
"""The function that a worker calls on a photo, as module:function."""


@dataclass(frozen=True, kw_only=True)
class BatchOptions(OperationOptions):
    """How a batch runs, beside the options of its inversions."""

    operation = "batch"

    apply: str | Path | None = option(
        None,
        "Edits for every photo; {name} in a mask's file name is the photo's.",
        kind="file",
        metavar="EDITS",
    )
    spp: int = option(
        PATHS,
        "Paths per pixel of the edits.",
        kind="whole",
        low=2,
        high=1_000_000,
        called="number of paths (spp)",
    )
    format: str = option(
        "png",
        "Suffix of the edited photos.",
        kind="word",
        choices=("png", "jpg", "tif", "webp", "avif", "exr"),
    )
    quality: int | None = option(
        None, "Of jpg, webp and avif, as for edit.", kind="whole", low=1, high=100, needs="format"
    )
    workers: int | None = option(
        None,
        "Worker processes; else one a GPU, or one a processor as far as memory reaches.",
        kind="whole",
        low=1,
        high=1024,
        called="number of workers",
    )
    ray: str | None = option(
        None, "A Ray cluster instead, or local.", kind="name", metavar="ADDRESS"
    )
    resume: bool = option(
        False, "Go on with the batch in RUNS: finished photos are kept.", kind="switch"
    )
    force: bool = option(
        False,
        "Begin an earlier batch in RUNS anew; with --resume, under other options.",
        kind="switch",
    )
    function: str = option(INVERSION, "The inversion, as module:function.", kind="name", flag=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.quality is not None and self.format not in ("jpg", "webp", "avif"):
            raise InputError(
                f"The quality is of jpg, webp and avif; {self.format} has none, so leave it out."
            )

    @property
    def recipe(self) -> Path | None:
        return None if self.apply is None else Path(self.apply).resolve()
