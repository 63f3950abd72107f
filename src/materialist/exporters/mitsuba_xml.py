"""Mitsuba 3 scene: two XML files over the same binary PLY meshes and float32 EXR maps.

`scene.xml` has Mitsuba's own materials, for `mi.load_file` or the `mitsuba` program. `scene_materialist.xml` has the
paper's, after `materialist.render.variant.setup()`: its picture is this program's but for noise.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from materialist.bsdf.disney_plugin import PLUGIN
from materialist.bsdf.rough_dielectric import PLUGIN as FROSTED
from materialist.edits.core.renderer import path_depth
from materialist.exporters.parts import Part
from materialist.io.exr import write_exr
from materialist.render.bodies import OUTSIDE, at_least_2x2, body_bsdf, body_emitter
from materialist.render.envmap import on_mitsuba_grid
from materialist.render.scene import beside_u, sensor, sphere
from materialist.types import Mesh, Scene

FILES = {"scene.xml": False, "scene_materialist.xml": True}
"""The files, and whether their materials are this program's own plugins."""
MAPS = {"base_color": "albedo", "roughness": "roughness", "metallic": "metallic"}
"""Textures, of the same names in `principled` and in `materialist_disney`, and the maps that they show."""
TAGS = {
    "path": "integrator", "perspective": "sensor", "multijitter": "sampler", "hdrfilm": "film", "box": "rfilter",
    "envmap": "emitter", "area": "emitter", "ply": "shape", "sphere": "shape", "bitmap": "texture", OUTSIDE: "texture",
}  # fmt: skip
"""Plugin -> the tag that it has in XML; all others are `bsdf`."""


def write_mitsuba(folder: Path, scene: Scene, parts: list[Part]) -> None:
    """Fill an empty folder with FILES and what they refer to, all by relative names."""
    # The light on Mitsuba's own grid, whose rows run from pole to pole; its columns are padded on loading.
    write_exr(folder / "envmap_mitsuba.exr", on_mitsuba_grid(scene.envmap, np)[:, 1:-1])
    for part in parts:
        (folder / f"{part.name}.ply").write_bytes(_ply(part.mesh))
        if part.surface is None or part.surface.transmission < 1:
            for key in MAPS.values():
                write_exr(folder / f"{part.name}_{key}.exr", at_least_2x2(getattr(part.materials, key)))
    for name, own in FILES.items():
        root = ET.Element("scene", version="3.0.0")
        for key, value in {"spp": 64, "max_depth": path_depth(scene)}.items():  # as in mi.load_file(path, spp=256)
            ET.SubElement(root, "default", name=key, value=str(value))
        for key, described in _description(scene, parts, own).items():
            _add(root, key, described)
        ET.indent(root)
        ET.ElementTree(root).write(folder / name, encoding="utf-8", xml_declaration=True)


def _description(scene: Scene, parts: list[Part], own: bool) -> dict:
    """The scene as `mi.load_dict` takes it, but for files, transforms, and texts such as $spp for parameters."""
    look = _transform("lookat", origin="0, 0, 0", target="0, 0, -1", up="0, 1, 0")
    turned = _transform("rotate", y="1", angle="180")
    found: dict = {
        "embree_use_robust_intersections": True,
        "integrator": {"type": "path", "max_depth": "$max_depth"},
        "sensor": {**sensor(scene.camera, look), "sampler": {"type": "multijitter", "sample_count": "$spp"}},
        "light": {"type": "envmap", "filename": "envmap_mitsuba.exr", "to_world": turned},
    }
    for part in parts:
        found[part.name] = {"type": "ply", "filename": f"{part.name}.ply", "bsdf": _bsdf(part, own)}
        if part.surface is not None and (emitter := body_emitter(part.surface)):
            found[part.name]["emitter"] = emitter
    return found | {f"lamp{k}": sphere(lamp) for k, lamp in enumerate(scene.lamps)}


def _bsdf(part: Part, own: bool) -> dict:
    """The renderer's material. Both sides shade alike: `principled` needs a wrapper for that, which our own plugin must
    not have, since it would take what leans away from the eye for a back."""
    how = ("nearest", "clamp") if part.surface is None else ("bilinear", "repeat")
    opaque: dict = {"type": PLUGIN}
    for name, key in MAPS.items():
        file = f"{part.name}_{key}.exr"
        opaque[name] = {"type": "bitmap", "filename": file, "raw": True, "filter_type": how[0], "wrap_mode": how[1]}
    bsdf = opaque if part.surface is None else body_bsdf(part.surface, opaque)
    if own:
        return bsdf
    bsdf = _standard(bsdf)
    return {"type": "twosided", "bsdf": bsdf} if bsdf["type"] == "principled" else bsdf


def _standard(bsdf: dict) -> dict:
    if bsdf["type"] == "blendbsdf":
        sides = {name: _standard(bsdf[name]) for name in ("opaque", "glass")}
        return {"type": "blendbsdf", "weight": bsdf["weight"]["value"], **sides}
    if bsdf["type"] == PLUGIN:
        return {**bsdf, "type": "principled"}
    return bsdf["interface"] if bsdf["type"] == FROSTED else bsdf


def _add(parent: ET.Element, name: str, value: Any) -> None:
    """A description, or a value in it, as an element."""
    if isinstance(value, ET.Element):
        parent.append(value)
    elif isinstance(value, dict) and value["type"] == "rgb":
        numbers = ", ".join(map(repr, np.ravel(value["value"]).tolist()))
        ET.SubElement(parent, "rgb", name=name, value=numbers)
    elif isinstance(value, dict):
        node = ET.SubElement(parent, TAGS.get(value["type"], "bsdf"), type=value["type"], name=name)
        for key, inner in value.items():
            if key != "type":
                _add(node, key, inner)
    elif isinstance(value, list):
        ET.SubElement(parent, "point", name=name, value=", ".join(map(repr, value)))
    else:
        kind = {bool: "boolean", int: "integer", float: "float", str: "string"}[type(value)]
        kind = "integer" if str(value).startswith("$") else kind
        ET.SubElement(parent, kind, name=name, value=str(value).lower() if kind == "boolean" else str(value))


def _transform(kind: str, **attributes: str) -> ET.Element:
    made = ET.Element("transform", name="to_world")
    ET.SubElement(made, kind, attributes)
    return made


def _ply(mesh: Mesh) -> bytes:
    """Binary PLY without the face attributes of the scene package, which Mitsuba warns about; its v is ours, DOWN."""
    columns = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in columns]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    vertices = np.concatenate([mesh.vertices, beside_u(mesh.normals), mesh.uv], 1).astype("<f4")  # [V, 8]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("indices", "<i4", 3)])
    faces["count"], faces["indices"] = 3, mesh.faces
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()
