"""Commands whose flags come from dataclasses: a parameter that is a dataclass becomes one flag for each field."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from materialist.option_kinds import OperationOptions, Option, declarations

TYPES: dict[str, Any] = {"number": float, "whole": int, "switch": bool, "file": Path}
"""Kind of an option -> type of its flag; texts for the others."""


def add_command(app: typer.Typer, function: Callable[..., Any], name: str = "", **settings: Any) -> None:
    """Register a function as the command of its name, its dataclass parameters spelled out as flags.

    Fields of a plain dataclass have typer's annotations; flags of an options class follow from `Option`. Options are
    read from what was given; fields without a flag take the value of the other parameters of the same name.
    """
    hints = get_type_hints(function, include_extras=True)
    named = inspect.signature(function).parameters
    flags = {key: _flags(hints[key], parameter, set(named)) for key, parameter in named.items()}

    @wraps(function)
    def command(**values: Any) -> Any:
        return function(**{key: _value(hints[key], own, values) for key, own in flags.items()})

    every = [flag for own in flags.values() for flag in own]
    command.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    command.__annotations__ = {flag.name: flag.annotation for flag in every}
    app.command(name or function.__name__, **settings)(command)


def _flags(kind: Any, parameter: inspect.Parameter, taken: set[str]) -> list[inspect.Parameter]:
    """The flags of a parameter; the default of a dataclass is an instance with other defaults of its fields.

    An option whose name is `taken` by another parameter gets its value from the function.
    """
    if not hasattr(kind, "__dataclass_fields__"):
        return [_parameter(parameter.name, kind, parameter.default)]
    if issubclass(kind, OperationOptions):
        declared = {name: told for name, told in declarations(kind).items() if name not in taken}
        return [flag for name, (told, default) in declared.items() for flag in _option_flags(name, told, default)]
    hints, given = get_type_hints(kind, include_extras=True), parameter.default
    defaults = {one.name: getattr(given, one.name) if is_dataclass(given) else one.default for one in fields(kind)}
    return [
        _parameter(name, hints[name], inspect.Parameter.empty if default is MISSING else default)
        for name, default in defaults.items()
    ]


def _value(kind: Any, flags: list[inspect.Parameter], values: dict[str, Any]) -> Any:
    """The argument that the flags of a parameter spell."""
    own = {flag.name: values[flag.name] for flag in flags}
    if not hasattr(kind, "__dataclass_fields__"):
        return own[flags[0].name]
    if not issubclass(kind, OperationOptions):
        return kind(**own)
    known: dict[str, tuple[Option, Any]] = declarations(kind)
    given = {}
    for key, value in own.items():
        if value is not None and value is not False and value != []:
            field, _, word = key.partition("__")  # the flag of a word that a switch also takes
            given[field] = word or value
    shared = {key: values[key] for key, (told, _) in known.items() if told.flag is None and key in values}
    return kind.read(given, flags=True, **shared)


def _option_flags(name: str, told: Option, default: Any) -> list[inspect.Parameter]:
    """The flag of an option, and one for each word that a switch takes beside; none for an option without flags."""
    if told.flag is None:
        return []
    if told.kind == "switch":
        words = [
            _parameter(f"{name}__{w}", _flag(bool, [f"--{w}"], f"{told.help[:-1]}, {w}."), False) for w in told.choices
        ]
        return [_parameter(name, _flag(bool, told.spells(name), told.help), False), *words]
    kind: Any = str if told.choices else TYPES.get(told.kind, str)
    if told.kind == "word":
        make: Any = StrEnum  # of a name that is not a literal
        kind = make(name, {word: word for word in told.choices})
    shown = _shown("auto" if default is None and "auto" in told.choices else default)
    help = f"{told.help}  [default: {shown}]" if shown else told.help
    several = list[kind] | None if told.many else kind | None
    return [_parameter(name, _flag(several, told.spells(name), help, metavar=told.metavar), None)]


def _flag(kind: Any, names: list[str], help: str, **settings: Any) -> Any:
    return Annotated[kind, typer.Option(*names, help=help, **settings)]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _shown(default: Any) -> str | bool:
    """A default as the help shows it."""
    if isinstance(default, tuple):
        whole = bool(default) and all(isinstance(one, int) for one in default)
        return ("x" if whole else ",").join(f"{one:g}" for one in default) or False
    return False if default is None else str(default)
