"""Blender: a script and the files it builds the .blend from, and the running of it where Blender is at hand."""

import importlib.util
import json
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from materialist.edits.core.renderer import path_depth
from materialist.errors import SetupError
from materialist.exporters.advice import advice
from materialist.exporters.exported import Exported, export_folder
from materialist.exporters.parts import Part, farthest
from materialist.io.atomic import whole_file
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.render.bodies import LEAST_IOR, SMOOTH, is_glowing, is_transparent
from materialist.types import Scene

_MINUTES = 20
"""How long Blender may take to build the file before it counts as hung."""


def export_blend(
    path: Path,
    scene: Scene,
    parts: list[Part],
    force: bool,
    *,
    blender: str | None,
    options: list[str],
) -> Exported:
    """PATH.blend with everything packed where Blender is found; else, or for a folder PATH, the script and its files.

    Args:
        blender: the program to use, None: look for one. options: of `build.py`.

    Raises SetupError when a Blender that was named, or was found, does not build the file.
    """
    # --- With Blender: the file itself, from assets that are thrown away ---
    wants_file = path.suffix.lower() == ".blend"
    program = None
    if wants_file:
        program = find_blender(blender)
    if program is not None:
        with tempfile.TemporaryDirectory() as scratch, whole_file(path, force) as result:
            write_blender_assets(Path(scratch), scene, parts)
            run_script(program, Path(scratch) / "build.py", result, options)
        return Exported(path)
    # --- Without: its script and assets, and the command that makes the file ---
    folder = path.with_suffix("") if wants_file else path
    with export_folder(folder, force, "blend") as whole:
        write_blender_assets(whole, scene, parts)
    file = path if wants_file else path.with_name(f"{path.name}.blend")
    command = shlex.join(_command(["blender"], folder / "build.py", file, options))
    if wants_file:
        return Exported(
            folder,
            notes=(f"No Blender was found; {folder} has a script: make {path} with: {command}",),
        )
    return Exported(folder, notes=(f"Make the .blend with: {command}",))


def write_blender_assets(folder: Path, scene: Scene, parts: list[Part]) -> None:
    """Fill an empty folder with `build.py` and what it reads: meshes, float32 maps, light, photo, camera."""
    # --- Meshes as arrays, maps and light as floats, the photo as it looks ---
    arrays = {}
    for part in parts:
        mesh = part.mesh
        for key in ("vertices", "normals", "uv", "faces"):
            arrays[f"{part.name}_{key}"] = getattr(mesh, key)
        for key in ("albedo", "roughness", "metallic"):
            write_exr(folder / f"{part.prefix}{key}.exr", getattr(part.materials, key))
    np.savez_compressed(folder / "meshes.npz", **arrays)  # type: ignore[arg-type]
    write_exr(folder / "envmap.exr", scene.envmap)
    write_png(folder / "photo.png", scene.photo.original)
    # --- What `build.py` reads beside them ---
    reach = farthest(parts)
    camera = scene.camera
    native = scene.photo.original.shape
    facts = {
        "width": camera.width,
        "height": camera.height,
        "fov": camera.fov,
        "near": reach * 1e-5,
        "far": reach * 4,
        "photo_width": native[1],
        "photo_height": native[0],
        "parts": {part.name: _look(part) for part in parts},
        "bounces": path_depth(scene) - 2,
        "in_photo": [
            *(p.name for p in parts if p.surface is None),
            *(f"body{k}" for k in range(_in_photo(scene))),
        ],
        "lamps": [asdict(lamp) for lamp in scene.lamps],
        "advice": advice(scene),
    }
    (folder / "scene.json").write_text(json.dumps(facts, indent=1) + "\n", "utf-8")
    shutil.copyfile(Path(__file__).with_name("blender_build.py"), folder / "build.py")


def _in_photo(scene: Scene) -> int:
    """How many of the scene's bodies, the first ones, its photo shows: those of edits that were saved."""
    saved = [stage for stage in scene.report.stages if stage.get("name") == "edit"]
    return max((int(stage.get("bodies", len(scene.bodies))) for stage in saved), default=0)


def _look(part: Part) -> dict:
    """The material of a part, for `build.py`: its maps, and for a body what it has beyond them."""
    surface = part.surface
    look: dict = {"maps": part.prefix, "repeat": surface is not None}
    if surface is not None and is_glowing(surface):
        look["emission"] = [float(c) for c in surface.emission]
    if surface is not None and is_transparent(surface):
        roughness = surface.interface_roughness
        look["glass"] = {
            "share": float(surface.transmission),
            "ior": max(float(surface.ior), LEAST_IOR),
            "roughness": 0.0 if roughness < SMOOTH else roughness,
            "tint": [float(c) for c in surface.tint],
        }
    return look


def find_blender(named: str | None) -> list[str] | None:
    """The start of a command that runs a script in Blender, or None. Raises SetupError where `named` is no program."""
    program = shutil.which(named or "blender")
    if program is None and named is not None:
        raise SetupError(
            f"There is no program {named}; give the path of blender, or of a Python that has bpy."
        )
    if program is None:
        return [sys.executable] if importlib.util.find_spec("bpy") else None
    return [program]


def _command(program: list[str], script: Path, output: Path, options: list[str]) -> list[str]:
    start = list(program)
    if "python" not in Path(program[0]).name.lower():
        start += ["-b", "--factory-startup", "--python-exit-code", "1", "--python"]
    return [*start, str(script), "--", "-o", str(output), *options]


def run_script(program: list[str], script: Path, result: Path, options: list[str]) -> None:
    """Let the program build `result` by the script. Raises SetupError where it does not."""
    command = _command(program, script, result, options)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60 * _MINUTES)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SetupError(
            f"{command[0]} did not build the file ({error}); give another as `blender=PROGRAM`."
        ) from error
    if done.returncode != 0 or not result.is_file():
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        last = lines[-1].strip() if lines else f"exit code {done.returncode}"
        raise SetupError(
            f"{command[0]} did not build the file ({last}); Blender 4.2 or later is needed."
        )
