"""What a data set holds: options of `materialist train data`; nothing slow is imported here."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from materialist.errors import InputError
from materialist.option_kinds import OperationOptions, option
from materialist_lab.procedural.catalog import packages

KINDS = ("furnished", "laid", "single", "outside")
"""Kinds of scenes."""
SPLITS: dict[str, tuple[int, ...]] = {"train": (), "heldout": (1,)}
"""Split -> the numbers it adds to the random seed of a sample: no two splits show the same scenes."""
HELD_OUT = frozenset(
    (
        "binoculars",
        "capsule",
        "fandisk",
        "lightbulb",
        "spot_cow",
        "train",
        "aristea_wreck_puresky",
        "brown_photostudio_06",
        "dikhololo_night",
        "kiara_dawn",
        "museum",
        "st_fagans_interior",
        "venice_sunset",
    )
)
"""Stems of meshes and HDR captures. No training set may use them; the split 'heldout' uses nothing else."""


def captures(folder: Path, pattern: str, held_out: bool | None = None) -> list[Path]:
    """Files of a folder by a pattern, sorted: all, or only those that are HELD_OUT, or only the others.

    Raises InputError where there are none.
    """
    paths = sorted(
        p for p in folder.glob(pattern) if held_out is None or (p.stem in HELD_OUT) == held_out
    )
    if not paths:
        which = (
            ""
            if held_out is None
            else f" {'kept aside for testing' if held_out else 'to train on'}"
        )
        raise InputError(
            f"{folder} holds no {Path(pattern).suffix} files{which}; give another folder, or none."
        )
    return paths


@dataclass(frozen=True, kw_only=True)
class DataSetOptions(OperationOptions):
    """What decides, with the number of a sample, what it shows.

    Raises InputError for values or folders that cannot be used.
    """

    operation = "The data set"

    size: int = option(256, "Pixels on a side, a multiple of 4.", kind="whole", low=32, high=2048)
    spp: int = option(16, "Samples per pixel, before denoising.", kind="whole", low=1, high=4096)
    meshes: Path | None = option(None, "Folder of .ply meshes to use as well.", kind="file")
    envmaps: Path | None = option(None, "Folder of .exr HDR captures to use as well.", kind="file")
    split: str = option(
        "train",
        "heldout uses only the files kept aside for testing.",
        kind="word",
        choices=tuple(SPLITS),
    )
    furniture: Path | None = option(
        None,
        "Folder of .sh3f catalogues; default: that of Debian's sweethome3d-furniture.",
        kind="file",
    )
    cache: Path | None = option(
        None,
        "Folder for models and photographs as they are read; default: in the user's cache.",
        kind="file",
    )
    only: str = option(
        "", f"Only one kind of scenes: {', '.join(KINDS)}.", kind="name", metavar="KIND"
    )
    seed: int = option(0, "Same seed, same samples.", kind="whole", low=0, flag=None)
    device: str = option(
        "auto", "Where it renders.", kind="word", choices=("auto", "cpu", "cuda"), flag=None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        # The tracer ends 16 lanes together: see `tracer.VECTOR`.
        if self.size % 4:
            raise InputError(f"The size is {self.size}; give a multiple of 4.")
        if self.only and self.only not in KINDS:
            raise InputError(
                f"There is no kind '{self.only}' of scene; give one of {', '.join(KINDS)}, or none."
            )
        _ = self.mesh_files, self.envmap_files  # which raise where a folder cannot be used

    @cached_property
    def archives(self) -> tuple[Path, ...]:
        """The catalogues of models, sorted. Raises InputError where there are none."""
        paths = packages.archives(self.furniture)
        if not paths:
            where = f"in {self.furniture}" if self.furniture else "installed"
            raise InputError(f"No 3D models are {where}; install them with: {packages.INSTALL}.")
        return paths

    @cached_property
    def photographs(self) -> tuple[Path, ...]:
        """Photographs of installed packages, sorted."""
        return packages.photographs()

    @cached_property
    def mesh_files(self) -> tuple[Path, ...]:
        """The meshes that the split may use, sorted by name."""
        return self._files(self.meshes, ".ply")

    @cached_property
    def envmap_files(self) -> tuple[Path, ...]:
        """The HDR captures that the split may use, sorted by name."""
        return self._files(self.envmaps, ".exr")

    def _files(self, folder: Path | None, ending: str) -> tuple[Path, ...]:
        if folder is None:
            return ()
        if not folder.is_dir():
            raise InputError(
                f"There is no folder {folder} to take {ending} files from; give one that exists."
            )
        paths = captures(folder, f"**/*{ending}", self.split == "heldout")
        return tuple(sorted(paths, key=lambda p: (p.name, str(p))))
