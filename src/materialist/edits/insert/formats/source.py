"""A mesh file that is being read, and the files beside it."""

from pathlib import Path
from urllib.parse import unquote

from materialist.edits.insert.formats.limits import MeshLimits
from materialist.errors import InputError

FORMATS = (".obj", ".ply", ".stl", ".gltf", ".glb")


class MeshFolder:
    """The files beside a mesh; none outside of its folder is opened, whatever leads there: path, link or address.

    `opened` are the files that were read, `missing` the references to files that are not there.
    """

    def __init__(self, path: Path, limits: MeshLimits):
        self.path = path
        self.limits = limits
        self.folder = path.parent.resolve()
        self.bytes_read = 0
        self.opened: list[Path] = []
        self.missing: list[str] = []

    def get(self, name: str) -> bytes | None:
        """The bytes of a file, None for a missing one. Raises InputError for a reference outside of the folder."""
        name = name.strip()
        try:
            path = self._inside(name)
            if not path.is_file():  # a pipe would wait for ever
                raise FileNotFoundError(path)
            self.count(path.stat().st_size)
            data = path.read_bytes()
        except (OSError, RuntimeError):  # RuntimeError: links that lead to each other
            self.missing.append(name[:200])
            return None
        self.opened.append(path)
        return data

    def count(self, size: int) -> None:
        """Add to the bytes read. Raises InputError where they exceed the limit."""
        self.bytes_read += size
        self.limits.check(self.path, "megabytes", self.bytes_read / 1e6)

    def _inside(self, name: str) -> Path:
        """The path of a reference; glTF's percent-encoding is decoded. Raises InputError where it leads outside."""
        # The reference as it stands, and decoded: neither may lead outside.
        spellings = [spelling.replace("\\", "/") for spelling in (name, unquote(name))]
        absolute = any(
            spelling.startswith("/") or ":" in spelling.split("/", 1)[0] or "\0" in spelling
            for spelling in spellings
        )
        paths = [] if absolute else [(self.folder / spelling).resolve() for spelling in spellings]
        if absolute or not all(path.is_relative_to(self.folder) for path in paths):
            raise InputError(
                f"{self.path} refers to {name[:200]}, outside of its folder, which is never followed; "
                "copy that file beside the mesh and name it there."
            )
        return paths[0] if paths[0].is_file() else paths[1]


class MeshSource:
    """The bytes of a mesh file, its folder and the limits that hold for it."""

    def __init__(self, path: Path, limits: MeshLimits):
        """Read the file. Raises InputError: another format, unreadable, empty or too large."""
        self.path = path
        self.limits = limits
        self.folder = MeshFolder(path, limits)
        self.suffix = path.suffix.lower()
        if self.suffix not in FORMATS:
            formats = ", ".join(FORMATS)
            raise InputError(f"The mesh {path} ends in '{path.suffix}'; give one of {formats}.")
        try:
            if path.exists() and not path.is_file():
                raise OSError(0, "it is no file")
            self.folder.count(path.stat().st_size)
            self.data = path.read_bytes()
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise InputError(f"The mesh {path} cannot be read: {reason}.") from error
        if not self.data:
            raise InputError(f"The mesh {path} is empty; give a file with faces.")

    def check(self, name: str, value: float) -> None:
        """Raise InputError where the value exceeds the limit of that name."""
        self.limits.check(self.path, name, value)

    def damaged(self, reason: str) -> InputError:
        """The error for bytes that are no such mesh."""
        reason = " ".join(reason.split())[:160] or "damaged"
        kind = self.suffix[1:].upper()
        return InputError(f"{self.path} is not a readable {kind} mesh ({reason}); export it again.")

    def material_error(self, reason: str) -> InputError:
        """The error for a material that says nonsense."""
        reason = " ".join(reason.split())[:160]
        return InputError(
            f"{self.path} has a material that cannot be read: {reason}; export it again."
        )
