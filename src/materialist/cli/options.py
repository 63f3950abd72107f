"""Options that several commands share, as options classes; and the arguments beside them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.option_kinds import OperationOptions, option
from materialist.options import PATHS


def output_option(metavar: str, help: str) -> Any:
    """The -o of a command that writes `metavar`."""
    return typer.Option("-o", "--output", metavar=metavar, help=help)


Json = Annotated[
    bool, typer.Option("--json", help="Print the outcome as one line of JSON, the last on stdout.")
]
SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="A scene package.")]
PictureOutput = Annotated[
    Path,
    output_option(
        "OUT", "A .png or .tif (as deep as the photo), .jpg, .webp, .avif, or .exr (linear, HDR)."
    ),
]


@dataclass(frozen=True, kw_only=True)
class Computing(OperationOptions):
    """What every command that computes takes."""

    # What makes a run repeatable, and where it runs.
    seed: int = option(
        0,
        "Random seed: the same seed on the same machine gives the same result.",
        kind="whole",
        low=0,
        high=2**31 - 1,
    )
    device: str = option(
        "auto",
        "Where to compute; auto takes the GPU when there is one.",
        kind="word",
        choices=("auto", "cpu", "cuda"),
    )
    as_json: bool = option(
        False,
        "Print the outcome as one line of JSON, the last on stdout.",
        kind="switch",
        flag="--json",
    )


@dataclass(frozen=True, kw_only=True)
class Run(Computing):
    """What every command that writes a result takes."""

    force: bool = option(False, "Replace the output when it exists.", kind="switch")


def pixels(about: str, called: str) -> Any:
    """An option that may be given several times, a pixel (x, y) each."""
    shown = {"called": called, "metavar": "X,Y"}
    return option((), about, kind="numbers", count=2, many=True, **shown)


@dataclass(frozen=True, kw_only=True)
class Place(OperationOptions):
    """A region of the photo."""

    mask: Path | None = option(None, "The region: white inside.", kind="file", metavar="PNG")
    click: tuple[tuple[float, float], ...] = pixels(
        "A pixel of the object, at working size; more than one helps.", "--click"
    )
    box: tuple[float, float, float, float] | None = option(
        None,
        "A box around the object.",
        kind="numbers",
        count=4,
        called="--box",
        metavar="X0,Y0,X1,Y1",
    )

    @property
    def named(self) -> list[str]:
        return [f"--{name}" for name in ("click", "box", "mask") if getattr(self, name)]


@dataclass(frozen=True, kw_only=True)
class Region(Place):
    method: str = option(
        "network",
        "network: MobileSAM and ClickNet; grabcut: colours alone.",
        kind="word",
        choices=("network", "grabcut", "sam2"),
        flag="--with",
    )
    extent: str = option(
        "auto",
        "How much a click takes, where auto takes too little or too much.",
        kind="word",
        choices=("auto", "small", "medium", "large"),
    )
    same_material: bool = option(
        False, "Of the object only what has the material of a click.", kind="switch"
    )
    exclude: tuple[tuple[float, float], ...] = pixels(
        "A pixel of what is taken away again.", "--exclude"
    )


@dataclass(frozen=True, kw_only=True)
class PictureFile(Run):
    """How a picture is written."""

    # How the file is encoded.
    quality: int | None = option(
        None,
        "Of .jpg (default 95), .webp (90, colour blurred; 100 loses nothing) and .avif (85).",
        kind="whole",
        low=1,
        high=100,
    )
    bits: int | None = option(
        None,
        "A channel, 8 or 16, of .png and .tif; default: the photo's.",
        kind="whole",
        low=8,
        high=16,
    )
    exr_layers: bool = option(
        False,
        "An .exr of many layers: beauty, albedo, diffuse, specular, N, Z, position, ...",
        kind="switch",
    )

    @property
    def encoding(self) -> dict[str, Any]:
        """Keywords of `save_image`."""
        return {"quality": self.quality, "bits": self.bits, "force": self.force}


@dataclass(frozen=True, kw_only=True)
class Rendering(PictureFile):
    """How an edited scene becomes a picture or a film."""

    # How the picture is rendered.
    spp: int = option(
        PATHS,
        "Paths per pixel, of both renderings.",
        kind="whole",
        low=2,
        high=1_000_000,
        called="--spp",
    )
    denoise: bool | None = option(
        None,
        "Clean the renderings (with pyoidn); default: where it is installed.",
        kind="switch",
        flag="--denoise/--no-denoise",
    )
    # The rendering in place of the composite.
    full_render: bool = option(False, "The plain rendering, without the photo.", kind="switch")
    upscale: Any = option(
        None,
        "Your function that enlarges a plain rendering: [h, w, 3] linear to a larger one.",
        kind="function",
        needs="full_render",
        metavar="FILE.py:FUNCTION",
    )
    # What else is written.
    save: Path | None = option(
        None, "Write the edited scene as well.", kind="file", metavar="SCENE2"
    )

    @property
    def compositing(self) -> dict[str, Any]:
        """Keywords of `composite`."""
        names = ("spp", "seed", "full_render", "upscale", "device")
        return {name: getattr(self, name) for name in names} | {
            "denoise": self.denoise is not False
        }
