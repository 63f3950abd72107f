"""Options that several commands share, and the values they may take."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.errors import InputError


class Device(StrEnum):
    """Where to compute."""

    auto = "auto"
    cpu = "cpu"
    cuda = "cuda"


class Engine(StrEnum):
    """How the fit renders."""

    transport = "transport"
    path = "path"


class Preset(StrEnum):
    """Which schedule the fit follows."""

    default = "default"
    paper = "paper"


class Completion(StrEnum):
    """How what the picture does not show is continued."""

    auto = "auto"
    planes = "planes"
    floors = "floors"
    none = "none"
    planes_backs = "planes,backs"
    floors_backs = "floors,backs"


class Strategy(StrEnum):
    """The paper's per-image strategies."""

    default = "default"
    white_light_first = "white-light-first"


class Method(StrEnum):
    """How a region is found."""

    network = "network"
    grabcut = "grabcut"
    sam2 = "sam2"


def output_option(metavar: str, help: str) -> Any:
    """The -o of a command that writes `metavar`."""
    return typer.Option("-o", "--output", metavar=metavar, help=help)


# Every command.
Seed = Annotated[
    int,
    typer.Option(min=0, max=2**31 - 1, help="Random seed: the same seed on the same machine gives the same result."),
]
DeviceOption = Annotated[Device, typer.Option(help="Where to compute; auto takes the GPU when there is one.")]
Json = Annotated[bool, typer.Option("--json", help="Print the outcome as one line of JSON, the last on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the output when it exists.")]

# A photo, or a scene.
FieldOfView = Annotated[str, typer.Option(help="Horizontal field of view in degrees, or auto: EXIF, else 35.")]
WorkingSize = Annotated[int, typer.Option(help="Working size: longer side, pixels.")]
SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="A scene package.")]

# A region of the photo.
Clicks = Annotated[
    list[str] | None,
    typer.Option("--click", metavar="X,Y", help="A pixel of the object, at working size; more than one helps."),
]
Box = Annotated[str | None, typer.Option("--box", metavar="X0,Y0,X1,Y1", help="A box around the object.")]
MaskFile = Annotated[Path | None, typer.Option("--mask", metavar="PNG", help="The region: white inside.")]
With = Annotated[
    Method, typer.Option("--with", help="network: edges and ClickNet; grabcut: edges alone; sam2 needs its weights.")
]

# What was behind it.
Background = Annotated[
    Path | None, typer.Option(metavar="PNG", help="The same view without the object, in place of inpainting.")
]
Inpainter = Annotated[
    str | None, typer.Option("--inpaint", metavar="sd:MODEL", help="A diffusion model: a folder, or owner/name.")
]
Shadow = Annotated[
    str,
    typer.Option(
        metavar="auto|S",
        help="Fill its shadow and reflection on the ground, too: where they are found, or by this share of its size.",
    ),
]

# A mesh that joins the scene.
MESH_FILES = "OBJ, PLY, STL, glTF or GLB."
MeshMaterial = Annotated[str, typer.Option(help="as-is, glass, mirror, R,G,B (linear) or #rrggbb.")]

# An edited picture, or a film of them.
PictureOutput = Annotated[Path, output_option("OUT", "A .png (as deep as the photo) or .exr (linear, HDR).")]
Spp = Annotated[int, typer.Option(help="Paths per pixel, of each of the two renderings.")]
Denoise = Annotated[bool, typer.Option("--denoise/--no-denoise", help="Clean the renderings (with pyoidn).")]
FullRender = Annotated[bool, typer.Option("--full-render", help="The plain rendering, without the photo.")]
Save = Annotated[Path | None, typer.Option("--save", metavar="SCENE2", help="Write the edited scene as well.")]
FramesPerSecond = Annotated[int, typer.Option(help="Frames per second.")]

# Training.
ResumeRun = Annotated[bool, typer.Option("--resume", help="Go on with the run in RUN, if there is one.")]
Steps = Annotated[int | None, typer.Option(help="Train this many steps more.")]
Batch = Annotated[int, typer.Option(help="Samples a step.")]
Rate = Annotated[float, typer.Option(help="Peak learning rate.")]
Bfloat16 = Annotated[bool, typer.Option("--bfloat16", help="Half as long on processors that have it.")]
Minutes = Annotated[float | None, typer.Option(help="Train this many minutes more.")]
CheckpointSeconds = Annotated[float, typer.Option(help="Seconds between checkpoints.")]


def parse_size(text: str) -> tuple[int, int]:
    """An envmap size such as 512x256 as (width, height). Raises InputError unless it is 2:1 and at least 16x8."""
    match = re.fullmatch(r"(\d+)\s*[xX×]\s*(\d+)", text.strip())
    if match is None:
        raise InputError(f"The envmap size must look like 512x256, not {text!r}.")
    width, height = int(match[1]), int(match[2])
    if width != 2 * height or not 8 <= height <= 4096:
        raise InputError(f"The envmap must be twice as wide as high, from 16x8 to 8192x4096, not {width}x{height}.")
    return width, height
