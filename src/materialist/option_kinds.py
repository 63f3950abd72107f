"""What a field of an options class says of itself (range, unit, help, flag), and how its values are checked.

Values may be given as texts, as a YAML file or a command line has them: "0.3", "310,220", "#ff8800".
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

from materialist.errors import InputError
from materialist.spelling import check_names

Colour = tuple[float, float, float]
"""Linear R, G, B in [0, 1]."""
ON = ("true", "yes", "on", "1")
OFF = ("false", "no", "off", "0")
"""How a text spells a switch."""
Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Option:
    """What is known of one field beside its default."""

    help: str
    kind: str = "number"
    low: float = -math.inf
    high: float = math.inf
    ends: str = "[]"
    """Whether the range includes its ends, as in mathematics."""
    unit: str = ""
    choices: tuple[str, ...] = ()
    """Words that the option takes beside the values of its kind."""
    count: int = 1
    """Of the kind `numbers`: how many."""
    many: bool = False
    called: str = ""
    """Name in messages, where the field's own is not a good one."""
    hint: str = ""
    """What a message about the range ends with."""
    needs: str = ""
    """Field without which this one says nothing."""
    flag: str | None = ""
    """Names on the command line, with spaces; empty for the field's own, None where no command takes it."""
    metavar: str | None = None
    written: bool = True
    """Whether a list of edits may name it."""

    def checked(self, name: str, value: Any) -> Any:
        """The value in the type of the field. Raises InputError that names the value and what may be given."""
        called = self.called or name.replace("_", " ")
        if isinstance(value, str) and value in self.choices:
            return value
        check = _CHECKS[self.kind]
        if self.many:
            return tuple(check(self, called, item) for item in several(value))
        return check(self, called, value)

    def spells(self, name: str) -> list[str]:
        """The flags of the field on the command line."""
        return (self.flag or f"--{name.replace('_', '-')}").split()

    def meaning(self, name: str, default: Any) -> str:
        """A line of a docstring: what the option means, what it takes, and its default."""
        # --- What it takes: words, and a range where it has one ---
        words = [repr(word) for word in self.choices]
        if self.kind in ("number", "whole", "span", "shift") and math.isfinite(self.low):
            span = f"{self.ends[0]}{_text(self.low)}, {_text(self.high)}{self.ends[1]}"
            words.insert(0, f"{self.low:g} or more" if math.isinf(self.high) else span)
        takes = f" Takes {' or '.join(words)}." if words else ""
        return f"{name}: {self.help}{takes} Default: {default!r}."


def option(default: Any, help: str, **facts: Any) -> Any:
    """A field of an options class; `facts` are the other fields of `Option`."""
    return field(default=default, metadata={"option": Option(help, **facts)})


def documented(kind: "type[OperationOptions]") -> Callable[[Function], Function]:
    """Decorate a function that takes the fields of an options class as keywords: its docstring then lists them."""

    def listed(function: Function) -> Function:
        if function.__doc__:
            function.__doc__ = f"{inspect.cleandoc(function.__doc__)}\n\n{_listing(kind)}"
        return function

    return listed


@dataclass(frozen=True, kw_only=True)
class OperationOptions:
    operation: ClassVar[str]

    @property
    def only_in_photo(self) -> bool:
        """Whether the result is a picture in the photo, which no rendering of the scene shows."""
        return False

    def __new__(cls, **values: Any) -> Self:
        """Raises InputError for a name that is no option."""
        check_names(values, declarations(cls), getattr(cls, "operation", cls.__name__))
        return super().__new__(cls)

    def __init_subclass__(cls) -> None:
        """The docstring of the class lists its options."""
        if cls.__doc__:
            cls.__doc__ = f"{inspect.cleandoc(cls.__doc__)}\n\n{_listing(cls)}"

    def __post_init__(self) -> None:
        for name, (declared, default) in declarations(type(self)).items():
            value = getattr(self, name)
            # None is a value only where it is the default: such an option may be left out.
            if value is not None or default is not None:
                object.__setattr__(self, name, declared.checked(name, value))

    @classmethod
    def merged(cls, options: Self | None = None, **values: Any) -> Self:
        """`options`, or the defaults, with these values instead. Raises InputError for a name that is no option."""
        return replace(options or cls(), **values)

    @classmethod
    def read(
        cls,
        texts: Mapping[str, Any],
        *,
        folder: Path = Path(),
        flags: bool = False,
        **defaults: Any,
    ) -> Self:
        """The options that a file in `folder` or a command line (`flags`) names: texts, and lists of texts.

        Raises InputError as the class does, and for an option that says nothing without another one.
        """
        values = dict(texts)
        known = declarations(cls)
        for name, (declared, default) in known.items():
            if name not in values:
                continue
            if declared.needs and declared.needs not in values and values[name] != default:
                needed = declared.needs
                this = declared.spells(name)[0] if flags else name
                other = known[needed][0].spells(needed)[0] if flags else needed
                raise InputError(
                    f"{this} says nothing without {other}; give that, too, or leave {this} out."
                )
            # Files are named relative to the list of edits that names them.
            if declared.kind == "file" and values[name] not in declared.choices:
                values[name] = beside(folder, name, values[name])
        return cls.merged(cls(**defaults), **values)


