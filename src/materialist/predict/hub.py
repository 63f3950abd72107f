"""Predictors that optional libraries run: Marigold through diffusers, Depth Anything V2 through transformers.

A model is loaded whole or not at all, and nothing is downloaded here.
"""

import importlib
import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist.camera import unit
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.errors import SetupError, WeightsError
from materialist.install import extra_command
from materialist.predict.models import locate
from materialist.predict.protocol import MapSet, MixedPredictor, Predictor, on_gpu
from materialist.predict.relative import planar
from materialist.predict.weights import CHECKSUMS, INSTEAD, reason, verify_folder
from materialist.types import Array, Photo

GIVES = {
    "MarigoldIntrinsicsPipeline": ("albedo", "roughness", "metallic"),
    "MarigoldNormalsPipeline": ("normal",),
    "MarigoldDepthPipeline": ("depth",),
}
"""Pipeline class, as model_index.json names it -> the maps it gives."""
MODELS = ("marigold-appearance", "marigold-normals", "marigold-depth")
"""The published models, in the order of `GIVES`."""
MEAN = (0.485, 0.456, 0.406)
DEVIATION = (0.229, 0.224, 0.225)
"""Of sRGB values in [0, 1], as the network was trained."""


@contextmanager
def advice(instead: str) -> Iterator[None]:
    """Errors of a missing library or model end with this advice, not with that of other predictors."""
    try:
        yield
    except (SetupError, WeightsError) as error:
        raise type(error)(str(error).replace(INSTEAD, instead)) from error


def import_library(name: str) -> Any:
    """The optional library, imported. Raises SetupError that says how to install it."""
    try:
        module = importlib.import_module(name)
    except ImportError as error:
        raise SetupError(
            f"This needs {name} ({error}); install it with: {extra_command('hub')}, or {INSTEAD}."
        ) from error
    # What matters is raised; their bars and hints would run through ours.
    module.utils.logging.set_verbosity_error()
    module.utils.logging.disable_progress_bar()
    return module


class HubPredictor(Predictor):
    """A model in a folder, of a hub id, or, where `where` is "", the default one."""

    default: ClassVar[str] = ""
    libraries: ClassVar[tuple[str, ...]]

    def __init__(self, where: str = "", *, device: str = "auto"):
        self.where = where or self.default
        self.device = device

    @property
    def folder(self) -> Path:
        """Where the model lies. Raises WeightsError where it does not."""
        return locate(self.where, self.default)

    def prepare(self, names: Collection[str]) -> None:
        """Raise SetupError or WeightsError where a library or the model is missing."""
        for name in self.libraries:  # before gigabytes of weights are asked for
            import_library(name)
        _ = self.folder


def open_marigold(where: str = "", *, device: str = "auto") -> Predictor:
    """The Marigold model in a folder or of a hub id; "": all maps from the three published ones.

    Raises SetupError or WeightsError where a library or the model of `where` is missing.
    """
    if where:
        for name in Marigold.libraries:
            import_library(name)
        return Marigold(where, GIVES[_pipeline_class(locate(where, ""))], device=device)
    parts = {
        model: Marigold(model, gives, device=device) for model, gives in zip(MODELS, GIVES.values())
    }
    return MixedPredictor(
        {name: model for model, part in parts.items() for name in part.gives}, parts
    )


