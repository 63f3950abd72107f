"""Commands whose flags come from dataclasses: a parameter that is a dataclass becomes one flag for each field."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass
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
    flags: list[inspect.Parameter] = []
    groups: list[_Group] = []
    for parameter in named.values():
        kind: Any = hints[parameter.name]
        if is_dataclass(kind):
            group = _Group(parameter.name, kind, _flags(kind, parameter.default, set(named)))
            groups.append(group)
            flags += group.flags
        else:
            flags.append(parameter.replace(annotation=kind, kind=inspect.Parameter.KEYWORD_ONLY))

    @wraps(function)
    def command(**values: Any) -> Any:
        made = {group.name: group.build(values) for group in groups}
        return function(**{key: value for key, value in values.items() if key in named} | made)

    command.__signature__ = inspect.Signature(flags)  # type: ignore[attr-defined]
    command.__annotations__ = {flag.name: flag.annotation for flag in flags}
    app.command(name or function.__name__, **settings)(command)


@dataclass(frozen=True)
class _Group:
    """A dataclass parameter and the flags that stand for it."""

    name: str
    kind: Any
    flags: list[inspect.Parameter]

    def build(self, values: dict[str, Any]) -> Any:
        own = {flag.name: values[flag.name] for flag in self.flags}
        if not issubclass(self.kind, OperationOptions):
            return self.kind(**own)
        known = declarations(self.kind)
        absent = lambda value: value is None or value is False or value == []  # noqa: E731
        given = {key: value for key, value in own.items() if key in known and not absent(value)}
        for key in own.keys() - known.keys():  # the flag of a word that a switch also takes
            if own[key]:
                field, _, word = key.partition("__")
                given[field] = word
        shared = {key: values[key] for key, (told, _) in known.items() if told.flag is None and key in values}
        return self.kind.read(given, flags=True, **shared)


def _flags(kind: Any, given: Any, taken: set[str]) -> list[inspect.Parameter]:
    """The flags of a dataclass; `given` is an instance with other defaults, `taken` holds names of other parameters."""
    if issubclass(kind, OperationOptions):
        declared = {name: told for name, told in declarations(kind).items() if name not in taken}
        return [flag for name, (told, default) in declared.items() for flag in _option_flags(name, told, default)]
    hints = get_type_hints(kind, include_extras=True)
    found = []
    for field in fields(kind):
        default = getattr(given, field.name) if is_dataclass(given) else field.default
        empty = inspect.Parameter.empty if default is MISSING else default
        found.append(_parameter(field.name, hints[field.name], empty))
    return found


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
