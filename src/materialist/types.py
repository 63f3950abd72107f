"""The types of the project: frozen dataclasses, with shape and unit on every array.

Conventions (see docs/conventions.md): linear Rec.709 RGB float32; camera at the origin looking down -Z, +Y up,
+X right; pixel (0, 0) is top left with its centre at (0.5, 0.5); depth is planar along -Z, 0 where there is no surface.
"""

import base64
import html
import re
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np

from materialist.errors import InputError
from materialist.records import Array, Record
from materialist.spelling import check_names

Progress = Callable[[str, int, int], None]
"""Called as progress(stage, done, total)."""
_SHOWN = 960
"""Width of a scene's picture in a notebook, pixels."""


def _numbers(value: Any, count: int) -> tuple[float, ...]:
    """`count` finite numbers as Python's; none where the value is anything else."""
    try:
        numbers = tuple(np.asarray(value, np.float64).ravel().tolist())
    except (TypeError, ValueError):
        return ()
    return numbers if len(numbers) == count and all(np.isfinite(numbers)) else ()


@dataclass(frozen=True)
class Camera:
    """Pinhole camera at the origin, looking down -Z."""

    width: int
    height: int
    fov: float = 35.0
    """Horizontal field of view, degrees, in (0, 180)."""

    def __post_init__(self) -> None:
        """NumPy's numbers become Python's, as files and other programs need them. Raises InputError for others."""
        # Each is a tuple of one number, or empty where it is none.
        width = _numbers(self.width, 1)
        height = _numbers(self.height, 1)
        fov = _numbers(self.fov, 1)
        if not (
            width
            and height
            and min(*width, *height) >= 1
            and all(n % 1 == 0 for n in (*width, *height))
        ):
            raise InputError(
                f"A camera of {self.width} x {self.height} pixels: give whole numbers from 1 on."
            )
        if not (fov and 0 < fov[0] < 180):
            raise InputError(
                f"A camera with a field of view of {self.fov}: give degrees between 0 and 180."
            )
        for name, value in (("width", int(width[0])), ("height", int(height[0])), ("fov", fov[0])):
            object.__setattr__(self, name, value)

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        # W / 2 pixels span half the field of view.
        return 0.5 * self.width / float(np.tan(np.radians(self.fov) / 2))


@dataclass(frozen=True, eq=False, repr=False)
class Photo(Record):
    """A photograph at working size, with its untouched original beside it."""

    linear: Array
    """[H, W, 3] float32 linear Rec.709 at working size, >= 0; HDR input clipped to [0, 10]."""
    camera: Camera
    original: Array
    """[H0, W0, 3] float32 linear at native size (after EXIF rotation), times 2**stops."""
    hdr: bool = False
    """True when the file holds scene-linear values of any unit (EXR, HDR, float TIFF), not clipped at 1."""
    fov_source: str = "default"
    """Where camera.fov came from: 'exif', 'option', 'predictor' or 'default'."""
    path: str | None = None
    source: bytes | None = field(default=None, repr=False)
    """The input file, byte for byte."""
    warnings: tuple[str, ...] = ()
    deep: bool = False
    """True when it comes from a display file of more than 8 bits a channel that is not in `source` any more."""
    stops: int = 0
    """Exposure of `linear` and `original` over the values of an HDR file, see `io.photo.read_photo`."""
    layer: str | None = None
    """Name of the layer or part that it is, of an EXR that has several."""
    exif: bytes | None = field(default=None, repr=False)
    """EXIF of the file that it was made of, where `source` is not there any more."""

    @property
    def name(self) -> str:
        """The name of its file, without folders."""
        return (self.path or "photo").replace("\\", "/").rsplit("/", 1)[-1]


