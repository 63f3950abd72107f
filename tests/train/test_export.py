"""Weights that leave a run, and weights that a run begins from."""

from dataclasses import replace

import made_runs
import made_samples
import pytest
import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.clicks.network import ClickNet
from materialist.predict.network import UNetArchitecture
from materialist.predict.weights import sha256
from materialist.train import checkpoint
from materialist.train.export import export_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    place = tmp_path_factory.mktemp("runs")
    data = made_samples.write_set(place / "data", 2)
    made_runs.trainer(made_runs.bundled(data), place / "run", steps=3).fit()
    return place / "run"


def test_the_averaged_weights_are_exported_and_predict(run, tmp_path):
    file = tmp_path / "w.safetensors"
    facts = export_run(run, file)
    assert facts["megabytes"] < 1
    predictor = BundledPredictor(file)
    assert predictor.facts["step"] == facts["step"] == 3 and predictor.facts["data"]["seed"] == [5]
    state = checkpoint.load(run, "matnet")
    for name, tensor in predictor.network.state_dict().items():
        torch.testing.assert_close(tensor, state["averaged"][name], atol=2e-3, rtol=2e-3)
    moved = max(float((state["averaged"][n] - state["network"][n]).abs().max()) for n in state["network"])
    assert moved > 0, "an average is not the last step"


def test_the_mean_with_other_weights_is_exported(run, tmp_path):
    alone, other, mean = (tmp_path / f"{name}.safetensors" for name in ("alone", "other", "mean"))
    export_run(run, alone)
    network, facts = BundledNetwork.load(alone)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 0.5
    network.save(other, facts)
    export_run(run, mean, average_with=other)
    found, told = BundledNetwork.load(mean)
    assert told["averaged with"] == sha256(other)[:16] and "scores" not in told
    mixed = found.state_dict()
    for name, tensor in BundledNetwork.load(alone)[0].named_parameters():
        torch.testing.assert_close(mixed[name], tensor + 0.25, atol=4e-3, rtol=4e-3)


def test_exports_that_cannot_be(run, tmp_path):
    file, other = tmp_path / "w.safetensors", tmp_path / "other.safetensors"
    BundledNetwork(replace(made_runs.NETWORK, fine=16)).save(other, {})
    for place, task, said in ((tmp_path / "paper", {"name": "paper"}, "leave it out for the paper's"),):
        place.mkdir()
        checkpoint.save(place, {"kind": "matnet", "task": task})
        with pytest.raises(InputError, match=said):
            export_run(place, file, average_with=other)
    for kind in ("clicks", "refraction"):
        checkpoint.save(tmp_path, {"kind": kind})
        with pytest.raises(InputError, match=f"holds a run of `train {kind}`"):
            export_run(tmp_path, file)
    with pytest.raises(WeightsError, match=r"no weights at .*nowhere"):
        export_run(run, file, average_with=tmp_path / "nowhere.safetensors")
    with pytest.raises(WeightsError, match="differ in fine; give weights of the same"):
        export_run(run, file, average_with=other)
    with pytest.raises(InputError, match=r"not w\.bin"):
        export_run(run, tmp_path / "w.bin")
    assert not file.exists()
    with pytest.raises(OutputError, match="exists"):
        export_run(run, other)
    (tmp_path / "file").write_text("")
    for place in ("file", "nowhere"):
        with pytest.raises(OutputError, match="cannot be written"):
            export_run(run, tmp_path / place / "w.safetensors")


def test_a_run_begins_with_exported_weights(run, tmp_path):
    def begin(**changes):
        data = run.parent / "data"
        task = made_runs.bundled(data, architecture=replace(made_runs.NETWORK, **changes))
        task.init = run / checkpoint.WEIGHTS
        return task.network().state_dict()

    averaged = checkpoint.load(run, "matnet")["averaged"]
    for name, tensor in begin().items():
        torch.testing.assert_close(tensor, averaged[name], atol=2e-3, rtol=2e-3)
    with pytest.raises(WeightsError, match="is not a checkpoint of BundledNetwork"):
        begin(fine=16)


def test_the_encoder_is_not_stored_with_a_network(tmp_path):
    network = ClickNet(UNetArchitecture((8, 8, 8, 8, 8), (1, 1, 1, 1, 1), "lite2"))
    network.save(tmp_path / "w.safetensors", {"step": 1})
    assert (tmp_path / "w.safetensors").stat().st_size < 300_000
    found, facts = ClickNet.load(tmp_path / "w.safetensors")
    assert facts == {"step": 1}
    torch.testing.assert_close(found.encoder.stem.weight, network.encoder.stem.weight)
