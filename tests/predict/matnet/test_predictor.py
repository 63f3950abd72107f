"""The predictor matnet: where weights come from, what is refused, and what it makes of the network's outputs."""

import hashlib
import pickle

import numpy as np
import pytest
import torch
from made_matnet import check_conventions, install, made_network, made_photo
from safetensors.torch import save_file

from materialist.errors import WeightsError
from materialist.predict import get_predictor
from materialist.predict.matnet.network import PATCH, MatNet
from materialist.predict.matnet.predictor import (
    MatNetPredictor,
    infer_matnet,
    network_size,
    planar_depth,
)
from materialist.predict.weights import write_weights


@pytest.fixture(autouse=True)
def tiny(monkeypatch, models):
    install(monkeypatch)


@pytest.fixture
def state():
    return {name: tensor.clone() for name, tensor in made_network().state_dict().items()}


def saved(path, content):
    torch.save(content, path)
    return path


def refused(path, *words):
    """The message of the WeightsError for a file; it names the file and the words."""
    with pytest.raises(WeightsError) as error:
        MatNetPredictor(path)
    message = str(error.value)
    assert all(word in message for word in (path.name, *words)), message
    return message


def test_prediction_is_the_networks_answer_in_our_conventions(tmp_path, state):
    photo = made_photo()
    predictor = MatNetPredictor(saved(tmp_path / "w.pth", state), input_size=28)
    prediction = predictor.predict(photo)
    raw = infer_matnet(made_network(), photo.linear, input_size=28)
    assert np.array_equal(prediction.materials.albedo, raw["albedo"].clip(0, 1))
    assert np.array_equal(prediction.materials.roughness, raw["roughness"].clip(0, 1))
    assert np.array_equal(prediction.materials.metallic, raw["metallic"].clip(0, 1))
    assert (
        np.allclose(prediction.depth, 2 * raw["depth"].max() - raw["depth"])
        and prediction.depth.min() > 0
    )
    check_conventions(prediction, photo.linear.shape[:2])
    known = np.linalg.norm(raw["normal"], axis=-1) > 0.1
    assert ((prediction.normal * raw["normal"]).sum(-1)[known] > 0).all()
    digest = hashlib.sha256((tmp_path / "w.pth").read_bytes()).hexdigest()[:16]
    assert prediction.predictor == f"matnet tiny w.pth sha256:{digest}"


def test_the_same_weights_in_every_packing(tmp_path, state):
    save_file(state, tmp_path / "w.safetensors")
    files = [
        tmp_path / "w.safetensors",
        saved(tmp_path / "plain.pth", state),
        saved(tmp_path / "wrapped.pt", {"model": state, "epoch": 3}),
        saved(tmp_path / "parallel.ckpt", {f"module.{k}": v for k, v in state.items()}),
        saved(tmp_path / "half.pth", {k: v.half() for k, v in state.items()}),
    ]
    maps = [
        MatNetPredictor(file, input_size=28).predict(made_photo()).materials.albedo
        for file in files
    ]
    for other in maps[1:4]:
        assert np.array_equal(other, maps[0])
    assert np.allclose(maps[4], maps[0], atol=2e-2)


def test_missing_extra_and_misshapen_tensors_are_named(tmp_path, state):
    bias = state.pop("pretrained.norm.bias")
    refused(saved(tmp_path / "less.pth", state), "Missing", "pretrained.norm.bias", "MatNet")
    state |= {"pretrained.norm.bias": bias, "head.extra": bias}
    refused(saved(tmp_path / "more.pth", state), "Unexpected", "head.extra")
    del state["head.extra"]
    state["depth_head.projects.0.weight"] = torch.zeros(8, 32, 3, 3)
    refused(saved(tmp_path / "odd.pth", state), "size mismatch for depth_head.projects.0.weight")
    refused(saved(tmp_path / "none.pth", {"a": bias}), "Missing", "Unexpected")


