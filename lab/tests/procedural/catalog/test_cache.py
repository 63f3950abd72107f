"""The catalogue as it is kept."""

import json

import numpy as np
import pytest
from made_catalog import grain, make_archive, make_photographs

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist_lab.procedural.catalog import packages
from materialist_lab.procedural.catalog.cache import CREDITS, LIST, as_roots, listing


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("catalog")
    return make_archive(folder / "made.sh3f"), make_photographs(folder)


@pytest.fixture(scope="module")
def kept(files, tmp_path_factory):
    archive, photographs = files
    return listing((archive,), photographs, tmp_path_factory.mktemp("cache"))


def test_models_by_role_and_why_others_are_left_out(kept):
    assert kept.models["table"] == ("made-001",) and kept.models["wall"] == ("made-006",)
    assert kept.models["small"] == ("made-003", "made-009")
    facts = json.loads((kept.folder / LIST).read_text())
    assert facts["left_out"] == {
        "made-007 Jar": "it is of glass",
        "made-008 Net": "its picture has holes",
    }
    assert [key for key, _ in kept.textures["wood"]] == ["made-001", "made-009"] and len(
        kept.textures
    ) == 1
    key, solid = kept.textures["wood"][0]
    assert kept.model(key).looks[solid].family == "wood"
    assert len(kept.photographs) == 2 and kept.photograph(kept.photographs[0]).shape == (
        300,
        400,
        3,
    )


def test_who_made_what_is_kept_beside_it(kept):
    text = (kept.folder / CREDITS).read_text()
    assert (
        "made-001: Table, by Somebody" in text
        and "creativecommons.org" in text
        and "Jar" not in text
    )


def test_a_model_comes_back(kept):
    model = kept.model("made-001")
    assert (
        model.entry.name == "Table"
        and model.role == "table"
        and model.places[-1].height == pytest.approx(0.75)
    )
    wood = [look.family for look in model.looks].index("wood")
    assert np.ptp(model.solids[wood].vertices[:, 0]) == pytest.approx(1.2)
    picture = model.pictures[wood]
    linear = (picture.pixels / 255.0) ** 2
    np.testing.assert_allclose(linear, srgb_to_linear(grain()), atol=0.15)
    assert linear[4, -1, 0] > linear[4, 0, 0] + 0.2 and linear[-1, 8, 1] > linear[0, 8, 1] + 0.1
    assert all(p is None for k, p in enumerate(model.pictures) if k != wood)


def test_it_is_built_once_and_again_for_another_catalogue(kept, files, tmp_path):
    archive, photographs = files
    stamp = (kept.folder / "made-001.npz").stat().st_mtime_ns
    assert listing((archive,), photographs, kept.folder).models == kept.models
    assert (kept.folder / "made-001.npz").stat().st_mtime_ns == stamp
    assert listing((archive,), (), kept.folder).photographs == ()
    assert (kept.folder / "made-001.npz").stat().st_mtime_ns != stamp


def test_a_damaged_model_is_named(files, tmp_path):
    again = listing((files[0],), (), tmp_path)
    (tmp_path / "made-003.npz").write_bytes(b"half")
    with pytest.raises(InputError, match="made-003"):
        again.model("made-003")


def test_roots_are_real_albedos():
    linear = (as_roots(np.array([[[0, 128, 255]]], np.uint8)) / 255.0) ** 2
    np.testing.assert_allclose(linear[0, 0], [0.012, 0.22, 0.85], atol=0.01)


def test_of_one_wallpaper_in_many_sizes_the_largest_is_taken(tmp_path, monkeypatch):
    images = tmp_path / "Lake" / "contents" / "images"
    images.mkdir(parents=True)
    (images / "640x480.jpg").write_bytes(b"0" * 70_000)
    (images / "1920x1080.jpg").write_bytes(b"0" * 90_000)
    (tmp_path / "icon.png").write_bytes(b"0" * 900)
    monkeypatch.setattr(packages, "PHOTOGRAPHS", (tmp_path,))
    assert [path.name for path in packages.photographs()] == ["1920x1080.jpg"]
