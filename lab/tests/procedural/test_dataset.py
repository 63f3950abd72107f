"""The data set on disk: contract, determinism, stops and refusals."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_catalog import make_archive, make_photographs

from materialist.errors import InputError
from materialist_lab.procedural.catalog import packages
from materialist_lab.procedural.dataset import identity, produce, sample_path
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.options import HELD_OUT, DataSetOptions
from materialist_lab.procedural.sample import make_sample

SIZE = 32
CONTRACT = {
    "image": (np.float16, 3),
    "shading": (np.float16, 3),
    "albedo": (np.uint8, 3),
    "roughness": (np.uint8, 0),
    "metallic": (np.uint8, 0),
    "normal": (np.int8, 3),
    "depth": (np.float16, 0),
    "mask": (np.uint8, 0),
    "thing": (np.int16, 0),
}


@pytest.fixture(scope="module")
def catalog(tmp_path_factory):
    """Options that name a tiny catalogue; its photographs are the only ones."""
    folder = tmp_path_factory.mktemp("catalog")
    make_archive(folder / "made.sh3f")
    (folder / "photographs").mkdir()
    make_photographs(folder / "photographs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packages, "PHOTOGRAPHS", (folder / "photographs",))
        yield {"furniture": folder, "cache": folder / "cache"}


@pytest.fixture(scope="module")
def options(catalog):
    return DataSetOptions(size=SIZE, seed=11, spp=4, device="cpu", only="single", **catalog)


@pytest.fixture(scope="module")
def data_set(tmp_path_factory, options):
    folder = tmp_path_factory.mktemp("set") / "data"
    assert produce(folder, options, count=4) == 4
    return folder


def arrays(folder, index):
    with np.load(sample_path(folder, index)) as file:
        return dict(file)


def test_every_sample_keeps_the_contract(data_set):
    samples = [arrays(data_set, k) for k in range(4)]
    # A picture out of focus has no shading that goes with its sharp maps.
    assert any("shading" in sample for sample in samples)
    for sample in samples:
        assert CONTRACT.keys() - sample.keys() <= {"shading"}
        for name, (kind, channels) in CONTRACT.items():
            if name not in sample:
                continue
            assert sample[name].dtype == kind, name
            assert sample[name].shape == (SIZE, SIZE, *([channels] if channels else [])), name
        mask = sample["mask"] > 0
        assert set(np.unique(sample["mask"])) <= {0, 1}
        assert 9 <= float(sample["fov"]) <= 50
        assert np.isfinite(sample["image"].astype(np.float32)).all()
        assert (sample["image"] >= 0).all()
        assert ((sample["depth"] > 0) == mask).all()
        length = np.linalg.norm(sample["normal"].astype(float) / 127, axis=-1)
        np.testing.assert_allclose(length[mask], 1, atol=0.02)
        assert not sample["normal"][~mask].any()


def test_a_sample_depends_on_seed_and_number_alone(data_set, options, tmp_path):
    again = make_sample(3, options)
    stored = arrays(data_set, 3)
    for name in stored.keys() & CONTRACT.keys():
        assert np.array_equal(again[name], stored[name]), name
    assert CONTRACT.keys() - again.keys() == CONTRACT.keys() - stored.keys()
    other = make_sample(3, replace(options, seed=12))
    assert not np.array_equal(other["albedo"], stored["albedo"])


def test_resume_makes_what_is_missing_and_nothing_else(data_set, options):
    # One sample is missing, and a run that was killed left half of another.
    gone = sample_path(data_set, 2)
    kept = sample_path(data_set, 3)
    before = arrays(data_set, 2)
    stamp = kept.stat().st_mtime_ns
    gone.unlink()
    (data_set / "samples" / ".0000003.npz.0.partial-99-0.npz").write_bytes(b"half a sample")
    assert produce(data_set, options, count=4, resume=True) == 1
    assert all(np.array_equal(v, arrays(data_set, 2)[k]) for k, v in before.items())
    assert kept.stat().st_mtime_ns == stamp
    assert not list((data_set / "samples").glob(".*"))


def test_other_sets_are_not_gone_on_with(data_set, options, tmp_path):
    with pytest.raises(InputError, match="--resume"):
        produce(data_set, options, count=4)
    with pytest.raises(InputError, match="seed 11, not 12"):
        produce(data_set, replace(options, seed=12), count=4, resume=True)
    # A set of an earlier version of the program.
    (tmp_path / "set").mkdir()
    facts = identity(data_set)
    assert (facts["format"], facts["size"], facts["seed"], facts["options"]["spp"]) == (
        1,
        SIZE,
        11,
        4,
    )
    (tmp_path / "set" / "dataset.json").write_text(
        json.dumps({**facts, "content": facts["content"] - 1})
    )
    with pytest.raises(InputError, match="begun with content"):
        produce(tmp_path / "set", options, count=2, resume=True)
    with pytest.raises(InputError, match=r"dataset\.json"):
        identity(data_set / "samples")


def test_no_held_out_scene_is_one_of_the_training_set_with_its_seed(options):
    train = make_sample(3, options)
    aside = make_sample(3, replace(options, split="heldout"))
    assert train["fov"] != aside["fov"] and not np.array_equal(train["thing"], aside["thing"])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"size": 30}, "30"),
        ({"size": 33}, "33"),
        ({"spp": 0}, "spp is 0"),
        ({"seed": -1}, "-1"),
        ({"split": "dev"}, "'dev'"),
        ({"only": "castle"}, "'castle'.*outside"),
        ({"meshes": Path("/nowhere")}, "/nowhere"),
    ],
)
def test_options_that_cannot_be(wrong, said):
    with pytest.raises(InputError, match=said):
        DataSetOptions(**wrong)


CORNERS = "0 0 0\n1 0 0\n0 1 0\n"
HEADER = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"


@pytest.mark.parametrize(
    "text",
    [
        "no mesh",
        HEADER + FACES + "0 0 0\n",
        HEADER + FACES + CORNERS + "3 0 1 9\n",
        HEADER + FACES + 3 * "0 0 0\n" + "3 0 1 2\n",
    ],
    ids=["text", "cut off", "corner that is not there", "point"],
)
def test_a_damaged_mesh_is_named_before_anything_is_made(tmp_path, text):
    (tmp_path / "meshes").mkdir()
    # A whole mesh is read, so that the refusal is about the other one.
    (tmp_path / "meshes" / "chair.ply").write_text(HEADER + FACES + CORNERS + "3 0 1 2\n")
    assert len(shapes.load(tmp_path / "meshes" / "chair.ply").faces) == 1
    (tmp_path / "meshes" / "vase.ply").write_text(text)
    options = DataSetOptions(size=SIZE, device="cpu", meshes=tmp_path / "meshes")
    with pytest.raises(InputError, match=r"vase\.ply .*; mend it"):
        produce(tmp_path / "set", options, count=1)
    assert not (tmp_path / "set").exists()


def test_the_splits_share_no_file(tmp_path):
    for name in (*sorted(HELD_OUT), "teapot", "vase"):
        (tmp_path / f"{name}.ply").touch()
    train, aside = (
        DataSetOptions(meshes=tmp_path, split=split).mesh_files for split in ("train", "heldout")
    )
    assert [p.stem for p in train] == ["teapot", "vase"]
    assert {p.stem for p in aside} == HELD_OUT


@pytest.mark.slow
def test_a_killed_run_leaves_whole_samples_only(tmp_path, catalog):
    command = [
        sys.executable,
        "-m",
        "materialist",
        "train",
        "data",
        "-o",
        str(tmp_path / "d"),
        "--count",
        "500",
        "--size",
        "32",
        "--spp",
        "4",
        "--seed",
        "11",
        "--device",
        "cpu",
        "--furniture",
        catalog["furniture"],
        "--cache",
        catalog["cache"],
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    # Killed once there are two samples, without a chance to clean up.
    deadline = time.monotonic() + 120
    while (
        len(list((tmp_path / "d" / "samples").glob("[0-9]*.npz"))) < 2
        and time.monotonic() < deadline
    ):
        assert process.poll() is None
        time.sleep(0.1)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    files = sorted((tmp_path / "d" / "samples").glob("[0-9]*.npz"))
    assert len(files) >= 2
    for file in files:
        with np.load(file) as sample:
            assert set(CONTRACT) <= set(sample.files)
            assert sample["image"].shape == (SIZE, SIZE, 3)


def test_the_command_makes_resumes_and_draws(done, refused, tmp_path, catalog):
    folder = tmp_path / "set"
    sheet = tmp_path / "sheet.png"
    make = (
        "train",
        "data",
        "-o",
        folder,
        "--size",
        32,
        "--spp",
        1,
        "--seed",
        5,
        "--device",
        "cpu",
        "--furniture",
        catalog["furniture"],
        "--cache",
        catalog["cache"],
        "--count",
    )
    # The second call makes the one sample that is missing.
    for count, resume in ((1, ()), (2, ("--resume",))):
        report = done(*make, count, *resume)
        assert (report["rendered"], report["existing"]) == (1, count - 1)
    draw = ("train", "data", "-o", folder, "--sheet", sheet)
    done(*draw)
    drawn = sheet.read_bytes()
    assert "--force" in refused(*draw) and sheet.read_bytes() == drawn
    done(*draw, "--force")
    os.truncate(sample_path(folder, 1), 900)
    assert "0000001.npz cannot be read" in refused(*draw, "--force")
