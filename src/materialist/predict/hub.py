"""What the hub predictors share: their libraries, and loading a model whole or not at all."""

from __future__ import annotations

import importlib
from collections.abc import Collection
from pathlib import Path
from typing import Any, ClassVar

from materialist.errors import SetupError, WeightsError
from materialist.predict.models import locate
from materialist.predict.protocol import Predictor
from materialist.predict.weights import CHECKSUMS, INSTEAD, reason, verify_folder

INSTALL = "pip install 'materialist[hub]'"


def library(name: str) -> Any:
    """The optional library, imported. Raises SetupError that says how to install it."""
    try:
        module = importlib.import_module(name)
    except ImportError as error:
        raise SetupError(f"This predictor needs {name} ({error}); install it with: {INSTALL}, or {INSTEAD}.") from error
    # What matters is raised; their bars and hints would run through ours.
    module.utils.logging.set_verbosity_error()
    module.utils.logging.disable_progress_bar()
    return module


class HubPredictor(Predictor):
    """A model that optional libraries run.

    Args:
        where: a folder with a model, a hub id, or "" for the default.
    """

    default: ClassVar[str] = ""
    libraries: ClassVar[tuple[str, ...]]

    def __init__(self, where: str = "", *, device: str = "auto"):
        self.where, self.device = where or self.default, device

    def prepare(self, wanted: Collection[str]) -> None:
        """Raise SetupError or WeightsError where a library or the model is missing."""
        locate(self.where, self.default)
        for name in self.libraries:
            library(name)


def checked(folder: Path) -> str:
    """' sha256:...' of a download after every file was verified; '' for a folder without a list of checksums."""
    return f" sha256:{verify_folder(folder)[:16]}" if (folder / CHECKSUMS).is_file() else ""


def load(cls: Any, folder: Path, subfolder: str = "", **options: Any) -> Any:
    """`cls.from_pretrained` of a local folder, where every tensor that the model needs must be there and fit.

    The libraries themselves fill what is missing with random numbers and only log it. Tensors too many do no harm:
    older files carry some that are no longer used. Raises WeightsError.
    """
    if subfolder:
        options["subfolder"] = subfolder
    try:
        model, info = cls.from_pretrained(folder, local_files_only=True, output_loading_info=True, **options)
    except Exception as error:  # the libraries raise whatever their readers raise on damaged files
        raise WeightsError(
            f"{folder / subfolder} does not hold a {cls.__name__} that can be read ({reason(error)}); fetch it again "
            f"with: materialist models download NAME --force, or {INSTEAD}."
        ) from error
    absent = [*(info.get("missing_keys") or ()), *(info.get("mismatched_keys") or ())]
    if absent:
        raise WeightsError(
            f"{folder / subfolder} is not a whole {cls.__name__}: it lacks {', '.join(map(str, absent[:4]))}, or has "
            "it in another shape; fetch it again."
        )
    return model


def pipeline(name: str, folder: Path, gpu: bool, what: str = "", **options: Any) -> Any:
    """The pipeline `name` of diffusers in a folder, every component whole; half precision on the GPU only.

    `what` is what errors call it, by default its name. Raises SetupError, WeightsError.
    """
    import torch

    diffusers, transformers = library("diffusers"), library("transformers")
    kinds = {
        "unet": diffusers.UNet2DConditionModel, "vae": diffusers.AutoencoderKL,
        "text_encoder": transformers.CLIPTextModel,
    }  # fmt: skip
    components = {}
    for part, cls in kinds.items():
        variant = {"variant": "fp16"} if any((folder / part).glob("*.fp16.*")) else {}
        components[part] = load(cls, folder, part, **variant).to(torch.float16 if gpu else torch.float32)
    try:
        made = getattr(diffusers, name).from_pretrained(folder, local_files_only=True, **components, **options)
    except Exception as error:  # whatever its readers raise on a damaged configuration
        raise WeightsError(
            f"{folder} does not hold a whole {what or name} ({reason(error)}); fetch it again."
        ) from error
    made.set_progress_bar_config(disable=True)
    return made.to("cuda" if gpu else "cpu")
