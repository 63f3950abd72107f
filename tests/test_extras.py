"""Packages that are not installed: one sentence names the command that installs them, and nothing is written."""

import sys

import numpy as np
import pytest
from edit_scenes import flat_scene
from PIL import Image

import materialist as mt
from materialist.edits import recipe
from materialist.edits.remove.background import inpainter
from materialist.edits.remove.filling import filled
from materialist.exporters import run
from materialist.io.photo import read_photo
from materialist.io.video import write_frames
from materialist.predict import get_predictor
from materialist.predict.onnx import session
from materialist.render.denoise import denoise

IMAGE = np.ones((4, 6, 3), np.float32)
FLAT = np.ones((4, 6), bool)


@pytest.mark.parametrize(
    ("package", "ask", "words"),
    [
        ("rawpy", lambda folder: read_photo(folder / "a.CR2"), "pip install 'rawpy"),
        (
            "imageio_ffmpeg",
            lambda folder: write_frames(folder / "a.mp4", iter([])),
            "pip install 'imageio-ffmpeg",
        ),
        ("pyoidn", lambda _: denoise(IMAGE, albedo=IMAGE, normal=IMAGE), "-m pip install pyoidn"),
        (
            "onnxruntime",
            lambda _: filled(IMAGE, FLAT, ~FLAT),
            "pip install onnxruntime",
        ),
        ("pxr", lambda folder: mt.export(flat_scene(), folder / "a.usdz"), "pip install 'usd-core"),
        (
            "diffusers",
            lambda _: get_predictor("constant", normal="marigold"),
            "needs diffusers.* install 'diffusers",
        ),
        ("diffusers", lambda _: get_predictor("marigold:a/b"), "needs diffusers"),
        ("transformers", lambda _: get_predictor("constant", depth="depth-anything"), "needs tran"),
        ("diffusers", lambda _: inpainter("sd"), "needs diffusers.* leave `inpaint"),
    ],
)
@pytest.mark.usefixtures("models")  # no weights: the library is asked for before them
def test_the_command_is_named(package, ask, words, tmp_path, monkeypatch):
    (tmp_path / "a.CR2").write_bytes(b"II*\0" * 20)
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, "materialist.exporters.usd", raising=False)
    session.cache_clear()
    with pytest.raises(mt.SetupError, match=words):
        ask(tmp_path)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("library", ["mujoco", "coacd"])
def test_a_list_of_edits_asks_for_physics_before_its_first_step(library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.setattr(recipe, "_applied", lambda *_: pytest.fail("the work comes first"))
    (tmp_path / "edits.yaml").write_text(
        "- relight: {rotate: 45}\n- drop: {mesh: a.ply, at: [8, 30]}\n"
    )
    words = "need two more packages; install them with: .* install 'coacd"
    with pytest.raises(mt.SetupError, match=words):
        recipe.apply(flat_scene(), recipe.read_recipe(tmp_path / "edits.yaml"))
    Image.fromarray(np.zeros((16, 16), np.uint8)).save(tmp_path / "photo.png")
    with pytest.raises(mt.SetupError, match=words):
        mt.batch(tmp_path / "photo.png", tmp_path / "runs", apply=tmp_path / "edits.yaml")
    assert not (tmp_path / "runs").exists()


def test_usd_asks_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.delitem(sys.modules, "materialist.exporters.usd", raising=False)
    monkeypatch.setattr(run, "with_residual", lambda scene: pytest.fail("the work comes first"))
    with pytest.raises(mt.SetupError, match="pip install 'usd-core"):
        mt.export(flat_scene(), tmp_path / "a.usdz")


def test_the_studio_asks_before_it_makes_a_folder(refused, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert "install 'pydantic" in refused("studio", "--work", tmp_path / "work")
    assert not (tmp_path / "work").exists()


def test_a_film_of_falling_things_asks_for_all_its_packages_at_once(refused, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    drop = ("drop", tmp_path / "no.scene", "a.ply", "--at", "1,2", "-o")
    words = refused(*drop, tmp_path / "a.mp4")
    assert "mujoco" in words and "coacd" in words and "imageio-ffmpeg" in words
    words = refused(*drop, tmp_path / "frames")  # a folder of PNG needs no encoder
    assert "mujoco" in words and "imageio" not in words
