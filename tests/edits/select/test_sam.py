"""SAM 2 with a tiny network of random weights: the code path, not the masks."""

import numpy as np
import pytest

from materialist.edits.select.sam import segment


@pytest.fixture(scope="module")
def model_folder(tmp_path_factory):
    transformers = pytest.importorskip("transformers", reason="needs the optional extra 'hub'")
    import torch

    torch.manual_seed(0)
    size = 64
    backbone = transformers.Sam2HieraDetConfig(
        hidden_size=8, num_attention_heads=1, image_size=[size, size], blocks_per_stage=[1, 1, 2, 1],
        embed_dim_per_stage=[8, 16, 32, 64], num_attention_heads_per_stage=[1, 1, 2, 2],
        window_size_per_stage=[4, 4, 4, 2],
        global_attention_blocks=[3], window_positional_embedding_background_size=[4, 4],
    )  # fmt: skip
    vision = transformers.Sam2VisionConfig(
        backbone_config=backbone, backbone_channel_list=[64, 32, 16, 8], fpn_hidden_size=32,
        backbone_feature_sizes=[[size // 4] * 2, [size // 8] * 2, [size // 16] * 2],
    )  # fmt: skip
    prompt = transformers.Sam2PromptEncoderConfig(hidden_size=32, image_size=size, patch_size=16, mask_input_channels=4)
    decoder = transformers.Sam2MaskDecoderConfig(
        hidden_size=32, mlp_dim=32, num_attention_heads=2, iou_head_hidden_dim=16, num_hidden_layers=1
    )
    config = transformers.Sam2Config(vision_config=vision, prompt_encoder_config=prompt, mask_decoder_config=decoder)
    folder = tmp_path_factory.mktemp("sam2")
    transformers.Sam2Model(config).save_pretrained(folder)
    return folder


PHOTO = np.random.default_rng(0).random((30, 44, 3), np.float32)


def test_clicks_and_boxes_give_masks_of_the_photo(model_folder):
    for points, box in (([(20, 10)], None), ([(20, 10), (25, 12)], None), ([], (5, 5, 30, 25))):
        mask = segment(PHOTO, points, box, where=str(model_folder), device="cpu")
        assert mask.shape == (30, 44) and mask.dtype == bool
    again = segment(PHOTO, [], (5, 5, 30, 25), where=str(model_folder), device="cpu")
    np.testing.assert_array_equal(mask, again)
