"""What an edit says of itself: command line, lists of edits, batches and the studio offer it by that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from materialist.option_kinds import OperationOptions, declarations

if TYPE_CHECKING:
    from materialist.types import Scene

REGION = ("mask", "click", "box", "with", "extent", "same_material", "exclude")
PLACE = ("mesh", "at")


class Target(Enum):
    """What an operation acts on."""

    REGION = "region"
    """A region [H, W] bool of the photo, as `select` gives it."""
    LIGHT = "light"
    """The light; a region [H, W] bool says which lights that the photo shows are meant, None: those that are found."""
    PLACE = "place"
    """A `Placement`."""

    @property
    def keys(self) -> tuple[str, ...]:
        """How a list of edits says where."""
        return PLACE if self is Target.PLACE else REGION


class PreviewMode(Enum):
    """How the studio shows an operation while its sliders move."""

    SHADED = "shaded"
    """At once, by cached light transport."""
    TRACED = "traced"
    """Path-traced by a process of its own, as soon as it can."""
    SKETCHED = "sketched"
    """Applied, and what it adds is sketched."""
    SIMULATED = "simulated"
    """The same, but applied in a process of its own: it may take long."""


@dataclass(frozen=True)
class Placement:
    """Meshes, and where they go."""

    meshes: tuple[Any, ...]
    """Files, or what `insert.meshes.read_model` made of them."""
    places: tuple[tuple[float, ...], ...]
    """(x, y) each, at working size."""


@dataclass(frozen=True, kw_only=True)
class Operation:
    """One kind of edit."""

    options: type[OperationOptions]
    """Its options; their `operation` is the command, and the key of a step in a list of edits."""
    kind: str
    """Its key in `provenance["edits"]`."""
    target: Target
    apply: Callable[[Scene, Any, Any, Scene], Scene]
    """apply(scene, target, options, fitted) -> Scene; `fitted` is the scene before its edits."""
    about: str
    """Of the command, in its help."""
    label: str
    """Of a step in the studio."""
    bare: str = "as it is"
    """What the studio says of a step without options."""
    preview: PreviewMode = PreviewMode.SKETCHED
    check_libraries: Callable[[], None] | None = None
    """Raises SetupError where an optional library that it needs is not installed."""
    needed: tuple[str, ...] = ()
    """Options without which nothing would change: one of them at least is to be given."""
    summary: Callable[[Scene], str] | None = None
    """What the command says of the edited scene."""
    notes: Callable[[Scene, Scene, float], list[str]] | None = None
    """notes(scene, edited, change): what to say of a picture, by its `core.notes.mean_change`."""

    @property
    def name(self) -> str:
        return self.options.operation

    @property
    def keys(self) -> tuple[str, ...]:
        """What a step of a list of edits may say."""
        declared = declarations(self.options).items()
        return (*self.target.keys, *(name for name, (option, _) in declared if option.written))


def new_edits(scene: Scene, edited: Scene) -> list[dict[str, Any]]:
    """What the provenance of an edited scene says of the edits between the two."""
    before = scene.provenance.get("edits", ())
    return [*edited.provenance.get("edits", ())[len(before) :]]
