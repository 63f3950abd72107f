"""`bench edit`: its truths are those of its edits, and its rows are what they say."""

from dataclasses import replace

import numpy as np
import pytest

from materialist import metrics
from materialist.camera import project
from materialist_lab.bench.edits import KINDS, MIN_SHIFT, SHIFTS, edits, true_scene
from materialist_lab.procedural.synthetic import make_sample


@pytest.fixture(scope="module")
def cases(mitsuba):
    sample = make_sample(0, 0, 0, size=40, spp=64)
    return sample, {edit.kind: edit for edit in edits(sample, sample.envmap[:, ::-1], KINDS)}


@pytest.mark.slow
def test_the_truth_of_an_edit_differs_in_its_object_alone(cases):
    sample, edits = cases
    before = sample.scene.render(sample.envmap, spp=64, seed=3)
    for kind in ("hue", "metal", "glass", "remove"):
        edit = edits[kind]
        after = edit.truth.render(edit.envmap, spp=64, seed=3)
        inside = edit.region(before, after)
        change = np.abs(after - before)
        np.testing.assert_array_equal(inside, edit.mask)
        assert change[inside].mean() > 3 * change[~inside].mean()
        if kind in ("hue", "metal"):
            # Inside the change is at least four times as large in squared error.
            assert metrics.psnr(before, after, mask=inside) + 6 < metrics.psnr(
                before, after, mask=~inside
            )


def test_the_true_cup_stands_where_the_scene_has_it(cases):
    sample, edits = cases
    edit = edits["insert"]
    scene = true_scene(sample)
    (body,) = edit.change(scene).bodies
    # The mask lies within the box of the projected vertices, to a pixel.
    place, _ = project(body.vertices.astype(np.float64), scene.camera)
    rows, columns = np.nonzero(edit.mask)
    assert columns.min() >= np.floor(place[:, 0].min()) and columns.max() <= np.ceil(
        place[:, 0].max()
    )
    assert rows.min() >= np.floor(place[:, 1].min()) - 1 and rows.max() <= np.ceil(
        place[:, 1].max()
    )
    assert edit.mask.sum() > 20


def test_a_material_edit_of_the_scene_is_the_true_one(cases):
    """The maps of the edit are the true ones after it; the paper's "high" and "low" move one value that has room."""
    sample, edits = cases
    scene = true_scene(sample)
    assert {"roughness+", "roughness-", "metallic+"} <= set(edits)
    for kind in {"metal", *SHIFTS} & set(edits):
        inside = edits[kind].mask
        truth = edits[kind].truth.truth.materials
        edited = edits[kind].change(scene).materials
        for name in ("albedo", "roughness", "metallic"):
            np.testing.assert_allclose(
                getattr(edited, name)[inside], getattr(truth, name)[inside], atol=1e-5
            )
        np.testing.assert_array_equal(edited.albedo[~inside], scene.materials.albedo[~inside])
        if kind in SHIFTS:
            name, by = SHIFTS[kind]
            # A shift moves as far as it can within [0, 1], and always visibly.
            moved = getattr(truth, name)[inside] - getattr(sample.truth.materials, name)[inside]
            assert (moved * np.sign(by) >= MIN_SHIFT - 1e-6).all() and (
                np.abs(moved) <= abs(by) + 1e-6
            ).all()


def test_a_cup_of_glass_is_where_the_blue_one_is(cases):
    sample, edits = cases
    blue = edits["insert"]
    clear = edits["glass cup"]
    assert (blue.mask & clear.mask).sum() > 0.9 * (blue.mask | clear.mask).sum()
    # Both are the same glass.
    (body,) = clear.change(true_scene(sample)).bodies
    assert body.surface.ior == clear.truth.items[-1].ior == 1.5


FINALS = ("material", "light", "insertion", "removal", "glass")


@pytest.fixture
def fitted(mitsuba, monkeypatch):
    """Inversions find the truth."""
    from materialist import pipeline

    sample = make_sample(0, 0, 0, size=32)
    monkeypatch.setattr(
        pipeline, "invert", lambda photo, **_: replace(true_scene(sample), photo=photo)
    )


@pytest.mark.slow
def test_a_run_writes_rows_with_their_ceilings(measured, fitted):
    report = measured(
        "edit", device="cpu", scenes=1, size=32, spp=8, truth_spp=16, kinds="hue", latency=0
    )
    rows = report.rows
    assert [row["method"] for row in rows] == [
        "hue: untouched",
        "ceiling hue",
        "ceiling hue, composite",
        "hue: edit",
    ]
    scored = [row["inside"] for row in rows]
    assert scored[0] < min(scored[1:]) and scored[3] == pytest.approx(
        scored[2]
    )  # a fit without error
    assert (report.folder / "sheet.png").stat().st_size > 1000


@pytest.mark.slow
def test_what_people_wait_for_is_timed(measured, fitted):
    rows = measured("edit", device="cpu", scenes=0, latency=32, large=300, frames=2).rows
    waited = [
        "preview: built once",
        "preview: material",
        "preview: light",
        *(f"final: {name}" for name in FINALS),
    ]
    waited += ["drop: 2 frames", "final: into a large photo"]
    assert list(dict.fromkeys(row["method"] for row in rows)) == waited
    assert (
        all(min(row["seconds"], row["cpu_seconds"]) > 0 for row in rows)
        and rows[-1]["sample"] == "300 x 300"
    )
