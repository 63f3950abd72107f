"""Meshes that fall onto the photographed scene (paper, Physical Simulation)."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from materialist.camera import project
from materialist.edits.core.notes import noted, warned
from materialist.edits.drop.ground import blocks, depth_in, ground_field
from materialist.edits.drop.options import Drop, DropKeywords
from materialist.edits.drop.physics import Pose, RigidBody, convex_pieces, fall, load_library
from materialist.edits.insert.insert import Support, moved_body, put, surface_points
from materialist.edits.insert.meshes import MeshModel, read_model, repainted
from materialist.errors import InputError
from materialist.geometry.boundary import joined_faces
from materialist.geometry.planes import axes, upright
from materialist.io.video import MAX_FRAMES
from materialist.option_kinds import documented, parse_numbers, several
from materialist.types import Array, Body, Scene


@dataclass(frozen=True)
class DropSettings:
    """What is a floor, and when things are at rest; tuned by eye."""

    min_floor_cosine: float = 0.5  # to the camera's up: a plane can be a floor or a table top
    max_seconds: float = 20.0  # after which a thing that still rolls is left where it is
    looks_per_second: int = 24  # how often motion is looked for
    looks_at_rest: int = 12  # in a row without motion, after which things are at rest


SETTINGS = DropSettings()


UNSEEN = "What fell came to rest where the camera does not look; try another place, height or seed."
Mesh = str | Path | MeshModel
"""A file, or what `meshes.read_model` made of it."""
Places = tuple[float, float] | Sequence[tuple[float, float]]
"""(x, y) at working size above which all fall, one over the other, or a place for each."""


@documented(Drop)
def drop(
    scene: Scene,
    meshes: Mesh | Sequence[Mesh],
    at: Places,
    options: Drop | None = None,
    *,
    frames: int = 48,
    fps: float = 24.0,
    **values: Unpack[DropKeywords],
) -> list[Scene]:
    """One scene a frame: meshes fall onto the surface under a pixel, tumble, and come to rest.

    The visible surface and the planes that continue it are the ground; bodies that are in the scene already count as
    part of it. Things are rigid, of one density, and collide as a few convex pieces each. Gravity is by default against
    the normal of the ground under the first place if it can be a floor, of the largest plane that can, or the camera's
    -Y.

    Args:
        options, values: see `options.Drop`; `values` are fields of it, as in `drop(scene, meshes, at, height=2)`.
        frames, fps: length of the film in frames, 2 to 3600, and frames a second.

    Raises:
        InputError: a place or mesh that cannot be used, or a number out of its range. SetupError: mujoco or coacd is
            missing.
    """
    options = Drop.merged(options, **values)
    # --- Options and places, before anything is computed ---
    if not 2 <= frames <= MAX_FRAMES:
        raise InputError(f"The number of frames is {frames}; it must lie in 2 to {MAX_FRAMES}.")
    if not 1 <= fps <= 240:
        raise InputError(f"The frame rate is {fps:g}; it must lie in [1, 240].")
    falling = _prepared(scene, meshes, at, options)
    # --- A scene a frame; one that hardly moves is the frame before ---
    film = []
    last = scene
    poses: list[Pose] | None = None
    for frame in fall(falling.things, falling.ground, frames=frames, fps=fps):
        if poses is None or moves(poses, frame, options.metres):
            last = falling.at(frame)
            poses = frame
        film.append(last)
    if not _in_view(scene, last):
        film[-1] = warned(last, UNSEEN)
    return film


@documented(Drop)
def settle(
    scene: Scene,
    meshes: Sequence[Mesh],
    at: Places,
    options: Drop | None = None,
    **values: Unpack[DropKeywords],
) -> Scene:
    """The scene with meshes that fell onto the surface under a pixel and lie where they came to rest.

    Everything is as in `drop`, of which this is the last frame, however long that takes: things are at rest
    when nothing has moved for half a second. What falls beside everything the photo shows is left out, and what
    still rolls after 20 seconds stays where it is then; warnings tell of both, and of things that lie out of view.

    Raises:
        InputError: a place or mesh that cannot be used, a number out of its range, or nothing comes to rest in sight.
        SetupError: mujoco or coacd is missing.
    """
    # --- The fall, until everything is at rest or gone ---
    falling = _prepared(scene, meshes, at, Drop.merged(options, **values))
    poses, gone, rests = _rested(falling)
    names = falling.facts["meshes"]
    if len(gone) == len(names):
        raise InputError(
            f"{', '.join(names)} falls beside everything that the photo shows; choose a place further from the edge of "
            "the surface, a smaller height, or another seed."
        )
    # --- What the user is to know of it ---
    notes = [
        f"{names[k]} falls beside everything that the photo shows, and was left out."
        for k in sorted(gone)
    ]
    if not rests:
        notes.append(
            f"After {SETTINGS.max_seconds:g} seconds not everything that fell is at rest; it stays where it is then."
        )
    edited = falling.at(poses, gone)
    if not _in_view(scene, edited):
        notes.append(UNSEEN)
    return warned(edited, *notes)


def _in_view(scene: Scene, edited: Scene) -> bool:
    """Whether the picture shows a vertex of what the edited scene has more, were nothing before it."""
    size = scene.camera.width, scene.camera.height
    places = (project(body.vertices, scene.camera) for body in edited.bodies[len(scene.bodies) :])
    return any(
        ((depth > 0) & ((place > 0) & (place < size)).all(-1)).any() for place, depth in places
    )


@dataclass(frozen=True)
class Falling:
    """Things over a scene, before they fall."""

    scene: Scene
    things: list[RigidBody]
    ground: list[Array]
    """Convex blocks [n, 3], metres, z up."""
    starts: list[tuple[tuple[Body, ...], Array]]
    """For each thing its bodies as they would stand, camera frame, and the shift [3] (metres, z up) that lifts it."""
    to_up: Array
    """[3, 3] from the camera frame to the simulation's."""
    factor: float
    """Metres a scene unit."""
    notes: tuple[str, ...]
    facts: dict[str, Any]
    """For the provenance."""

    def at(self, poses: list[Pose], gone: frozenset[int] = frozenset()) -> Scene:
        """The scene with the things in these poses, without those of the numbers `gone`."""
        placed = []
        for k, ((bodies, shift), thing, pose) in enumerate(zip(self.starts, self.things, poses)):
            turn = self.to_up.T @ pose.turn @ self.to_up
            # In metres, z up: x -> R (x + shift - first centre) + centre.
            move = (pose.turn @ (shift - thing.centre) + pose.centre) / self.factor @ self.to_up
            placed += [moved_body(body, turn, move) for body in bodies if k not in gone]
        dropped = replace(self.scene, bodies=(*self.scene.bodies, *placed))
        return noted(warned(dropped, *self.notes), "drop", self.facts)


