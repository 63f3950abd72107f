"""The encoder that the networks share: its blocks, how a classifier becomes it, and the one in the package."""

import pytest
import torch
from torch.nn import functional as F

from materialist.errors import InputError, WeightsError
from materialist.predict import lite
from materialist.predict.lite import LiteEncoder, convert, level, read_classifier, shipped
from materialist.predict.weights import load_weights, read_state

STRIDES = (4, 8, 16, 32)
FIGURES = (
    (24, -1.2621, 8.2813, 9.2987, 8.4701, -5.9386),
    (48, -0.5538, 7.8424, 9.9643, -6.1738, 6.2877),
    (120, -0.2624, 4.4237, 8.6887, -10.2042, -2.9417),
    (352, 0.0155, 1.9152, 0.4106, 0.0495, -0.7167),
)
"""Channels, mean, spread and three values that efficientnet_lite_pytorch 0.1.0 has for `picture`, in float32."""


def picture():
    """Two ramps and a ripple, 260 x 260: the size for which that package pads."""
    rows, columns = torch.meshgrid(torch.linspace(0, 1, 260), torch.linspace(0, 1, 260), indexing="ij")
    return torch.stack([rows, columns, (6 * rows * columns).sin() * 0.5 + 0.5])[None]


def classifier(encoder, seed=0):
    """A checkpoint with random weights and statistics, by the names of efficientnet_lite_pytorch."""
    generator = torch.Generator().manual_seed(seed)
    state = {}

    def layer(module, conv, norm):
        state[f"{conv}.weight"] = (
            torch.randn(module.weight.shape, generator=generator) / module.weight[0].numel() ** 0.5
        )
        for name in ("weight", "running_var"):
            state[f"{norm}.{name}"] = torch.rand(len(module.weight), generator=generator) + 0.5
        for name in ("bias", "running_mean"):
            state[f"{norm}.{name}"] = torch.randn(len(module.weight), generator=generator) * 0.1

    layer(encoder.stem, "_conv_stem", "_bn0")
    for k, block in enumerate(encoder.blocks):
        if block.expand is not None:
            layer(block.expand, f"_blocks.{k}._expand_conv", f"_blocks.{k}._bn0")
        layer(block.depthwise, f"_blocks.{k}._depthwise_conv", f"_blocks.{k}._bn1")
        layer(block.project, f"_blocks.{k}._project_conv", f"_blocks.{k}._bn2")
    return state


