"""Mitsuba 3 scene: two XML files over the same binary PLY meshes and float32 EXR maps.

`scene.xml` has Mitsuba's own materials, for `mi.load_file` or the `mitsuba` program. `scene_materialist.xml` has the
paper's, after `materialist.render.variant.setup()`: its picture is this program's but for noise.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from materialist.bsdf.disney_plugin import PLUGIN
from materialist.bsdf.rough_dielectric import PLUGIN as FROSTED
from materialist.exporters.parts import Part
from materialist.io.exr import write_exr
from materialist.render.bodies import OUTSIDE, SMOOTH
from materialist.render.envmap import on_mitsuba_grid
from materialist.render.scene import GLASS_DEPTH, MAX_DEPTH, beside_u
from materialist.types import Array, Camera, Lamp, Materials, Mesh, Scene, Surface

DEFAULTS = {"spp": "64", "max_depth": str(MAX_DEPTH)}
"""Parameters of the files and their values: `mi.load_file(path, spp=256)` sets another."""
FILES = {"scene.xml": False, "scene_materialist.xml": True}
"""The files, and whether their materials are this program's own plugins."""
MAPS = {"base_color": "albedo", "roughness": "roughness", "metallic": "metallic"}
"""Textures, of the same names in `principled` and in `materialist_disney`, and the maps that they show."""


def write_mitsuba(folder: Path, scene: Scene, parts: list[Part]) -> None:
    """Fill an empty folder with FILES and what they refer to, all by relative names."""
    # The light on Mitsuba's own grid, whose rows run from pole to pole; its columns are padded on loading.
    write_exr(folder / "envmap_mitsuba.exr", on_mitsuba_grid(scene.envmap, np)[:, 1:-1])
    for part in parts:
        (folder / f"{part.name}.ply").write_bytes(_ply(part.mesh))
        if part.surface is None or part.surface.transmission < 1:
            for key in MAPS.values():
                write_exr(folder / f"{part.name}_{key}.exr", _at_least_2x2(part.materials, key))
    for name, own in FILES.items():
        root = _document(scene, parts, own)
        ET.indent(root)
        ET.ElementTree(root).write(folder / name, encoding="utf-8", xml_declaration=True)


def _document(scene: Scene, parts: list[Part], own: bool) -> ET.Element:
    root = ET.Element("scene", version="3.0.0")
    clear = any(part.surface is not None and part.surface.transmission > 0 for part in parts)
    for name, value in (DEFAULTS | ({"max_depth": str(GLASS_DEPTH)} if clear else {})).items():
        ET.SubElement(root, "default", name=name, value=value)
    _value(root, "boolean", "embree_use_robust_intersections", "true")
    _value(_node(root, "integrator", "path"), "integer", "max_depth", "$max_depth")
    _sensor(root, scene.camera)
    light = _node(root, "emitter", "envmap")
    _value(light, "string", "filename", "envmap_mitsuba.exr")
    ET.SubElement(_transform(light), "rotate", y="1", angle="180")
    for part in parts:
        shape = _node(root, "shape", "ply")
        _value(shape, "string", "filename", f"{part.name}.ply")
        _material(shape, part, own)
        if part.surface is not None and max(part.surface.emission) > 0:
            glow = ", ".join(repr(float(c)) for c in part.surface.emission)
            _value(_node(shape, "emitter", "area"), "rgb", "radiance", glow)
    for lamp in scene.lamps:
        _lamp(root, lamp)
    return root


def _lamp(root: ET.Element, lamp: Lamp) -> None:
    """A black sphere that glows."""
    shape = _node(root, "shape", "sphere")
    x, y, z = (repr(float(v)) for v in lamp.position)
    ET.SubElement(shape, "point", name="center", x=x, y=y, z=z)
    _value(shape, "float", "radius", repr(float(lamp.radius)))
    _value(_node(shape, "bsdf", "diffuse"), "rgb", "reflectance", "0")
    _value(_node(shape, "emitter", "area"), "rgb", "radiance", ", ".join(map(repr, lamp.radiance)))


