"""MatNet: albedo, roughness, metallic, normal and depth from one linear picture (paper, eq. "matnet").

Its encoder is DINOv2 (Oquab et al. 2023), its decoders are DPT (Ranftl et al. 2021) as Depth Anything builds it, with
the parameter names of the published checkpoints.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.network import Architecture, StoredNetwork

PATCH = 14
"""Side of a patch, pixels; a picture's sides must be multiples of it."""
GRID = 37
"""The position embedding was learned on 518 x 518 pixels: 37 x 37 patches."""
OFFSET = 0.1
"""Added to the patch counts when the embedding is resized, as in DINOv2 without registers (else results differ)."""


@dataclass(frozen=True)
class Size(Architecture):
    """How large the network is."""

    width: int
    blocks: int
    heads: int
    layers: tuple[int, int, int, int]
    """The encoder blocks whose tokens the decoders read."""
    pyramid: tuple[int, int, int, int]
    fused: int
    grid: int = GRID


SIZES = {
    "vits": Size(384, 12, 6, (2, 5, 8, 11), (48, 96, 192, 384), 64),
    "vitb": Size(768, 12, 12, (2, 5, 8, 11), (96, 192, 384, 768), 128),
    "vitl": Size(1024, 24, 16, (4, 11, 17, 23), (256, 512, 1024, 1024), 256),
}
"""The published MatNet is 'vitb'; the others follow Depth Anything, whose checkpoints can start their training."""


class MatNet(StoredNetwork):
    """One encoder, one decoder for depth, one for materials and normals (paper, section "Material Prediction Network").

    The state dict has the names of the published checkpoint, so `load_state_dict(..., strict=True)` takes it.
    """

    FORMAT = "materialist-matnet-1"
    COMMAND = "materialist train matnet --config paper"
    ARCHITECTURE = Size

    def __init__(self, size: str | Size = "vitb"):
        size = SIZES[size] if isinstance(size, str) else size
        super().__init__(size)
        self.pretrained = Encoder(size.width, size.blocks, size.heads, size.grid)
        self.depth_head = Head(size.width, size.pyramid, size.fused, outputs=1)
        self.material_head = Head(size.width, size.pyramid, size.fused, outputs=8)

    def forward(self, image: Tensor) -> dict[str, Tensor]:
        """The raw outputs for images [B, 3, H, W] linear RGB, about [0, 1], without mean and deviation; H, W multiples
        of 14.

        albedo [B, 3, H, W], roughness, metallic, depth [B, 1, H, W]: >= 0, not bounded above; normal [B, 3, H, W]:
        unit, camera frame. What `depth` means depends on the weights: in the published ones it falls with distance.
        """
        # Five channels of materials (A, R, M) and three of normals come from one head, depth
        # from the other.
        features = self.pretrained(image, self.architecture.layers)
        materials = self.material_head(features)
        positive = F.relu(materials[:, :5])
        depth = F.relu(self.depth_head(features))
        normal = F.normalize(torch.tanh(materials[:, 5:]), dim=1, eps=1e-6)
        albedo, roughness, metallic = positive.split([3, 1, 1], 1)
        return {
            "depth": depth,
            "albedo": albedo,
            "roughness": roughness,
            "metallic": metallic,
            "normal": normal,
        }


class Encoder(nn.Module):
    """Pictures to patch tokens of several depths. `grid`: side of the learned position embedding, patches."""

    def __init__(self, width: int, blocks: int, heads: int, grid: int = GRID):
        super().__init__()
        self.cls_token = nn.Parameter(torch.zeros(1, 1, width))
        self.pos_embed = nn.Parameter(torch.zeros(1, 1 + grid * grid, width))
        # Only masked pre-training uses it; checkpoints carry it.
        self.mask_token = nn.Parameter(torch.zeros(1, width))
        self.patch_embed = nn.ModuleDict({"proj": nn.Conv2d(3, width, PATCH, stride=PATCH)})
        self.blocks = nn.ModuleList(_Block(width, heads) for _ in range(blocks))
        self.norm = nn.LayerNorm(width, eps=1e-6)
        nn.init.trunc_normal_(self.pos_embed, std=0.02)
        nn.init.normal_(self.cls_token, std=1e-6)

    def forward(self, image: Tensor, layers: Sequence[int]) -> list[Tensor]:
        """The patch features after each block in `layers` (ascending), normalised, as pictures [B, width, H / 14, W /
        14] of an image [B, 3, H, W], whose sides are multiples of 14.
        """
        rows = image.shape[-2] // PATCH
        columns = image.shape[-1] // PATCH
        # --- Tokens: one a patch [B, rows * columns, width], and the class token before them ---
        patches = self.patch_embed["proj"](image).flatten(2).transpose(1, 2)
        tokens = torch.cat([self.cls_token.expand(len(patches), -1, -1), patches], 1)
        tokens = tokens + self._positions(rows, columns)
        layer_features = []
        # --- Features after the chosen blocks, as pictures again, without the class token ---
        for k, block in enumerate(self.blocks[: max(layers) + 1]):
            tokens = block(tokens)
            if k in layers:
                features = self.norm(tokens)[:, 1:]
                layer_features.append(features.transpose(1, 2).unflatten(-1, (rows, columns)))
        return layer_features

    def _positions(self, rows: int, columns: int) -> Tensor:
        """[1, 1 + rows * columns, width]: the position embedding of a picture of that many patches."""
        grid = round((self.pos_embed.shape[1] - 1) ** 0.5)
        if (rows, columns) == (grid, grid):
            return self.pos_embed
        # The embedding was learned on a square grid: it is resized as a picture, the class
        # token's stays.
        learned = self.pos_embed[:, 1:].unflatten(1, (grid, grid)).permute(0, 3, 1, 2)
        scale = ((rows + OFFSET) / grid, (columns + OFFSET) / grid)
        resized = F.interpolate(learned, scale_factor=scale, mode="bicubic")
        return torch.cat([self.pos_embed[:, :1], resized.flatten(2).transpose(1, 2)], 1)