class Marigold(HubPredictor):
    """One Marigold model: a folder with a pipeline of diffusers or a hub id, and the maps that it gives."""

    libraries = ("diffusers", "transformers")

    def __init__(self, where: str, gives: tuple[str, ...], *, device: str = "auto"):
        super().__init__(where, device=device)
        self.gives = gives
        self.name = f"marigold ({where})"

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted maps at the photo's size. The model sees sRGB values; equal seeds start from equal noise."""
        import torch

        # --- The answer of the pipeline ---
        folder = self.folder
        source = f"marigold ({folder.name.replace('--', '/')}){checksum_note(folder)}"
        kind = _pipeline_class(folder)
        gpu = on_gpu(self.device)
        loaded = pipeline(kind, folder, gpu)
        generator = torch.Generator("cuda" if gpu else "cpu").manual_seed(seed)
        output = loaded(
            linear_to_srgb(photo.linear)[None], generator=generator, output_type="np"
        ).prediction
        notes: tuple[str, ...] = ()
        if kind == "MarigoldIntrinsicsPipeline":
            # --- Its answer as our maps: each kind of pipeline has its own convention ---
            maps = appearance(output, loaded.target_properties or {})
        elif kind == "MarigoldNormalsPipeline":
            normal = unit(output[0])  # in our frame already; interpolation shortens
            maps = {
                "normal": np.where(normal.any(-1, keepdims=True), normal, [0, 0, 1]).astype(
                    np.float32
                )
            }
        else:
            inverse = loaded.config.prediction_type == "disparity"
            depth, note, notes = planar(
                output[0, ..., 0], photo.camera, normal, inverse=inverse, name=self.name
            )
            maps = {"depth": depth}
            source = source + note
        # --- A model may give other maps than those that are asked for ---
        lacking = [name for name in names if name not in maps]
        if lacking:
            raise WeightsError(
                f"{folder} gives {', '.join(maps)}, not {lacking[0]}; use an 'appearance' model for it."
            )
        return MapSet({name: maps[name] for name in names}, dict.fromkeys(names, source), notes)


def appearance(output: Array, properties: dict) -> dict[str, Array]:
    """Albedo, and roughness and metallic where they are among the targets, of output [T, H, W, 3] in [0, 1].

    `properties`: the pipeline's `target_properties`: the order of the targets, what their channels are
    (`sub_target_names`), and whether the albedo is linear or sRGB (`prediction_space`; sRGB unless said).
    """
    maps: dict[str, Array] = {}
    ours = {"metallicity": "metallic", "roughness": "roughness"}
    for name, picture in zip(properties.get("target_names", ("albedo",)), output):
        about = properties.get(name) or {}
        channels = about.get("sub_target_names")
        if channels:
            maps |= {ours[part]: picture[..., k] for k, part in enumerate(channels) if part in ours}
        elif name == "albedo":
            maps[name] = (
                picture if about.get("prediction_space") == "linear" else srgb_to_linear(picture)
            )
    return {
        name: np.ascontiguousarray(np.clip(values, 0, 1), np.float32)
        for name, values in maps.items()
    }


def _pipeline_class(folder: Path) -> str:
    """The kind of pipeline in a folder. Raises WeightsError unless it is a Marigold."""
    try:
        kind = json.loads((folder / "model_index.json").read_text("utf-8")).get("_class_name")
    except (OSError, ValueError, AttributeError) as error:
        raise WeightsError(
            f"{folder} holds no readable model_index.json, as diffusers writes it ({error})."
        ) from error
    if kind not in GIVES:
        raise WeightsError(f"{folder} holds a {kind}; Marigold models are {', '.join(GIVES)}.")
    return kind


class DepthAnything(HubPredictor):
    """Gives depth alone; by default Depth Anything V2 Small."""

    gives = ("depth",)
    default = "depth-anything"
    libraries = ("transformers",)

    def __init__(self, where: str = "", *, device: str = "auto"):
        super().__init__(where, device=device)
        self.name = f"depth-anything ({where or 'V2 Small'})"

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """Planar depth. The network sees sRGB values; a metric model's depth is in metres and taken as it is, a
        relative one gives inverse depth without scale and shift, see `relative.from_relative`.
        """
        # --- The model, verified, and one run of its pipeline ---
        folder = self.folder
        digest = checksum_note(folder)
        model = load_model(import_library("transformers").DepthAnythingForDepthEstimation, folder)
        values = _run(model, photo.linear, on_gpu(self.device))
        if model.config.depth_estimation_type == "metric":
            return MapSet(
                {"depth": np.maximum(values, 1e-3)}, {"depth": f"{self.name}{digest}, metric"}
            )
        depth, note, warnings = planar(values, photo.camera, normal, inverse=True, name=self.name)
        return MapSet({"depth": depth}, {"depth": f"{self.name}{digest}{note}"}, warnings)


