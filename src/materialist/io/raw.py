"""Camera RAW (with rawpy)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.errors import InputError, SetupError
from materialist.io.decoded import Decoded, check_size
from materialist.io.exif import file_tags

RAW_SUFFIXES = frozenset(
    f".{name}"
    for name in (
        *("3fr", "ari", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "iiq", "k25", "kdc", "mef", "mos"),
        *("mrw", "nef", "nrw", "orf", "pef", "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f"),
    )
)
"""File names that mean camera RAW: most are TIFF inside, so the content cannot tell."""


def read_raw(path: Path) -> Decoded:
    """Camera RAW: demosaiced with the camera's white balance, linear Rec.709, no automatic brightening.

    Raises SetupError where rawpy is not installed, InputError for a file that it cannot read.
    """
    try:
        import rawpy
    except ImportError as error:
        raise SetupError(f"Camera RAW needs one more package to read {path.name}: pip install rawpy") from error
    try:
        with rawpy.imread(str(path)) as raw:
            check_size(raw.sizes.width, raw.sizes.height, path)
            pixels = raw.postprocess(gamma=(1, 1), no_auto_bright=True, use_camera_wb=True, output_bps=16)
    except rawpy.LibRawError as error:
        raise InputError(f"{path} is not a RAW file this program can read ({error}); export it as TIFF.") from error
    return Decoded(pixels.astype(np.float32) / np.float32(65535), False, file_tags(path))
