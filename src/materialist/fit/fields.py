"""What the optimiser moves: fields for the environment map and for the materials.

The paper's are MLPs on sinusoidal encodings; texels, spherical harmonics, direct maps and a small U-Net are its
ablations. A field is a torch module; calling it gives the map or the materials.
"""

import math
from itertools import pairwise

import torch
from torch import nn
from torch.nn import functional

from materialist.envmap import sh_basis, texel_directions

Rows = torch.Tensor | slice
"""Which pixels of a material field are meant: their numbers, or a slice."""
ALL = slice(None)


def positional_encoding(x: torch.Tensor, bands: int) -> torch.Tensor:
    """gamma(x): sin and cos of 2^k pi x for k = 0 .. bands-1; [..., C] -> [..., 2 * bands * C]."""
    angles = torch.cat([(2.0**k) * math.pi * x for k in range(bands)], -1)
    return torch.cat([angles.sin(), angles.cos()], -1)


def mlp(inputs: int, outputs: int, *, width: int, layers: int) -> nn.Sequential:
    """Fully connected network with `layers` hidden ReLU layers of `width`."""
    sizes = [inputs] + [width] * layers
    hidden = [m for a, b in pairwise(sizes) for m in (nn.Linear(a, b), nn.ReLU())]
    return nn.Sequential(*hidden, nn.Linear(width, outputs))


class EnvmapMLP(nn.Module):
    """E(u, v) = Softplus(MLP_env(gamma(d))), d the unit direction (paper, Environment Map Optimization).

    With `coordinates="uv"` the encoding is of (u, v) instead: the paper's ablation of coordinate systems.
    """

    BANDS = 4

    def __init__(self, *, coordinates: str = "direction"):
        super().__init__()
        self.coordinates = coordinates
        inputs = 3 if coordinates == "direction" else 2
        self.net = mlp(2 * self.BANDS * inputs, 3, width=128, layers=3)

    def forward(self, height: int, jitter: torch.Generator | None = None) -> torch.Tensor:
        """Radiance [h, 2h, 3] at texel centres, or at random points of the texels when a generator is given."""
        # Texel centres, all moved by one random offset, or by none.
        offset = torch.rand(2, generator=jitter) - 0.5 if jitter is not None else torch.zeros(2)
        v = (torch.arange(height) + 0.5 + offset[0])[:, None] / height
        u = (torch.arange(2 * height) + 0.5 + offset[1])[None, :] / (2 * height)
        u, v = (x.to(self.net[0].weight) for x in torch.broadcast_tensors(u, v))
        if self.coordinates == "uv":
            x = torch.stack([u, v], -1)
        else:
            # d(u, v): theta from +Y, phi = 0 along -Z in the middle of the map.
            theta = math.pi * v
            phi = 2 * math.pi * (u - 0.5)
            x = torch.stack([theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos()], -1)
        return functional.softplus(self.net(positional_encoding(x, self.BANDS)))


class EnvmapTexels(nn.Module):
    """exp of one parameter per texel and channel: positive, and equally easy to move over decades of radiance."""

    def __init__(self, initial: torch.Tensor):
        super().__init__()
        self.log = nn.Parameter(initial.clamp_min(1e-6).log())

    def forward(self, height: int, jitter: torch.Generator | None = None) -> torch.Tensor:
        """Radiance [h, 2h, 3], resampled bilinearly when `height` is not the field's own."""
        return resize_envmap(self.log.exp(), height)


class EnvmapSH(nn.Module):
    """Softplus of real spherical harmonics up to degree 3, which the paper's appendix compares."""

    DEGREE = 3

    def __init__(self):
        super().__init__()
        self.coefficients = nn.Parameter(torch.zeros((self.DEGREE + 1) ** 2, 3))

    def forward(self, height: int, jitter: torch.Generator | None = None) -> torch.Tensor:
        basis = torch.from_numpy(sh_basis(texel_directions(height, 2 * height), self.DEGREE)).to(
            self.coefficients
        )
        return functional.softplus(basis @ self.coefficients)


def resize_envmap(envmap: torch.Tensor, height: int) -> torch.Tensor:
    """[h, 2h, 3] -> [height, 2 height, 3]: area average when shrinking, bilinear (azimuth wrapped) when enlarging."""
    h = envmap.shape[0]
    if h == height:
        return envmap
    # Smaller: each new texel is the mean over its area, rows and columns apart.
    if height < h:
        rows, columns = (_coverage(n, m).to(envmap) for n, m in ((height, h), (2 * height, 2 * h)))
        return torch.einsum("ij,jkc,lk->ilc", rows, envmap, columns)
    # Larger: with a rim of one texel, wrapped in azimuth, repeated at the poles.
    image = envmap.permute(2, 0, 1)[None]
    image = functional.pad(
        functional.pad(image, (1, 1, 0, 0), mode="circular"), (0, 0, 1, 1), mode="replicate"
    )
    # Centres of the new texels on the padded map, in [-1, 1].
    y = (2 * ((torch.arange(height) + 0.5) * h / height + 1) / (h + 2) - 1).to(image)
    x = (2 * ((torch.arange(2 * height) + 0.5) * h / height + 1) / (2 * h + 2) - 1).to(image)
    places = torch.stack(torch.meshgrid(y, x, indexing="ij")[::-1], -1)[None]
    return functional.grid_sample(image, places, mode="bilinear", align_corners=False)[0].permute(
        1, 2, 0
    )


def _coverage(count: int, of: int) -> torch.Tensor:
    """[count, of] part of each of `count` cells that each of `of` cells covers; both divide the same length."""
    ends = torch.arange(count + 1, dtype=torch.float64) * of / count
    cell = torch.arange(of, dtype=torch.float64)
    overlap = torch.minimum(ends[1:, None], cell + 1) - torch.maximum(ends[:-1, None], cell)
    return overlap.clamp_min(0) * count / of


