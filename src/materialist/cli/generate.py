"""Commands whose flags come from options classes: a parameter of such a class becomes one flag for each field."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import typer

from materialist.option_kinds import OperationOptions, Option, declarations

TYPES: dict[str, Any] = {"number": float, "whole": int, "switch": bool, "file": Path}


def group(name: str, help: str, app: typer.Typer | None = None, **settings: Any) -> typer.Typer:
    """A group of commands, of `app` where one is given; `settings` are other ones of typer."""
    made = typer.Typer(
        name=name,
        help=help,
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        **settings,
    )
    if app is not None:
        app.add_typer(made)
    return made


def add_command(
    app: typer.Typer, function: Callable[..., Any], name: str = "", **settings: Any
) -> None:
    """Register a function as the command of its name, its parameters of options classes spelled out as flags.

    Options are read from what was given; fields without a flag take the value of the other parameters of that name.
    """
    hints = get_type_hints(function, include_extras=True)
    named = inspect.signature(function).parameters
    taken = {key for key in named if not _is_options(hints[key])}
    flags = {key: _flags(hints[key], parameter, taken) for key, parameter in named.items()}

    @wraps(function)
    def command(**values: Any) -> Any:
        return function(
            **{key: _value(hints[key], named[key], own, values) for key, own in flags.items()}
        )

    every = [flag for own in flags.values() for flag in own]
    command.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    command.__annotations__ = {flag.name: flag.annotation for flag in every}
    app.command(name or function.__name__, **settings)(command)


def _is_options(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, OperationOptions)


def _usual(parameter: inspect.Parameter) -> dict[str, Any]:
    """Other defaults of the fields, where the parameter has a default."""
    return dict(vars(parameter.default)) if isinstance(parameter.default, OperationOptions) else {}


def _flags(kind: Any, parameter: inspect.Parameter, taken: set[str]) -> list[inspect.Parameter]:
    """The flags of a parameter; an option whose name is `taken` by another one gets its value from the function."""
    if not _is_options(kind):
        return [_parameter(parameter.name, kind, parameter.default)]
    declared = {name: told for name, told in declarations(kind).items() if name not in taken}
    usual = {name: default for name, (_, default) in declared.items()} | _usual(parameter)
    return [
        flag
        for name, (told, _) in declared.items()
        for flag in _option_flags(name, told, usual[name])
    ]


def _value(
    kind: Any, parameter: inspect.Parameter, flags: list[inspect.Parameter], values: dict[str, Any]
) -> Any:
    """The argument that the flags of a parameter spell."""
    own = {flag.name: values[flag.name] for flag in flags}
    if not _is_options(kind):
        return own[flags[0].name]
    given = {}
    for key, value in own.items():
        if value is not None and value != []:
            field, _, word = key.partition("__")  # the flag of a word that a switch also takes
            given[field] = word or value
    unspelled = (key for key, (told, _) in declarations(kind).items() if told.flag is None)
    shared = {key: values[key] for key in unspelled if values.get(key) is not None}
    return kind.read(given, flags=True, **(_usual(parameter) | shared))


def _option_flags(name: str, told: Option, default: Any) -> list[inspect.Parameter]:
    """The flag of an option, and one for each word that a switch takes beside; none for an option without flags."""
    if told.flag is None:
        return []
    if told.kind == "switch":
        help = f"{told.help}  [default: on]" if default is True else told.help
        texts = {name: (told.spells(name), help)}
        texts |= {
            f"{name}__{word}": ([f"--{word}"], f"{told.help[:-1]}, {word}.")
            for word in told.choices
        }
        return [_parameter(key, _flag(bool | None, *text), None) for key, text in texts.items()]
    kind: Any = str if told.choices else TYPES.get(told.kind, str)
    if told.kind == "word":
        kind = Literal[told.choices]
    shown = _shown("auto" if default is None and "auto" in told.choices else default)
    help = f"{told.help}  [default: {shown}]" if shown else told.help
    several = list[kind] | None if told.many else kind | None
    return [_parameter(name, _flag(several, told.spells(name), help, metavar=told.metavar), None)]


def _flag(kind: Any, names: list[str], help: str, **settings: Any) -> Any:
    return Annotated[kind, typer.Option(*names, help=help, **settings)]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


def _shown(default: Any) -> str | bool:
    if isinstance(default, tuple):
        whole = bool(default) and all(isinstance(one, int) for one in default)
        return ("x" if whole else ",").join(f"{one:g}" for one in default) or False
    return False if default is None else str(default)