class _Block(nn.Module):
    """Attention and a two-layer perceptron, each normalised before and scaled after (LayerScale)."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.norm1 = nn.LayerNorm(width, eps=1e-6)
        self.attn = _Attention(width, heads)
        self.ls1 = nn.ParameterDict({"gamma": torch.ones(width)})
        self.norm2 = nn.LayerNorm(width, eps=1e-6)
        layers = {
            "fc1": nn.Linear(width, 4 * width),
            "gelu": nn.GELU(),
            "fc2": nn.Linear(4 * width, width),
        }
        self.mlp = nn.Sequential(OrderedDict(layers))
        self.ls2 = nn.ParameterDict({"gamma": torch.ones(width)})

    def forward(self, tokens: Tensor) -> Tensor:
        tokens = tokens + self.ls1["gamma"] * self.attn(self.norm1(tokens))
        return tokens + self.ls2["gamma"] * self.mlp(self.norm2(tokens))


class _Attention(nn.Module):
    """Multi-head self-attention [B, N, width] -> [B, N, width], without storing the N x N matrix."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)

    def forward(self, tokens: Tensor) -> Tensor:
        qkv = self.qkv(tokens).unflatten(-1, (3, self.heads, -1))  # [B, N, 3, heads, width / heads]
        query, key, value = qkv.permute(2, 0, 3, 1, 4)
        mixed = F.scaled_dot_product_attention(query, key, value)
        return self.proj(mixed.transpose(1, 2).flatten(2))


class Head(nn.Module):
    """Features of four encoder layers to one picture. `pyramid`: channels at 4, 2, 1 and 1/2 times the patch grid;
    `fused`: channels while these are put together.
    """

    def __init__(self, width: int, pyramid: Sequence[int], fused: int, outputs: int):
        super().__init__()
        self.projects = nn.ModuleList(nn.Conv2d(width, channels, 1) for channels in pyramid)
        # --- Each layer at its scale: 4, 2, 1 and 1/2 times the patch grid ---
        enlarge = [
            nn.ConvTranspose2d(channels, channels, n, stride=n)
            for channels, n in zip(pyramid, (4, 2))
        ]
        shrink = nn.Conv2d(pyramid[3], pyramid[3], 3, stride=2, padding=1)
        self.resize_layers = nn.ModuleList([*enlarge, nn.Identity(), shrink])
        # --- Fusion from coarse to fine, and the output ---
        self.scratch = nn.ModuleDict()  # the name is the checkpoints'
        for k, channels in enumerate(pyramid, 1):
            self.scratch[f"layer{k}_rn"] = nn.Conv2d(channels, fused, 3, padding=1, bias=False)
            self.scratch[f"refinenet{k}"] = _Fusion(fused)
        self.scratch["output_conv1"] = nn.Conv2d(fused, fused // 2, 3, padding=1)
        last = nn.Conv2d(fused // 2, 32, 3, padding=1), nn.ReLU(), nn.Conv2d(32, outputs, 1)
        self.scratch["output_conv2"] = nn.Sequential(*last)

    def forward(self, features: Sequence[Tensor]) -> Tensor:
        """[B, outputs, 14 h, 14 w] without a last activation, from four tensors [B, width, h, w]."""
        rows, columns = features[0].shape[-2:]
        # --- Each layer projected to its channels and brought to its scale ---
        steps = zip(features, self.projects, self.resize_layers, strict=True)
        layers = [resize(project(x)) for x, project, resize in steps]
        # From the coarsest scale to the finest, then two convolutions.
        fine = [self.scratch[f"layer{k}_rn"](x) for k, x in enumerate(layers, 1)]
        fuse = [self.scratch[f"refinenet{k}"] for k in range(1, 5)]
        path = fuse[3](fine[3], None, fine[2].shape[-2:])
        path = fuse[2](path, fine[2], fine[1].shape[-2:])
        path = fuse[1](path, fine[1], fine[0].shape[-2:])
        path = fuse[0](path, fine[0], tuple(2 * n for n in path.shape[-2:]))
        whole = _resized(self.scratch["output_conv1"](path), (rows * PATCH, columns * PATCH))
        return self.scratch["output_conv2"](whole)


class _Fusion(nn.Module):
    """RefineNet: what comes from the coarser scale, plus this scale's layer, enlarged."""

    def __init__(self, channels: int):
        super().__init__()
        self.out_conv = nn.Conv2d(channels, channels, 1)
        # The coarsest one never uses its first unit, but checkpoints carry it.
        self.resConfUnit1 = _convolutions(channels)
        self.resConfUnit2 = _convolutions(channels)

    def forward(self, path: Tensor, layer: Tensor | None, size: Sequence[int]) -> Tensor:
        if layer is not None:
            path = path + layer + self.resConfUnit1(layer)
        return self.out_conv(_resized(path + self.resConfUnit2(path), size))


def _convolutions(channels: int) -> nn.Sequential:
    """What a residual unit adds to its input."""
    relu = nn.ReLU

    def conv():
        return nn.Conv2d(channels, channels, 3, padding=1)

    return nn.Sequential(OrderedDict(relu1=relu(), conv1=conv(), relu2=relu(), conv2=conv()))


def _resized(x: Tensor, size: Sequence[int]) -> Tensor:
    return F.interpolate(x, tuple(size), mode="bilinear", align_corners=True)
