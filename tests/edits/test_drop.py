"""Falling things: they come to rest on the ground, lose energy, never go through it; films, scenes and recipes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from made_meshes import extent, floor_scene

from materialist.edits.drop.drop import drop, settle
from materialist.edits.drop.ground import Field, blocks
from materialist.edits.drop.options import Drop
from materialist.edits.drop.physics import SETTINGS, Pose, RigidBody, convex_pieces, fall
from materialist.edits.insert.insert import insert
from materialist.edits.recipe import apply, read_recipe, write_recipe
from materialist.errors import InputError

pytest.importorskip("mujoco")

UP = np.array([0, np.cos(np.radians(30)), np.sin(np.radians(30))])
BOX = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.05, 0.05) for z in (-0.1, 0.1)])
AT = (48.0, 50.0)
FALL = "materialist.edits.drop.drop.fall"
FLAT = Field(np.array([-1.0, -1.0]), 2 / 64, np.zeros((65, 65)))


@pytest.fixture(scope="module")
def filmed_box(box):
    return drop(floor_scene(96, 72), [box], AT, frames=40, seed=3)


def test_it_starts_above_the_click_and_rests_on_the_floor(filmed_box):
    heights = [float((frame.bodies[0].vertices @ UP + 2).min()) for frame in filmed_box]
    size = extent(filmed_box[0].bodies)
    np.testing.assert_allclose(
        heights[0], 1.5 * size, rtol=0.1
    )  # the extent is that of the box in the camera frame
    assert abs(heights[-1]) < 0.01 * size  # a hundredth of its size
    assert min(heights) > -0.03 * size  # and not deeper at the moment it lands
    last = filmed_box[-1].bodies[0].vertices @ UP
    lying = [edge for edge in (0.5, 1, 2) if np.isclose(np.ptp(last) / size, edge / 2, atol=0.1)]
    assert lying  # on one of its sides
    assert filmed_box[-1] is filmed_box[-2]  # what does not move is one scene


def test_energy_is_only_lost():
    things = [RigidBody((BOX,), np.array([0, 0, 0.5]), np.array([1.0, 3.0, 0.5]))]
    energy = np.array(
        [poses[0].energy for poses in fall(things, blocks(FLAT, metres=0.2), frames=60, fps=60)]
    )
    assert (np.diff(energy) < 0.01 * energy[0]).all() and energy[-1] < 0.5 * energy[0]


@pytest.mark.parametrize("height", [pytest.param(1.0, marks=pytest.mark.slow), 8.0])
def test_nothing_tunnels(height):
    rough = np.random.default_rng(0).normal(0, 0.003, (65, 65))
    ground = blocks(Field(FLAT.corner, FLAT.cell, rough), metres=0.2)
    poses = list(
        fall([RigidBody((BOX,), np.array([0, 0, height]), np.zeros(3))], ground, frames=45, fps=20)
    )
    z = np.array([pose[0].centre[2] for pose in poses])
    assert z.min() > 0.04 and abs(z[-1] - z[-10]) < 1e-3


def test_things_rest_on_bodies_that_are_there(box):
    scene = insert(floor_scene(96, 72), box, AT, scale=2, turn=20)
    size = extent(scene.bodies)
    last = drop(scene, [box], AT, frames=40, spin=0, height=3, scale=0.8)[-1]
    assert len(last.bodies) == 2
    low = float((last.bodies[1].vertices @ UP + 2).min())
    assert low > 0.9 * size or low < 0.02 * size  # on top of it, or it has slid off onto the floor


def test_inside_of_something_there_is_no_room(box):
    scene = insert(floor_scene(96, 72), box, AT, scale=8)
    (body,) = scene.bodies  # its base must not be one with the floor
    scene = replace(
        scene, bodies=(replace(body, vertices=(body.vertices + 0.01 * UP).astype(np.float32)),)
    )
    with pytest.raises(InputError, match="no room at 48,50"):
        drop(scene, [box], AT, frames=2)


@pytest.mark.parametrize(
    "remedy", [{"scale": 0.25}, {"height": 8}], ids=lambda value: next(iter(value))
)
def test_what_the_message_advises_makes_room(box, remedy):
    scene = insert(floor_scene(96, 72), box, AT, scale=4)
    beside = (38.0, 50.0)
    with pytest.raises(InputError, match="a smaller scale, or a larger height"):
        drop(scene, [box], beside, frames=2)
    assert len(drop(scene, [box], beside, frames=2, **remedy)) == 2


def test_it_spins_about_its_centre_of_mass_which_falls_as_newton_says():
    """Straight down, wherever the middle of the box around the thing is."""
    off = np.array([0.15, 0.0, 0.05])
    (spun,) = zip(
        *fall(
            [RigidBody((BOX + off,), np.array([0, 0, 2.0]), np.array([1.0, 5.0, 3.0]))],
            [],
            frames=10,
            fps=25,
        )
    )
    mass = np.array([pose.centre + pose.turn @ off for pose in spun])
    np.testing.assert_allclose(mass[:, :2], np.tile(off[:2], (10, 1)), atol=2e-3)
    np.testing.assert_allclose(
        mass[:, 2], 2.05 - SETTINGS.gravity / 2 * (np.arange(10) / 25) ** 2, atol=2e-3
    )


def test_the_fastest_spin_ends_and_one_beyond_it_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ground = blocks(FLAT, metres=0.2)
    rod = BOX * np.array([1, 0.2, 0.1])

    def spun(turns):
        spin = 2 * np.pi * turns * np.array([0.6, 0.0, 0.8])
        return fall([RigidBody((rod,), np.array([0, 0, 0.5]), spin)], ground, frames=48, fps=24)

    energy = [poses[0].energy for poses in spun(20)]
    assert np.isfinite(energy).all() and max(energy) < 1.02 * energy[0]
    with pytest.raises(InputError, match="smaller spin"):
        list(spun(1e12))
    assert not list(tmp_path.iterdir()), "no log of the simulation's"


def test_what_is_too_light_is_told():
    rod = 0.0005 * np.array(
        [[x, y, z] for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-1, 1)]
    )
    with pytest.raises(InputError, match=r"Things of 0\.001 m .* larger metres"):
        list(fall([RigidBody((rod,), np.array([0, 0, 0.1]), np.zeros(3))], [], frames=2, fps=24))


def test_several_start_clear_of_each_other(box):
    film = drop(floor_scene(96, 72), [box, box], AT, frames=2, spin=0)
    a, b = (body.vertices @ UP for body in film[0].bodies)
    assert b.min() > a.max()
    told = film[0].provenance["edits"][-1]
    assert told["kind"] == "drop" and told["metres"] == Drop.metres and told["up"] == "auto"
    assert np.linalg.norm(told["gravity"]) == pytest.approx(1, abs=1e-5)  # the one that was found


def test_bad_input(box):
    scene = floor_scene(96, 72)
    for options, sentence in [
        ({"frames": 1}, "frames"),
        ({"height": -1}, "height"),
        ({"spin": np.inf}, "spin"),
        ({"metres": 0}, "metres"),
        ({"fps": 0}, "frame rate"),
        ({"gravity": (0, 0, 0)}, "gravity"),
        ({"at": [(1, 1), (2, 2)]}, "places"),
        ({"at": (400, 3)}, "outside"),
        ({"meshes": []}, "Nothing falls"),
    ]:
        given = {"meshes": [box], "at": AT, **options}
        with pytest.raises(InputError, match=sentence):
            drop(scene, **given)


def test_convex_shapes_are_one_piece_and_concave_ones_several():
    ball = trimesh.creation.icosphere(2)
    assert len(convex_pieces(ball.vertices, ball.faces)) == 1
    pytest.importorskip("coacd")
    parts = [
        trimesh.creation.box((3, 1, 1)),
        trimesh.creation.box((1, 3, 1)).apply_translation([-1, 2, 0]),
    ]
    corner = trimesh.util.concatenate(parts)
    pieces = convex_pieces(np.asarray(corner.vertices), np.asarray(corner.faces))
    total = sum(trimesh.convex.convex_hull(piece).volume for piece in pieces)
    assert (
        len(pieces) > 1 and 6 <= total < 7.3
    )  # the hull alone has 8; the pieces come from a coarse grid


@pytest.fixture(scope="module")
def rested(box):
    return settle(floor_scene(96, 72), [box], AT, seed=3)


def test_it_is_the_end_of_the_film(box, rested):
    film = drop(floor_scene(96, 72), [box], AT, frames=72, seed=3)
    size = extent(rested.bodies)
    np.testing.assert_allclose(
        rested.bodies[0].vertices, film[-1].bodies[0].vertices, atol=0.01 * size
    )
    assert (
        abs(float((rested.bodies[0].vertices @ UP + 2).min())) < 0.01 * size
    )  # it lies on the floor
    assert not np.allclose(rested.bodies[0].vertices, film[0].bodies[0].vertices, atol=0.1 * size)
    assert rested.provenance["edits"] == film[-1].provenance["edits"]


def test_a_file_with_a_drop_says_the_same_before_and_after(tmp_path, box_path, rested):
    (tmp_path / "edits.yaml").write_text(
        f"- drop: {{mesh: {box_path}, at: [48, 50], seed: 3}}\n- relight: {{ambient: 2}}\n"
    )
    scene = floor_scene(96, 72)
    steps = read_recipe(tmp_path / "edits.yaml")
    write_recipe(tmp_path / "again.yaml", steps)
    again = read_recipe(tmp_path / "again.yaml")
    assert again == steps
    for edited in (apply(scene, steps), apply(scene, again)):
        np.testing.assert_array_equal(edited.bodies[0].vertices, rested.bodies[0].vertices)
        assert [entry["kind"] for entry in edited.provenance["edits"]] == ["drop", "light"]


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (
            [[Pose(np.array([0, 0, -1e6]), np.eye(3)), Pose(np.zeros(3), np.eye(3))]] * 14,
            "left out",
        ),
        (
            [[Pose(np.array([0, 0, 2.0]), np.eye(3))]] * 14,
            "came to rest where the camera does not look",
        ),
        ([[Pose(np.array([0.01 * k, 0, 0]), np.eye(3))] for k in range(40)], "at rest"),
    ],
    ids=["fell out", "out of view", "rolls on"],
)
def test_what_cannot_be_seen_at_rest_is_told(box, monkeypatch, poses, words):
    monkeypatch.setattr(FALL, lambda *_, **__: poses)
    edited = settle(floor_scene(96, 72), [box] * len(poses[0]), AT)
    assert len(edited.bodies) == 1 and any(words in note for note in edited.report.warnings)


def test_a_film_that_ends_out_of_view_says_so_and_one_beside_everything_is_refused(
    box, monkeypatch
):
    scene = floor_scene(96, 72)
    height = [0.0, 2.0]
    monkeypatch.setattr(
        FALL, lambda *_, **__: [[Pose(np.array([0, 0, z]), np.eye(3))] for z in height]
    )
    film = drop(scene, box, AT, frames=2)
    assert [any("does not look" in note for note in one.report.warnings) for one in film] == [
        False,
        True,
    ]
    height[:] = 14 * [-1e6]
    with pytest.raises(InputError, match="falls beside everything"):
        settle(scene, [box], AT)
