"""The command that installs a package into this very Python: by pipx where it made it, else by pip, else by uv."""

import re
import shlex
import sys
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

DISTRIBUTION = "materialist-photo"
"""Name of this project among distributions: `materialist` is another one's."""
LABORATORY = "materialist-photo-lab"
"""The distribution of the benchmarks and the training; its source is the folder lab/ of the repository."""


def install_command(*requirements: str) -> str:
    """A line for a shell that installs requirements, as in `install_command("rawpy>=0.21")`.

    Environments that uv made have no pip of their own; those of pipx have one or not, as pipx chose.
    """
    environment = Path(sys.prefix)
    if (environment / "pipx_metadata.json").is_file():
        return shlex.join(["pipx", "inject", environment.name, *requirements])
    # This very Python's pip, whatever the shell would find first.
    if find_spec("pip") is not None:
        return shlex.join([sys.executable, "-m", "pip", "install", *requirements])
    return shlex.join(["uv", "pip", "install", "--python", sys.executable, *requirements])


def laboratory_advice() -> str:
    """Lines for a shell that install the laboratory: from the checkout that this package runs from, if it does."""
    folder = Path(__file__).resolve().parents[2] / "lab"
    if (folder / "pyproject.toml").is_file():
        return install_command("-e", str(folder))
    return (
        f"{install_command(LABORATORY)}, or in a checkout of the repository: "
        f"{install_command('./lab')}"
    )


def extra_command(*extras: str) -> str:
    """A line for a shell that installs the packages of extras of ours, such as `usd`."""
    return install_command(*(need for extra in extras for need in extra_requirements(extra)))


def extra_requirements(extra: str) -> list[str]:
    """The requirements of an extra of ours; our distribution with it where this installation does not know them."""
    try:
        every = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        every = []
    # Metadata has lines such as: rawpy>=0.21; extra == "raw".
    marked = re.compile(rf"(.+?)\s*;.*extra == ['\"]{re.escape(extra)}['\"]")
    requirements = [match[1].replace(" ", "") for match in map(marked.match, every) if match]
    return requirements or [f"{DISTRIBUTION}[{extra}]"]
