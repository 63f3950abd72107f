"""The pictures of a film in which some frames are alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from materialist.edits.composite.composite import pictures
from materialist.types import Array, Scene


def filmed(scene: Scene, frames: Sequence[Scene], *, last: list[Any] | None = None, **options: Any) -> Iterator[Array]:
    """The composites [H0, W0, 3] of frames in order; one that is the scene before it is not rendered again.

    `options` are those of `composite.pictures`. `last[0]`, where given, becomes the latest picture.
    """
    starts = [k for k, frame in enumerate(frames) if k == 0 or frame is not frames[k - 1]]
    lengths = [after - first for first, after in zip(starts, [*starts[1:], len(frames)])]
    for picture, length in zip(pictures(scene, [frames[k] for k in starts], **options), lengths):
        if last is not None:
            last[0] = picture
        for _ in range(length):
            yield picture
