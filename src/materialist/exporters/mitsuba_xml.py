"""Mitsuba 3 scene: two XML files over the same binary PLY meshes and float32 EXR maps.

`scene.xml` has Mitsuba's own materials, for `mi.load_file` or the `mitsuba` program. `scene_materialist.xml` has the
paper's, after `materialist.render.variant.setup()`: its picture is this program's but for noise.
"""

from pathlib import Path

import numpy as np

from materialist.bsdf.disney_plugin import PLUGIN
from materialist.bsdf.rough_dielectric import PLUGIN as FROSTED
from materialist.edits.core.renderer import path_depth
from materialist.exporters.advice import advice
from materialist.exporters.parts import Part
from materialist.io.exr import write_exr
from materialist.render.bodies import OUTSIDE, at_least_2x2, body_bsdf, body_emitter
from materialist.render.envmap import half_turn, on_mitsuba_grid
from materialist.render.scene import look_along, seen_shape, sensor, sphere
from materialist.render.variant import setup
from materialist.types import Scene

FILES = {"scene.xml": False, "scene_materialist.xml": True}
"""The files, and whether their materials are this program's own plugins."""
MAPS = {"base_color": "albedo", "roughness": "roughness", "metallic": "metallic"}
"""Textures, of the same names in `principled` and in `materialist_disney`, and the maps that they show."""
SPP = 64
"""Paths a pixel unless the one who loads it says otherwise."""


def write_mitsuba(folder: Path, scene: Scene, parts: list[Part]) -> None:
    """Fill an empty folder with FILES and what they refer to, all by relative names."""
    mi = setup()
    # The light on Mitsuba's own grid, whose rows run from pole to pole; its columns are padded on loading.
    write_exr(folder / "envmap_mitsuba.exr", on_mitsuba_grid(scene.envmap, np)[:, 1:-1])
    for part in parts:
        seen_shape(mi, part.mesh, {"type": "diffuse"}).write_ply(str(folder / f"{part.name}.ply"))
        if part.surface is None or part.surface.transmission < 1:
            for key in MAPS.values():
                write_exr(
                    folder / f"{part.name}_{key}.exr", at_least_2x2(getattr(part.materials, key))
                )
    for name, uses_plugin in FILES.items():
        text = _xml(mi, _description(mi, scene, parts, uses_plugin), path_depth(scene))
        words = advice(scene)
        (folder / name).write_text(
            f"{text}\n<!-- {words['scale']} {words['colour']} -->\n", "utf-8"
        )


def _xml(mi, description: dict, depth: int) -> str:
    """The text of a description, whose `spp` and `max_depth` are parameters: mi.load_file(path, spp=256)."""
    state = mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), description)
    kinds = {
        PLUGIN: mi.ObjectType.BSDF,
        FROSTED: mi.ObjectType.BSDF,
        OUTSIDE: mi.ObjectType.Texture,
    }
    for node in state.nodes:  # Mitsuba knows the kinds of its own plugins alone
        node.type = kinds.get(node.props.plugin_name(), node.type)
    text = mi.parser.write_string(state)
    # max_depth becomes an XML parameter (`mi.load_file(path, max_depth=…)`); Mitsuba's writer does
    # this for spp only.
    text = text.replace(f'"max_depth" value="{depth}"', '"max_depth" value="$max_depth"')
    return text.replace("<default", f'<default name="max_depth" value="{depth}"/>\n    <default', 1)


def _description(mi, scene: Scene, parts: list[Part], uses_plugin: bool) -> dict:
    """The scene as `mi.load_dict` takes it."""
    # --- Camera, light and integrator as in `render.scene` ---
    eye = sensor(scene.camera, look_along(mi))
    description: dict = {
        "type": "scene",
        "embree_use_robust_intersections": True,
        "integrator": {"type": "path", "max_depth": path_depth(scene)},
        "sensor": {**eye, "sampler": {"type": "multijitter", "sample_count": SPP}},
        "light": {"type": "envmap", "filename": "envmap_mitsuba.exr", "to_world": half_turn(mi)},
    }
    # --- Each part by its mesh file, with the material of one of the two scenes ---
    for part in parts:
        description[part.name] = {
            "type": "ply",
            "filename": f"{part.name}.ply",
            "bsdf": _bsdf(part, uses_plugin),
        }
        if part.surface is not None and (emitter := body_emitter(part.surface)):
            description[part.name]["emitter"] = emitter
    return description | {f"lamp{k}": sphere(lamp) for k, lamp in enumerate(scene.lamps)}


def _bsdf(part: Part, uses_plugin: bool) -> dict:
    """The renderer's material, as `mi.load_dict` takes it."""
    # The depth surface has unmixed pixels, bodies have textures that repeat.
    sampling = ("nearest", "clamp") if part.surface is None else ("bilinear", "repeat")
    opaque: dict = {"type": PLUGIN}
    for name, key in MAPS.items():
        file = f"{part.name}_{key}.exr"
        opaque[name] = {
            "type": "bitmap",
            "filename": file,
            "raw": True,
            "filter_type": sampling[0],
            "wrap_mode": sampling[1],
        }
    bsdf = opaque if part.surface is None else body_bsdf(part.surface, opaque)
    # Both sides shade alike. `principled` is one-sided, so wrap it in `twosided`. Our plugin handles
    # back sides itself; `twosided` would flip hits whose shading normal faces away from the camera.
    if uses_plugin:
        return bsdf
    bsdf = _standard(bsdf)
    return {"type": "twosided", "bsdf": bsdf} if bsdf["type"] == "principled" else bsdf


def _standard(bsdf: dict) -> dict:
    # Mitsuba's own materials in the place of ours: the weight is one number there.
    if bsdf["type"] == "blendbsdf":
        sides = {name: _standard(bsdf[name]) for name in ("opaque", "glass")}
        return {"type": "blendbsdf", "weight": bsdf["weight"]["value"], **sides}
    if bsdf["type"] == PLUGIN:
        return {**bsdf, "type": "principled"}
    return bsdf["interface"] if bsdf["type"] == FROSTED else bsdf
