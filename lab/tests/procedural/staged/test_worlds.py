"""Scenes of real things, made of a tiny catalogue."""

import numpy as np
import pytest
import trimesh
from made_catalog import make_archive, make_stock

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.types import Camera
from materialist_lab.procedural import options as o
from materialist_lab.procedural import packing, sample
from materialist_lab.procedural.catalog import packages
from materialist_lab.procedural.catalog.look import CatalogLook
from materialist_lab.procedural.catalog.support import LevelPlace
from materialist_lab.procedural.dataset import produce
from materialist_lab.procedural.staged import finishes, pieces, sculptures, studio_light
from materialist_lab.procedural.staged import stock as stocks
from materialist_lab.procedural.world import bounds


@pytest.fixture(scope="module")
def stock(tmp_path_factory):
    return make_stock(tmp_path_factory.mktemp("stock"))


@pytest.fixture(autouse=True)
def everything_is_trained_on(monkeypatch):
    monkeypatch.setattr(stocks, "HELD_OUT_EVERY", 10**12)


@pytest.mark.parametrize("kind", o.KINDS)
def test_worlds_can_be_packed(stock, kind):
    maker, _ = sample.MAKERS[kind]
    for k in range(4):
        rng = np.random.default_rng([6, k])
        world = maker(rng, stock)
        packed = packing.pack(world, rng)
        for array in (
            packed.vertices,
            packed.face,
            packed.material,
            packed.env,
            packed.env_density,
            packed.portals,
        ):
            assert np.isfinite(array).all()
        assert world.kind == kind and 8 < world.view.fov < 75
        assert packed.shares.sum() == pytest.approx(1) and len(packed.faces) < 400_000
        assert np.linalg.det(world.view.to_scene) == pytest.approx(1)
        angle = np.repeat(
            (-np.diff(np.cos(np.linspace(0, np.pi, packing.ENV_ROWS + 1)))), 2 * packing.ENV_ROWS
        )
        assert (packed.env_density * angle).sum() * np.pi / packing.ENV_ROWS == pytest.approx(
            1, abs=1e-4
        )
        if kind in ("furnished", "laid"):
            points = np.concatenate([p.solid.vertices for p in world.parts])
            assert (world.view.position > points.min(0)).all() and (
                world.view.position < points.max(0)
            ).all()


def test_a_model_is_one_thing_of_its_size(stock):
    table = stock.listing.model("made-001")
    parts = pieces.piece(np.random.default_rng(0), table, stock)
    # All surfaces of a model are labelled as one thing.
    assert len({part.thing for part in parts}) == 1
    low, high = bounds(parts)
    np.testing.assert_allclose(high - low, table.entry.size, rtol=1e-5)


def test_a_lamp_shines_when_it_is_lit(stock):
    lamp = stock.listing.model("made-005")
    for lit in (False, True):
        parts = pieces.piece(np.random.default_rng(0), lamp, stock, lit=lit)
        assert any(max(part.material.emission) > 0 for part in parts) == lit


def test_things_are_laid_on_their_place_side_by_side(stock):
    place = LevelPlace(0.75, -0.6, 0.6, -0.3, 0.3, 10.0)
    parts = pieces.laid(np.random.default_rng(3), place, 8, stock)
    things = {}
    for part in parts:
        things.setdefault(part.thing, []).append(part)
    # Boxes by thing, which may have several parts.
    boxes = [bounds(parts_of_thing) for parts_of_thing in things.values()]
    assert len(boxes) > 2
    for k, (low, high) in enumerate(boxes):
        assert low[1] == pytest.approx(0.75, abs=0.03)
        assert (np.abs((low + high)[[0, 2]] / 2) < [0.6, 0.3]).all()
        for other_low, other_high in boxes[:k]:
            # Their middles are apart; boxes of round things may overlap.
            middle = (low + high - other_low - other_high)[[0, 2]] / 2
            assert np.hypot(*middle) > 0.02


def test_nothing_is_laid_where_it_does_not_fit(stock):
    # Five centimetres of air.
    place = LevelPlace(0.2, -0.6, 0.6, -0.3, 0.3, 0.05)
    for k in range(6):
        parts = pieces.laid(np.random.default_rng(k), place, 4, stock)
        assert not parts or bounds(parts)[1][1] < 0.26


