"""Rigid bodies of convex pieces (CoACD) that fall onto blocks that stay (MuJoCo): metres, seconds, z up."""

import importlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from trimesh import Trimesh

from materialist.errors import InputError, SetupError
from materialist.install import extra_command
from materialist.types import Array


@dataclass(frozen=True)
class PhysicsSettings:
    """How things move and touch, and the convex pieces that stand for them; tuned by eye unless derived."""

    step: float = 1e-3  # seconds: at 10 m/s 1 cm, and blocks are deeper; derived
    gravity: float = 9.81  # m / s^2
    # time constant, short as step allows; damping
    contact_spring: tuple[float, float] = (4e-3, 1.0)
    # sliding, torsional (m), rolling (m)
    friction: tuple[float, float, float] = (0.6, 0.01, 0.0005)
    density: float = 600.0  # kg / m^3: wood; things of one density fall alike

    # Convex pieces.
    max_hull_ratio: float = 1.05  # volume of hull over shape up to which one hull is enough
    max_concavity: float = 0.12  # that is left in a piece (CoACD's threshold)
    max_pieces: int = 16
    max_triangles: int = 1500  # beyond, a mesh is thinned out before it is taken apart
    thinned_cells: int = 24  # along the longest side to which it is thinned out


SETTINGS = PhysicsSettings()
LIBRARIES = ("mujoco", "coacd")
"""What the extra `physics` installs."""


@dataclass(frozen=True)
class RigidBody:
    """A rigid body at its start."""

    pieces: tuple[Array, ...]
    """Convex pieces: corners [n, 3] each, relative to the centre."""
    centre: Array
    """[3] metres."""
    spin: Array
    """[3] angular velocity, rad/s."""


@dataclass(frozen=True)
class Pose:
    """Where a thing is at one moment: x -> turn (x - its first centre) + centre."""

    centre: Array
    """[3] metres."""
    turn: Array
    """[3, 3] rotation since the start."""
    energy: float = 0.0
    """Kinetic and potential energy of all things, joule; heights count from z = 0."""


