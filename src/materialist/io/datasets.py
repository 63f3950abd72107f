"""Which kind of data set a folder holds, and several sets as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from materialist.errors import InputError
from materialist.io.interiorverse import InteriorVerse, is_interiorverse
from materialist.io.samples import Sample, SampleFolder, Source


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


class SampleSets:
    """Several sets of `materialist train data` as one. A sample keeps the number that it has in its own."""

    def __init__(self, sets: Sequence[SampleFolder]):
        self.sets = sets

    def __len__(self) -> int:
        return sum(map(len, self.sets))

    def read(self, index: int) -> Sample:
        """Sample number `index`: those of the first set come first."""
        part, place = self._place(index)
        return part.read(place)

    def number(self, index: int) -> int:
        """The number in the name of sample number `index`."""
        part, place = self._place(index)
        return part.number(place)

    def refresh(self) -> None:
        """List all folders again."""
        for part in self.sets:
            part.refresh()

    def seed(self) -> list[int | None]:
        """The seeds that the sets were made with."""
        return [part.seed() for part in self.sets]

    def _place(self, index: int) -> tuple[SampleFolder, int]:
        for part in self.sets:
            if 0 <= index < len(part):
                return part, index
            index -= len(part)
        raise IndexError(index)


def open_sources(folders: Sequence[Path]) -> Source:
    """The data set in one folder, or the procedural sets of several as one. Raises InputError, also for an
    InteriorVerse among several."""
    if len(folders) == 1:
        return open_source(folders[0])
    sets = []
    for folder in folders:
        found = open_source(folder)
        if not isinstance(found, SampleFolder):
            raise InputError(f"{folder} is InteriorVerse; only sets of materialist train data can be put together.")
        sets.append(found)
    return SampleSets(sets)
