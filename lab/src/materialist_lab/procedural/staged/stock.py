"""What scenes of real things are made of: models and photographs of a cache, captured meshes and light."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from zlib import crc32

import cv2
import numpy as np

from materialist.types import Array
from materialist_lab.procedural.catalog.cache import CatalogModel, Listing, as_roots, listing
from materialist_lab.procedural.materials import ColourPicture

SMALLEST_CROP = 0.2
"""Smallest height of a crop as a share of the largest one that fits into the photograph."""
HELD_OUT_EVERY = 10
"""One model and photograph in so many is never trained on."""
MIN_TEXTURES = 4
"""Pictures that a family must have: with fewer, all its things would look alike."""


@dataclass(frozen=True, eq=False)
class Stock:
    """Everything at hand."""

    listing: Listing
    held_out: bool = False
    """Whether it has only the models and photographs that are kept aside for testing; else only the others."""
    meshes: tuple[Path, ...] = ()
    captures: tuple[Path, ...] = ()

    def _is_mine(self, name: str) -> bool:
        # A checksum of the name: the same on every machine, whatever else is installed.
        return (crc32(name.encode()) % HELD_OUT_EVERY == 0) == self.held_out

    def _mine(self, names: tuple[str, ...]) -> list[str]:
        return [name for name in names if self._is_mine(name)]

    def model(
        self, rng: np.random.Generator, *roles: str, high: float = 9.0
    ) -> CatalogModel | None:
        """A model of one of the roles whose longest side is at most `high` metres; None where there is none."""
        keys = [key for role in roles for key in self._mine(self.listing.models.get(role, ()))]
        # A dozen tries: the sizes of all models are not known before they are loaded.
        for _ in range(12 if keys else 0):
            model = self.listing.model(keys[rng.integers(len(keys))])
            if max(model.entry.size) <= high:
                return model
        return None

    def texture(self, rng: np.random.Generator, family: str) -> ColourPicture | None:
        """A picture that repeats, of a surface of that family of materials; None where there is none."""
        # Only of models that this stock may use.
        places = [
            place for place in self.listing.textures.get(family, ()) if self._is_mine(place[0])
        ]
        if len(places) < MIN_TEXTURES:
            return None
        key, solid = places[rng.integers(len(places))]
        return self.listing.model(key).pictures[solid]

    def photograph(self, rng: np.random.Generator) -> Array | None:
        """[h, w, 3] uint8 sRGB; None where there is none."""
        names = self._mine(self.listing.photographs)
        return self.listing.photograph(names[rng.integers(len(names))]) if names else None

    def crop(
        self, rng: np.random.Generator, aspect: float, side: int, min_share: float = SMALLEST_CROP
    ) -> Array | None:
        """[h, w, 3] uint8 sRGB, its longer side `side` pixels: a part of a photograph of that width over height."""
        whole = self.photograph(rng)
        if whole is None:
            return None
        h, w = whole.shape[:2]
        # --- A random part of that shape, mirrored in half of the cases ---
        max_height = min(h, w / aspect)
        height = max_height * rng.uniform(min_share, 1.0)
        width = height * aspect
        top = rng.uniform(0, h - height)
        left = rng.uniform(0, w - width)
        part = whole[int(top) : int(top + height) + 1, int(left) : int(left + width) + 1]
        if rng.random() < 0.5:
            part = part[:, ::-1]
        # --- Its size; averaged where it shrinks ---
        scale = side / max(part.shape[:2])
        size = max(4, round(part.shape[1] * scale)), max(4, round(part.shape[0] * scale))
        interpolation = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        return cv2.resize(part, size, interpolation=interpolation)

    def printed(self, rng: np.random.Generator, aspect: float) -> ColourPicture | None:
        """A part of a photograph as a picture of that width over height."""
        part = self.crop(rng, aspect, 320, 0.5)
        return None if part is None else ColourPicture(as_roots(part))

    def repeating(self, rng: np.random.Generator) -> ColourPicture | None:
        """A part of a photograph, mirrored so that it repeats."""
        part = self.crop(rng, 1.0, 192)
        if part is None:
            return None
        both = np.concatenate([part, part[:, ::-1]], 1)
        return ColourPicture(as_roots(np.concatenate([both, both[::-1]], 0)))


@lru_cache(maxsize=4)
def stock(
    archives: tuple[Path, ...],
    photographs: tuple[Path, ...],
    folder: Path | None,
    *,
    held_out: bool = False,
    meshes: tuple[Path, ...] = (),
    captures: tuple[Path, ...] = (),
) -> Stock:
    """The stock of archives and photographs, made once a process."""
    return Stock(listing(archives, photographs, folder), held_out, meshes, captures)
