"""Which captured meshes and HDR maps are kept aside for testing, by name: every fifth of the sorted names."""

from __future__ import annotations

from pathlib import Path

from materialist.errors import InputError

MESHES = frozenset(("binoculars", "capsule", "fandisk", "lightbulb", "spot_cow", "train"))
"""Stems of .ply files that no training set may use."""

ENVMAPS = frozenset(
    ("aristea_wreck_puresky", "brown_photostudio_06", "dikhololo_night", "kiara_dawn", "museum", "st_fagans_interior",
     "venice_sunset")
)  # fmt: skip
"""Stems of .exr files that no training set may use."""

SPLITS = ("train", "heldout")


def files(folder: Path | None, ending: str, aside: frozenset[str], split: str) -> tuple[Path, ...]:
    """The files of a folder (and those below it) that a split may use, sorted by name; none for no folder.

    Args:
        folder: where to look. ending: such as '.ply'.
        aside: stems that only the split 'heldout' may use, and which are all that it may use.

    Raises:
        InputError: an unknown split, or a folder that is missing or has no such file.
    """
    if split not in SPLITS:
        raise InputError(f"The split is {split!r}; choose train or heldout.")
    if folder is None:
        return ()
    if not Path(folder).is_dir():
        raise InputError(f"There is no folder {folder} to take {ending} files from; give one that exists.")
    wanted = [p for p in Path(folder).rglob(f"*{ending}") if (p.stem in aside) == (split == "heldout")]
    if not wanted:
        raise InputError(f"{folder} holds no {ending} file for the split {split!r}; give another or leave it out.")
    return tuple(sorted(wanted, key=lambda p: (p.name, str(p))))
