"""Which kind of data set a folder holds."""

from __future__ import annotations

from pathlib import Path

from materialist.errors import InputError
from materialist.train.interiorverse import InteriorVerse, is_interiorverse
from materialist.train.samples import SampleFolder, Source


def open_source(folder: str | Path, *, split: str = "train") -> Source:
    """The data set in `folder`: procedural samples, or InteriorVerse in its published layout.

    `split` is that of InteriorVerse: 'train', 'val' or 'test'. Raises InputError when it is neither, or is empty.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"There is no data folder {folder}; make one with: materialist train data -o {folder}.")
    if (folder / "samples").is_dir():
        return SampleFolder(folder)
    if is_interiorverse(folder):
        return InteriorVerse(folder, split)
    raise InputError(
        f"{folder} holds neither 'samples' (materialist train data) nor InteriorVerse scenes; check the path."
    )
