"""Files of weights whose large tensors are stored as int8."""

import pytest
import torch
from safetensors.torch import save_file

from materialist.errors import WeightsError
from materialist.predict.weights import metadata, read_state, write_weights


def test_int8_levels_come_with_their_scales(tmp_path):
    values = torch.tensor([[0.5, -1.0, 0.25], [100.0, 3.0, -127.0]])
    scale = values.abs().amax(1) / 127
    levels = (values / scale[:, None]).round().to(torch.int8)
    path = tmp_path / "levels.safetensors"
    save_file({"a.weight": levels, "a.weight.scale": scale, "a.bias": torch.ones(2)}, path)
    state = read_state(path)
    assert set(state) == {"a.weight", "a.bias"}
    # Half a level is the most that rounding may take away.
    assert (state["a.weight"] - values).abs().amax(1).le(scale / 2 + 1e-6).all()


@pytest.mark.parametrize("scales", [1, 3])
def test_scales_of_another_length_are_damage(tmp_path, scales):
    path = tmp_path / "levels.safetensors"
    levels = torch.ones(2, 3, dtype=torch.int8)
    save_file({"a.weight": levels, "a.weight.scale": torch.ones(scales)}, path)
    with pytest.raises(WeightsError, match=rf"levels.safetensors is damaged: .*{scales} scales"):
        read_state(path)


def test_written_weights_are_as_open_to_others_as_any_file(tmp_path):
    plain = tmp_path / "plain.txt"
    plain.touch()
    path = tmp_path / "own.safetensors"
    write_weights(path, {"a": torch.tensor([0.5, -2.0])}, {"format": "one"})
    assert path.stat().st_mode == plain.stat().st_mode
    assert read_state(path)["a"].tolist() == [0.5, -2.0]
    assert metadata(path) == {"format": "one"}
