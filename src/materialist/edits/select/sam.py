"""SAM 2 (Ravi et al. 2024), the paper's way to select, where its weights are there."""

from collections.abc import Sequence

import numpy as np

from materialist.color import linear_to_srgb
from materialist.install import extra_command
from materialist.predict import hub
from materialist.predict.models import hub_model, is_complete, locate
from materialist.predict.protocol import on_gpu
from materialist.types import Array

REPO = "facebook/sam2.1-hiera-tiny"
_MEAN = (0.485, 0.456, 0.406)
_STD = (0.229, 0.224, 0.225)


def segment(
    linear: Array,
    points: Sequence[tuple[int, int]],
    box: tuple[int, int, int, int] | None = None,
    *,
    where: str = REPO,
    device: str = "auto",
) -> Array:
    """[H, W] bool of the object at the clicks (column, row) or in the box, by SAM 2.

    linear: [H, W, 3] photo. where: a folder that holds the model, or a hub id that was downloaded.
    Raises SetupError where transformers is missing, WeightsError where the weights are not there, or damaged.
    """
    import torch

    with hub.advice('leave `method="sam2"` out'):
        model = hub.load_model(hub.import_library("transformers").Sam2Model, locate(where, REPO))
    target = torch.device("cuda" if on_gpu(device) else "cpu")
    model = model.to(target).eval()
    side = int(model.config.vision_config.backbone_config.image_size[0])
    height, width = linear.shape[:2]
    scale = np.array([side / width, side / height])
    corners = [] if box is None else [box[:2], box[2:]]
    # Clicks are at pixel centres, corners of a box between pixels.
    spots = (np.array([*points, *corners], np.float32) + 0.5 * (box is None)) * scale
    # SAM's labels: 1 a click on the object, 2 and 3 the two corners of a box.
    labels = [1] * len(points) + ([] if box is None else [2, 3])
    with torch.inference_mode():
        output = model(
            pixel_values=_pixels(linear, side).to(target),
            input_points=torch.tensor(spots, dtype=torch.float32, device=target)[None, None],
            input_labels=torch.tensor(labels, dtype=torch.int32, device=target)[None, None],
            multimask_output=len(spots) == 1,
        )
    masks = output.pred_masks[0, 0].float()
    scores = output.iou_scores[0, 0]
    # --- The best of its masks, at the photo's size ---
    best = masks[int(scores.argmax())][None, None]
    large = torch.nn.functional.interpolate(
        best, (height, width), mode="bilinear", align_corners=False
    )
    return (large[0, 0] > 0).cpu().numpy()


def sam_problem() -> str | None:
    """Why SAM 2 cannot select here, in a sentence that says what to do; None where it can. Imports nothing large."""
    from importlib.util import find_spec

    if find_spec("transformers") is None:
        return f"Not installed: {extra_command('hub')}, then materialist models download sam2."
    if not is_complete(hub_model(REPO)):
        return "Its weights are not here: materialist models download sam2."
    return None


def _pixels(linear: Array, side: int):
    """[1, 3, side, side] normalised picture; stretched to a square, as the model was trained.

    The model's own image processor needs torchvision, which this project cannot have.
    """
    import torch

    encoded = torch.from_numpy(linear_to_srgb(linear)).permute(2, 0, 1)[None]
    square = torch.nn.functional.interpolate(
        encoded, (side, side), mode="bilinear", align_corners=False, antialias=True
    )
    return (square - torch.tensor(_MEAN).view(1, 3, 1, 1)) / torch.tensor(_STD).view(1, 3, 1, 1)
