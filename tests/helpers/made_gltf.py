"""glTF files made by hand: a document with its numbers, of any kind that the format knows."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

COMPONENTS = {
    "int8": 5120,
    "uint8": 5121,
    "int16": 5122,
    "uint16": 5123,
    "uint32": 5125,
    "float32": 5126,
}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.uint16)
"""A tetrahedron of size 1."""


class GltfBuilder:
    """A document that grows by accessors, pictures and materials; `tree` may be changed at will."""

    def __init__(self) -> None:
        self.data = b""
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{}],
        }

    def view(self, data: bytes) -> int:
        """Number of a new buffer view of these bytes."""
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.tree["bufferViews"].append(view)
        self.data += data
        return len(self.tree["bufferViews"]) - 1

    def accessor(self, values: Any, **fields: Any) -> int:
        """Number of a new accessor of an array [n] or [n, k]."""
        values = np.asarray(values)
        columns = 1 if values.ndim == 1 else values.shape[1]
        entry = {
            "bufferView": self.view(values.tobytes()),
            "componentType": COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": KINDS[columns],
        }
        self.tree["accessors"].append(entry | fields)
        return len(self.tree["accessors"]) - 1

    def sparse(
        self, count: int, columns: int, rows: Any, values: Any, base: int | None = None
    ) -> int:
        """Number of a new accessor of zeros, or of what is at `base`, with some rows replaced."""
        rows = np.asarray(rows, np.uint16)
        values = np.asarray(values, np.float32)
        entry: dict[str, Any] = {"componentType": 5126, "count": count, "type": KINDS[columns]}
        if base is not None:
            entry["bufferView"] = self.tree["accessors"][base]["bufferView"]
        indices = {"bufferView": self.view(rows.tobytes()), "componentType": 5123}
        entry["sparse"] = {
            "count": len(rows),
            "indices": indices,
            "values": {"bufferView": self.view(values.tobytes())},
        }
        self.tree["accessors"].append(entry)
        return len(self.tree["accessors"]) - 1

    def mesh(self, attributes: dict[str, int], **primitive: Any) -> int:
        """Number of a new mesh of one primitive."""
        self.tree["meshes"].append({"primitives": [{"attributes": attributes} | primitive]})
        return len(self.tree["meshes"]) - 1

    def tetrahedron(self, **attributes: int) -> int:
        """Number of a new mesh: the tetrahedron."""
        position = self.accessor(CORNERS)
        indices = self.accessor(FACES.ravel())
        return self.mesh({"POSITION": position} | attributes, indices=indices)

    def textured(self, pixels: Any, sampler: dict[str, int] | None = None, **info: Any) -> int:
        """Number of a new material with a picture [h, w, 3] uint8 for its base colour."""
        file = io.BytesIO()
        Image.fromarray(np.asarray(pixels, np.uint8)).save(file, "PNG")
        images, textures = (self.tree.setdefault(name, []) for name in ("images", "textures"))
        images.append({"bufferView": self.view(file.getvalue()), "mimeType": "image/png"})
        textures.append({"source": len(images) - 1})
        if sampler is not None:
            self.tree.setdefault("samplers", []).append(sampler)
            textures[-1]["sampler"] = len(self.tree["samplers"]) - 1
        texture = {"index": len(textures) - 1} | info
        self.tree.setdefault("materials", []).append(
            {"pbrMetallicRoughness": {"baseColorTexture": texture}}
        )
        return len(self.tree["materials"]) - 1

    def write(self, path: Path) -> Path:
        """Write a .glb."""
        self.tree["buffers"][0].setdefault("byteLength", len(self.data))
        return write_glb(path, json.dumps(self.tree).encode(), self.data)


def write_glb(path: Path, text: bytes, data: bytes = b"") -> Path:
    """A .glb of JSON and a binary chunk."""
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if data:
        chunks += struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