def _run(model, linear: Array, gpu: bool) -> Array:
    """The network's output [H, W] for a linear picture [H, W, 3]: the shorter side is seen at 518 pixels."""
    from materialist.predict.matnet.predictor import at_network_size

    model = model.to("cuda" if gpu else "cpu").float().eval()

    def run(image):
        return {"depth": model(pixel_values=image).predicted_depth[:, None]}

    pixels = ((linear_to_srgb(linear) - MEAN) / DEVIATION).astype(np.float32)
    return at_network_size(run, pixels, model.device)["depth"]


def checksum_note(folder: Path) -> str:
    """' sha256:...' of a download after every file was verified; '' for a folder without a list of checksums."""
    return f" sha256:{verify_folder(folder)[:16]}" if (folder / CHECKSUMS).is_file() else ""


def load_model(cls: Any, folder: Path, subfolder: str = "", **options: Any) -> Any:
    """`cls.from_pretrained` of a local folder, where every tensor that the model needs must be there and fit.

    The libraries themselves fill what is missing with random numbers and only log it. Tensors too many do no harm:
    older files carry some that are no longer used. Raises WeightsError.
    """
    if subfolder:
        options["subfolder"] = subfolder
    try:
        model, info = cls.from_pretrained(
            folder, local_files_only=True, output_loading_info=True, **options
        )
    except Exception as error:  # the libraries raise whatever their readers raise on damaged files
        raise WeightsError(
            f"{folder / subfolder} does not hold a {cls.__name__} that can be read ({reason(error)}); fetch it again "
            f"with: materialist models download NAME --force, or {INSTEAD}."
        ) from error
    # Weights that lack tensors would give noise: the libraries fill them at random.
    absent = [*(info.get("missing_keys") or ()), *(info.get("mismatched_keys") or ())]
    if absent:
        raise WeightsError(
            f"{folder / subfolder} is not a whole {cls.__name__}: it lacks {', '.join(map(str, absent[:4]))}, or has "
            "it in another shape; fetch it again."
        )
    return model


def pipeline(name: str, folder: Path, gpu: bool, label: str = "", **options: Any) -> Any:
    """The pipeline `name` of diffusers in a folder, every component whole; half precision on the GPU only.

    `label`: name of the model in errors, by default that of the pipeline. Raises SetupError, WeightsError.
    """
    import torch

    diffusers = import_library("diffusers")
    transformers = import_library("transformers")
    # --- Each network on its own, so that one that is not whole is refused ---
    kinds = {
        "unet": diffusers.UNet2DConditionModel,
        "vae": diffusers.AutoencoderKL,
        "text_encoder": transformers.CLIPTextModel,
    }
    components = {}
    for part, cls in kinds.items():
        # Half-precision files hold the same network in half the space.
        variant = {"variant": "fp16"} if any((folder / part).glob("*.fp16.*")) else {}
        components[part] = load_model(cls, folder, part, **variant).to(
            torch.float16 if gpu else torch.float32
        )
    # --- The pipeline around them: its configuration, scheduler and tokenizer ---
    try:
        loaded = getattr(diffusers, name).from_pretrained(
            folder, local_files_only=True, **components, **options
        )
    except Exception as error:  # whatever its readers raise on a damaged configuration
        raise WeightsError(
            f"{folder} holds no whole {label or name} ({reason(error)}); fetch it again."
        ) from error
    loaded.set_progress_bar_config(disable=True)
    return loaded.to("cuda" if gpu else "cpu")
