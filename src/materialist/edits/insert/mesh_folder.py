"""What a mesh file may refer to: files in its own folder and below, and nothing else."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from urllib.parse import unquote

from materialist.errors import InputError

MAX_FACES = 2_000_000
"""Triangles of a file that is still read."""
FORMATS = (".obj", ".ply", ".stl", ".gltf", ".glb")
TOGETHER = "materialist-libraries.mtl"
"""Name under which the several .mtl files of an .obj are read."""
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".gif", ".webp")


OPTIONS = re.compile(
    rb"(?im)^([ \t]*map_kd[ \t]+)"
    rb"(?:-(?:blendu|blendv|cc|clamp|boost|texres|bm|imfchan|type)[ \t]+\S+[ \t]+"
    rb"|-mm[ \t]+\S+[ \t]+\S+[ \t]+"
    rb"|-[ost](?:[ \t]+[-+.\de]+(?=[ \t])){1,3}[ \t]+)+"
)
"""A texture of an .mtl up to its name, which may hold spaces, with the options of the format before it."""
OTHERS = re.compile(rb"(?im)^([ \t]*map_kd[ \t]+)-[^\r\n]*[ \t]([^\s]+)[ \t]*\r?$")
"""The same with options that the format does not know: the name is the last word."""
LIBRARY = re.compile(rb"(?m)^[ \t]*mtllib[ \t]+([^\r\n]+)")
"""A line of an .obj that names its materials."""
MAPS = re.compile(rb"(?im)^[ \t]*(?:map_|norm|bump|disp|refl)\S*[ \t]+([^\r\n]+)")
"""What an .mtl says of a texture: options and a name."""


class MeshFolder:
    """The files beside a mesh, as trimesh asks for them (its `Resolver` interface).

    `refused` are references that lead outside, by a path, a link or an address: they are never opened. `missing` are
    those inside that are not there. trimesh swallows what a resolver raises, so both are kept for the caller;
    `damaged` counts the pictures that could not be read, or are too large for it.
    """

    def __init__(self, folder: Path):
        self.folder = folder.resolve()
        self.refused: list[str] = []
        self.missing: list[str] = []
        self.damaged = 0
        self.left_out: set[str] = set()
        """What of its materials is not shown, in words."""
        self.together: dict[str, list[str]] = {}
        """Names that stand for several libraries of materials, one after the other."""

    def get(self, name: str) -> bytes:
        """The bytes of a file. Raises InputError for a reference outside of the folder, OSError for a missing one."""
        name = str(name).strip()
        if name in self.together:
            return b"\n".join(self._there(each) for each in self.together[name])
        path = self._inside(name)
        if path is None:
            self.refused.append(name)
            raise InputError(f"The reference {name} leads outside of {self.folder}.")
        try:
            data = path.read_bytes()
        except OSError:
            self.missing.append(name)
            raise
        self.damaged += path.suffix.lower() in PICTURES and not _is_picture(data)
        if path.suffix.lower() == ".mtl":
            plain = OTHERS.sub(rb"\1\2", OPTIONS.sub(rb"\1", data))  # trimesh takes them for a part of the name
            if plain != data:
                self.left_out.add("the options of its textures, such as -s")
            return plain
        return data

    def _there(self, name: str) -> bytes:
        """The bytes of a file, none where it is missing, which `missing` says."""
        try:
            return self.get(name)
        except OSError:
            return b""

    def holds(self, name: str) -> bool:
        """Whether a file of this name is there, and may be opened."""
        path = self._inside(name)
        return path is not None and path.is_file()

    def libraries(self, data: bytes) -> list[str]:
        """Names of the .mtl files of an .obj: one a line, with spaces perhaps, or several."""
        names: list[str] = []
        for line in LIBRARY.findall(data):
            whole = line.decode("utf-8", "replace").strip()
            split = whole.split()
            several = not self.holds(whole) and all(name.lower().endswith(".mtl") for name in split)
            names += split if several else [whole]
        return list(dict.fromkeys(names))

    def _inside(self, name: str) -> Path | None:
        """The path of a reference, None when it leads outside. Percent-encoding, as of glTF, is taken back."""
        for spelled in dict.fromkeys((name, unquote(name))):
            plain = spelled.replace("\\", "/")
            head = plain.split("/", 1)[0]
            if ":" in head or plain.startswith("/") or "\0" in plain:
                return None
            path = (self.folder / plain).resolve()
            if not path.is_relative_to(self.folder):
                return None
            if path.is_file():
                return path
        return path

    __getitem__ = get

    def keys(self) -> list[str]:
        """Names of the files, as trimesh asks for them."""
        return [path.name for path in self.folder.iterdir() if path.is_file()]

    def __contains__(self, name: str) -> bool:
        return name in self.keys()

    def namespaced(self, namespace: str) -> MeshFolder:
        """The same folder: no other is ever opened."""
        return self

    def write(self, name: str, data: bytes) -> None:
        """Nothing is written beside a mesh."""
        raise InputError("A mesh's folder is only read.")


def files_beside(path: Path) -> list[Path]:
    """Files that an .obj, .gltf or .glb refers to, themselves or through an .mtl, and that are there in its folder."""
    folder, data = MeshFolder(path.parent), path.read_bytes()
    if path.suffix.lower() == ".obj":
        libraries = _named(folder, [name.encode() for name in folder.libraries(data)])
        lines = [line for file in libraries for line in MAPS.findall(file.read_bytes())]
        return [*libraries, *_named(folder, lines)]
    if path.suffix.lower() not in (".gltf", ".glb"):
        return []
    try:
        header = gltf_header(data)
        parts = [*header.get("buffers", []), *header.get("images", [])]
        return _named(folder, [str(part["uri"]).encode() for part in parts if "uri" in part])
    except (ValueError, TypeError, AttributeError, struct.error):
        return []


def _named(folder: MeshFolder, references: list[bytes]) -> list[Path]:
    """Of references, whole or their last word, the files that are there and that may be opened."""
    found = []
    for reference in references:
        name = reference.decode("utf-8", "replace").strip()
        for spelled in (name, name.rpartition(" ")[2]):
            if not name.startswith("data:") and (file := folder._inside(spelled)) and file.is_file():
                found.append(file)
                break
    return found


def _is_picture(data: bytes) -> bool:
    """Whether the bytes begin as a picture that may be decoded, not one too large for that. trimesh says nothing."""
    import io

    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)):
            return True
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return False


def claimed_faces(path: Path, data: bytes) -> int:
    """How many faces the file says it has, before it is parsed; 0 where that cannot be told. Polygons count as one."""
    suffix = path.suffix.lower()
    try:
        if suffix == ".ply":
            head = data[: data.find(b"end_header")]
            words = [line.split() for line in head.splitlines()]
            return sum(int(w[2]) for w in words if len(w) == 3 and w[:2] == [b"element", b"face"])
        if suffix == ".stl":
            (count,) = struct.unpack_from("<I", data, 80)
            return count if len(data) == 84 + 50 * count else data.count(b"endfacet")
        if suffix == ".obj":
            return data.count(b"\nf ") + data.startswith(b"f ")
        return _gltf_faces(data)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error):
        return 0


def gltf_header(data: bytes) -> dict:
    """The JSON of a .gltf or .glb. Raises ValueError or struct.error where there is none."""
    if data[:4] == b"glTF":
        (length,) = struct.unpack_from("<I", data, 12)
        data = data[20 : 20 + length]
    return json.loads(data)


def _gltf_faces(data: bytes) -> int:
    header = gltf_header(data)
    accessors = header.get("accessors", [])
    total = 0
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            index = primitive.get("indices", primitive["attributes"]["POSITION"])
            total += int(accessors[index]["count"]) // 3
    return total