def slow_features(state, encoder, x):
    """The same, with the normalisation where the classifier has it."""

    def layer(x, conv, norm, stride=1, groups=1, act=True):
        weight = state[f"{conv}.weight"]
        kernel = weight.shape[-1]
        for axis in (-1, -2):
            missing = max((-(-x.shape[axis] // stride) - 1) * stride + kernel - x.shape[axis], 0)
            pair = (missing // 2, missing - missing // 2)
            x = F.pad(x, pair if axis == -1 else (0, 0, *pair))
        x = F.conv2d(x, weight, stride=stride, groups=groups)
        x = F.batch_norm(x, state[f"{norm}.running_mean"], state[f"{norm}.running_var"], state[f"{norm}.weight"],
                         state[f"{norm}.bias"], eps=1e-3)  # fmt: skip
        return x.clamp(0, 6) if act else x

    x, found = layer((x * 255 - 127) / 128, "_conv_stem", "_bn0", stride=2), []
    for k, block in enumerate(encoder.blocks):
        name, y = f"_blocks.{k}.", x
        if block.expand is not None:
            y = layer(y, name + "_expand_conv", name + "_bn0")
        y = layer(y, name + "_depthwise_conv", name + "_bn1", block.depthwise.stride[0], block.depthwise.groups)
        y = layer(y, name + "_project_conv", name + "_bn2", act=False)
        x = x + y if block.residual else y
        found.append(x)
    return [found[k] for k in encoder.told]


@pytest.mark.parametrize("size", ["lite0", "lite2"])
@pytest.mark.parametrize("shape", [(64, 96), (65, 47)])
def test_a_classifier_becomes_an_encoder_with_the_same_features(tmp_path, size, shape):
    encoder = LiteEncoder(size).eval()
    state = classifier(encoder)
    torch.save(state, tmp_path / "c.pth")
    read_classifier(encoder, tmp_path / "c.pth")
    x = torch.rand(2, 3, *shape, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        found, expected = encoder(x), slow_features(state, encoder, x)
    for k in range(4):
        assert found[k].shape[1] == encoder.channels[k]
        assert (found[k] - expected[k]).abs().max() < 1e-4 * expected[k].abs().max()


def test_the_package_has_the_classifier_it_names():
    """Against the reference implementation with the same checkpoint; the package stores float16."""
    encoder = shipped("lite2")
    with torch.no_grad():
        found = encoder(picture())
    for one, (channels, mean, spread, *values) in zip(found, FIGURES, strict=True):
        assert one.shape[1] == channels
        assert one.mean().item() == pytest.approx(mean, abs=0.01)
        assert one.std().item() == pytest.approx(spread, rel=4e-3)
        places = [one[0, 0, 0, 0], one[0, -1, -1, -1], one[0, 7, 1, 1]]
        assert [v.item() for v in places] == pytest.approx(values, abs=0.03 * spread)


def test_features_lie_where_the_networks_add_them():
    encoder = shipped("lite2")
    with torch.no_grad():
        found = encoder(torch.rand(1, 3, 64, 96))
    for one, stride in zip(found, STRIDES, strict=True):
        assert one.shape[-2:] == (64 // stride, 96 // stride)
    assert not encoder.training and not any(p.requires_grad for p in encoder.parameters())


def test_a_copy_is_ones_own():
    one = shipped("lite2")
    with torch.no_grad():
        one.stem.weight.zero_()
    assert shipped("lite2").stem.weight.abs().max() > 0


def test_levels_are_even():
    x = torch.randn(2, 5, 4, 4) * torch.tensor([0.01, 30.0]).view(2, 1, 1, 1)
    torch.testing.assert_close(level(x).square().mean((1, 2, 3)), torch.ones(2), atol=0.02, rtol=0)


def test_convert_writes_what_the_package_reads(tmp_path):
    encoder = LiteEncoder("lite0").eval()
    torch.save(classifier(encoder), tmp_path / "c.pth")
    convert(tmp_path / "c.pth", "lite0", tmp_path / "lite0.safetensors")
    read_classifier(encoder, tmp_path / "c.pth")
    again = LiteEncoder("lite0").eval()
    load_weights(again, read_state(tmp_path / "lite0.safetensors"), tmp_path / "lite0.safetensors")
    for name, tensor in encoder.state_dict().items():
        torch.testing.assert_close(again.state_dict()[name], tensor, atol=1e-3, rtol=1e-3)


def test_bad_files_and_names(tmp_path):
    with pytest.raises(InputError, match=r"no encoder 'huge'.*lite2"):
        LiteEncoder("huge")
    torch.save({"a": torch.zeros(2)}, tmp_path / "odd.pth")
    with pytest.raises(WeightsError, match="no EfficientNet-lite0 checkpoint"):
        read_classifier(LiteEncoder("lite0"), tmp_path / "odd.pth")
    other = LiteEncoder("lite2")
    torch.save(classifier(other), tmp_path / "other.pth")
    with pytest.raises(WeightsError):
        read_classifier(LiteEncoder("lite0"), tmp_path / "other.pth")


def test_variants_have_the_published_widths():
    assert LiteEncoder("lite0").channels == (24, 40, 112, 320)
    assert LiteEncoder("lite2").channels == (24, 48, 120, 352)
    assert [len(LiteEncoder(size).blocks) for size in lite.SIZES] == [16, 21, 21]
