"""Hub models with random weights, small enough for tests, saved the way their libraries save them."""

import json
from pathlib import Path

import torch

APPEARANCE = {
    "target_names": ["albedo", "material"],
    "albedo": {"prediction_space": "srgb"},
    "material": {
        "prediction_space": "stack",
        "sub_target_names": ["roughness", "metallicity", None],
    },
    "roughness": {"prediction_space": "linear"},
    "metallicity": {"prediction_space": "linear"},
}
"""As the published 'appearance' model says it."""


def save_marigold(folder: Path, kind: str, *, half: bool = False, **settings) -> Path:
    """A Marigold pipeline of one kind (a class name of diffusers)."""
    import diffusers

    targets = 2 if kind == "MarigoldIntrinsicsPipeline" else 1
    unet, vae, text, tokenizer = _networks(folder, 4 * (targets + 1), 4 * targets, levels=2)
    pipeline = getattr(diffusers, kind)(
        unet=unet,
        vae=vae,
        scheduler=diffusers.DDIMScheduler(prediction_type="v_prediction"),
        text_encoder=text,
        tokenizer=tokenizer,
        default_denoising_steps=1,
        default_processing_resolution=32,
        **settings,
    )
    pipeline.save_pretrained(folder, variant="fp16" if half else None)
    return folder


def save_depth_anything(folder: Path, **settings) -> Path:
    """A Depth Anything model."""
    from transformers import DepthAnythingConfig, DepthAnythingForDepthEstimation, Dinov2Config

    backbone = Dinov2Config(
        hidden_size=16,
        num_hidden_layers=4,
        num_attention_heads=2,
        image_size=70,
        patch_size=14,
        mlp_ratio=1,
        out_indices=[1, 2, 3, 4],
        reshape_hidden_states=False,
        apply_layernorm=True,
    )
    config = DepthAnythingConfig(
        backbone_config=backbone,
        reassemble_hidden_size=16,
        neck_hidden_sizes=[4, 8, 8, 8],
        fusion_hidden_size=8,
        head_hidden_size=4,
        **settings,
    )
    with torch.random.fork_rng():
        torch.manual_seed(3)
        DepthAnythingForDepthEstimation(config).save_pretrained(folder)
    return folder


def _networks(folder: Path, channels: int, out: int, *, levels: int):
    """A denoiser, an autoencoder of so many levels, a text encoder and its tokenizer."""
    import diffusers

    with torch.random.fork_rng():
        torch.manual_seed(7)
        unet = diffusers.UNet2DConditionModel(
            block_out_channels=(8, 16),
            layers_per_block=1,
            sample_size=8,
            in_channels=channels,
            out_channels=out,
            down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"),
            norm_num_groups=4,
            attention_head_dim=4,
            up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"),
            cross_attention_dim=8,
        )
        vae = diffusers.AutoencoderKL(
            block_out_channels=(8,) * levels,
            layers_per_block=1,
            latent_channels=4,
            norm_num_groups=4,
            down_block_types=("DownEncoderBlock2D",) * levels,
            up_block_types=("UpDecoderBlock2D",) * levels,
        )
        return unet, vae, *_text_encoder(folder)


def _text_encoder(folder: Path):
    """A text encoder, and a vocabulary of a few letters."""
    from transformers import CLIPTextConfig, CLIPTextModel, CLIPTokenizer

    config = CLIPTextConfig(
        hidden_size=8,
        intermediate_size=16,
        num_attention_heads=2,
        num_hidden_layers=1,
        vocab_size=8,
        max_position_embeddings=16,
        bos_token_id=0,
        eos_token_id=1,
    )
    files = folder.parent / "vocabulary"
    files.mkdir(parents=True, exist_ok=True)
    words = {"<|startoftext|>": 0, "<|endoftext|>": 1, "a</w>": 2, "a": 3}
    (files / "vocab.json").write_text(json.dumps(words))
    (files / "merges.txt").write_text("#version: 0.2\n")
    tokenizer = CLIPTokenizer(
        str(files / "vocab.json"), str(files / "merges.txt"), model_max_length=16
    )
    return CLIPTextModel(config), tokenizer


def save_inpainting(folder: Path) -> Path:
    """A Stable Diffusion inpainting pipeline."""
    import diffusers

    unet, vae, text, tokenizer = _networks(folder, 9, 4, levels=4)
    diffusers.StableDiffusionInpaintPipeline(
        unet=unet,
        vae=vae,
        scheduler=diffusers.DDIMScheduler(steps_offset=1),
        text_encoder=text,
        tokenizer=tokenizer,
        safety_checker=None,
        feature_extractor=None,
        requires_safety_checker=False,
    ).save_pretrained(folder)
    return folder
