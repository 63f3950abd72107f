"""The folder that `moge infer --maps` writes."""

import json

import cv2
import numpy as np
import pytest
from made_matnet import made_photo

from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.predict import get_predictor
from materialist.predict.moge import MogeFolder
from materialist.predict.normals import normals_from_depth

H, W = 20, 32


def write(folder, *, normal=True, mask=True, fov=True):
    """MoGe's own layout; returns depth [H, W], normals [H, W, 3] in our frame, and the mask [H, W]."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(2)
    depth = (2 + rng.random((H, W))).astype(np.float32)
    normals = rng.normal(size=(H, W, 3)) * [0.5, 0.5, 0.1] + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    seen = np.ones((H, W), bool)
    seen[:4, 10:] = False
    write_exr(folder / "depth.exr", np.where(seen, depth, np.inf).astype(np.float32))
    if normal:  # MoGe: +Y down, +Z into the picture; colour = n * (0.5, -0.5, -0.5) + 0.5
        theirs = np.where(seen[..., None], normals * [1, -1, -1], 0)
        colour = ((theirs * [0.5, -0.5, -0.5] + 0.5).clip(0, 1) * 255).astype(np.uint8)
        cv2.imwrite(str(folder / "normal.png"), cv2.cvtColor(colour, cv2.COLOR_RGB2BGR))
    if mask:
        cv2.imwrite(str(folder / "mask.png"), (seen * 255).astype(np.uint8))
    if fov:
        (folder / "fov.json").write_text(json.dumps({"fov_x": 61.23, "fov_y": 40.0}))
    return depth, normals, seen


def test_depth_normals_and_field_of_view_are_read(tmp_path):
    depth, normals, seen = write(tmp_path)
    source = MogeFolder(tmp_path)
    part = source.parts(made_photo(H, W), ("depth", "normal"))
    assert source.field_of_view == 61.23
    assert np.array_equal(part.maps["depth"], np.where(seen, depth, 0))
    assert (part.maps["normal"] * normals).sum(-1)[seen].min() > 0.999
    assert np.allclose(np.linalg.norm(part.maps["normal"], axis=-1), 1, atol=1e-5)
    assert part.sources == {"depth": f"moge:{tmp_path}", "normal": f"moge:{tmp_path}"}


def test_infinite_depth_is_no_surface_without_a_mask(tmp_path):
    _, _, seen = write(tmp_path, mask=False)
    assert np.array_equal(MogeFolder(tmp_path).parts(made_photo(H, W), ("depth",)).maps["depth"] > 0, seen)


def test_the_first_version_has_no_normals(tmp_path):
    write(tmp_path, normal=False, fov=False)
    source, photo = MogeFolder(tmp_path), made_photo(H, W)
    part = source.parts(photo, ("normal",))
    depth = source.parts(photo, ("depth",)).maps["depth"]
    assert source.field_of_view is None
    assert np.array_equal(part.maps["normal"], normals_from_depth(depth, photo.camera, radius=2))
    assert part.sources["normal"].startswith("derived from the depth")


def test_another_size_is_resampled_and_another_aspect_refused(tmp_path):
    write(tmp_path)
    part = MogeFolder(tmp_path).parts(made_photo(H // 2, W // 2), ("depth", "normal"))
    assert part.maps["depth"].shape == (10, 16) and part.maps["normal"].shape == (10, 16, 3)
    with pytest.raises(InputError, match="aspect ratio"):
        MogeFolder(tmp_path).parts(made_photo(20, 20), ("depth",))


def test_the_outer_folder_is_enough_when_it_holds_one_result(tmp_path):
    write(tmp_path / "kitchen")
    assert MogeFolder(tmp_path).folder == tmp_path / "kitchen"
    write(tmp_path / "garden")
    with pytest.raises(InputError, match="garden, kitchen"):
        MogeFolder(tmp_path)


def test_what_is_no_result_is_refused(tmp_path):
    for spec, word in (
        (f"moge:{tmp_path / 'none'}", "no folder"),
        (f"moge:{tmp_path}", "no depth.exr"),
        ("moge:", "needs"),
    ):
        with pytest.raises(InputError, match=word):
            get_predictor("constant", depth=spec)
    write(tmp_path)
    with pytest.raises(InputError, match=r"gives only normal, depth.*--depth moge:"):
        get_predictor(f"moge:{tmp_path}")
    for content in ("{}", '{"fov_x": "wide"}', "[]", "no json", '{"fov_x": 200}'):
        (tmp_path / "fov.json").write_text(content)
        with pytest.raises(InputError, match="fov"):
            MogeFolder(tmp_path)
    (tmp_path / "fov.json").unlink()
    (tmp_path / "mask.png").write_bytes(b"no png")
    with pytest.raises(InputError, match=r"mask\.png"):
        MogeFolder(tmp_path).parts(made_photo(H, W), ("depth",))
    cv2.imwrite(str(tmp_path / "mask.png"), np.zeros((H, W), np.uint8))
    with pytest.raises(InputError, match="no surface"):
        MogeFolder(tmp_path).parts(made_photo(H, W), ("depth",))
