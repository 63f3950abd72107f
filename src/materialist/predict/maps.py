"""The predictors `maps:DIR` and `moge:DIR`: maps that another tool has written (docs/predictors.md)."""

import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.image import read_map as read_data
from materialist.predict import resample
from materialist.predict.protocol import CONSTANT, MAPS, MapSet, Predictor
from materialist.types import Array, Photo, Prior

MOGE = "write it with: moge infer -i PHOTO -o DIR --maps"


@dataclass(frozen=True)
class MapSettings:
    """Limits within which the values of a foreign map are mended; beyond them the map is refused. Tuned by eye."""

    max_excess: float = 0.1  # distance outside of its range up to which a value is clipped
    max_wild_share: float = 0.01  # share of values farther outside; more means another unit
    max_depth_ratio: float = 1e5  # to the nearest surfaces; renderers write more for missed rays
    min_normal_length: float = 0.2  # length of a normal from which it is known


SETTINGS = MapSettings()


class MapsPredictor(Predictor):
    """Reads albedo, roughness, metallic, normal and depth as .exr or .png from a folder."""

    def __init__(self, folder: str | Path):
        if not str(folder):
            raise InputError('maps: needs a folder, as in `predictor="maps:my_maps"`.')
        self.folder = Path(folder).expanduser()
        if not self.folder.is_dir():
            raise InputError(f"There is no folder {self.folder} to read maps from.")
        self.name = f"maps:{self.folder}"

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted maps. A missing roughness or metallic is the paper's neutral start, a missing normal is unknown.

        Warnings tell both, and every resampling and clipping. Raises InputError when albedo or depth is missing, a map
        has another aspect ratio than the photo, or its values cannot be meant.
        """
        size = photo.linear.shape[:2]
        maps = dict[str, Array]()
        warnings: list[str] = []
        for name in names:
            path = next(
                (p for s in ("exr", "png") if (p := self.folder / f"{name}.{s}").is_file()), None
            )
            # Missing materials are neutral, missing normals follow from depth; albedo and depth
            # are needed.
            if path is not None:
                maps[name] = _fitted(self.read(name, path, warnings), name, size, path, warnings)
            elif name == "normal":
                warnings.append("There is no normal map: the normals were derived from depth.")
                maps[name] = np.zeros((*size, 3), np.float32)
            elif name in ("roughness", "metallic"):
                warnings.append(
                    f"There is no {name} map: the neutral {name} {CONSTANT[name]} was used everywhere."
                )
                maps[name] = np.full(size, CONSTANT[name], np.float32)
            else:
                raise InputError(
                    f"{self.folder} holds no {name}.exr or {name}.png; albedo and depth are needed."
                )
        return MapSet(maps, dict.fromkeys(names, self.name), tuple(warnings))

    def read(self, name: str, path: Path, warnings: list[str]) -> Array:
        """The values of a map at their own size, checked and mended. Raises InputError."""
        return _CHECKS[name](read_map_file(path, name), path, warnings)


class ArraysPredictor(Predictor):
    """Maps that somebody has as arrays, checked and brought to the photo's size as files of them would be."""

    name = "arrays"

    def __init__(self, prior: Prior):
        self.known = prior.known
        self.gives = tuple(self.known)

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted maps. Raises InputError as `MapsPredictor.parts`."""
        size = photo.linear.shape[:2]
        warnings = list[str]()
        maps = {name: self._fitted(name, size, warnings) for name in names}
        return MapSet(maps, dict.fromkeys(names, self.name), tuple(warnings))

    def _fitted(self, name: str, size: tuple[int, int], warnings: list[str]) -> Array:
        called = Path(f"The prior's {name}")
        values = np.ascontiguousarray(self.known[name], np.float32)
        checked = _CHECKS[name](values, called, warnings)
        return _fitted(np.asarray(checked, np.float32), name, size, called, warnings)


class MogeFolder(MapsPredictor):
    """What `moge infer --maps` (Wang et al. 2025) has written: depth.exr, mask.png, normal.png, fov.json.

    They lie in the folder, or in the one folder in it that has them.

    Depth is in metres (in MoGe's second version), and no surface where the mask is empty or depth is infinite. MoGe
    looks down +Z with +Y down, but encodes its normals the usual way (red to the right, green up, blue to the viewer),
    which is our frame; its first version writes none.
    """

    gives = ("normal", "depth")

    def __init__(self, folder: str | Path):
        if not str(folder):
            raise InputError(f'moge: needs a folder, as in `depth="moge:DIR"`; {MOGE}')
        super().__init__(folder)
        # MoGe writes a folder for each picture: the results lie here, or in the only folder below.
        folders = [
            path.parent
            for path in sorted((*self.folder.glob("depth.exr"), *self.folder.glob("*/depth.exr")))
        ]
        if self.folder not in folders and len(folders) != 1:
            listed = ", ".join(path.name for path in folders[:3])
            several = (
                f"several results ({listed}); name one of them"
                if folders
                else f"no depth.exr; {MOGE}"
            )
            raise InputError(f"{self.folder} holds {several}.")
        self.folder = self.folder if self.folder in folders else folders[0]
        self.field_of_view = _field_of_view(self.folder / "fov.json")
        self.name = f"moge:{self.folder}"

    def read(self, name: str, path: Path, warnings: list[str]) -> Array:
        """The values of a map at their own size; depth is 0 where mask.png is."""
        values = super().read(name, path, warnings)
        mask = self.folder / "mask.png"
        if name != "depth" or not mask.is_file():
            return values
        pixels = read_data(mask)
        if pixels.shape[:2] != values.shape:
            raise InputError(f"{mask} is of another size than depth.exr; {MOGE}")
        values = np.where(pixels.reshape(*values.shape, -1)[..., 0] > 0.5, values, 0)
        if not (values > 0).any():
            raise InputError(f"{path} has no surface anywhere; {MOGE}")
        return values


def _fitted(
    values: Array, name: str, size: tuple[int, int], path: Path, warnings: list[str]
) -> Array:
    """A map [h, w, ...] brought to the photo's size (H, W). Raises InputError for another aspect ratio."""
    h, w = values.shape[:2]
    height, width = size
    if (h, w) == size:
        return values
    slack = 1.5 * max(1.0, height / h, width / w)  # pixels, for sizes that were rounded
    if abs(w * height / h - width) > slack and abs(h * width / w - height) > slack:
        raise InputError(
            f"{path} is {w}x{h} and the photo is {width}x{height}: give maps of the photo's aspect ratio (no cropping)."
        )
    warnings.append(f"{path.name} is {w}x{h} and was resampled to {width}x{height}.")
    return {"normal": resample.normals, "depth": resample.depth}.get(name, resample.values)(
        values, size
    )


def read_map_file(path: Path, name: str) -> Array:
    """The linear values in a map file, float32: [H, W, 3] for albedo and normal, [H, W] for the others.

    EXR values are as stored. PNG (8 or 16 bit) is brought to [0, 1]; albedo is then sRGB-decoded and normal is
    2 v - 1. Raises InputError for a damaged file or the wrong number of channels.
    """
    values = read_data(path)
    # --- PNGs are encoded: colours by the sRGB curve, normals by (n + 1) / 2 ---
    if path.suffix != ".exr" and name == "albedo":
        values = srgb_to_linear(values)
    elif path.suffix != ".exr" and name == "normal":
        values = 2 * values - 1

    # --- Three channels for colours and directions, one for the rest ---
    if name in ("albedo", "normal"):
        if values.ndim == 2 and name == "albedo":
            values = np.repeat(values[..., None], 3, -1)
        if values.ndim != 3:
            raise InputError(f"{path} has one channel, but a {name} map needs three.")
        return np.ascontiguousarray(values)
    if values.ndim == 3:
        # Grey maps are often saved as RGB: equal channels are one channel.
        if np.nanmax(np.ptp(values, axis=-1)) > 0.01 * max(1.0, float(np.nanmax(np.abs(values)))):
            raise InputError(
                f"{path} is a colour picture, but a {name} map has one value a pixel; save it as grey."
            )
        values = values[..., 0]
    return np.ascontiguousarray(values)


def _check_finite(values: Array, path: Path) -> None:
    """Raises InputError when there are NaN or infinite values."""
    bad = ~np.isfinite(values)
    if bad.any():
        raise InputError(
            f"{path} has {int(bad.sum())} NaN or infinite values; replace them (depth 0: no surface)."
        )


def _unit_range(values: Array, path: Path, warnings: list[str]) -> Array:
    """Albedo, roughness, metallic: in [0, 1], slight excess clipped, anything else refused."""
    _check_finite(values, path)
    wild = (values < -SETTINGS.max_excess) | (values > 1 + SETTINGS.max_excess)
    if wild.mean() > SETTINGS.max_wild_share:
        raise InputError(
            f"{path} has values from {values.min():.4g} to {values.max():.4g}; this map must be in [0, 1] "
            "(divide by 255 or 65535 if it was written as integers)."
        )
    # Rounding and resampling overshoot a little, which is no reason for a warning.
    if values.min() < -1e-3 or values.max() > 1 + 1e-3:
        warnings.append(
            f"{path.name} reaches from {values.min():.3f} to {values.max():.3f}: clipped to [0, 1]."
        )
    return np.clip(values, 0, 1)


def _depth_range(values: Array, path: Path, warnings: list[str]) -> Array:
    """Depth: positive, 0 for no surface; infinite is taken as no surface."""
    # --- No surface: infinite, negative, or far beyond everything else ---
    if np.isposinf(values).any():
        warnings.append(f"{path.name} has infinite depths: taken as sky (no surface).")
        values = np.where(np.isposinf(values), 0, values)
    _check_finite(values, path)
    negative = values < 0
    if negative.mean() > SETTINGS.max_wild_share:
        raise InputError(
            f"{path} has negative depths (to {values.min():.4g}); depth is a positive distance along -Z."
        )
    if negative.any():
        warnings.append(
            f"{path.name} has {int(negative.sum())} negative depths: taken as no surface."
        )
    values = np.maximum(values, 0)
    if (values > 0).any():
        far = values > SETTINGS.max_depth_ratio * np.percentile(values[values > 0], 5)
        if far.any():
            warnings.append(
                f"{path.name} has depths of up to {values.max():.3g}: taken as sky (no surface)."
            )
            values = np.where(far, 0, values).astype(np.float32)
    if not (values > 0).any():
        raise InputError(
            f"{path} is 0 everywhere, so there is no surface to reconstruct; depth must be positive."
        )
    # --- Coarse steps make terraces of slopes ---
    if path.suffix == ".png" and np.unique(values).size <= 256:
        warnings.append(
            f"{path.name} has only {np.unique(values).size} depth steps; 16-bit PNG or EXR is smoother."
        )
    return values


def _unit_normals(values: Array, path: Path, warnings: list[str]) -> Array:
    """Normals: unit vectors facing the viewer; a zero vector means unknown."""
    _check_finite(values, path)
    # --- Unit vectors, and not those of an 8-bit picture, (n + 1) / 2 ---
    length = np.linalg.norm(values, axis=-1)
    known = length > SETTINGS.min_normal_length
    wrong = (np.abs(length[known] - 1) > SETTINGS.max_excess).mean() > 0.05 if known.any() else True
    if (
        wrong
        and path.suffix == ".exr"
        and values.min() >= 0
        and values.max() <= 1 + SETTINGS.max_excess
    ):
        raise InputError(
            f"{path} has no negative value: it holds encoded normals; store 2 v - 1 in an EXR."
        )
    if wrong:
        raise InputError(
            f"{path} does not hold unit vectors (median length {np.median(length):.3g})."
        )
    # --- In our frame: surfaces that are seen face +Z, but for grazing ones ---
    if (values[known][:, 2] < 0).mean() > 0.5:
        raise InputError(
            f"{path} points away from the viewer; normals are in the camera frame with +Z to the viewer."
        )
    if (np.abs(length[known] - 1) > 0.02).any():
        warnings.append(f"{path.name} was normalised to unit length.")
    return np.where(known[..., None], values / np.maximum(length, 1e-6)[..., None], 0).astype(
        np.float32
    )


_CHECKS = dict.fromkeys(MAPS[:3], _unit_range) | {"depth": _depth_range, "normal": _unit_normals}


def _field_of_view(path: Path) -> float | None:
    """Horizontal field of view in degrees; None without a file. Raises InputError when it cannot be meant."""
    if not path.is_file():
        return None
    try:
        angle = float(json.loads(path.read_text("utf-8"))["fov_x"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} does not say fov_x in degrees ({error}); {MOGE}") from error
    if not 1 < angle < 170:
        raise InputError(
            f"{path} says a field of view of {angle:g} degrees; it must be between 1 and 170."
        )
    return angle
