"""Limits of what a mesh file may ask for."""

from dataclasses import dataclass
from pathlib import Path

from materialist.errors import InputError


@dataclass(frozen=True)
class MeshLimits:
    """Limits checked in headers, before the memory is taken.

    Together they keep a reading process near ten times the file's size plus 300 MB, and within 0.9 GB where a file says
    much in few bytes (`tests/edits/insert/test_mesh_bombs.py`).
    """

    faces: int = 2_000_000
    """Triangles, copies counted; above it rendering runs out of memory on ordinary machines."""
    vertices: int = 6_000_000
    """Vertices: three for each triangle. Also the numbers of accessors that no bytes stand behind."""
    megabytes: float = 512.0
    """Size of the file together with those beside it; ordinary scans reach 200."""
    texture: int = 4096
    """Pixels along the longer side of a texture; larger ones are shrunk. A photo shows no more of a thing."""
    texture_pixels: int = 16_777_216
    """Pixels of all textures together, as kept; larger ones are shrunk. One of 4096 x 4096; 200 MB as float32."""
    pictures: int = 512
    """Pictures; scans have one for each of their patches."""
    picture_pixels: int = 67_108_864
    """Pixels of one picture as stored: 8192 x 8192, the largest that libraries of models offer; 270 MB to decode."""
    all_picture_pixels: int = 268_435_456
    """Pixels of all pictures as stored: four of the largest; some seconds to decode."""
    materials: int = 2_000
    """Materials; each is a body of its own to the renderer."""
    json_items: int = 1_500_000
    """Brackets and commas of a glTF's JSON, about 100 bytes of memory each; the largest scenes have 300,000."""
    accessors: int = 100_000
    """Entries of a glTF's `accessors`, and of its `bufferViews`; ten for each of 10,000 meshes."""
    nodes: int = 100_000
    """Entries of a glTF's `nodes`; large assemblies of CAD have 50,000."""
    node_depth: int = 1_000
    """Levels of a glTF's nodes below each other; the longest chains of bones have 200."""
    copies: int = 20_000
    """Primitives times the nodes and instances that show them; about 0.2 ms each."""
    targets: int = 512
    """Morph targets of a primitive; a face has about 50."""
    joint_sets: int = 8
    """Sets of four joints that move a vertex; exporters write one or two."""
    polygon: int = 10_000
    """Corners of a polygon that is not convex: cut into triangles in 0.1 s, with the square of it beyond."""
    line_bytes: int = 1_000_000
    """Length of a line of text; a polygon of 10,000 corners has 200,000."""
    crease: float = 40.0
    """Degrees: where a file has no normals, faces that meet at a sharper angle keep an edge."""

    def check(self, path: Path, name: str, value: float) -> None:
        """Raise InputError where the value exceeds the limit of that name."""
        limit = getattr(self, name)
        if value > limit:
            things, remedy = _WORDS[name]
            raise InputError(
                f"{path} has {_number(value)} {things}, more than {_number(limit)}; {remedy}."
            )


_REDUCE = (
    "reduce it first (Blender: Modifier > Decimate; MeshLab: Quadric Edge Collapse Decimation)"
)
_JOIN = "join its objects first (Blender: Object > Join)"
_SHRINK = "shrink its textures first"
_EXPORT = "export it again, in Blender for example"
_WORDS = {
    "faces": ("triangles", _REDUCE),
    "vertices": ("vertices", _REDUCE),
    "megabytes": ("MB, with the files beside it", _REDUCE),
    "pictures": ("pictures", "bake its textures into one first"),
    "picture_pixels": ("pixels in one picture", _SHRINK),
    "all_picture_pixels": ("pixels in its pictures", _SHRINK),
    "materials": ("materials", "join its materials first"),
    "json_items": ("entries in its JSON", _JOIN),
    "accessors": ("accessors or buffer views", _JOIN),
    "nodes": ("nodes", _JOIN),
    "node_depth": ("levels of nodes", "apply its parents first (Blender: Object > Parent > Clear)"),
    "copies": ("copies of meshes", _JOIN),
    "targets": ("morph targets in one mesh", "apply them first"),
    "joint_sets": ("sets of joints for a vertex", "limit it to four joints first"),
    "polygon": ("corners in one polygon", "triangulate it first (Blender: Face > Triangulate)"),
    "line_bytes": ("bytes in one line", _EXPORT),
}
"""Name of a limit -> what it counts, and what to do about it."""


def _number(value: float) -> str:
    if value >= 100_000:
        return f"{value / 1e6:.3g} million"
    return f"{value:.6g}"