def _prepared(scene: Scene, meshes: Mesh | Sequence[Mesh], at: Places, options: Drop) -> Falling:
    # --- Models, and a place for each ---
    load_library("mujoco")
    meshes = [meshes] if isinstance(meshes, str | Path | MeshModel) else meshes
    models = [
        repainted(m if isinstance(m, MeshModel) else read_model(m, up=options.up), options.material)
        for m in meshes
    ]
    if not models:
        raise InputError("Nothing falls; give at least one mesh.")
    places = _places(at, len(models))
    # --- As they would stand; then in the frame of the simulation: metres, z up ---
    stood = [put(scene, model, place, scale=options.scale) for model, place in zip(models, places)]
    direction = down(scene, stood[0][1], options.gravity)
    to_up = np.concatenate([axes(-direction), -direction[None]])
    factor = options.metres / max(longest for *_, longest in stood)
    points = [
        np.concatenate([surface_points(b) for b in bodies]) @ to_up.T * factor
        for bodies, *_ in stood
    ]
    lifts = _lifts(points, options.height * options.metres)

    # --- The ground below them, as convex blocks ---
    high = np.array([corners[:, 2].max() + lift for corners, lift in zip(points, lifts)])
    middles = np.array([(corners.min(0) + corners.max(0))[:2] / 2 for corners in points])
    field = ground_field(
        scene, to_up, factor, places=middles, tops=high + options.metres, metres=options.metres
    )
    # What would start in a bump lifts them all.
    overlaps = (
        depth_in(field, corners + np.array([0, 0, lift])) for corners, lift in zip(points, lifts)
    )
    clear = max(0.0, *overlaps)
    if clear >= options.metres:
        raise InputError(
            f"There is no room at {places[0][0]:g},{places[0][1]:g}: the things would start inside of something; "
            "choose a place with more room around it, a smaller scale, or a larger height."
        )
    # --- Where they start, and what the provenance keeps ---
    starts = [(bodies, np.array([0, 0, lift + clear])) for (bodies, *_), lift in zip(stood, lifts)]
    things = _things(starts, to_up, factor, options)
    ground = blocks(field, metres=options.metres)
    facts: dict[str, Any] = {
        "meshes": [model.name for model in models],
        "at": [[float(v) for v in place] for place in places],
        **{
            name: getattr(options, name)
            for name in ("height", "spin", "scale", "material", "metres", "seed", "up")
        },
        "gravity": [round(float(v), 6) for v in direction],
    }
    notes = tuple(note for model in models for note in model.warnings)
    return Falling(scene, things, ground, starts, to_up, factor, notes, facts)


