"""The network: shapes, ranges, and its fast parts against slow twins."""

import pytest
import torch
from made_matnet import TINY, made_network

from materialist.predict.matnet.network import PATCH
from materialist.predict.matnet.predictor import network_size


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


@pytest.mark.parametrize(
    ("height", "width", "wanted"),
    [(512, 512, (518, 518)), (384, 512, (518, 686)), (98, 126, (518, 672)), (1000, 300, (1722, 518))],
)
def test_network_size_keeps_the_aspect_and_the_shorter_side(height, width, wanted):
    found = network_size(height, width)
    assert found == wanted
    assert min(found) >= 518 and all(side % PATCH == 0 for side in found)
