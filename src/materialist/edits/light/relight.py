"""Other light for a fitted scene: a map, a turn, a sun, lamps, moving ones (paper, Object insertion and relighting)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import cv2
import numpy as np

from materialist.camera import pixel_rays
from materialist.color import CLIPPED, LUMINANCE, luminance
from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import checked_pixel
from materialist.edits.core.surfaces import triple
from materialist.edits.light.options import Relight, RelightKeywords
from materialist.envmap import direction_of, row_solid_angle, texel_directions
from materialist.errors import InputError
from materialist.geometry.planes import level_frame
from materialist.io.photo import decode_photo
from materialist.io.video import MAX_FRAMES
from materialist.option_kinds import documented
from materialist.render.envmap import check_envmap, is_peaked
from materialist.spelling import spelled
from materialist.types import Array, Lamp, Scene


@dataclass(frozen=True)
class AddedLightSettings:
    """Sizes of added lights."""

    max_map_rows: int = 256  # derived: memory
    min_sun_radius: float = 6.0  # degrees: hard shadows show each step of the depth; 5 photos
    # With power 1 the old light keeps half, and what faces the sun gets 2.5 times that half from it.
    # Less shows no shadows, more makes an overcast sky a thunderstorm's; 8 photos.
    sun_irradiance: float = 1.25  # at power 1, in irradiances of surfaces by the old light
    sky_loss: float = 1.0  # the old light is divided by 1 + power times this
    normals: int = 256  # of surfaces whose irradiance is compared; derived: time
    lamp_unit: float = 0.25  # share of the median depth at which power 1 shows white as white
    lamp_radius: float = 0.015  # share of the median depth; tuned by eye


SETTINGS = AddedLightSettings()


@documented(Relight)
def relight(
    scene: Scene,
    options: Relight | None = None,
    *,
    fitted: Scene | None = None,
    **values: Unpack[RelightKeywords],
) -> Scene:
    """The scene under other light; geometry, materials and photo are shared. Steps happen in the order of `Relight`.

    Dimmed lights become surfaces that glow and stay where they are, whatever happens to the light from around. A sun
    takes the place of much of the old light, so that its shadows are seen: it replaces the brightest
    spot of the map (see `with_sun`), and surfaces keep 1 / (1 + `sun_power`) of the rest. `ambient` leaves it alone.

    options, values: see `options.Relight`; `values` are fields of it, as in `relight(scene, rotate=90)`.
    fitted: the scene before its edits, in which `dim` finds the photo's lights; needed where there are edits.
    Raises InputError for a map that is not 2:1, not finite or negative, or a number out of its range.
    """
    # --- Values of the options; lights of the photo as surfaces, if they are dimmed ---
    notes: list[str] = []
    changes = resolved(scene, Relight.merged(options, **values), notes)
    if isinstance(changes.rotate, tuple):
        raise InputError(
            f"The rotation is {'..'.join(map('{:g}'.format, changes.rotate))}; one picture has one number."
        )
    if changes.dim is not None:
        from materialist.edits.light.emitters import dimmed

        scene = dimmed(scene, changes.dim, lights=changes.lights, fitted=fitted)
    elif changes.lights is not None:
        raise InputError("The mask of lights says nothing without a dimming; give dim, too.")
    # --- The environment map, in the order of the options: another one, turned, with a sun ---
    light = scene.envmap
    lamps = changes.lamps
    if changes.envmap is not None:
        light = changes.envmap * _gain(changes.gain, changes.envmap, scene.envmap)
    if changes.rotate:
        light = rotated(light, changes.rotate)
    disc = np.zeros_like(light)
    if changes.sun is not None:
        light, disc = _sunny(scene, light, changes.sun, changes.sun_power)
    light = (light * np.float32(changes.ambient) + disc).astype(np.float32)
    if not light.any() and not (
        lamps or scene.lamps or any(max(b.surface.emission) > 0 for b in scene.bodies)
    ):
        raise InputError("The new light is black; give an ambient above 0, a sun or a lamp.")
    facts = {
        "envmap": None if changes.envmap is None else list(np.shape(changes.envmap)),
        "gain": changes.gain if changes.envmap is not None else None,
        "rotate": changes.rotate or None,
        "sun": changes.sun,
        "ambient": changes.ambient if changes.ambient != 1 else None,
        "lamps": len(lamps) or None,
        "dim": changes.dim,
    }
    # --- The scene, and what the provenance keeps of the options ---
    new = replace(scene, envmap=light, lamps=(*scene.lamps, *lamps))
    return noted(warned(new, *_warnings(fitted or scene), *notes), "light", facts)


def resolved(scene: Scene, options: Relight, notes: list[str] | None = None) -> Any:
    """The options with the environment map [h, 2h, 3] itself, its gain, and `types.Lamp` objects.

    The notes of the file's reader are added to `notes`. Raises InputError.
    """
    envmap = options.envmap
    gain = options.gain
    if isinstance(envmap, str | Path):
        envmap = read_envmap(envmap, notes)
        gain = "auto" if gain is None else gain
    elif envmap is not None:
        envmap = checked_envmap(envmap)
        gain = 1.0 if gain is None else gain
    lamps = tuple(item if isinstance(item, Lamp) else lamp(scene, *item) for item in options.lamps)
    return replace(options, envmap=envmap, gain=gain, lamps=lamps)


@spelled
def lamp(scene: Scene, x: float, y: float, depth: float, kelvin: float, power: float) -> Lamp:
    """A lamp at pixel (x, y) of the working size, `depth` scene units along the view axis.

    kelvin: colour temperature, 1667 to 25000. power: 1 shows a white wall that faces the lamp from a quarter of the
    scene's median depth as white in the photo. Raises InputError for values out of range.
    """
    for name, value in (("depth", depth), ("power", power)):
        if not (np.isfinite(value) and 0 < value <= 1e6):
            raise InputError(f"The lamp's {name} is {value:g}; it must be above 0.")
    column, row = checked_pixel(scene, (x, y), "lamp")
    middle = float(np.median(scene.depth[scene.depth > 0]))
    position = pixel_rays(scene.camera)[row, column].astype(np.float64) * depth
    # White wall: radiance = albedo / pi * I / d^2 = power at d = SETTINGS.lamp_unit * middle, with flux 4 pi I.
    flux = 4 * np.pi * np.pi * power * (SETTINGS.lamp_unit * middle) ** 2 * kelvin_colour(kelvin)
    return Lamp(triple(position), triple(flux), SETTINGS.lamp_radius * middle)


def kelvin_colour(kelvin: float) -> Array:
    """[3] linear Rec.709 of a black body of that temperature, with luminance 1 and no channel below 0.

    Chromaticity by the cubic fits of Kim et al. (2002). Raises InputError outside 1667 to 25000 K.
    """
    # --- Chromaticity (x, y) of the Planckian locus ---
    if not 1667 <= kelvin <= 25000:
        raise InputError(
            f"The lamp has {kelvin:g} K; a colour temperature lies between 1667 and 25000."
        )
    t = 1000.0 / kelvin
    if kelvin < 4000:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
    else:
        x = -3.0258469 * t**3 + 2.1070379 * t**2 + 0.2226347 * t + 0.240390
    if kelvin < 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin < 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    # --- CIE XYZ at luminance 1, and the matrix to linear Rec.709 ---
    xyz = np.array([x / y, 1.0, (1 - x - y) / y])
    to_rgb = np.array(
        [
            [3.2404542, -1.5371385, -0.4985314],
            [-0.9692660, 1.8760108, 0.0415560],
            [0.0556434, -0.2040259, 1.0572252],
        ]
    )
    rgb = np.maximum(to_rgb @ xyz, 0)
    return (rgb / (LUMINANCE @ rgb)).astype(np.float32)


def checked_envmap(envmap: Array) -> Array:
    """float32 [h, 2h, 3]. Raises InputError for another shape, values that are not finite and >= 0, or no light."""
    envmap = np.asarray(envmap, np.float32)
    check_envmap(envmap)
    if not envmap.any():
        raise InputError("The environment map is entirely black; there is no light in it.")
    return envmap


def read_envmap(path: str | Path, notes: list[str] | None = None) -> Array:
    """[h, 2h, 3] float32 from an EXR, HDR or display file, shrunk to at most `map_rows` rows.

    The notes of its reader are added to `notes`. Raises InputError.
    """
    decoded = decode_photo(Path(path))
    if notes is not None:
        notes += [f"The environment map {Path(path).name}: {note}" for note in decoded.warnings]
    envmap = checked_envmap(decoded.linear)
    if len(envmap) > (rows := SETTINGS.max_map_rows):
        # Means over areas keep the light of a small lamp.
        envmap = np.asarray(cv2.resize(envmap, (2 * rows, rows), interpolation=cv2.INTER_AREA))
    return envmap


def rotated(envmap: Array, degrees: float) -> Array:
    """[h, 2h, 3] turned about the vertical; > 0 to the right of the camera. Between columns, linear."""
    columns = degrees / 360 * envmap.shape[1]
    whole = int(np.floor(columns))
    share = np.float32(columns - whole)
    turned = np.roll(envmap, whole, 1)
    return turned if share == 0 else (1 - share) * turned + share * np.roll(envmap, whole + 1, 1)


def with_sun(
    envmap: Array,
    azimuth: float,
    elevation: float,
    *,
    power: float = 1.0,
    level: Array | None = None,
) -> tuple[Array, Array]:
    """(map without its brightest spot, the sun alone), both [h, 2h, 3].

    azimuth: degrees from straight ahead of the camera, > 0 to the right, in [-360, 360]; 180 is behind the camera.
    elevation: degrees above the horizon, in [-90, 90]. power: irradiance on a surface that faces the sun, as a
    multiple of the mean irradiance of the map. level: [3, 3], as `planes.level_frame`; None: the map is level.
    """
    if not (np.isfinite(azimuth) and -360 <= azimuth <= 360):
        raise InputError(f"The sun's azimuth is {azimuth:g}; it must lie in [-360, 360] degrees.")
    if not (np.isfinite(elevation) and -90 <= elevation <= 90):
        raise InputError(f"The sun's elevation is {elevation:g}; it must lie in [-90, 90] degrees.")
    towards = direction_of(azimuth, elevation)
    if level is not None:
        towards = level @ towards
    # --- A disc with a soft border of one texel around the sun's direction ---
    cosine = texel_directions(*envmap.shape[:2]) @ towards
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))  # [h, 2h]
    solid = row_solid_angle(envmap.shape[0])[:, None]  # [h, 1]
    texel = 180 / envmap.shape[0]
    disc = np.clip((max(SETTINGS.min_sun_radius, 1.5 * texel) - angle) / texel + 0.5, 0, 1)
    # --- Its radiance: an irradiance of `power` times that of a map of the mean radiance, pi L ---
    mean = luminance((envmap * solid[..., None]).sum((0, 1)) / (4 * np.pi))
    radiance = power * np.pi * mean / (disc * solid).sum()
    # --- The map without its own sun: texels above the 98th percentile are brought down ---
    bright = luminance(envmap)
    limit = max(float(np.quantile(bright, 0.98)), float(mean))
    calm = envmap * np.minimum(1, limit / np.maximum(bright, 1e-12))[..., None]
    sun = disc[..., None] * radiance * kelvin_colour(5500)
    return calm.astype(np.float32), sun.astype(np.float32)


def _sunny(
    scene: Scene, light: Array, sun: tuple[float, float], power: float
) -> tuple[Array, Array]:
    """(what is left of a light [h, 2h, 3] under a sun, the sun alone), by what surfaces of the photo get of them."""
    # --- The old light without its brightest spot, and irradiances by both ---
    level = level_frame(scene.normal, scene.geometry.plane_label)
    calm, disc = with_sun(light, *sun, level=level)
    normals = scene.normal[scene.depth > 0]
    normals = normals[:: max(1, len(normals) // SETTINGS.normals)]
    old = _irradiance(light, normals)
    # The brightest spot may have been most of the light; what is left takes its place.
    kept = old / max(_irradiance(calm, normals), 1e-9) / (1 + SETTINGS.sky_loss * power)
    # --- The sun, as bright as its irradiance on a surface that faces it asks ---
    facing = luminance(disc * row_solid_angle(len(disc))[:, None, None]).sum()
    strength = SETTINGS.sun_irradiance * power * old / max(float(facing), 1e-12)
    return calm * np.float32(kept), disc * np.float32(strength)


def _irradiance(envmap: Array, normals: Array) -> float:
    """Mean luminance that surfaces with normals [N, 3] get from a map [h, 2h, 3] with nothing in its way."""
    rows = min(len(envmap), 32)
    small = cv2.resize(luminance(envmap), (2 * rows, rows), interpolation=cv2.INTER_AREA)
    # The integral of L max(n.w, 0) over the sphere, texel by texel.
    power = (small * row_solid_angle(rows)[:, None]).reshape(-1)
    cosine = normals @ texel_directions(rows, 2 * rows).reshape(-1, 3).T
    return float((np.maximum(cosine, 0) @ power).mean())


def _gain(gain: float | str, envmap: Array, fitted: Array) -> np.float32:
    """The factor on `envmap`; `auto` gives it the mean light of the fitted map."""
    if gain != "auto":
        return np.float32(gain)

    def mean(e):
        return float((e.mean(-1).T * row_solid_angle(e.shape[0])).sum())

    return np.float32(mean(np.asarray(fitted)) / mean(np.asarray(envmap)))


def _warnings(scene: Scene) -> list[str]:
    """What relighting may show of the photo's own light (paper, failure cases)."""
    notes: list[str] = []
    if is_peaked(scene.envmap):
        notes.append(
            "The photo has hard light: its shadows may be baked into the albedo and stay beside the new ones "
            "(double shadows); look at maps/albedo.exr."
        )
    clipped = float((scene.photo.linear >= CLIPPED).any(-1).mean())
    if clipped > 0.05 and not scene.photo.hdr:
        notes.append(
            f"{clipped:.0%} of the photo is clipped; light and albedo are uncertain there."
        )
    return notes


