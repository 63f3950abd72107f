"""The network: shapes, ranges, and its fast parts against slow twins."""

import numpy as np
import pytest
import torch
from made_matnet import TINY, made_network, made_photo

from materialist.predict.matnet.encoder import PATCH
from materialist.predict.matnet.inference import infer, network_size, planar_depth


def test_outputs_have_the_promised_shapes_and_ranges():
    with torch.no_grad():
        outputs = made_network()(torch.rand(2, 3, 42, 70))
    channels = {"albedo": 3, "roughness": 1, "metallic": 1, "normal": 3, "depth": 1}
    assert {name: tuple(x.shape) for name, x in outputs.items()} == {k: (2, c, 42, 70) for k, c in channels.items()}
    assert all((outputs[name] >= 0).all() for name in channels if name != "normal")
    assert torch.allclose(outputs["normal"].norm(dim=1), torch.ones(2, 42, 70), atol=1e-5)
    assert all(outputs[name].std() > 0 for name in channels)


def test_attention_is_the_textbook_one():
    attention = made_network().pretrained.blocks[0].attn
    tokens = torch.randn(2, 7, TINY.width)
    query, key, value = attention.qkv(tokens).chunk(3, -1)
    mixed = []
    for head in range(TINY.heads):
        part = slice(head * 16, head * 16 + 16)
        weights = torch.softmax(query[..., part] @ key[..., part].transpose(1, 2) / 4, -1)
        mixed.append(weights @ value[..., part])
    assert torch.allclose(attention(tokens), attention.proj(torch.cat(mixed, -1)), atol=1e-6)


def test_tokens_keep_their_place():
    encoder = made_network().pretrained
    image = torch.zeros(1, 3, 3 * PATCH, 5 * PATCH)
    image[..., 1 * PATCH : 2 * PATCH, 3 * PATCH : 4 * PATCH] = 1
    with torch.no_grad():
        patches = encoder.patch_embed(image).transpose(1, 2).unflatten(-1, (3, 5))
    changed = (patches - patches[..., :1, :1]).abs().sum(1)[0] > 1e-6
    assert changed.nonzero().tolist() == [[1, 3]]


@pytest.mark.parametrize(
    ("height", "width", "wanted"),
    [(512, 512, (518, 518)), (384, 512, (518, 686)), (98, 126, (518, 672)), (1000, 300, (1722, 518))],
)
def test_network_size_keeps_the_aspect_and_the_shorter_side(height, width, wanted):
    found = network_size(height, width)
    assert found == wanted
    assert min(found) >= 518 and all(side % PATCH == 0 for side in found)


def test_inference_gives_the_photo_its_own_size_and_no_gradients():
    photo = made_photo(20, 31)
    maps = infer(made_network(), photo.linear, input_size=28)
    assert {name: x.shape for name, x in maps.items()} == {
        "albedo": (20, 31, 3), "normal": (20, 31, 3), "roughness": (20, 31), "metallic": (20, 31), "depth": (20, 31),
    }  # fmt: skip
    assert all(x.dtype == np.float32 and x.flags.c_contiguous for x in maps.values())


def test_planar_depth_turns_the_output_round():
    output = np.array([[0, 1], [4, 2]], np.float32)
    assert planar_depth(output).tolist() == [[8, 7], [4, 6]]
    assert (planar_depth(np.zeros((2, 3), np.float32)) == 1).all()