@pytest.mark.parametrize("family", finishes.ROUGHNESS)
def test_finishes_are_physical(stock, family):
    look = CatalogLook(family, (0.4, 0.3, 0.2), 0.5, "", False)
    rng = np.random.default_rng(1)
    for _ in range(20):
        material = finishes.finish(
            rng,
            type(look)(family, (0.4, 0.3, 0.2), 0.5, "", False),
            None,
            finishes.style(rng),
            stock,
        )
        assert all(0 < r <= 1 for r in material.roughness) and all(
            0 <= v <= 1 for v in material.metallic
        )
        assert all(0 < c <= 1 for colour in material.colours for c in colour)
        assert material.relief is None or 0 < material.relief.slope < 0.6


@pytest.mark.parametrize("make", [sculptures._weathered, sculptures._plate])
def test_sculptures_are_fine_meshes_with_unit_normals(stock, make):
    for k in range(4):
        solid = make(np.random.default_rng([2, k]), stock)
        assert np.isfinite(solid.vertices).all() and len(solid.faces) > 5000
        np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=-1), 1, atol=1e-5)


def test_a_sculpture_may_have_an_edge_of_three_faces():
    vertices = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    fan = trimesh.Trimesh(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert len(sculptures._subdivided(fan).faces) == 12


def test_hard_lamps_are_small_and_stand_on_the_side_of_the_camera():
    to_camera = np.array([0.0, 0.3, 1.0]) / np.hypot(1, 0.3)
    for k in range(6):
        light = studio_light.hard_lamps(np.random.default_rng(k), to_camera)
        # Less than three hundredths of the texels are bright, and the rest is dark.
        bright = light.mean(-1) > 0.5 * light.max() / 3
        assert 0 < bright.mean() < 0.03
        assert np.median(light) < 0.05 * light.max()


def test_what_is_kept_aside_is_never_trained_on(stock, monkeypatch):
    # Every other model, so that forty keys suffice.
    monkeypatch.setattr(stocks, "HELD_OUT_EVERY", 2)
    keys = tuple(f"made-{k:03d}" for k in range(40))
    train, held_out = (
        stocks.Stock(stock.listing, held_out=aside)._mine(keys) for aside in (False, True)
    )
    assert (
        set(train) | set(held_out) == set(keys)
        and not set(train) & set(held_out)
        and min(len(train), len(held_out)) > 5
    )


def test_options_need_the_models(tmp_path, monkeypatch):
    monkeypatch.setattr(packages, "FURNITURE", tmp_path)
    with pytest.raises(InputError, match="apt-get install"):
        _ = o.DataSetOptions().archives
    made = make_archive(tmp_path / "made.sh3f")
    assert o.DataSetOptions().archives == (made,)


def test_a_set_keeps_the_contract_and_the_credits(tmp_path, monkeypatch):
    monkeypatch.setattr(packages, "PHOTOGRAPHS", (tmp_path / "none",))
    make_archive(tmp_path / "made.sh3f")
    options = o.DataSetOptions(
        size=32, spp=1, seed=3, device="cpu", furniture=tmp_path, cache=tmp_path / "cache"
    )
    produce(tmp_path / "set", options, count=3)
    assert "Somebody" in (tmp_path / "set" / "ATTRIBUTION.txt").read_text()
    for k in range(3):
        with np.load(tmp_path / "set" / "samples" / f"{k:07d}.npz") as stored:
            mask = stored["mask"] > 0
            assert str(stored["kind"]) in o.KINDS
            assert ((stored["depth"] > 0) == mask).all()
            length = np.linalg.norm(stored["normal"].astype(float) / 127, axis=-1)
            np.testing.assert_allclose(length[mask], 1, atol=0.02)
            # The cosine between a normal and the ray that sees it is not above 0.
            rays = pixel_rays(Camera(32, 32, float(stored["fov"])))
            towards = (
                stored["normal"] / 127 * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
            ).sum(-1)
            assert towards.max() < 0.1, "normals face the viewer"
            assert (
                np.isfinite(stored["image"].astype(np.float32)).all() and stored["image"].max() > 0
            )
            again = sample.make_sample(k, options)
            assert np.array_equal(again["albedo"], stored["albedo"]) and np.array_equal(
                again["image"], stored["image"]
            )