def moving_light(
    scene: Scene | Sequence[Scene],
    count: int,
    options: Relight | None = None,
    *,
    suns: tuple[tuple[float, float], ...] = (),
    **values: Unpack[RelightKeywords],
) -> Iterator[Scene]:
    """`count` relit scenes: the light turns by `rotate` degrees in all, or from A to B; the sun and one lamp follow
    their stations.

    Several suns or lamps are stations of one that moves in straight lines at even time between them; a single one
    stands still. With nothing that moves the light makes a full turn. Lights that the photo shows (`lights`, or those
    that are found) stay where they are, all frames with the same `dim` (None: they are part of what turns).
    scene: one, or one for each frame, in which things move. `options` and `values` are those of `relight`. Raises
    InputError for a count outside 2 to 3600.
    """
    if not 2 <= count <= MAX_FRAMES:
        raise InputError(f"The number of frames is {count}; it must lie in 2 to {MAX_FRAMES}.")
    # --- What moves: the turn, the sun or one lamp ---
    film = [scene] * count if isinstance(scene, Scene) else scene
    notes: list[str] = []
    changes = resolved(film[0], Relight.merged(options, **values), notes)
    lamps = changes.lamps
    first, last = changes.rotate if isinstance(changes.rotate, tuple) else (0.0, changes.rotate)
    if not (first or last) and len(suns) < 2 and len(lamps) < 2:
        last = 360.0
    turn = last - first
    if isinstance(scene, Scene) and (changes.dim is not None or changes.lights is not None):
        # Once: finding the lights takes a rendering.
        film = [relight(scene, dim=changes.dim, lights=changes.lights)] * count
        changes = replace(changes, dim=None, lights=None)
    # After a full turn the last frame would be the first again: the film then stops one step before.
    closed = turn != 0 and turn % 360 == 0 and len(suns) < 2 and len(lamps) < 2
    # --- A scene a frame, at even steps t in [0, 1] ---
    for k in range(count):
        t = k / (count if closed else count - 1)
        sun = tuple(_between(suns, t)) if suns else None
        placed: tuple[Lamp, ...] = ()
        if lamps:
            x, y, z, *power, radius = _between(
                [(*station.position, *station.power, station.radius) for station in lamps], t
            )
            placed = (Lamp((x, y, z), triple(power), radius),)
        yield warned(
            relight(film[k], changes, rotate=first + t * turn, sun=sun, lamps=placed), *notes
        )


def _between(stations: Sequence[tuple[float, ...]], t: float) -> list[float]:
    """The numbers at time t in [0, 1] between stations at even times."""
    times = np.linspace(0, 1, len(stations))
    return [float(np.interp(t, times, numbers)) for numbers in zip(*stations, strict=True)]