def fall(
    bodies_at_start: list[RigidBody], ground: list[Array], *, frames: int, fps: float
) -> Iterator[list[Pose]]:
    """Poses of all things at the times 0, 1 / fps, ...: `frames` lists. The same input gives the same poses.

    Raises SetupError where mujoco is not installed, InputError where the motion cannot be followed.
    """
    mujoco = load_library("mujoco")
    # MuJoCo would write its warnings to a file in the current folder.
    mujoco.set_mju_user_warning(lambda message: None)
    model = _world(mujoco, bodies_at_start, ground)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for k, thing in enumerate(bodies_at_start):
        body = data.body(f"thing{k}")
        # It turns about its centre of mass, which stands still; a free joint moves the body's own origin.
        data.qvel[6 * k : 6 * k + 3] = -np.cross(thing.spin, body.xipos - body.xpos)
        data.qvel[6 * k + 3 : 6 * k + 6] = thing.spin
    mujoco.mj_forward(model, data)
    warnings = mujoco.mjtWarning
    diverged = warnings.mjWARN_BADQPOS, warnings.mjWARN_BADQVEL, warnings.mjWARN_BADQACC
    # --- Steps of the simulation until each frame is due ---
    done = 0
    for frame in range(frames):
        target = round(frame / fps / SETTINGS.step)
        while done < target:
            mujoco.mj_step(model, data)
            done += 1
        if any(data.warning[int(kind)].number for kind in diverged):
            raise InputError(
                "The things fly apart in the simulation; choose a smaller spin, or larger metres."
            )
        mujoco.mj_forward(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        energy = float(data.energy.sum())
        bodies = [data.body(f"thing{k}") for k in range(len(bodies_at_start))]
        yield [Pose(b.xpos.copy(), b.xmat.reshape(3, 3).copy(), energy) for b in bodies]


def check_libraries(*extras: str) -> None:
    """Import all `LIBRARIES`. Raises SetupError with the command that installs them and the packages of `extras`."""
    for name in LIBRARIES:
        load_library(name, *extras)


def load_library(name: str, *extras: str) -> Any:
    """The module of one of `LIBRARIES`. Raises SetupError as `check_libraries` does."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        number = "more packages" if extras else "two more packages"
        raise SetupError(
            f"Falling objects need {number}; install them with: {extra_command('physics', *extras)}"
        ) from error


def _world(mujoco, things: list[RigidBody], ground: list[Array]):
    spec = mujoco.MjSpec()
    spec.option.timestep = SETTINGS.step
    spec.option.gravity = [0, 0, -SETTINGS.gravity]
    # Implicit: stable for things that spin fast. A simulation that fails must not start again by itself.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # Several contacts between two pieces, which later versions always find.
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):
        spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_MULTICCD
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # --- The ground does not move; each thing is one body of convex pieces ---
    for number, corners in enumerate(ground):
        _piece(mujoco, spec, spec.worldbody, f"ground{number}", corners)
    for k, thing in enumerate(things):
        body = spec.worldbody.add_body(name=f"thing{k}", pos=[float(v) for v in thing.centre])
        body.add_freejoint()
        for number, corners in enumerate(thing.pieces):
            _piece(mujoco, spec, body, f"thing{k}_{number}", corners)
    try:
        return spec.compile()
    except ValueError as error:  # as of a mass that is nearly none
        size = max(float(np.ptp(piece, axis=0).max()) for thing in things for piece in thing.pieces)
        raise InputError(
            f"Things of {size:.3g} m are too light for the simulation; choose larger metres."
        ) from error


def _piece(mujoco, spec, body, name: str, corners: Array) -> None:
    spec.add_mesh(name=name, uservert=np.ascontiguousarray(corners, np.float64).ravel().tolist())
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        density=SETTINGS.density,
        friction=list(SETTINGS.friction),
        condim=4,
        solref=list(SETTINGS.contact_spring),
        solimp=[0.95, 0.99, 1e-4, 0.5, 2],
        margin=0.0,
    )


def hull(points: Array) -> Array:
    """[n, 3] corners of the convex hull of points [m, 3], m >= 4; flat ones are given a thickness."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        size = max(float(np.ptp(points, axis=0).max()), 1e-9)
        thick = np.concatenate([points, *(points + shift for shift in 0.01 * size * np.eye(3))])
        return thick[ConvexHull(thick).vertices]


def convex_pieces(vertices: Array, faces: Array, *, seed: int = 0) -> list[Array]:
    """Corners [n, 3] of convex pieces that together make up a mesh: one hull where that is nearly all of it.

    Raises SetupError where coacd is not installed and the mesh is not nearly convex.
    """
    # --- One hull is enough where it has hardly more volume than the mesh ---
    vertices = np.asarray(vertices, np.float64)
    outer = hull(vertices)
    mesh = Trimesh(vertices, faces, validate=True)
    if mesh.is_watertight and ConvexHull(outer).volume <= SETTINGS.max_hull_ratio * abs(
        mesh.volume
    ):
        return [outer]
    # --- Taken apart into nearly convex pieces, thinned out before where it is fine ---
    coacd = load_library("coacd")
    logging.getLogger("coacd").setLevel(logging.ERROR)
    coacd.set_log_level("error")
    if len(faces) > SETTINGS.max_triangles:
        cell = max(float(np.ptp(vertices, axis=0).max()), 1e-30) / SETTINGS.thinned_cells
        mesh = Trimesh(np.round(vertices / cell) * cell, faces, validate=True)
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=SETTINGS.max_concavity,
        max_convex_hull=SETTINGS.max_pieces,
        preprocess_resolution=30,
        resolution=400,
        mcts_nodes=8,
        mcts_iterations=20,
        mcts_max_depth=2,
        seed=seed,
    )
    return [hull(np.asarray(points, np.float64)) for points, _ in parts if len(points) >= 4] or [
        outer
    ]
