"""Boxes of ISO files (HEIC, AVIF, JPEG 2000): colour and bits a channel, which Pillow does not hand out."""

import struct
from collections.abc import Iterator
from pathlib import Path

_HEAD_BYTES = 4 << 20
"""How much of a file is searched: boxes of colour stand before the pixels."""
_CODESTREAM = b"\xff\x4f\xff\x51"
"""How the pixels of a JPEG 2000 begin: the markers SOC and SIZ."""


def nclx(path: Path) -> tuple[int, int] | None:
    """Codes of primaries and transfer (ITU-T H.273) of a HEIC's or AVIF's main picture; None where it has none."""
    for kind, data in _primary_properties(path):
        if kind == b"colr" and data[:4] == b"nclx" and len(data) >= 8:
            return struct.unpack_from(">HH", data, 4)  # type: ignore[return-value]
    return None


def avif_bits(path: Path) -> int:
    """Bits a channel of an AVIF's main picture; 8 where the file does not say."""
    for kind, data in _primary_properties(path):
        if kind == b"av1C" and len(data) > 2 and data[2] & 0x40:
            return 12 if data[2] & 0x20 else 10
        if (
            kind == b"pixi" and len(data) > 5
        ):  # the codec's box stands at the tiles of a picture in tiles
            return max(data[5 : 5 + data[4]])
    return 8


def jp2_bits(path: Path) -> int:
    """Bits a channel of a JPEG 2000, of the channel that has most; 8 where the file does not say."""
    _, _, sizes = _head(path).partition(_CODESTREAM)
    try:
        (channels,) = struct.unpack_from(">H", sizes, 36)
        # Of each channel: bits less one, with a sign in front, and its two steps.
        return 1 + max(sizes[38 + 3 * k] & 0x7F for k in range(channels))
    except (IndexError, ValueError, struct.error):
        return 8


def jp2_profile(path: Path) -> bytes | None:
    """The ICC profile of a JPEG 2000 file, or None."""
    header = dict(iso_boxes(_head(path))).get(b"jp2h", b"")
    return next(
        (
            data[3:]
            for kind, data in iso_boxes(header)
            if kind == b"colr" and data[:1] in (b"\2", b"\3")
        ),
        None,
    )


def iso_boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of each box, one after the other; what is cut off or damaged ends them."""
    at = 0
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        start = at + 8
        # Size 1: the true size follows in 64 bits. Size 0: to the end of the file.
        if size == 1 and at + 16 <= len(data):
            (size,) = struct.unpack_from(">Q", data, start)
            start += 8
        end = at + size if size else len(data)
        if end < start:
            return
        yield kind, data[start:end]
        at = end


def _primary_properties(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of the properties of a HEIC's or AVIF's main picture."""
    meta = dict(iso_boxes(_head(path))).get(b"meta", b"")[4:]
    top = dict(iso_boxes(meta))
    properties = list(iso_boxes(dict(iso_boxes(top.get(b"iprp", b""))).get(b"ipco", b"")))
    for index in _properties_of_primary(top):
        if 0 < index <= len(properties):
            yield properties[index - 1]


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)


def _properties_of_primary(meta: dict[bytes, bytes]) -> list[int]:
    """Numbers, from 1, of the properties of the main picture (ISO 23008-12, `pitm` and `ipma`)."""
    # --- Which item is the main picture, and how wide the entries of the table are ---
    primary_box = meta.get(b"pitm", b"")
    association = dict(iso_boxes(meta.get(b"iprp", b""))).get(b"ipma", b"")
    try:
        (primary,) = struct.unpack_from(">I" if primary_box[0] else ">H", primary_box, 4)
        wide_ids = association[0] > 0
        wide_indices = association[3] & 1
        (entries,) = struct.unpack_from(">I", association, 4)
        at = 8
        # --- Walk the table of items; every entry has its own length ---
        for _ in range(entries):
            (item,) = struct.unpack_from(">I" if wide_ids else ">H", association, at)
            at += 4 if wide_ids else 2
            count = association[at]
            form = f">{count}{'H' if wide_indices else 'B'}"
            indices = struct.unpack_from(form, association, at + 1)
            if item == primary:
                return [index & (0x7FFF if wide_indices else 0x7F) for index in indices]
            at += 1 + struct.calcsize(form)
    except (IndexError, struct.error):
        pass
    return []
