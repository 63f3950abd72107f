"""RefractionNet: a small U-Net from the maps of an object to its thickness and the normals of its back.

The paper has the decoder of its depth prediction here. This one sees the photo, the geometry, and the thickness by
symmetry, and answers with a factor on the latter and a turn of the mirrored normals: it starts as the symmetry prior
and learns where that is wrong. Normals have an answer of their own because glass is decided by them, and a soft map of
thickness says little about which way the back leans.
"""

import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.predict.network import UNet, UNetArchitecture
from materialist.predict.refraction.crop import ANSWERS, CHANNELS, MASK, MIRROR, NORMAL_X

MIN_THICKNESS = 0.05
"""Added to the mirrored thickness, in units of the object's size, so that a factor can change where that is 0."""


class RefractionNet(UNet):
    """Features of an object in, solid and hollow thickness and normals of the back out."""

    FORMAT = "materialist-refraction-1"
    COMMAND = "materialist train refraction"

    def __init__(self, architecture: UNetArchitecture | None = None):
        super().__init__(CHANNELS, ANSWERS, architecture or UNetArchitecture())

    def forward(self, maps: Tensor) -> Tensor:
        """[B, 5, S, S] float32 of maps [B, CHANNELS, S, S] (`crop.refraction_features`), S a multiple of 32; 0 outside
        the mask.

        Solid thickness, in units of the object's size; hollow <= solid; the outward normal of the last surface, unit,
        in the frame of the features, away from the viewer.
        """
        raw = self.raw(maps)
        inside = maps[:, MASK : MASK + 1]
        # exp(3 tanh(x / 3)): a factor on the mirrored thickness, 1 at x = 0, at most e^3 either
        # way.
        solid = (maps[:, MIRROR : MIRROR + 1] + MIN_THICKNESS) * (
            3 * torch.tanh(raw[:, :1] / 3)
        ).exp()
        normal = maps[:, NORMAL_X : NORMAL_X + 3]
        # The mirrored front normal (z turned round), turned by what the network adds.
        back = F.normalize(
            torch.cat([normal[:, :2], -normal[:, 2:]], 1) + raw[:, 2:], dim=1, eps=1e-4
        )
        return torch.cat([solid, solid * raw[:, 1:2].sigmoid(), back], 1) * inside
