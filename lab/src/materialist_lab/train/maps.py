"""What the networks that predict all maps have in common: pictures with true maps, scores and a sheet."""

from abc import abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from torch import nn

from materialist.errors import InputError
from materialist.types import Prediction
from materialist_lab.data.samples import Sample, Source
from materialist_lab.data.sheets import strip, write_sheet
from materialist_lab.metrics.maps import score, summary
from materialist_lab.procedural.photographic import as_photo
from materialist_lab.train.task import Recipe, Task

HELD_OUT_EVERY = 40
"""Of every so many samples the last one is never trained on, but scored."""
SHEET_ROWS = 6
HELD_OUT = "samples kept aside"
TRAINED_ON = "samples trained on"


class MapsTask(Task):
    """A network from a picture to all maps, on procedural samples or on InteriorVerse."""

    kind: ClassVar[str] = "matnet"

    def __init__(
        self, source: Source, recipe: Recipe, *, init: Path | None = None, score_samples: int = 12
    ):
        """`init`: weights to begin from. `score_samples`: how many held-out samples are scored; 0 for none."""
        if score_samples < 0:
            raise InputError(f"--score-samples is {score_samples}; give 0 or more.")
        super().__init__(recipe, init)
        self.source = source
        self.score_samples = score_samples
        self._places = trained_on(source)
        self.notes = (*self.notes, *source.notes)

    def count(self) -> int:
        return len(self._places)

    def refresh(self) -> None:
        self.source.refresh()
        self._places = trained_on(self.source)

    def read(self, index: int) -> Sample:
        """Example number `index` of those that are trained on. Raises InputError where it is damaged."""
        return self.source.read(self._places[index])

    @abstractmethod
    def predict(self, network: nn.Module, sample: Sample) -> Prediction:
        """The maps of a sample, as the predictor finds them."""

    def data(self) -> dict[str, Any]:
        """How many samples there are, and the seeds they were made with."""
        return {"samples": len(self.source), "seed": self.source.seed()}

    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Means over held-out samples, seen as photographs (always the same ones); draws FOLDER/sheet.png.

        Of a set that is too small to hold any out, samples that it learns from are scored, and `of` says so.
        """
        # The same samples and the same camera noise at every scoring.
        origin, samples = held_out(self.source, self.score_samples)
        rows = []
        strips = []
        for k, sample in enumerate(samples):
            photo = as_photo(sample, np.random.default_rng((7, k)))
            predicted = self.predict(network, photo)
            rows.append(score(predicted, photo.truth()))
            if k < SHEET_ROWS:
                strips.append(strip(photo.image, predicted, photo.truth()))
        write_sheet(strips, folder / "sheet.png")
        if not samples:
            return {}
        figures = summary([row for row in rows if row])
        shown = {
            name: value
            for name, value in figures.items()
            # Those are for pooling over a set; a log needs the rest.
            if not name.endswith(("_mse", "_raw", "_scale"))
        }
        return {"of": origin, **shown}


def trained_on(source: Source) -> list[int]:
    """Places of the samples to train on. Their own numbers say which are held out; none of a set that is too small."""
    # By the sample's own number, so that a growing set keeps its held-out samples.
    count = len(source)
    return [
        k for k in range(count) if count < HELD_OUT_EVERY or (source.number(k) + 1) % HELD_OUT_EVERY
    ]


def held_out(source: Source, max_samples: int) -> tuple[str, list[Sample]]:
    """What samples are scored, and up to `max_samples` of them, spread over the set.

    They come from the source's own validation split where it has one; of a set that is too small to hold any out they
    are the first ones that it learns from. Those that cannot be read are left out.
    """
    origin = HELD_OUT
    # --- Which ones ---
    validation = source.validation()
    if validation is not None:
        source = validation
        chosen = list(range(len(validation)))
    elif not (chosen := sorted(set(range(len(source))) - set(trained_on(source)))):
        origin = TRAINED_ON
        chosen = list(range(min(len(source), max_samples)))
    # --- Read them, evenly spread ---
    samples = []
    for k in np.unique(np.linspace(0, len(chosen) - 1, max_samples).astype(int)):
        with suppress(InputError):
            samples.append(source.read(chosen[k]))
    return origin, samples