def test_what_is_no_checkpoint_is_refused(tmp_path, state):
    whole = saved(tmp_path / "w.pth", state).read_bytes()
    for name, content in {
        "cut.pth": whole[: len(whole) // 2],
        "noise.pth": bytes(range(256)) * 50,
        "page.pth": b"<!DOCTYPE html><html>not found</html>",
        "noise.safetensors": bytes(range(256)) * 50,
        "short.safetensors": b"\x10",
    }.items():
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, "maps:DIR")
    (tmp_path / "empty.pth").write_bytes(b"")
    refused(tmp_path / "empty.pth", "empty")
    refused(saved(tmp_path / "list.pth", [1, 2]), "more than named tensors")
    refused(saved(tmp_path / "words.pth", {"a": "b", **state}), "more than named tensors")
    save_file(state, tmp_path / "cut.safetensors")
    (tmp_path / "cut.safetensors").write_bytes((tmp_path / "cut.safetensors").read_bytes()[:-100])
    refused(tmp_path / "cut.safetensors", "truncated or damaged")


class Trap:
    """Runs a command when it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return (open, (str(self.mark), "w"))


def test_a_pickle_never_runs(tmp_path):
    mark = tmp_path / "ran"
    (tmp_path / "plain.pth").write_bytes(pickle.dumps({"a": Trap(mark)}, protocol=2))
    refused(tmp_path / "plain.pth", "run code")
    refused(saved(tmp_path / "zip.pth", {"a": Trap(mark)}), "run code")
    assert not mark.exists()


def test_the_checksum_beside_the_file_is_obeyed(tmp_path, state):
    path = saved(tmp_path / "w.pth", state)
    good = hashlib.sha256(path.read_bytes()).hexdigest()
    (tmp_path / "SHA256SUMS").write_text(f"{good}  w.pth\n")
    assert MatNetPredictor(path).name.endswith(good[:16])
    (tmp_path / "SHA256SUMS").write_text(f"{'0' * 64}  w.pth\n")
    refused(path, good, "0" * 64, "damaged")


def test_downloaded_models_are_found_by_name_and_by_id(tmp_path, state):
    for repo in ("Lez--MatNet", "someone--theirs"):
        folder = tmp_path / "models" / repo
        folder.mkdir(parents=True)
        path = saved(folder / "matnet_weights.pth", state)
        (folder / "SHA256SUMS").write_text(
            f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        )
    assert get_predictor("matnet").name == get_predictor("matnet:someone/theirs").name


def test_a_network_trained_here_answers_with_depth_itself(tmp_path, state):
    """SiLog makes the output depth; the published weights' output falls with distance, and is turned round."""
    photo = made_photo(42, 56)
    write_weights(tmp_path / "own.safetensors", state, {"format": MatNet.FORMAT})
    published = MatNetPredictor(saved(tmp_path / "plain.pth", state), device="cpu", input_size=28)
    output = infer_matnet(published.network, photo.linear, input_size=published.input_size)["depth"]
    assert np.ptp(output) > 0
    np.testing.assert_allclose(published.predict(photo).depth, planar_depth(output), rtol=1e-5)
    own = (
        MatNetPredictor(tmp_path / "own.safetensors", device="cpu", input_size=28)
        .predict(photo)
        .depth
    )
    np.testing.assert_allclose(own, np.maximum(output, 1e-3), rtol=1e-2, atol=1e-2 * output.max())


@pytest.mark.parametrize(
    ("height", "width", "wanted"),
    [
        (512, 512, (518, 518)),
        (384, 512, (518, 686)),
        (98, 126, (518, 672)),
        (1000, 300, (1722, 518)),
    ],
)
def test_network_size_keeps_the_aspect_and_the_shorter_side(height, width, wanted):
    found = network_size(height, width)
    assert found == wanted
    assert min(found) >= 518 and all(side % PATCH == 0 for side in found)