@dataclass(frozen=True, eq=False, repr=False)
class Materials(Record):
    """Maps of the parameters of the simplified Disney BRDF."""

    albedo: Array
    """[H, W, 3] float32 linear, in [0, 1]."""
    roughness: Array
    """[H, W] float32 perceptual roughness r (alpha = r**2), in [0, 1]."""
    metallic: Array
    """[H, W] float32, in [0, 1]."""


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Record):
    """What a predictor says about a photograph: the prior of the fit."""

    materials: Materials
    normal: Array
    """[H, W, 3] float32 unit, camera frame (+X right, +Y up, +Z to the viewer)."""
    depth: Array
    """[H, W] float32 planar depth along -Z, > 0, scene units; 0 where there is no surface."""
    predictor: str = "unknown"
    warnings: tuple[str, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)
    """Map -> where it comes from, where several predictors or weights are behind them; empty: all of `predictor`."""
    light: Array | None = None
    """[h, 2h, 4] float32 environment map: linear radiance, and the scale of the error of its logarithm."""
    spread: dict[str, Array] = field(default_factory=dict)
    """Map -> [H, W] float32 expected absolute error, where the predictor knows it.

    Of the sRGB-encoded albedo (mean over RGB), of roughness and metallic, of the normal's angle in radians, and of the
    natural logarithm of relative depth.
    """


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Prior(Record):
    """Maps that are known of a photo, any of the five; a predictor gives the others.

    Each is of the photo's shape, at working size or another one of its proportions, to which it is resampled.
    """

    albedo: Array | None = None
    """[h, w, 3] linear, in [0, 1]."""
    roughness: Array | None = None
    """[h, w] perceptual roughness, in [0, 1]."""
    metallic: Array | None = None
    """[h, w] in [0, 1]."""
    normal: Array | None = None
    """[h, w, 3] unit, camera frame (+X right, +Y up, +Z to the viewer); a zero vector means unknown."""
    depth: Array | None = None
    """[h, w] planar depth along -Z, scene units; 0 where there is no surface."""

    def __new__(cls, **values: Any) -> Self:
        """Raises InputError for a name that is no map."""
        check_names(values, [entry.name for entry in fields(cls)], cls.__name__)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Arrays of whatever was given. Raises InputError for another shape than the map has, no numbers, or a mask."""
        for name, array in self.known.items():
            if np.ma.is_masked(array):
                raise InputError(
                    f"The prior's {name} is a masked array; fill what is masked, as in depth.filled(0)."
                )
            try:
                values = np.asarray(array)
            except Exception as error:  # whatever an object's __array__ raises
                raise InputError(f"The prior's {name} is no array: {error}") from error
            channels = (3,) if name in ("albedo", "normal") else ()
            is_map = values.ndim >= 2 and values.shape[2:] == channels and values.size > 0
            if values.dtype.kind not in "fiub" or not is_map:
                form = "[H, W, 3]" if channels else "[H, W]"
                raise InputError(
                    f"The prior's {name} is {values.dtype}{list(values.shape)}; give numbers of the shape {form}."
                )
            object.__setattr__(self, name, values)

    @property
    def known(self) -> dict[str, Array]:
        """The maps that are there, by name."""
        return {name: values for name, values in vars(self).items() if values is not None}


@dataclass(frozen=True, eq=False, repr=False)
class Triangles(Record):
    """A surface of triangles, float32, camera frame, scene units."""

    vertices: Array
    """[V, 3]."""
    faces: Array
    """[F, 3] int32, counter-clockwise seen from outside (a cavity's from within the cavity)."""
    normals: Array
    """[V, 3] unit shading normals, to the outside."""
    uv: Array
    """[V, 2] u to the right, v DOWN."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Triangles):
    """The scene's: the depth surface, and the planes that continue it beyond what the picture shows.

    Outside is where the camera is; uv is the place in the picture, with pixel (row i, column j) centred at
    ((j+.5)/W, (i+.5)/H).
    """

    face_pixel: Array
    """[F] int32 row-major index of the pixel whose surface (or nearest surface) the face carries."""
    face_plane: Array
    """[F] int16: -1 for the depth surface, k >= 0 for the continuation of plane k."""


@dataclass(frozen=True, eq=False, repr=False)
class Geometry(Record):
    """A mesh and the planes found in it."""

    mesh: Mesh
    plane_label: Array
    """[H, W] int8: plane k that the pixel lies on, -1 for none. Its continuation has the mean material of those."""


@dataclass(frozen=True)
class Lamp:
    """A small glowing sphere that somebody put into the scene."""

    position: tuple[float, float, float]
    """Centre, camera frame, scene units."""
    power: tuple[float, float, float]
    """Radiant flux in R, G, B: radiance of the photo x scene units squared x steradian."""
    radius: float
    """Scene units, > 0."""

    def __post_init__(self) -> None:
        """NumPy's numbers become Python's, as files and other programs need them. Raises InputError for others."""
        position = _numbers(self.position, 3)
        power = _numbers(self.power, 3)
        radius = _numbers(self.radius, 1)
        if not position or not power or min(power) < 0 or not radius or radius[0] <= 0:
            raise InputError(
                f"A lamp at {self.position} of power {self.power} and radius {self.radius}: give three coordinates, "
                "three powers of 0 or more, and a radius above 0."
            )
        for name, value in (("position", position), ("power", power), ("radius", radius[0])):
            object.__setattr__(self, name, value)

    @property
    def radiance(self) -> tuple[float, float, float]:
        """Of its surface, in R, G, B: power / (4 pi^2 radius^2)."""
        # A surface of radiance L sends out the flux pi L times its area, 4 pi r^2.
        r, g, b = (float(c) / (4 * np.pi**2 * self.radius**2) for c in self.power)
        return r, g, b


@dataclass(frozen=True, eq=False, repr=False)
class Surface(Materials):
    """The material of a body: maps of the scene's BRDF, repeated over the texture coordinates, and a share of light
    that enters instead."""

    transmission: float = 0.0
    """Share T of a dielectric interface in place of the opaque surface, in [0, 1]."""
    ior: float = 1.5
    """Index of refraction of the inside, in [1, 3]."""
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Colour of white light after a way in and a way out, linear, in [0, 1]."""
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance that it gives off to the outside by itself, linear, >= 0."""
    glass_roughness: float | None = None
    """Perceptual roughness of the dielectric interface; None: the mean of `roughness`."""

    @property
    def interface_roughness(self) -> float:
        """That of the dielectric interface, in [0, 1]."""
        return (
            float(self.roughness.mean()) if self.glass_roughness is None else self.glass_roughness
        )


@dataclass(frozen=True, eq=False, repr=False)
class Body(Triangles):
    """A thing with a material of its own beside the depth surface: inserted, dropped, or turned to glass."""

    surface: Surface
    name: str = "body"

    @property
    def mesh(self) -> Mesh:
        """The triangles; no face of them carries a pixel of the photo."""
        count = len(self.faces)
        pixel = np.zeros(count, np.int32)
        plane = np.full(count, -1, np.int16)
        return Mesh(self.vertices, self.faces, self.normals, self.uv, pixel, plane)


@dataclass(frozen=True, eq=False, repr=False)
class FitReport(Record):
    """What happened, stage by stage, and how good the result is; the content of report.json."""

    stages: tuple[dict[str, Any], ...] = ()
    """One dict a stage: name, steps, seconds, losses (first, last, curve)."""
    metrics: dict[str, float] = field(default_factory=dict)
    """rerender_psnr_path, rerender_ssim_path, total_seconds, peak_rss_mb, prior_l1_albedo, ..."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Record):
    """A photograph, decomposed: everything a scene package holds."""

    camera: Camera
    photo: Photo
    prior: Prediction
    materials: Materials
    normal: Array
    """[H, W, 3] float32 unit, camera frame."""
    depth: Array
    """[H, W] float32 planar, scene units, 0 = none."""
    geometry: Geometry
    envmap: Array
    """[h, 2h, 3] float32 linear radiance, >= 0; centre column along -Z, columns to the right turn to +X, top row +Y."""
    rerender: Array
    """[H, W, 3] float32 linear: the path-traced re-rendering."""
    report: FitReport = field(default_factory=FitReport)
    provenance: dict[str, Any] = field(default_factory=dict)
    """Tool version, predictor, weights hash, options, seed."""
    lamps: tuple[Lamp, ...] = ()
    """Lights beside the environment map; a photograph has none until somebody adds one."""
    bodies: tuple[Body, ...] = ()
    """Closed things beside the depth surface; a photograph has none until somebody adds one."""

    @property
    def warnings(self) -> list[str]:
        """Those of the photo, the prior, the fit and the edits, each once."""
        return list(
            dict.fromkeys((*self.photo.warnings, *self.prior.warnings, *self.report.warnings))
        )

    def __repr__(self) -> str:
        camera = self.camera
        edits = self.provenance.get("edits", ())
        # What edits have added, each as singular, plural, items.
        counts = (
            ("edit", "edits", edits),
            ("lamp", "lamps", self.lamps),
            ("body", "bodies", self.bodies),
        )
        facts = [
            f"{camera.width} x {camera.height} pixels",
            f"field of view {camera.fov:.4g} degrees",
            "predictor " + re.sub(" sha256:[0-9a-f]+", "", self.prior.predictor),
        ]
        quality = self.report.metrics.get("rerender_psnr_path")
        facts += [] if quality is None else [f"re-rendering {quality:.1f} dB"]
        facts += [
            f"{len(items)} {plural if len(items) > 1 else singular}"
            for singular, plural, items in counts
            if items
        ]
        return f"<Scene {self.photo.name}: {', '.join(facts)}>"

    def _repr_png_(self) -> bytes:
        """For notebooks: the photo beside its re-rendering, as a PNG."""
        # Imported here: a scene is used without ever being shown.
        import cv2

        from materialist.color import srgb_levels

        both = np.concatenate([self.photo.linear, np.nan_to_num(self.rerender)], 1)
        scale = min(1, _SHOWN / both.shape[1])
        small = cv2.resize(both, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        return bytes(cv2.imencode(".png", srgb_levels(small)[..., ::-1])[1])

    def _repr_html_(self) -> str:
        """For notebooks: the picture, with what `repr` says under it."""
        picture = base64.b64encode(self._repr_png_()).decode()
        words = html.escape(repr(self).strip("<>"))
        return f'<img alt="Photo and re-rendering" src="data:image/png;base64,{picture}"><div>{words}</div>'