def down(scene: Scene, support: Support, gravity: tuple[float, float, float] | None) -> Array:
    """[3] unit direction of gravity, camera frame; see `drop`. Raises InputError for a direction of no length."""
    if gravity is not None:
        direction = np.asarray(gravity, np.float64)
        if not (np.isfinite(direction).all() and direction.any()):
            raise InputError(
                f"The gravity is {gravity}; give a direction X,Y,Z in the camera frame, such as 0,-1,0."
            )
        return direction / np.linalg.norm(direction)
    if support.normal[1] > SETTINGS.min_floor_cosine:
        return -support.normal
    floor = upright(scene.normal, scene.geometry.plane_label)
    return np.array([0.0, -1.0, 0.0]) if floor is None else -floor


def _places(at: Any, count: int) -> list[Any]:
    places = [parse_numbers(place, 2, "place") for place in several(at)]
    places = places * count if len(places) == 1 else places
    if len(places) != count:
        raise InputError(
            f"There are {len(places)} places for {count} meshes; give one, or as many."
        )
    return places


def _lifts(points: list[Array], height: float) -> list[float]:
    """How far each thing, that stands with its points [n, 3], is lifted: by `height`, or clear of those below it."""
    boxes: list[tuple[Array, Array]] = []
    lifts = []
    for corners in points:
        low = corners.min(0)
        high = corners.max(0)
        # A quarter of its height above each thing that stands below it.
        over = [
            top[2] - low[2] + 0.25 * (high[2] - low[2])
            for bottom, top in boxes
            if (low[:2] < top[:2]).all() and (high[:2] > bottom[:2]).all()
        ]
        lift = float(max([height, *over]))
        lifts.append(lift)
        # Later things must clear this one as well.
        up = np.array([0, 0, lift])
        boxes.append((low + up, high + up))
    return lifts


def _things(
    starts: list[tuple[tuple[Body, ...], Array]], to_up: Array, factor: float, options: Drop
) -> list[RigidBody]:
    """What the simulation needs to know of each thing; all turn as fast, each about an axis of its own."""
    rng = np.random.default_rng(options.seed)
    things = []
    for bodies, shift in starts:
        vertices, faces = joined_faces(bodies)
        points = vertices.astype(np.float64) @ to_up.T * factor + shift
        # The middle of its box; the turn is in radians a second.
        centre = (points.min(0) + points.max(0)) / 2
        axis = rng.normal(size=3)
        turning = 2 * np.pi * options.spin * axis / np.linalg.norm(axis)
        pieces = convex_pieces(points, faces, seed=options.seed)
        things.append(RigidBody(tuple(piece - centre for piece in pieces), centre, turning))
    return things


def moves(before: list[Pose], now: list[Pose], metres: float) -> bool:
    """Whether anything has moved by more than a thousandth of a turn or of its size."""
    return any(
        np.abs(a.centre - b.centre).max() > 1e-3 * metres or np.abs(a.turn - b.turn).max() > 2e-3
        for a, b in zip(before, now)
    )


def _rested(falling: Falling) -> tuple[list[Pose], frozenset[int], bool]:
    """(the last poses, numbers of the things that fell out of the scene, whether the rest lies still)."""
    bottom = min((float(block[:, 2].min()) for block in falling.ground), default=-np.inf)
    recent: deque[list[Pose]] = deque(maxlen=SETTINGS.looks_at_rest + 1)
    gone: frozenset[int] = frozenset()
    # Looked at now and then: at rest when no look of the last half second differs.
    for poses in fall(
        falling.things,
        falling.ground,
        frames=round(SETTINGS.max_seconds * SETTINGS.looks_per_second) + 1,
        fps=SETTINGS.looks_per_second,
    ):
        gone = frozenset(k for k, pose in enumerate(poses) if pose.centre[2] < bottom)
        recent.append([pose for k, pose in enumerate(poses) if k not in gone])
        # A thing at the top of its flight is slow, too, but not for half a second.
        last = recent[-1]
        metres = falling.facts["metres"]
        still = all(len(look) == len(last) and not moves(look, last, metres) for look in recent)
        if not last or (len(recent) > SETTINGS.looks_at_rest and still):
            return poses, gone, True
    return poses, gone, False