def declarations(kind: type[OperationOptions]) -> dict[str, tuple[Option, Any]]:
    """Name of a field -> (what is known of it, its default); the fields of the class itself come first."""
    inherited = {entry.name for base in kind.__bases__ for entry in fields(base)}
    ordered = sorted(fields(kind), key=lambda entry: entry.name in inherited)
    return {entry.name: (entry.metadata["option"], entry.default) for entry in ordered}


def _listing(kind: type[OperationOptions]) -> str:
    """The options of a class as lines of a docstring; `kind` need not be a dataclass yet."""
    # A dataclass has its fields in `__dataclass_fields__`; before that they are its attributes.
    declared = {name: value for name, value in vars(kind).items() if isinstance(value, Field)}
    inherited = getattr(kind, "__dataclass_fields__", {})
    # Fields of the class itself come first.
    entries = declared | {**inherited, **declared}
    lines = []
    for name, entry in entries.items():
        if "option" in entry.metadata:
            lines.append(f"    {entry.metadata['option'].meaning(name, entry.default)}")
    return "\n".join(["Options:", *lines])


def beside(folder: Path, name: str, value: Any) -> Path:
    """A file that an option names, relative to `folder`. Raises InputError unless the value is a text."""
    if not isinstance(value, str | Path):
        raise InputError(f"The {name} must be a file name, not {value!r}.")
    return folder / value


def several(value: Any) -> list[Any]:
    """A single value, or a list of them: of lists, of texts such as 310,220, or of objects; also from an array."""
    value = getattr(value, "tolist", lambda: value)()
    plural = isinstance(value, list | tuple) and all(
        not isinstance(item, str | Real) or "," in str(item) for item in value
    )
    return list(value) if plural else [value]


def parse_numbers(value: Any, count: int, called: str) -> tuple[float, ...]:
    """`count` numbers from a sequence, or from a text such as 310,220. Raises InputError."""
    parts = value.split(",") if isinstance(value, str) else value
    try:
        values = tuple(float(part) for part in parts)
    except (TypeError, ValueError, OverflowError):
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(
            f"The {called} must be {count} numbers, with commas between them, not {value!r}."
        )
    return values


def parse_colour(colour: Any, name: str = "albedo") -> Colour:
    """Linear (R, G, B) from three linear numbers, a text "R,G,B" of them, or "#rrggbb" in sRGB.

    Raises InputError, which says what colour of what `name`.
    """
    # --- "#rrggbb" is sRGB as in every editor; numbers are linear ---
    if isinstance(colour, str) and colour.startswith("#"):
        import numpy as np

        from materialist.color import srgb_to_linear

        if not re.fullmatch("#[0-9a-fA-F]{6}", colour):
            raise InputError(f"The {name} {colour!r} must look like #ff8800.")
        levels = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)], np.float32)
        colour = srgb_to_linear(levels)
    try:
        r, g, b = (float(c) for c in (colour.split(",") if isinstance(colour, str) else colour))
    except (TypeError, ValueError):
        r = g = b = math.nan
    if not all(0 <= c <= 1 for c in (r, g, b)):
        raise InputError(
            f"The {name} {colour!r} must be R,G,B with three numbers in [0, 1], or #rrggbb."
        )
    return r, g, b


def _number(declared: Option, called: str, value: Any) -> Any:
    """A finite number in the range; a whole one stays whole."""
    low = declared.low
    high = declared.high
    ends = declared.ends
    try:
        # True is no 1: a switch that was meant is an error.
        if isinstance(value, bool):
            raise TypeError
        # A whole number stays one, so that messages and files show it as it was given.
        number = float(value)
        number = value if isinstance(value, int) else number
    except (TypeError, ValueError, OverflowError) as error:
        or_else = "".join(f", or {word}" for word in declared.choices)
        raise InputError(f"The {called} must be a number{or_else}, not {value!r}.") from error
    # Ends that do not belong to the range, by its brackets.
    excluded = [end for end, mark in zip((low, high), ends) if mark in "()"]
    if not (math.isfinite(number) and low <= number <= high) or number in excluded:
        span = (
            f"it must lie in {ends[0]}{_text(low)}, {_text(high)}{ends[1]} {declared.unit}".rstrip()
        )
        tail = f"{span} {declared.hint}".rstrip() if math.isfinite(low) else "give a finite number"
        raise InputError(f"The {called} is {_text(number)}; {tail}.")
    return number


