"""`materialist.export`: which format, where to, and is it free."""

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Unpack

from materialist.edits.core.notes import PICTURED, is_pictured
from materialist.errors import InputError, SetupError
from materialist.exporters.advice import advice
from materialist.exporters.exported import EXPORT, Exported, export_folder
from materialist.exporters.glb import glb_bytes, write_hdr
from materialist.exporters.parts import Part, body_parts, scene_parts
from materialist.exporters.residual import with_residual
from materialist.install import extra_command
from materialist.io.atomic import ensure_writable, whole_file, write_whole
from materialist.keywords import ExportKeywords
from materialist.option_kinds import documented
from materialist.options import ExportOptions
from materialist.types import Scene

SUFFIX = {"glb": ".glb", "blend": ".blend", "usd": ".usdz", "html": ".html"}
"""Format -> suffix of its single file."""
FOLDERS = ("blend", "usd", "mitsuba")
"""Formats that may also be a folder: PATH without a suffix of its own."""
ADVICE = {
    "glb": ("light", "scale", "colour"),
    "usd": ("scale", "colour"),
    "mitsuba": ("scale",),
    "blend": ("scale",),
}
"""Format -> the advice that its files do not follow by themselves."""
CARRIED = "Base colour and metallic carry what the fit leaves of the photo; `residual=False` writes the fitted maps."
PAGE_TRIANGLES = 60_000
"""Triangles in an HTML page unless the caller says otherwise."""


@documented(ExportOptions)
def export(
    scene: Scene,
    path: str | Path,
    options: ExportOptions | None = None,
    *,
    force: bool = False,
    **values: Unpack[ExportKeywords],
) -> Exported:
    """Write a scene for another program, whole or not at all. The camera is exact: renders line up with the photo.

    Args:
        path: a file with the suffix of the format; for blend, usd and mitsuba a folder (a name without suffix).
        options, values: see `options.ExportOptions`; `values` are fields of it, as in `export(scene, path, to="usd")`.
        force: replace PATH where it is an earlier export.

    Raises:
        InputError: an unknown format, a suffix of another format. OutputError: PATH exists or cannot be written.
        SetupError: the extra for the format is missing, or `blender` does not work.
    """
    # --- Options that do not go together are refused ---
    settings = ExportOptions.merged(options, **values)
    path = Path(path)
    to = check_format(path, settings.to)
    most = settings.max_triangles
    flags = [
        f"--{name.replace('_', '-')}"
        for name in ("shadow_catcher", "fitted_material")
        if getattr(settings, name)
    ]
    if to != "blend" and (settings.blender is not None or flags):
        raise InputError(f"The options for Blender do not go with the format {to}; leave them out.")
    if to == "html" and most is None:
        most = PAGE_TRIANGLES
    # --- What is missing is told before the work ---
    if to == "usd":
        _usd_writers()
    if settings.blender is not None:
        from materialist.exporters.blender import find_blender

        find_blender(settings.blender)
    ensure_writable(path, force, EXPORT if path.suffix.lower() not in SUFFIX.values() else None)
    # --- What is exported: maps with the residual in them, surfaces and bodies ---
    carries = settings.residual and to != "html"
    if carries:
        scene = replace(scene, materials=with_residual(scene))
    bodies = body_parts(scene)
    parts = [*scene_parts(scene, most), *bodies]
    if to == "blend":
        from materialist.exporters.blender import export_blend

        files = export_blend(path, scene, parts, force, blender=settings.blender, options=flags)
    else:
        writers: dict[str, Callable[..., Exported]] = {
            "glb": _glb,
            "usd": _usd,
            "mitsuba": _mitsuba,
            "html": _html,
        }
        files = writers[to](path, scene, parts, force)
    # --- What the format says of it, and what it does not show ---
    words = advice(scene)
    notes = [words[key] for key in ADVICE.get(to, ())]
    if carries:
        notes.append(CARRIED)
    return replace(files, notes=(*files.notes, *notes, *_losses(scene, bodies, to)))