class MaterialMLP(nn.Module):
    """m_p + zeta * tanh(MLP_mat(x, m_p)) with learnable zeta (paper, Material Properties Optimization).

    The network is the published one: it sees the place x of a pixel beside m_p, its activations are sines, and its
    input is joined once more to the first and the third hidden layer. From m_p alone, equal priors would move alike.
    """

    BANDS = 2
    UNITS = 256
    ZETA = 1.3
    prior: torch.Tensor
    code: torch.Tensor

    def __init__(self, prior: torch.Tensor, pixels: torch.Tensor, height: int, width: int):
        """prior: [P, 5] albedo, roughness, metallic of the row-major `pixels` [P] of a picture."""
        super().__init__()
        # In pixels of a picture with 512 on its longer side, which the published code always has.
        place = torch.stack([pixels // width, pixels % width], 1) * (512 / max(height, width))
        place = place.to(prior)
        waves = [wave(2.0**k * place) for k in range(self.BANDS) for wave in (torch.sin, torch.cos)]
        # code [P, 15]: the place, its sines and cosines in 2 bands, m_p.
        self.register_buffer("prior", prior)
        self.register_buffer("code", torch.cat([place, *waves, prior], 1))
        inputs = self.code.shape[1]
        units = self.UNITS
        # Layers 0 and 2 are narrower by the input, which joins their output.
        joined = nn.Linear(inputs, units - inputs), nn.Linear(units, units - inputs)
        plain = nn.Linear(units, units), nn.Linear(units, units)
        self.hidden = nn.ModuleList([joined[0], plain[0], joined[1], plain[1]])
        self.last = nn.Linear(units, 5)
        _silence(self.last)
        self.zeta = nn.Parameter(torch.tensor(self.ZETA))

    def forward(self, rows: Rows = ALL) -> torch.Tensor:
        code = self.code[rows]
        x = code
        for k, layer in enumerate(self.hidden):
            before = torch.cat([x, code], 1) if k % 2 else x
            x = layer(before).sin()
        return clamped(self.prior[rows] + self.zeta * torch.tanh(self.last(x)))


def clamped(values: torch.Tensor) -> torch.Tensor:
    """Values clamped to [0, 1]. A gradient passes as if they were not, so what left the range can come back."""
    return values + (values.clamp(0, 1) - values).detach()


class MaterialMaps(nn.Module):
    """The maps themselves as parameters ("w/o Network" in the paper)."""

    def __init__(self, prior: torch.Tensor):
        """prior: [P, 5]."""
        super().__init__()
        self.maps = nn.Parameter(prior.clone())

    def forward(self, rows: Rows = ALL) -> torch.Tensor:
        return self.maps[rows].clamp(0, 1)


class MaterialUNet(nn.Module):
    """Residual by a U-Net with two down- and two upsampling blocks of two 3x3 convolutions (paper's ablation)."""

    prior: torch.Tensor

    def __init__(
        self,
        prior: torch.Tensor,
        pixels: torch.Tensor,
        height: int,
        width: int,
        *,
        channels: int = 32,
    ):
        super().__init__()
        # --- The prior as a picture whose sides can be halved twice ---
        grid = prior.new_zeros(height * width, 5)
        grid[pixels] = prior
        pad_h = -height % 4
        pad_w = -width % 4
        image = grid.view(1, height, width, 5).permute(0, 3, 1, 2)
        self.size = (height, width)
        self.pixels = pixels
        self.register_buffer("image", functional.pad(image, (0, pad_w, 0, pad_h), mode="replicate"))
        self.register_buffer("prior", prior)
        # --- Two blocks down, one between, two up; both halves are joined ---
        c = channels
        self.down1 = _double_conv(5, c)
        self.down2 = _double_conv(c, 2 * c)
        self.middle = _double_conv(2 * c, 2 * c)
        self.up2 = _double_conv(4 * c, c)
        self.up1 = _double_conv(2 * c, c)
        self.head = nn.Conv2d(c, 5, 1)
        _silence(self.head)
        self.zeta = nn.Parameter(torch.tensor(0.3))

    def forward(self, rows: Rows = ALL) -> torch.Tensor:
        a = self.down1(self.image)
        b = self.down2(functional.max_pool2d(a, 2))
        m = self.middle(functional.max_pool2d(b, 2))
        u = self.up2(torch.cat([functional.interpolate(m, scale_factor=2.0), b], 1))
        u = self.up1(torch.cat([functional.interpolate(u, scale_factor=2.0), a], 1))
        # The residual of the surface pixels [P, 5], without the padding.
        delta = self.head(u)[0, :, : self.size[0], : self.size[1]].reshape(5, -1).T[self.pixels]
        return (self.prior + self.zeta * torch.tanh(delta)).clamp(0, 1)[rows]


def _silence(layer: nn.Module) -> None:
    """Zero weights and bias, so that a residual network starts at its prior."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)


def _double_conv(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(outputs, outputs, 3, padding=1),
        nn.ReLU(),
    )


class Unified(nn.Module):
    """Mask mode: one roughness and one metallic, their means, inside a mask (paper, Material Editing Settings)."""

    def __init__(self, field: nn.Module, inside: torch.Tensor):
        """inside: [P] bool."""
        super().__init__()
        self.field = field
        self.inside = inside

    def forward(self, rows: Rows = ALL) -> torch.Tensor:
        maps = self.field()
        mean = maps[self.inside, 3:].mean(0)
        unified = torch.where(self.inside[:, None], mean, maps[:, 3:])
        return torch.cat([maps[:, :3], unified], 1)[rows]
