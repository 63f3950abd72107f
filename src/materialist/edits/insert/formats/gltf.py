"""glTF 2.0 meshes as they stand at rest: copies, morph targets with their default weights, skins."""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.edits.insert.formats.content import (
    MeshContent,
    MeshPart,
    compacted,
    fan_faces,
    mean_of_corners,
    strip_faces,
)
from materialist.edits.insert.formats.gltf_file import GltfFile
from materialist.edits.insert.formats.gltf_material import GltfMaterials, base_factor
from materialist.edits.insert.formats.gltf_nodes import GltfNodes
from materialist.edits.insert.formats.source import MeshSource
from materialist.types import Array

TRIANGLES = 4
STRIP = 5
FAN = 6
"""Modes of primitives; those below are points and lines."""
CHUNK = 1 << 16
"""Vertices of a skin that are moved in one go: bounds the memory."""
MALFORMED = (
    KeyError,
    TypeError,
    ValueError,
    AttributeError,
    IndexError,
    OverflowError,
    RecursionError,
    struct.error,
)
"""What JSON of any shape may end in."""


@dataclass(frozen=True)
class Drawn:
    """A primitive under a node."""

    node: int
    mesh: dict[str, Any]
    primitive: dict[str, Any]
    triangles: int
    """How many one copy has at most."""

    @property
    def attributes(self) -> dict[str, Any]:
        """Name -> accessor."""
        return self.primitive["attributes"]


def read_gltf(source: MeshSource) -> MeshContent:
    """The triangles of a .gltf or .glb, a part for each primitive and copy.

    All counts are looked at in the JSON before any vertex is read. Raises InputError beyond the limits, for damaged
    bytes, and for an extension that must be read and is not.
    """
    try:
        file = GltfFile(source)
        nodes = GltfNodes(file)
        content = MeshContent()
        # Counts first, then pictures, then vertices: each step is checked before memory is taken
        drawn = _drawn(file, nodes, content)
        used = sorted(
            {
                drawn_mesh.primitive["material"]
                for drawn_mesh in drawn
                if "material" in drawn_mesh.primitive
            }
        )
    except MALFORMED as error:
        raise source.damaged(_reason(error)) from error
    try:
        materials = GltfMaterials(file, used)
    except MALFORMED as error:
        raise source.material_error(_reason(error)) from error
    content.paints.update(materials.paints)
    content.left_out += materials.left_out
    content.notes += materials.pictures.notes()
    try:
        for drawn_mesh in drawn:
            content.parts += _parts(file, nodes, content, drawn_mesh)
    except MALFORMED as error:
        raise source.damaged(_reason(error)) from error
    return content