def _losses(scene: Scene, bodies: list[Part], to: str) -> Iterator[str]:
    """What the format does not show of the scene, in sentences."""
    surfaces = [body.surface for body in scene.bodies]
    clear = any(surface.transmission > 0 for surface in surfaces)
    absent = []
    if to == "usd" and clear:
        absent.append("refraction and tint of glass")
    if to == "html":
        if any(not body.constant for body in bodies):
            absent.append("textures but for their colours at the vertices")
        if clear:
            absent.append("glass")
        if any(max(surface.emission) > 0 for surface in surfaces):
            absent.append("glow")
    if absent:
        yield f"{to} shows bodies without {' and '.join(absent)}; glb, blend and mitsuba have all of it."
    if scene.lamps and to == "html":
        count = len(scene.lamps)
        yield f"html has none of the scene's {count} lamp{'s' * (count != 1)}; the other formats have."
    if is_pictured(scene) and to != "html":
        yield f"{PICTURED}{to} shows the scene without it."
    if to == "mitsuba" and any(0 < surface.transmission < 1 for surface in surfaces):
        yield (
            "Mitsuba has no glass whose coat is seen from outside alone: where the transmission is below 1 it is "
            "darker there, by 7 to 30 %."
        )


def check_format(path: Path, to: str | None) -> str:
    """The format of an export to PATH. Raises InputError where PATH does not say it, or its suffix is another's."""
    suffix = path.suffix.lower()
    if to is None:
        named = [name for name, end in SUFFIX.items() if end == suffix]
        if not named:
            raise InputError(f"{path} does not say its format; give it as `to=FORMAT`.")
        to = named[0]
    folder = to in FOLDERS and suffix not in (".usda", ".usdc", ".usd", ".xml", *SUFFIX.values())
    if not folder and suffix != SUFFIX.get(to):
        expected = [f"NAME{SUFFIX[to]}"] if to in SUFFIX else []
        expected += ["a folder name"] if to in FOLDERS else []
        raise InputError(
            f"The output {path} does not fit the format {to}; give {' or '.join(expected)}."
        )
    return to


def _glb(path: Path, scene: Scene, parts: list[Part], force: bool) -> Exported:
    light = path.with_suffix(".light.hdr")
    with whole_file(path, force) as mesh_file, whole_file(light, force) as light_file:
        mesh_file.write_bytes(glb_bytes(scene, parts))
        write_hdr(light_file, scene.envmap)
    note = f"glTF holds no environment light: {light.name} is it."
    return Exported(path, (light,), (note,))


def _mitsuba(path: Path, scene: Scene, parts: list[Part], force: bool) -> Exported:
    from materialist.exporters.mitsuba_xml import write_mitsuba

    with export_folder(path, force, "mitsuba") as folder:
        write_mitsuba(folder, scene, parts)
    return Exported(
        path / "scene.xml", (), (f"Render it with: mitsuba -m scalar_rgb {path / 'scene.xml'}",)
    )


def _usd_writers() -> tuple[Callable[..., None], Callable[..., None]]:
    """What writes a folder, and what packs it. Raises SetupError where usd-core is not installed."""
    try:
        from materialist.exporters.usd import pack_usdz, write_usd
    except ImportError as error:
        raise SetupError(f"USD needs usd-core; install it with: {extra_command('usd')}") from error
    return write_usd, pack_usdz


def _usd(path: Path, scene: Scene, parts: list[Part], force: bool) -> Exported:
    write_usd, pack_usdz = _usd_writers()
    if path.suffix.lower() == ".usdz":
        with tempfile.TemporaryDirectory() as scratch, whole_file(path, force) as file:
            write_usd(Path(scratch), scene, parts)
            pack_usdz(Path(scratch), file)
        return Exported(path)
    with export_folder(path, force, "usd") as folder:
        write_usd(folder, scene, parts)
    return Exported(path / "scene.usdc")


def _html(path: Path, scene: Scene, parts: list[Part], force: bool) -> Exported:
    from materialist.exporters.page import page

    write_whole(path, page(scene, parts), force)
    return Exported(path)
