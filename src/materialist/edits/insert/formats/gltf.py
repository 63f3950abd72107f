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
class PrimitiveInstance:
    """A primitive under a node."""

    node: int
    mesh: dict[str, Any]
    primitive: dict[str, Any]

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
        reader = _Reader(file, GltfNodes(file), MeshContent())
        # --- Counts first, then pictures, then vertices: checked before memory is taken ---
        instances = reader.instances()
        used = sorted(
            {
                instance.primitive["material"]
                for instance in instances
                if "material" in instance.primitive
            }
        )
    except MALFORMED as error:
        raise source.damaged(_reason(error)) from error
    try:
        materials = GltfMaterials(file, used)
    except MALFORMED as error:
        raise source.material_error(_reason(error)) from error
    content = reader.content
    content.paints.update(materials.paints)
    content.left_out += materials.left_out
    content.notes += materials.pictures.notes()
    try:
        for instance in instances:
            content.parts += reader.parts(instance)
    except MALFORMED as error:
        raise source.damaged(_reason(error)) from error
    return content


def _reason(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"damaged: it lacks {error}"
    if isinstance(error, RecursionError):
        return "damaged: its JSON nests too deep"
    return f"damaged: {error}"


@dataclass(frozen=True)
class _Reader:
    """Reads the primitives of one document."""

    file: GltfFile
    nodes: GltfNodes
    content: MeshContent
    """What is read of it, and notes on what is not."""

    def instances(self) -> list[PrimitiveInstance]:
        """The primitives that the scene shows, after a look at how many triangles they have together."""
        instances = []
        copies = 0
        triangles = 0
        for node in self.nodes.shown():
            if "mesh" not in self.nodes.nodes[node]:
                continue
            mesh = self.file.entry("meshes", self.nodes.nodes[node]["mesh"])
            count = self.nodes.copies(node)
            for primitive in mesh["primitives"]:
                # Only triangles have a surface.
                mode = primitive.get("mode", TRIANGLES)
                if mode not in (TRIANGLES, STRIP, FAN):
                    self.content.left_out.append("its points and lines")
                    continue
                self.file.source.check("targets", len(primitive.get("targets", [])))
                corners = self.file.count(
                    primitive.get("indices", primitive["attributes"]["POSITION"])
                )
                instances.append(PrimitiveInstance(node=node, mesh=mesh, primitive=primitive))
                copies += count
                triangles += count * (corners // 3 if mode == TRIANGLES else max(corners - 2, 0))
                self.file.source.check("copies", copies)
        self.file.source.check("faces", triangles)
        self._note_left_out()
        return instances

    def _note_left_out(self) -> None:
        """Note what the document has beside meshes."""
        tree = self.file.tree
        if "KHR_lights_punctual" in (tree.get("extensions") or {}):
            self.content.left_out.append("its lighting")
        if tree.get("animations"):
            self.content.left_out.append("its animation")
        if len(tree["scenes"]) > 1:
            self.content.left_out.append("what is in its other scenes")

    def parts(self, instance: PrimitiveInstance) -> list[MeshPart]:
        """The copies of a primitive."""
        # --- Once for all copies: faces, points, texture coordinates, colours ---
        faces, rows = self._faces(instance)
        if not len(faces):
            return []
        points, normals = self._shape(instance, rows)
        places = self.nodes.places(instance.node)
        if "skin" in self.nodes.nodes[instance.node] and "JOINTS_0" in instance.attributes:
            points, normals = self._skinned(instance, rows, points, normals)
            places = np.eye(4)[None]  # a skin stands where its joints are, wherever its node is
        uv = self._uv(instance, rows)
        colours = self._colours(instance, rows)
        face_colours = None if colours is None else mean_of_corners(colours, faces)
        # --- Each copy at its place; a mirrored one is turned inside out again ---
        key = instance.primitive.get("material")
        name = str(instance.mesh.get("name", f"mesh{self.nodes.nodes[instance.node]['mesh']}"))
        parts = []
        for place in places:
            linear = place[:3, :3]
            turned = faces[:, ::-1] if np.linalg.det(linear) < 0 else faces
            moved = points @ linear.T + place[:3, 3]
            facing = (
                None if normals is None else (normals @ np.linalg.pinv(linear)).astype(np.float32)
            )
            parts.append(MeshPart(moved, turned, key, name, facing, uv, face_colours))
        return parts

    def _faces(self, instance: PrimitiveInstance) -> tuple[Array, Array]:
        """(faces [F, 3] as positions in the rows, rows [V] of the accessors that they use)."""
        mode = instance.primitive.get("mode", TRIANGLES)
        position = instance.attributes["POSITION"]
        # --- Corners by their numbers, or all vertices in their order ---
        if "indices" in instance.primitive:
            corners = self.file.accessor(instance.primitive["indices"], 1)[:, 0]
            if corners.dtype.kind == "f":
                raise self.file.source.damaged("its indices are no whole numbers")
            if len(corners) and not 0 <= int(corners.min()) <= int(corners.max()) < self.file.count(
                position
            ):
                raise self.file.source.damaged("it has faces of vertices that do not exist")
            corners = corners.astype(np.int32)
        else:
            corners = np.arange(self.file.count(position), dtype=np.int32)
        if len(corners) < 3:
            return np.zeros((0, 3), np.int32), np.zeros(0, np.int64)
        # --- Triangles, and only the rows that they use ---
        if mode == TRIANGLES:
            faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
        else:
            faces = strip_faces(corners) if mode == STRIP else fan_faces(corners)
        places, rows = compacted(faces.ravel(), self.file.count(position))
        return places.reshape(-1, 3), rows

    def _shape(self, instance: PrimitiveInstance, rows: Array) -> tuple[Array, Array | None]:
        """(positions [V, 3] float64, normals [V, 3] or None), with the morph targets by their weights at rest."""
        points = self.file.accessor(instance.attributes["POSITION"], 3, rows).astype(np.float64)
        normals = None
        if "NORMAL" in instance.attributes:
            normals = self.file.accessor(instance.attributes["NORMAL"], 3, rows).astype(np.float64)
        weights = self.nodes.nodes[instance.node].get("weights", instance.mesh.get("weights", []))
        for weight, target in zip(weights, instance.primitive.get("targets", [])):
            if float(weight) != 0 and "POSITION" in target:
                points += float(weight) * self.file.accessor(target["POSITION"], 3, rows)
            if float(weight) != 0 and "NORMAL" in target and normals is not None:
                normals += float(weight) * self.file.accessor(target["NORMAL"], 3, rows)
        return points, normals

    def _skinned(
        self,
        instance: PrimitiveInstance,
        rows: Array,
        points: Array,
        normals: Array | None,
    ) -> tuple[Array, Array | None]:
        """(positions, normals) in the world: moved by the joints, at rest (glTF 2.0, section 3.7.3)."""
        skin = self.file.entry("skins", self.nodes.nodes[instance.node]["skin"])
        for joint in skin["joints"]:
            self.file.entry("nodes", joint)
        # --- Matrix of each joint: where it stands now, times the inverse of where it stood ---
        worlds = [self.nodes.world[joint] for joint in skin["joints"]]
        joint_matrices = np.array(worlds).reshape(-1, 4, 4)
        if "inverseBindMatrices" in skin:
            inverse = self.file.accessor(skin["inverseBindMatrices"], 16).astype(np.float64)
            if len(inverse) < len(joint_matrices):
                raise self.file.source.damaged("a skin has fewer matrices than joints")
            inverse = inverse[: len(joint_matrices)].reshape(-1, 4, 4).transpose(0, 2, 1)
            joint_matrices = joint_matrices @ inverse
        normal_matrices = np.linalg.pinv(joint_matrices[:, :3, :3])  # their transposes turn normals
        # --- Each vertex: the mean of where its joints take it, by their weights ---
        skinned_points = np.zeros_like(points)
        skinned_normals = None if normals is None else np.zeros_like(normals)
        for start in range(0, len(points), CHUNK):
            chunk = slice(start, start + CHUNK)
            joints, weights = self._joint_weights(instance, rows[chunk])
            if int(joints.max()) >= len(joint_matrices):
                raise self.file.source.damaged("it names joints that do not exist")
            for joint, weight in zip(joints.T, weights.T, strict=True):
                matrix = joint_matrices[joint]
                moved = np.einsum("nij,nj->ni", matrix[:, :3, :3], points[chunk]) + matrix[:, :3, 3]
                skinned_points[chunk] += weight[:, None] * moved
                if skinned_normals is not None and normals is not None:
                    turned = np.einsum("nj,nji->ni", normals[chunk], normal_matrices[joint])
                    skinned_normals[chunk] += weight[:, None] * turned
        return skinned_points, skinned_normals

    def _joint_weights(self, instance: PrimitiveInstance, rows: Array) -> tuple[Array, Array]:
        """(joints [V, n], their weights [V, n], which sum to 1)."""
        sets = [k for k in range(len(instance.attributes)) if f"JOINTS_{k}" in instance.attributes]
        self.file.source.check("joint_sets", len(sets))
        numbers = np.concatenate(
            [self.file.accessor(instance.attributes[f"JOINTS_{k}"], 4, rows) for k in sets], -1
        )
        weights = np.concatenate(
            [self.file.accessor(instance.attributes[f"WEIGHTS_{k}"], 4, rows) for k in sets], -1
        )
        total = weights.astype(np.float64).sum(-1, keepdims=True)
        first = np.eye(1, weights.shape[1])
        return numbers.astype(np.int64), np.where(
            total > 0, weights / np.where(total > 0, total, 1), first
        )

    def _uv(self, instance: PrimitiveInstance, rows: Array) -> Array | None:
        """[V, 2] as the material lays its texture."""
        paint = self.content.paints.get(instance.primitive.get("material"))
        if paint is None:
            return None
        name = f"TEXCOORD_{paint.layout.uv_set}"
        if name not in instance.attributes:
            if max(paint.surface.albedo.size // 3, paint.surface.roughness.size) > 1:
                self.content.left_out.append("a texture, whose coordinates are missing")
            return None
        uv = self.file.accessor(instance.attributes[name], 2, rows).astype(np.float64)
        return paint.layout.placed(uv).astype(np.float32)

    def _colours(self, instance: PrimitiveInstance, rows: Array) -> Array | None:
        """[V, 3] linear colours of the vertices times the material's; None where a texture is shown instead."""
        if "COLOR_0" not in instance.attributes:
            return None
        colours = self.file.accessor(instance.attributes["COLOR_0"], 3, rows)
        if colours.dtype.kind != "f":
            colours = colours.astype(np.float32) / np.float32(np.iinfo(colours.dtype).max)
        number = instance.primitive.get("material")
        if number is None:
            return colours
        if self.content.paints[number].surface.albedo.size > 3:
            self.content.left_out.append("the colours of its vertices")
            return None
        return colours * base_factor(self.file.entry("materials", number))