def _text(number: float) -> str:
    return f"{int(number)}" if math.isfinite(number) and number == int(number) else f"{number:g}"


def _span(declared: Option, called: str, value: Any) -> Any:
    """A number, or the two that a film goes through: a pair, or a text such as 30..90."""
    ends = value.split("..") if isinstance(value, str) else value
    # So that the message of a wrong value names this form.
    declared = replace(declared, choices=("A..B",))
    if isinstance(ends, list | tuple) and len(ends) == 2:
        return tuple(_number(declared, called, end) for end in ends)
    return _number(declared, called, value)


def _whole(declared: Option, called: str, value: Any) -> int:
    number = _number(declared, called, value)
    if number != int(number):
        raise InputError(f"The {called} is {number:g}; give a whole number.")
    return int(number)


def _shift(declared: Option, called: str, value: Any) -> float | str:
    """A number in the range, or a text with a sign that shifts by as much as the range is wide."""
    # A sign makes it a shift; a number without one sets the value.
    if isinstance(value, str) and value.strip()[:1] in ("+", "-"):
        width = declared.high - declared.low
        _number(replace(declared, low=-width, high=width), f"{called} shift", value)
        return value.strip()
    return _number(replace(declared, choices=("a shift such as +0.5",)), called, value)


def _paint(declared: Option, called: str, value: Any) -> str:
    """A text that names a colour, for what takes other words as well."""
    text = ",".join(str(part) for part in value) if isinstance(value, list | tuple) else str(value)
    try:
        parse_colour(text)
    except InputError as error:
        known = ", ".join(declared.choices)
        raise InputError(
            f"The {called} is {text!r}; give {known}, R,G,B in [0, 1], or #rrggbb."
        ) from error
    return text


def _switch(declared: Option, called: str, value: Any) -> bool | str:
    text = str(value).lower()
    if text in declared.choices:
        return text
    if text not in (*ON, *OFF):
        or_else = "".join(f", or {word}" for word in declared.choices)
        raise InputError(f"The {called} must be true or false{or_else}, not {value!r}.")
    return text in ON


def _word(declared: Option, called: str, value: Any) -> str:
    known = ", ".join(repr(word) if "," in word else word for word in declared.choices)
    raise InputError(f"The {called} is '{value}'; choose one of {known}.")


def _size(declared: Option, called: str, value: Any) -> tuple[int, int]:
    """(width, height) of an environment map, from a pair or a text such as 512x256."""
    parts = re.split("[xX×]", value) if isinstance(value, str) else value
    try:
        width, height = (_whole(declared, called, part) for part in parts)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"The {called} must look like 512x256, not {value!r}.") from error
    # Twice as wide as high: equirectangular.
    if width != 2 * height or not 8 <= height <= 4096:
        raise InputError(
            f"The {called} is {width}x{height}; it must be twice as wide as high, from 16x8 to 8192x4096."
        )
    return width, height


def _lamp(declared: Option, called: str, value: Any) -> Any:
    """A lamp itself, or what `materialist.lamp` makes one of."""
    return parse_numbers(value, 5, called) if isinstance(value, str | list | tuple) else value


def _function(declared: Option, called: str, value: Any) -> Any:
    """A function itself, or one that a text such as FILE.py:FUNCTION names; the file is run."""
    if callable(value):
        return value
    from runpy import run_path

    # From the right: Windows paths have a colon, too.
    path, _, name = str(value).rpartition(":")
    if not Path(path).is_file():
        raise InputError(
            f"The {called} is {value}; give FILE.py:FUNCTION, with a file that is there."
        )
    try:
        function = run_path(path).get(name)
    except Exception as error:  # whatever a user's file raises
        raise InputError(
            f"The {called} {path} cannot be run: {type(error).__name__}: {error}."
        ) from error
    if not callable(function):
        raise InputError(f"The {called} {path} has no function '{name}'; write FILE.py:FUNCTION.")
    return function


_CHECKS: dict[str, Callable[[Option, str, Any], Any]] = {
    "number": _number,
    "span": _span,
    "function": _function,
    "whole": _whole,
    "shift": _shift,
    "numbers": lambda declared, called, value: parse_numbers(value, declared.count, called),
    "colour": lambda declared, called, value: parse_colour(value, called),
    "paint": _paint,
    "switch": _switch,
    "word": _word,
    "size": _size,
    "lamp": _lamp,
    "file": lambda declared, called, value: value,
    "any": lambda declared, called, value: value,
    "name": lambda declared, called, value: value if callable(value) else str(value),
}
