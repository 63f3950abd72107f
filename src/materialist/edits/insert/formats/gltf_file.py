"""A glTF 2.0 document: its JSON, and the numbers and pictures behind it."""

import base64
import binascii
import json
import struct
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np

from materialist.edits.insert.formats.source import MeshSource
from materialist.errors import InputError
from materialist.types import Array

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
READ = (
    "KHR_materials_",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
)
"""Beginnings of the extensions that a file may require."""
LISTS = {
    "nodes": "nodes",
    "accessors": "accessors",
    "bufferViews": "accessors",
    "images": "pictures",
    "materials": "materials",
    "textures": "materials",
    "samplers": "materials",
    "meshes": "nodes",
    "skins": "nodes",
    "buffers": "pictures",
    "scenes": "nodes",
}
"""List of the document -> the limit of its length."""


class GltfFile:
    """The document of a .gltf or .glb. Its references are followed when they are asked for.

    All methods raise InputError for what the file does not have or what does not fit its bytes; KeyError, TypeError
    and ValueError for JSON of another shape than glTF's, which `read_gltf` turns into one.
    """

    def __init__(self, source: MeshSource):
        self.source = source
        # --- The document, no larger than it may be ---
        text, self.chunk = _chunks(source)
        source.check("json_items", sum(text.count(mark) for mark in (b"{", b"[", b",")))
        tree = json.loads(text)
        if not isinstance(tree, dict):
            raise source.damaged("its JSON is no object")
        self.tree: dict[str, Any] = tree
        if not str((tree.get("asset") or {}).get("version", "2.")).startswith("2"):
            raise source.damaged(
                f"version {str(tree['asset']['version'])[:20]} of glTF; 2.0 is read"
            )
        # --- Its lists, and what they promise ---
        for name, limit in LISTS.items():
            entries = tree.setdefault(name, [])
            if not isinstance(entries, list):
                raise source.damaged(f"its {name} are no list")
            source.check(limit, len(entries))
        self._refuse_required()
        self._check_unbacked()
        self._buffers: dict[int, Array] = {}
        self._sparse: dict[int, Array] = {}

    def _refuse_required(self) -> None:
        for name in self.tree.get("extensionsRequired", []):
            if not str(name).startswith(READ):
                raise InputError(
                    f"{self.source.path} needs the glTF extension {str(name)[:80]}, which is not read; export it "
                    "without (in Blender, without compression), or as OBJ or PLY."
                )

    def _check_unbacked(self) -> None:
        """Numbers that no bytes stand behind are bounded by nothing else."""
        unbacked = [
            accessor
            for accessor in self.tree["accessors"]
            if "bufferView" not in accessor or "sparse" in accessor
        ]
        self.source.check("vertices", sum(_whole(accessor["count"]) for accessor in unbacked))

    def entry(self, kind: str, number: Any) -> dict[str, Any]:
        """An entry of a list of the document."""
        entries = self.tree[kind]
        if (
            isinstance(number, bool)
            or not isinstance(number, int)
            or not 0 <= number < len(entries)
        ):
            raise self.source.damaged(
                f"it names number {str(number)[:20]} of {len(entries)} {kind}"
            )
        if not isinstance(entries[number], dict):
            raise self.source.damaged(f"number {number} of its {kind} is no object")
        return dict(entries[number])

    def count(self, number: Any) -> int:
        """Rows of an accessor, as the document says."""
        return _whole(self.entry("accessors", number)["count"])

    def accessor(self, number: Any, columns: int, rows: Array | None = None) -> Array:
        """[n, columns] numbers of an accessor, of `rows` [n] or of all; whole numbers that are normalised as float32.

        Without rows it may be a view of the file's bytes.
        """
        entry = self.entry("accessors", number)
        stored = COLUMNS[entry["type"]]
        if stored != columns and not (stored > columns > 1):
            raise self.source.damaged(
                f"accessor {number} is a {entry['type']}, where {columns} numbers are needed"
            )
        values = (
            self._sparse_values(number, entry) if "sparse" in entry else self._values(number, entry)
        )
        # Rows first: what is not used is not turned into floats.
        if rows is not None:
            if len(rows) and int(rows.max()) >= len(values):
                raise self.source.damaged(
                    f"row {int(rows.max())} of accessor {number}, which has {len(values)}"
                )
            values = values[rows]
        return _normalised(values[:, :columns]) if entry.get("normalized") else values[:, :columns]

    def _values(self, number: Any, entry: dict[str, Any]) -> Array:
        count = _whole(entry["count"])
        columns = COLUMNS[entry["type"]]
        kind = np.dtype(COMPONENTS[entry["componentType"]])
        if "bufferView" not in entry:
            return np.zeros((count, columns), kind)
        return self._table(f"accessor {number}", entry, count, columns, kind)

    def _table(
        self, name: str, entry: dict[str, Any], count: int, columns: int, kind: np.dtype
    ) -> Array:
        """[count, columns] view of a buffer view."""
        view = self.entry("bufferViews", entry["bufferView"])
        data = self.view(entry["bufferView"])
        offset = _whole(entry.get("byteOffset", 0))
        width = columns * kind.itemsize
        stride = _whole(view.get("byteStride", 0)) or width
        needed = offset + (count - 1) * stride + width if count else 0
        if stride < width or needed > len(data):
            raise self.source.damaged(
                f"{name} takes {needed} bytes of a buffer view of {len(data)}"
            )
        if not count:
            return np.zeros((0, columns), kind)
        return np.ndarray((count, columns), kind, data.data, offset, (stride, kind.itemsize))

    def _sparse_values(self, number: Any, entry: dict[str, Any]) -> Array:
        """The values of an accessor, some of which are replaced."""
        if number not in self._sparse:
            # Rows of a dense array, or of zeros, that other values replace (glTF 2.0, 3.6.2.3).
            sparse = entry["sparse"]
            columns = COLUMNS[entry["type"]]
            count = _whole(sparse["count"])
            values = np.array(self._values(number, entry))
            name = f"sparse accessor {number}"
            indices = sparse["indices"]
            replaced = sparse["values"]
            places = self._table(
                name, indices, count, 1, np.dtype(COMPONENTS[indices["componentType"]])
            )[:, 0]
            if places.dtype.kind == "f" or (
                count and not 0 <= int(places.min()) <= int(places.max()) < len(values)
            ):
                raise self.source.damaged(f"{name} replaces rows that it does not have")
            values[places] = self._table(name, replaced, count, columns, values.dtype)
            self._sparse[number] = values
        return self._sparse[number]

    def view(self, number: Any) -> Array:
        """[n] uint8 of a buffer view."""
        view = self.entry("bufferViews", number)
        data = self._buffer(view["buffer"])
        offset = _whole(view.get("byteOffset", 0))
        length = _whole(view["byteLength"])
        if offset + length > len(data):
            raise self.source.damaged(
                f"damaged: buffer view {number} ends at byte {offset + length} of a buffer of {len(data)}"
            )
        return data[offset : offset + length]

    def _buffer(self, number: Any) -> Array:
        entry = self.entry("buffers", number)
        if number not in self._buffers:
            data = self.chunk if "uri" not in entry and number == 0 else self.file(entry.get("uri"))
            if data is None:
                name = str(entry.get("uri", "a buffer"))[:200]
                raise InputError(
                    f"{self.source.path} needs {name}, which is not beside it; add that file."
                )
            self._buffers[number] = np.frombuffer(data, np.uint8)
        return self._buffers[number]

    def file(self, address: Any) -> bytes | None:
        """The bytes of a data address or of a file beside this one; None for none."""
        if not isinstance(address, str):
            return None
        if not address.startswith("data:"):
            return self.source.folder.get(address)
        kind, _, content = address.partition(",")
        try:
            return (
                base64.b64decode(content) if kind.endswith(";base64") else unquote_to_bytes(content)
            )
        except (binascii.Error, ValueError) as error:
            raise self.source.damaged("a data address in it is no base64") from error

    def picture(self, number: Any) -> bytes | None:
        """The encoded bytes of an image; None for a file that is not there."""
        entry = self.entry("images", number)
        if "bufferView" in entry:
            return self.view(entry["bufferView"]).tobytes()
        return self.file(entry.get("uri"))