def _reason(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"damaged: it lacks {error}"
    if isinstance(error, RecursionError):
        return "damaged: its JSON nests too deep"
    return f"damaged: {error}"


def _drawn(file: GltfFile, nodes: GltfNodes, content: MeshContent) -> list[Drawn]:
    """The primitives that the scene shows, after a look at how many triangles they have together."""
    drawn = []
    copies = triangles = 0
    for node in nodes.shown():
        if "mesh" not in nodes.nodes[node]:
            continue
        mesh = file.entry("meshes", nodes.nodes[node]["mesh"])
        count = nodes.copies(node)
        for primitive in mesh["primitives"]:
            # Only triangles have a surface.
            mode = primitive.get("mode", TRIANGLES)
            if mode not in (TRIANGLES, STRIP, FAN):
                content.left_out.append("its points and lines")
                continue
            file.source.check("targets", len(primitive.get("targets", [])))
            corners = file.count(primitive.get("indices", primitive["attributes"]["POSITION"]))
            drawn_mesh = Drawn(
                node, mesh, primitive, corners // 3 if mode == TRIANGLES else max(corners - 2, 0)
            )
            drawn.append(drawn_mesh)
            copies += count
            triangles += count * drawn_mesh.triangles
            file.source.check("copies", copies)
    file.source.check("faces", triangles)
    content.left_out += ["its lighting"] * (
        "KHR_lights_punctual" in (file.tree.get("extensions") or {})
    )
    content.left_out += ["its animation"] * bool(file.tree.get("animations"))
    content.left_out += ["what is in its other scenes"] * (len(file.tree["scenes"]) > 1)
    return drawn


def _parts(
    file: GltfFile, nodes: GltfNodes, content: MeshContent, drawn_mesh: Drawn
) -> list[MeshPart]:
    """The copies of a primitive."""
    # --- Once for all copies: faces, points, texture coordinates, colours ---
    faces, rows = _faces(file, drawn_mesh)
    if not len(faces):
        return []
    points, normals = _shape(file, nodes, drawn_mesh, rows)
    places = nodes.places(drawn_mesh.node)
    if "skin" in nodes.nodes[drawn_mesh.node] and "JOINTS_0" in drawn_mesh.attributes:
        points, normals = _skinned(file, nodes, drawn_mesh, rows, points, normals)
        places = np.eye(4)[None]  # a skin stands where its joints are, wherever its node is
    uv = _uv(file, content, drawn_mesh, rows)
    colours = _colours(file, content, drawn_mesh, rows)
    face_colours = None if colours is None else mean_of_corners(colours, faces)
    # --- Each copy at its place; a mirrored one is turned inside out again ---
    key = drawn_mesh.primitive.get("material")
    name = str(drawn_mesh.mesh.get("name", f"mesh{nodes.nodes[drawn_mesh.node]['mesh']}"))
    parts = []
    for place in places:
        linear = place[:3, :3]
        turned = faces[:, ::-1] if np.linalg.det(linear) < 0 else faces
        moved = points @ linear.T + place[:3, 3]
        facing = None if normals is None else (normals @ np.linalg.pinv(linear)).astype(np.float32)
        parts.append(MeshPart(moved, turned, key, name, facing, uv, face_colours))
    return parts


def _faces(file: GltfFile, drawn_mesh: Drawn) -> tuple[Array, Array]:
    """(faces [F, 3] as positions in the rows, rows [V] of the accessors that they use)."""
    mode = drawn_mesh.primitive.get("mode", TRIANGLES)
    position = drawn_mesh.attributes["POSITION"]
    if "indices" in drawn_mesh.primitive:
        corners = file.accessor(drawn_mesh.primitive["indices"], 1)[:, 0]
        if corners.dtype.kind == "f":
            raise file.source.damaged("its indices are no whole numbers")
        if len(corners) and not 0 <= int(corners.min()) <= int(corners.max()) < file.count(
            position
        ):
            raise file.source.damaged("it has faces of vertices that do not exist")
        corners = corners.astype(np.int32)
    else:
        corners = np.arange(file.count(position), dtype=np.int32)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int32), np.zeros(0, np.int64)
    if mode == TRIANGLES:
        faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
    else:
        faces = strip_faces(corners) if mode == STRIP else fan_faces(corners)
    places, rows = compacted(faces.ravel(), file.count(position))
    return places.reshape(-1, 3), rows


def _shape(
    file: GltfFile, nodes: GltfNodes, drawn_mesh: Drawn, rows: Array
) -> tuple[Array, Array | None]:
    """(positions [V, 3] float64, normals [V, 3] or None), with the morph targets by their weights at rest."""
    points = file.accessor(drawn_mesh.attributes["POSITION"], 3, rows).astype(np.float64)
    normals = None
    if "NORMAL" in drawn_mesh.attributes:
        normals = file.accessor(drawn_mesh.attributes["NORMAL"], 3, rows).astype(np.float64)
    weights = nodes.nodes[drawn_mesh.node].get("weights", drawn_mesh.mesh.get("weights", []))
    for weight, target in zip(weights, drawn_mesh.primitive.get("targets", [])):
        if float(weight) != 0 and "POSITION" in target:
            points += float(weight) * file.accessor(target["POSITION"], 3, rows)
        if float(weight) != 0 and "NORMAL" in target and normals is not None:
            normals += float(weight) * file.accessor(target["NORMAL"], 3, rows)
    return points, normals


