"""The files that a mesh file may refer to: those in its own folder and below."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

from materialist.errors import InputError


class MeshFolder:
    """The files beside a mesh, as trimesh asks for them (its `Resolver` interface).

    trimesh swallows the errors of a resolver, so this keeps them: `refused` are references that lead outside of the
    folder by a path, a link or an address, and are never opened; `missing` are files that are not there.
    """

    def __init__(self, folder: Path):
        self.folder = folder.resolve()
        self.opened: list[Path] = []
        self.refused: list[str] = []
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """The bytes of a file. Raises InputError for a reference outside of the folder, OSError for a missing file."""
        name = str(name).strip()
        path = self._inside(name)
        if path is None:
            self.refused.append(name)
            raise InputError(f"The reference {name} leads outside of {self.folder}.")
        try:
            data = path.read_bytes()
        except OSError:
            self.missing.append(name)
            raise
        self.opened.append(path)
        return data

    def _inside(self, name: str) -> Path | None:
        """The path of a reference, None when it leads outside. glTF's percent-encoding is decoded."""
        path = None
        for spelled in dict.fromkeys((name, unquote(name))):
            plain = spelled.replace("\\", "/")
            path = (self.folder / plain).resolve()
            outside = ":" in plain.split("/", 1)[0] or plain.startswith("/") or "\0" in plain
            if outside or not path.is_relative_to(self.folder):
                return None
            if path.is_file():
                break
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