def extension(entry: Any, name: str) -> dict[str, Any]:
    """An extension of an entry of the document; empty for none."""
    value = (entry.get("extensions") or {}).get(name) if isinstance(entry, dict) else None
    return value if isinstance(value, dict) else {}


def _chunks(source: MeshSource) -> tuple[bytes, bytes | None]:
    """(JSON, binary chunk)."""
    data = source.data
    if data[:4] != b"glTF":
        return data, None
    if len(data) < 20:
        raise source.damaged(f"truncated after {len(data)} bytes")
    # --- The header of 12 bytes, and the JSON chunk, which comes first ---
    version, total, length, kind = struct.unpack_from("<IIII", data, 4)
    if version != 2 or kind != 0x4E4F534A:
        raise source.damaged(f"version {version} of GLB; 2 is read")
    if max(20 + length, total) > len(data):
        raise source.damaged(
            f"truncated: it should have {max(20 + length, total)} bytes, and has {len(data)}"
        )
    # --- The binary chunk, if there is one ---
    after = 20 + length
    if after + 8 > len(data):
        return data[20:after], None
    length, kind = struct.unpack_from("<II", data, after)
    if kind != 0x004E4942:
        return data[20:after], None
    if after + 8 + length > len(data):
        raise source.damaged(
            f"truncated: it should have {after + 8 + length} bytes, and has {len(data)}"
        )
    return data[20:after], data[after + 8 : after + 8 + length]


def _whole(value: Any) -> int:
    """A count of the document. Raises ValueError for none."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or value != int(value)
        or value < 0
    ):
        raise ValueError(f"{str(value)[:40]} is no count")
    return int(value)


def _normalised(values: Array) -> Array:
    """float32 in [-1, 1] of whole numbers (glTF 2.0, section 3.11)."""
    if values.dtype.kind == "f":
        return values
    top = np.float32(np.iinfo(values.dtype).max)
    return np.maximum(values.astype(np.float32) / top, np.float32(-1))