def _skinned(
    file: GltfFile,
    nodes: GltfNodes,
    drawn_mesh: Drawn,
    rows: Array,
    points: Array,
    normals: Array | None,
) -> tuple[Array, Array | None]:
    """(positions, normals) in the world: moved by the joints, at rest (glTF 2.0, section 3.7.3)."""
    skin = file.entry("skins", nodes.nodes[drawn_mesh.node]["skin"])
    for joint in skin["joints"]:
        file.entry("nodes", joint)
    # --- Matrix of each joint: where it stands now, times the inverse of where it stood ---
    joints = np.array([nodes.world[joint] for joint in skin["joints"]]).reshape(-1, 4, 4)
    if "inverseBindMatrices" in skin:
        inverse = file.accessor(skin["inverseBindMatrices"], 16).astype(np.float64)
        if len(inverse) < len(joints):
            raise file.source.damaged("a skin has fewer matrices than joints")
        joints = joints @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    # --- Each vertex: the mean of where its joints take it, by their weights ---
    turns = np.linalg.pinv(joints[:, :3, :3])
    moved = np.zeros_like(points)
    facing = None if normals is None else np.zeros_like(normals)
    for start in range(0, len(points), CHUNK):
        chunk = slice(start, start + CHUNK)
        numbers, weights = _joint_weights(file, drawn_mesh, rows[chunk])
        if int(numbers.max()) >= len(joints):
            raise file.source.damaged("it names joints that do not exist")
        for joint, weight in zip(numbers.T, weights.T):
            bent = (
                np.einsum("nij,nj->ni", joints[joint, :3, :3], points[chunk]) + joints[joint, :3, 3]
            )
            moved[chunk] += weight[:, None] * bent
            if facing is not None and normals is not None:
                turned = np.einsum("nj,nji->ni", normals[chunk], turns[joint])
                facing[chunk] += weight[:, None] * turned
    return moved, facing


def _joint_weights(file: GltfFile, drawn_mesh: Drawn, rows: Array) -> tuple[Array, Array]:
    """(joints [V, n], their weights [V, n], which sum to 1)."""
    sets = [k for k in range(len(drawn_mesh.attributes)) if f"JOINTS_{k}" in drawn_mesh.attributes]
    file.source.check("joint_sets", len(sets))
    numbers = np.concatenate(
        [file.accessor(drawn_mesh.attributes[f"JOINTS_{k}"], 4, rows) for k in sets], -1
    )
    weights = np.concatenate(
        [file.accessor(drawn_mesh.attributes[f"WEIGHTS_{k}"], 4, rows) for k in sets], -1
    )
    total = weights.astype(np.float64).sum(-1, keepdims=True)
    first = np.eye(1, weights.shape[1])
    return numbers.astype(np.int64), np.where(
        total > 0, weights / np.where(total > 0, total, 1), first
    )


def _uv(file: GltfFile, content: MeshContent, drawn_mesh: Drawn, rows: Array) -> Array | None:
    """[V, 2] as the material lays its texture."""
    paint = content.paints.get(drawn_mesh.primitive.get("material"))
    if paint is None:
        return None
    textured = max(paint.surface.albedo.size // 3, paint.surface.roughness.size) > 1
    name = f"TEXCOORD_{paint.layout.uv_set}"
    if name not in drawn_mesh.attributes:
        content.left_out += ["a texture, whose coordinates are missing"] * textured
        return None
    uv = file.accessor(drawn_mesh.attributes[name], 2, rows).astype(np.float64)
    return paint.layout.placed(uv).astype(np.float32)


def _colours(file: GltfFile, content: MeshContent, drawn_mesh: Drawn, rows: Array) -> Array | None:
    """[V, 3] linear colours of the vertices times the material's; None where a texture is shown instead."""
    if "COLOR_0" not in drawn_mesh.attributes:
        return None
    colours = file.accessor(drawn_mesh.attributes["COLOR_0"], 3, rows)
    if colours.dtype.kind != "f":
        colours = colours.astype(np.float32) / np.float32(np.iinfo(colours.dtype).max)
    number = drawn_mesh.primitive.get("material")
    if number is None:
        return colours
    if content.paints[number].surface.albedo.size > 3:
        content.left_out.append("the colours of its vertices")
        return None
    return colours * base_factor(file.entry("materials", number))