def _sensor(root: ET.Element, camera: Camera) -> None:
    sensor = _node(root, "sensor", "perspective")
    _value(sensor, "float", "fov", repr(camera.fov))
    _value(sensor, "string", "fov_axis", "x")
    _value(sensor, "float", "near_clip", "1e-4")
    _value(sensor, "float", "far_clip", "1e7")
    ET.SubElement(_transform(sensor), "lookat", origin="0, 0, 0", target="0, 0, -1", up="0, 1, 0")
    _value(_node(sensor, "sampler", "multijitter"), "integer", "sample_count", "$spp")
    film = _node(sensor, "film", "hdrfilm")
    _value(film, "integer", "width", str(camera.width))
    _value(film, "integer", "height", str(camera.height))
    _value(film, "string", "pixel_format", "rgb")
    _value(film, "string", "component_format", "float32")
    _node(film, "rfilter", "box")


def _material(shape: ET.Element, part: Part, own: bool) -> None:
    """Both sides shade alike: `principled` needs a wrapper for that, which our own plugin must not have, since it
    would take what leans away from the eye for a back."""
    surface = part.surface
    if surface is None or surface.transmission <= 0:
        _opaque(shape if own else _node(shape, "bsdf", "twosided"), part, own)
    elif surface.transmission >= 1:
        _glass(shape, surface, own)
    else:
        mixed, weight = _node(shape, "bsdf", "blendbsdf"), repr(float(surface.transmission))
        if own:
            _value(_node(mixed, "texture", OUTSIDE, name="weight"), "float", "value", weight)
        else:
            _value(mixed, "float", "weight", weight)
        _opaque(mixed, part, own)
        _glass(mixed, surface, own)


def _opaque(parent: ET.Element, part: Part, own: bool) -> None:
    bsdf = _node(parent, "bsdf", PLUGIN if own else "principled")
    for name, key in MAPS.items():
        texture = _node(bsdf, "texture", "bitmap", name=name)
        _value(texture, "string", "filename", f"{part.name}_{key}.exr")
        _value(texture, "boolean", "raw", "true")
        _value(texture, "string", "filter_type", "nearest" if part.surface is None else "bilinear")
        _value(texture, "string", "wrap_mode", "clamp" if part.surface is None else "repeat")


def _glass(parent: ET.Element, surface: Surface, own: bool) -> None:
    """As `render.bodies` has it: each interface the root of the tint, smooth below the least roughness."""
    roughness = surface.interface_roughness
    if own and roughness >= SMOOTH:
        bsdf = _node(_node(parent, "bsdf", FROSTED), "bsdf", "roughdielectric", name="interface")
    else:
        bsdf = _node(parent, "bsdf", "dielectric" if roughness < SMOOTH else "roughdielectric")
    _value(bsdf, "float", "int_ior", repr(max(float(surface.ior), 1.0001)))
    _value(bsdf, "float", "ext_ior", "1.0")
    _value(bsdf, "rgb", "specular_transmittance", ", ".join(repr(float(np.sqrt(c))) for c in surface.tint))
    if roughness >= SMOOTH:
        _value(bsdf, "string", "distribution", "ggx")
        _value(bsdf, "float", "alpha", repr(roughness**2))


def _at_least_2x2(materials: Materials, key: str) -> Array:
    """A map [H, W] or [H, W, 3]; a single row or column is repeated, since Mitsuba takes no texture below 2 x 2."""
    values = getattr(materials, key)
    for axis in (0, 1):
        values = np.repeat(values, 2, axis) if values.shape[axis] == 1 else values
    return values


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


def _node(parent: ET.Element, kind: str, plugin: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, kind, {"type": plugin, **attributes})


def _value(parent: ET.Element, kind: str, name: str, value: str) -> None:
    ET.SubElement(parent, kind, name=name, value=value)


def _transform(parent: ET.Element) -> ET.Element:
    return ET.SubElement(parent, "transform", name="to_world")
