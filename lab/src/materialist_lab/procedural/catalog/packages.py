"""Where models and photographs lie on this machine, and the command that installs what is missing."""

from pathlib import Path

FURNITURE = Path("/usr/share/sweethome3d/furniture")
PHOTOGRAPHS = (Path("/usr/share/backgrounds"), Path("/usr/share/wallpapers"))
INSTALL = (
    "apt-get install --no-install-recommends sweethome3d-furniture plasma-workspace-wallpapers gnome-backgrounds "
    "ukui-wallpapers mate-backgrounds"
)
"""Of Debian and what comes from it."""
_LEAST_BYTES = 60_000
"""Smaller pictures are icons, patterns and gradients."""


def archives(folder: Path | None = None) -> tuple[Path, ...]:
    """The catalogues in a folder, that of the Debian package by default; sorted, none where there is none."""
    return tuple(sorted((folder or FURNITURE).glob("*.sh3f")))


def photographs() -> tuple[Path, ...]:
    """The largest version of each picture of the installed packages of wallpapers, sorted."""
    largest: dict[str, Path] = {}
    for root in PHOTOGRAPHS:
        for path in sorted(root.rglob("*")):
            if path.suffix.lower() not in (".jpg", ".jpeg", ".png", ".webp") or path.is_symlink():
                continue
            size = path.stat().st_size
            name = (
                path.parent.parent.parent.name
                if path.parent.name.startswith("images")
                else _plain(path.stem)
            )
            if size >= _LEAST_BYTES and (
                name not in largest or size > largest[name].stat().st_size
            ):
                largest[name] = path
    return tuple(sorted(largest.values()))


def _plain(stem: str) -> str:
    return stem.split("_")[0]
