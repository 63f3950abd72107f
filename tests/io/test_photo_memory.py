"""How much memory reading a photo takes, over its pixels, against what its header predicts."""

import subprocess
import sys

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image
from pillow_heif import register_heif_opener

from materialist.io.decode import peak_bytes

SHAPE = (1500, 2000)
MEASURE = """
import resource, sys
import cv2, numpy, OpenEXR, PIL.Image, tifffile, pillow_heif
from materialist.io.photo import read_photo
read_photo(sys.argv[2])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
photo = read_photo(sys.argv[1], size=64)
assert photo.original.size == 3 * 1500 * 2000
print(1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before))
"""


def pixels():
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    return np.stack([x // 16 + y // 16, x // 9, y // 11], -1).astype(np.uint8)


def with_alpha(colour):
    top = 1 if colour.dtype == np.float32 else np.iinfo(colour.dtype).max
    alpha = np.full((*SHAPE, 1), top, colour.dtype)
    alpha[:100] = top * 0.4
    return np.concatenate([colour, alpha], -1)


def write(folder, name):
    """A large file of that kind."""
    path = folder / name
    colour = pixels()
    deep = colour.astype(np.uint16) * 257
    light = colour / np.float32(255)
    if name.endswith("16.png"):
        cv2.imwrite(str(path), with_alpha(deep) if "rgba" in name else deep)
    elif name == "deep.avif":
        cv2.imwrite(str(path), with_alpha(deep) >> 6, [cv2.IMWRITE_AVIF_DEPTH, 10])
    elif name in ("deep.jp2", "deep.ppm"):
        cv2.imwrite(str(path), deep)
    elif name == "float.tif":
        tifffile.imwrite(path, light, photometric="rgb")
    elif name == "lab16.tif":
        tifffile.imwrite(path, deep, photometric="cielab")
    elif name.endswith(".exr"):
        header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(
            header, {"RGBA": with_alpha(light)} if "rgba" in name else {"RGB": light}
        ).write(str(path))
    elif name == "a.hdr":
        cv2.imwrite(str(path), light)
    else:
        settings = {"progressive": True} if name == "progressive.jpg" else {}
        mode = {"grey": "L", "palette": "P", "bit": "1", "cmyk": "CMYK"}.get(
            name.partition(".")[0], "RGB"
        )
        image = Image.fromarray(with_alpha(colour) if "rgba" in name else colour)
        exif = Image.Exif()
        exif[274] = 6 if name == "turned.jpg" else 1
        (image if "rgba" in name else image.convert(mode)).save(path, exif=exif, **settings)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "rgb.png",
        "rgba.png",
        "grey.png",
        "palette.png",
        "bit.png",
        "rgb16.png",
        "rgba16.png",
        "rgb.jpg",
        "turned.jpg",
        "progressive.jpg",
        "cmyk.jpg",
        "rgb.webp",
        "rgba.webp",
        "rgb.heic",
        "rgb.avif",
        "rgb.jp2",
        "deep.avif",
        "deep.jp2",
        "deep.ppm",
        "rgb.tif",
        "float.tif",
        "lab16.tif",
        "rgb.exr",
        "rgba.exr",
        "a.hdr",
    ],
)
def test_every_kind_takes_no_more_memory_than_its_header_predicts(tmp_path, name):
    check(tmp_path, name)


def check(tmp_path, name):
    register_heif_opener()
    path = write(tmp_path, name)
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (16, 16, 3)).astype(np.uint8)).save(
        tmp_path / "s.png"
    )
    small = tmp_path / "s.png"
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, path, small], capture_output=True, text=True, check=True
    )
    assert int(done.stdout) < peak_bytes(path)
    assert peak_bytes(path) <= path.stat().st_size + 40 * SHAPE[0] * SHAPE[1]


def test_transparent_png_of_8_bits_fits_its_prediction(tmp_path):
    """63 bytes a pixel before: a flat picture of 50 megapixels and 460 kB took 3.1 GB."""
    check(tmp_path, "rgba.png")
