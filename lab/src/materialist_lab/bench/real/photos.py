"""A real photograph with what was measured of its scene, and how files become one."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.image import read_map
from materialist.predict import resample
from materialist.types import Array, Camera, Photo
from materialist_lab.bench.real.smooth import plane_normals

MILLIMETRES = 1e-3
"""Metres in a millimetre."""
LEVELS = 65535
"""Largest value of a 16-bit file, which `read_map` gives as 1."""


@dataclass(frozen=True)
class Reading:
    """How photos are read."""

    size: int
    """Longer side, pixels."""
    lamps: int
    """Photos of each view that was taken under several lights; 0: all."""


@dataclass(frozen=True)
class OtherLight:
    """The same view under another light."""

    envmap: Array
    """[h, 2h, 3] linear radiance, camera frame, of any brightness."""
    picture: Array
    """[H, W, 3] float32 linear: the photograph of it, of any exposure."""


@dataclass(frozen=True)
class RealPhoto:
    """A photograph and its measured truth at the photo's working size; what is not known is None."""

    name: str
    photo: Photo
    albedo: Array | None = None
    """[H, W, 3] linear, up to one factor."""
    normal: Array | None = None
    """[H, W, 3] unit, camera frame; zero where it is not known."""
    depth: Array | None = None
    """[H, W] planar, up to one factor; 0 where it is not known."""
    mask: Array | None = None
    """[H, W] bool: the object that all figures are taken on; None: the whole picture."""
    other: OtherLight | None = None
    judgements: Path | None = None
    """A file of human judgements of brightness, as IIW has them."""
    source: str = "truth"
    """What the maps are called on sheets: truth, or what stands in its place."""

    @property
    def inside(self) -> Array:
        """[H, W] bool: the mask, or everything."""
        return np.ones(self.photo.linear.shape[:2], bool) if self.mask is None else self.mask


def with_depth(name: str, photo: Photo, depth: Array) -> RealPhoto:
    """A photo with a measured depth [h, w] of any size of its aspect; normals where the depth is smooth."""
    # Resampled first: normals belong to the photo's own pixels.
    at_size = resample.depth(depth, photo.linear.shape[:2])
    normal = plane_normals(at_size, photo.camera)
    return RealPhoto(name, photo, normal=normal, depth=at_size)


def linear_photo(path: Path, size: int, fov: float) -> Photo:
    """A Photo of a file whose values are linear light, with the longer side at most `size` pixels.

    fov: horizontal field of view, degrees. Raises InputError where there is no such file.
    """
    # Averaged in linear light; never enlarged.
    linear = read_map(path)
    if max(linear.shape[:2]) > size:
        linear = resample.values(linear, resample.with_longer_side(linear.shape[:2], size))
    height, width = linear.shape[:2]
    return Photo(linear, Camera(width, height, fov), linear, fov_source="option", path=str(path))


def read_millimetres(path: Path) -> Array:
    """[H, W] float32 metres of a 16-bit PNG in millimetres; 0 where nothing was measured."""
    return (read_map(path) * np.float32(LEVELS * MILLIMETRES)).astype(np.float32)


def read_array(path: Path) -> Array:
    """The (first) array in a .npy or .npz file. Raises InputError where there is none."""
    try:
        content = np.load(path)
        return content[content.files[0]] if path.suffix == ".npz" else content
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f"{path} holds no array that can be read ({error}).") from error
