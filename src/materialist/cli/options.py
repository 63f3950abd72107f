"""Flags that several commands share, and groups of them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.options import InvertOptions


class Device(StrEnum):
    """Where to compute."""

    auto = "auto"
    cpu = "cpu"
    cuda = "cuda"


class Method(StrEnum):
    """How a region is found."""

    network = "network"
    grabcut = "grabcut"
    sam2 = "sam2"


def output_option(metavar: str, help: str) -> Any:
    """The -o of a command that writes `metavar`."""
    return typer.Option("-o", "--output", metavar=metavar, help=help)


def help_of(name: str) -> str:
    """The help of an option of `invert`, for other commands that take it."""
    return str(InvertOptions.__dataclass_fields__[name].metadata["option"].help)


Seed = Annotated[
    int,
    typer.Option(min=0, max=2**31 - 1, help="Random seed: the same seed on the same machine gives the same result."),
]
DeviceOption = Annotated[Device, typer.Option(help="Where to compute; auto takes the GPU when there is one.")]
Json = Annotated[bool, typer.Option("--json", help="Print the outcome as one line of JSON, the last on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the output when it exists.")]
FieldOfView = Annotated[str, typer.Option(help=help_of("fov"))]
WorkingSize = Annotated[int, typer.Option(help=help_of("size"))]
SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="A scene package.")]
PictureOutput = Annotated[Path, output_option("OUT", "A .png (as deep as the photo) or .exr (linear, HDR).")]
FramesPerSecond = Annotated[int, typer.Option(help="Frames per second.")]


@dataclass(frozen=True)
class Run:
    """What every command that writes a result takes."""

    seed: Seed = 0
    device: DeviceOption = Device.auto
    as_json: Json = False
    force: Force = False


@dataclass(frozen=True)
class Place:
    """A region of the photo."""

    mask: Annotated[Path | None, typer.Option("--mask", metavar="PNG", help="The region: white inside.")] = None
    click: Annotated[
        list[str] | None,
        typer.Option("--click", metavar="X,Y", help="A pixel of the object, at working size; more than one helps."),
    ] = None
    box: Annotated[str | None, typer.Option("--box", metavar="X0,Y0,X1,Y1", help="A box around the object.")] = None

    @property
    def named(self) -> list[str]:
        """The flags that were given."""
        return [f"--{name}" for name in ("click", "box", "mask") if getattr(self, name)]


@dataclass(frozen=True)
class Region(Place):
    """A region of the photo, found as one likes."""

    method: Annotated[
        Method,
        typer.Option("--with", help="network: edges and ClickNet; grabcut: edges alone; sam2 needs its weights."),
    ] = Method.network


@dataclass(frozen=True)
class Rendering:
    """How an edited scene becomes a picture."""

    spp: Annotated[
        int | None,
        typer.Option(help="Paths per pixel, of both renderings; else 256 for glass and other light, 128 for the rest."),
    ] = None
    denoise: Annotated[bool, typer.Option("--denoise/--no-denoise", help="Clean the renderings (with pyoidn).")] = True
    full_render: Annotated[bool, typer.Option("--full-render", help="The plain rendering, without the photo.")] = False
    save: Annotated[Path | None, typer.Option("--save", metavar="SCENE2", help="Write the edited scene as well.")] = (
        None
    )


@dataclass(frozen=True)
class Training:
    """How long a network is trained, and where the run goes on."""

    steps: Annotated[int | None, typer.Option(help="Train this many steps more.")] = None
    minutes: Annotated[float | None, typer.Option(help="Train this many minutes more.")] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in RUN, if there is one.")] = False
    every: Annotated[float, typer.Option(help="Seconds between checkpoints.")] = 180
    seed: Seed = 0
    device: DeviceOption = Device.auto
    as_json: Json = False


@dataclass(frozen=True)
class Learning:
    """How a network learns."""

    batch: Annotated[int, typer.Option(help="Samples a step.")] = 16
    rate: Annotated[float, typer.Option(help="Peak learning rate.")] = 1.5e-3
    bfloat16: Annotated[bool, typer.Option("--bfloat16", help="Half as long on processors that have it.")] = False
    init: Annotated[Path | None, typer.Option(help="Weights of an earlier run to begin from.")] = None
