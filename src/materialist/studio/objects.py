"""Objects that are put into the photo: made, placed, changed, and let fall; steps `insert` and `drop` of the list."""

from dataclasses import replace
from typing import Any

from trimesh import creation, transformations

from materialist.edits.core.operation import Target
from materialist.edits.drop.operation import DROP
from materialist.edits.insert.operation import INSERT
from materialist.edits.recipe import Step
from materialist.edits.registry import OPERATIONS
from materialist.errors import InputError
from materialist.io.atomic import whole_file
from materialist.studio.live import views
from materialist.studio.session import Session

KINDS = tuple(name for name, entry in OPERATIONS.items() if entry.target is Target.PLACE)
_SHAPES: dict[str, tuple[str, dict[str, Any]]] = {
    "Ball": ("icosphere", {"subdivisions": 4, "radius": 0.5}),
    "Cube": ("box", {"extents": (1, 1, 1)}),
    "Cylinder": ("cylinder", {"radius": 0.3, "height": 1, "sections": 96}),
    "Cone": ("cone", {"radius": 0.4, "height": 1, "sections": 96}),
    "Ring": (
        "torus",
        {"major_radius": 0.35, "minor_radius": 0.15, "major_sections": 96, "minor_sections": 48},
    ),
    "Slab": ("box", {"extents": (1, 1, 0.12)}),
}
LIBRARY = tuple(_SHAPES)


def last(session: Session) -> int | None:
    """The place of the object that is chosen, else of the last one in the list."""
    if session.current_kind in KINDS:
        return session.edits.current
    return max(
        (k for k, step in enumerate(session.edits.steps) if step.kind in KINDS), default=None
    )


def place(session: Session, x: float, y: float) -> None:
    """Stand the current object at a pixel, or let it fall there if it fell; else a new one. Raises InputError."""
    with session.lock:
        # As texts: the list of edits holds nothing else.
        at = [str(v) for v in session.pixel(x, y)]
        edits = session.edits
        if session.current_kind not in KINDS:
            if "mesh" not in session.next_object:
                raise InputError("Choose an object from the list, or upload one, first.")
            edits = edits.add(Step(INSERT.name, session.next_object, session.workspace))
        session.put(edits, at=at)


def set_object_option(session: Session, name: str, value: str | None) -> None:
    """Set or clear (None) an option of the current object, and of the next one. Raises InputError."""
    with session.lock:
        if name == "mesh":  # another object is a new one
            session.edits = session.edits.chosen(None)
        # A fallen object knows fewer options: it cannot be turned.
        kind = session.current_kind
        if kind in KINDS and name in OPERATIONS[kind].keys:
            session.put(session.edits, **{name: value})
        session.next_object = {
            k: v for k, v in {**session.next_object, name: value}.items() if v is not None
        }


def let_fall(session: Session, height: float) -> list[str]:
    """The current object, else the last one, falls where it stands and lies where it comes to rest.

    Each fall has another seed, so an object that is let fall again tumbles in another way. Returns sentences on what
    did not go as expected.

    Raises:
        InputError: there is none, or it falls beside everything. SetupError: the physics is not installed.
    """
    with session.lock:
        index = last(session)
        live = session.preview
        if index is None:
            raise InputError("Place an object first; it falls where it stands.")
        # Only what this fall adds is told.
        known = live.call(views.check, steps=session.edits.active)
        step = session.edits.steps[index]
        kept = {name: value for name, value in step.options.items() if name in {*DROP.keys, "skip"}}
        options = {**kept, "height": f"{height:.3g}", "seed": str(session.falls)}
        after = session.edits.put(index, replace(step, kind=DROP.name, options=options))
        session.falls += 1
        session.change("fall", after)
        return [n for n in live.call(views.check, steps=after.active) if n not in known]


def library_file(session: Session, name: str) -> str:
    """A computed mesh as a file in the workspace: +Y up, longest side 1."""
    import numpy as np

    file = session.workspace / f"thing-{name.lower()}.ply"
    if not file.is_file():
        maker, options = _SHAPES[name]
        mesh = getattr(creation, maker)(**options)
        # trimesh builds along +Z; a ring lies flat as it is.
        mesh.apply_transform(transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
        with whole_file(file, force=True) as temporary:
            mesh.export(temporary)
    return file.name
