"""The bodies of requests, checked: a body with another key, or another type, is refused with its name."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Name = Annotated[str, Field(max_length=100)]
Place = tuple[Number, Number]
"""(x, y) in working pixels."""
Numbers = Annotated[list[Number], Field(max_length=16)]
Value = bool | Number | Annotated[str, Field(max_length=60)] | Numbers | None
"""Of an option; None clears it."""


class RequestBody(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Nothing(RequestBody):
    """No body at all, or an empty object."""


class Start(RequestBody):
    """A photo to be taken apart: an upload by its id, or an example by its name."""

    file: Name | None = None
    example: Name | None = None
    size: Annotated[int, Field(ge=64, le=1024)] = 512
    predictor: Name = "auto"
    fov: Annotated[str, Field(max_length=10)] = "auto"


class Named(RequestBody):
    project: Name


class Renamed(Named):
    title: Annotated[str, Field(min_length=1, max_length=60)]


class Numbered(RequestBody):
    number: int


class Pick(RequestBody):
    tool: Literal["click", "box", "brush"]
    mode: Literal["new", "add", "remove"] = "new"
    at: Annotated[list[Number], Field(max_length=4)] = []
    points: Annotated[list[Place], Field(max_length=20_000)] = []
    radius: Number = 1.0


class Resized(RequestBody):
    larger: bool


class Pointed(RequestBody):
    at: Place


class Options(RequestBody):
    """Options of an edit over the selection, or of the light, or of an object."""

    kind: Literal["edit", "glass", "remove", "relight", "insert"]
    options: Annotated[dict[Name, Value], Field(max_length=20)]
    coarse: bool = False
    quiet: bool = False
    """The page draws the change itself; it wants no picture yet."""


class File(RequestBody):
    """An upload that an edit uses."""

    option: Literal["texture", "envmap", "mesh"]
    file: Name


class Chosen(RequestBody):
    """Something that the studio computes: an environment, or an object of the library."""

    name: Name | None


class NewLamp(RequestBody):
    at: Place
    kelvin: Annotated[float, Field(ge=1000, le=20_000)] = 2700.0
    power: Annotated[float, Field(ge=0, le=100)] = 1.0
    before: Annotated[float, Field(gt=0, lt=1)] = 0.75


class MovedLamp(RequestBody):
    """A lamp moved or changed, [x, y, depth, kelvin, power], or taken away (None)."""

    index: Annotated[int, Field(ge=0, le=50)]
    lamp: Annotated[list[Number], Field(min_length=5, max_length=5)] | None
    quiet: bool = False


class Put(RequestBody):
    at: Place
    quiet: bool = False


class Fall(RequestBody):
    height: Annotated[float, Field(ge=0, le=100)] = 1.5


class Act(RequestBody):
    action: Literal["toggle", "up", "down", "remove", "choose"]
    index: Annotated[int, Field(ge=0, le=1000)]


class Undo(RequestBody):
    again: bool = False


class Take(RequestBody):
    kind: Name


class LoadedList(RequestBody):
    file: Name


def complaint(error: ValidationError) -> str:
    """The first thing that is wrong with a body, in a sentence."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    place = ".".join(str(part) for part in first["loc"][:3])
    reason = first["msg"][:1].lower() + first["msg"][1:]
    return f"The request cannot be read: {place or 'its body'}: {reason}."
