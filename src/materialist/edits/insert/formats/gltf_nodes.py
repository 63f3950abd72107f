"""The tree of nodes of a glTF: where its meshes stand."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from materialist.edits.insert.formats.gltf_file import GltfFile, extension
from materialist.types import Array

INSTANCING = "EXT_mesh_gpu_instancing"


class GltfNodes:
    """The nodes with their places in the world.

    Raises InputError for a node with two parents or below itself, and for too many levels.
    """

    def __init__(self, file: GltfFile):
        self.file = file
        self.nodes = [file.entry("nodes", number) for number in range(len(file.tree["nodes"]))]
        self.children = [self._children(node) for node in self.nodes]
        self._parents = self._checked_parents()
        self.world = self._worlds()
        """[4, 4] float64 of each node."""

    def shown(self) -> list[int]:
        """Nodes of the scene that the file shows by itself; of all where it has no scenes."""
        scenes = self.file.tree["scenes"]
        if not scenes:
            return list(range(len(self.nodes)))
        scene = self.file.entry("scenes", self.file.tree.get("scene", 0))
        return self._below(list(dict.fromkeys(scene.get("nodes", []))))

    def copies(self, node: int) -> int:
        """How often the meshes of a node are shown."""
        attributes = extension(self.nodes[node], INSTANCING).get("attributes", {})
        return self.file.count(next(iter(attributes.values()))) if attributes else 1

    def places(self, node: int) -> Array:
        """[n, 4, 4] float64: where the copies of a node's mesh stand."""
        attributes = extension(self.nodes[node], INSTANCING).get("attributes", {})
        if not attributes:
            return self.world[node][None]
        count = self.copies(node)
        local = np.tile(np.eye(4), (count, 1, 1))
        read = {name: self._instances(number, name) for name, number in attributes.items()}
        if any(len(values) != count for values in read.values()):
            raise self.file.source.damaged(
                f"node {node} has places of other counts for its instances"
            )
        if "ROTATION" in read:
            local[:, :3, :3] = rotations(read["ROTATION"])
        if "SCALE" in read:
            local[:, :3, :3] *= read["SCALE"][:, None]
        if "TRANSLATION" in read:
            local[:, :3, 3] = read["TRANSLATION"]
        return self.world[node] @ local

    def _instances(self, number: Any, name: str) -> Array:
        columns = 4 if name == "ROTATION" else 3
        if name not in ("ROTATION", "SCALE", "TRANSLATION"):
            return np.zeros((self.file.count(number), 0))
        return self.file.accessor(number, columns).astype(np.float64)

    def _children(self, node: dict[str, Any]) -> list[int]:
        children = node.get("children", [])
        for child in children:
            self.file.entry("nodes", child)
        return list(children)

    def _checked_parents(self) -> list[int]:
        """Parent of each node; -1 for none."""
        parents = [-1] * len(self.nodes)
        for number, children in enumerate(self.children):
            for child in children:
                if parents[child] != -1:
                    raise self.file.source.damaged(f"node {child} has two parents")
                parents[child] = number
        return parents

    def _worlds(self) -> list[Array]:
        worlds: list[Any] = [None] * len(self.nodes)
        level = [number for number, parent in enumerate(self._parents) if parent == -1]
        depth = 0
        while level:
            depth += 1
            self.file.source.check("node_depth", depth)
            for number in level:
                local = _matrix(self.nodes[number])
                parent = self._parents[number]
                worlds[number] = local if parent == -1 else worlds[parent] @ local
            level = [child for number in level for child in self.children[number]]
        if any(world is None for world in worlds):
            raise self.file.source.damaged("a node is below itself")
        return worlds

    def _below(self, roots: list[int]) -> list[int]:
        """These nodes and all below them."""
        for root in roots:
            self.file.entry("nodes", root)
        reached: dict[int, None] = {}
        level = roots
        while level:
            reached.update(dict.fromkeys(level))
            level = [
                child for number in level for child in self.children[number] if child not in reached
            ]
        return list(reached)


def rotations(quaternions: Array) -> Array:
    """[n, 3, 3] of quaternions [n, 4] (x, y, z, w) of any length; none where it is 0."""
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return Rotation.from_quat(np.where(length > 0, quaternions, [0, 0, 0, 1])).as_matrix()


def _matrix(node: dict[str, Any]) -> Array:
    """[4, 4] of a node in its parent."""
    if "matrix" in node:
        return np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    local = np.eye(4)
    if "rotation" in node:
        local[:3, :3] = rotations(np.asarray(node["rotation"], np.float64).reshape(1, 4))[0]
    if "scale" in node:
        local[:3, :3] *= np.asarray(node["scale"], np.float64).reshape(3)
    if "translation" in node:
        local[:3, 3] = np.asarray(node["translation"], np.float64).reshape(3)
    return local
