"""Options that several commands share, and the values they may take."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Annotated

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

    planes_backs = "planes,backs"
    planes = "planes"
    none = "none"


class Strategy(StrEnum):
    """The paper's per-image strategies."""

    default = "default"
    white_light_first = "white-light-first"


Seed = Annotated[int, typer.Option(help="Random seed: the same seed on the same machine gives the same result.")]
DeviceOption = Annotated[Device, typer.Option(help="Where to compute; auto takes the GPU when there is one.")]
Json = Annotated[bool, typer.Option("--json", help="Print the outcome as one line of JSON, the last on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the output when it exists.")]


def parse_size(text: str) -> tuple[int, int]:
    """An envmap size such as 512x256 as (width, height). Raises InputError unless it is 2:1 and at least 8x4."""
    match = re.fullmatch(r"(\d+)\s*[xX×]\s*(\d+)", text.strip())
    if match is None:
        raise InputError(f"The envmap size must look like 512x256, not {text!r}.")
    width, height = int(match[1]), int(match[2])
    if width != 2 * height or not 4 <= height <= 4096:
        raise InputError(f"The envmap must be twice as wide as high, from 8x4 to 8192x4096, not {width}x{height}.")
    return width, height
