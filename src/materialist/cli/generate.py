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
    app_group = typer.Typer(
        name=name,
        help=help,
        no_args_is_help=True,
        add_completion=app is None,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        **settings,
    )
    if app is not None:
        app.add_typer(app_group)
    return app_group


def add_command(
    app: typer.Typer, function: Callable[..., Any], name: str = "", **settings: Any
) -> None:
    """Register a function as the command of its name, its parameters of options classes spelled out as flags.

    Options are read from what was given; fields without a flag take the value of the other parameters of that name.
    """
    # --- Which parameters are options classes, and the flags of all parameters ---
    hints = get_type_hints(function, include_extras=True)
    named = inspect.signature(function).parameters
    taken = {key for key in named if not _is_options(hints[key])}
    flags = {key: _flags(hints[key], parameter, taken) for key, parameter in named.items()}

    @wraps(function)
    def command(**values: Any) -> Any:
        return function(
            **{
                key: _value(hints[key], named[key], parameter_flags, values)
                for key, parameter_flags in flags.items()
            }
        )

    every = [flag for parameter_flags in flags.values() for flag in parameter_flags]
    # Typer reads the signature: there each flag is a parameter of its own.
    command.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    command.__annotations__ = {flag.name: flag.annotation for flag in every}
    app.command(name or function.__name__, **settings)(command)


def _is_options(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, OperationOptions)


def _defaults(parameter: inspect.Parameter) -> dict[str, Any]:
    """Other defaults of the fields, where the parameter has a default."""
    return dict(vars(parameter.default)) if isinstance(parameter.default, OperationOptions) else {}


def _flags(kind: Any, parameter: inspect.Parameter, taken: set[str]) -> list[inspect.Parameter]:
    """The flags of a parameter; an option whose name is `taken` by another one gets its value from the function."""
    if not _is_options(kind):
        return [_parameter(parameter.name, kind, parameter.default)]
    declared = {name: entry for name, entry in declarations(kind).items() if name not in taken}
    defaults = {name: default for name, (_, default) in declared.items()} | _defaults(parameter)
    flags = []
    for name, (declaration, _) in declared.items():
        flags += _option_flags(name, declaration, defaults[name])
    return flags


def _value(
    kind: Any, parameter: inspect.Parameter, flags: list[inspect.Parameter], values: dict[str, Any]
) -> Any:
    """The argument that the flags of a parameter spell."""
    flag_values = {flag.name: values[flag.name] for flag in flags}
    if not _is_options(kind):
        return flag_values[flags[0].name]
    spelled = {}
    for key, value in flag_values.items():
        # Flags that were not given say nothing.
        if value is not None and value != []:
            field, _, word = key.partition("__")  # the flag of a word that a switch also takes
            spelled[field] = word or value
    unspelled = (
        key for key, (declaration, _) in declarations(kind).items() if declaration.flag is None
    )
    shared = {key: values[key] for key in unspelled if values.get(key) is not None}
    return kind.read(spelled, flags=True, **(_defaults(parameter) | shared))


def _option_flags(name: str, declared: Option, default: Any) -> list[inspect.Parameter]:
    """The flag of an option, and one for each word that a switch takes beside; none for an option without flags."""
    if declared.flag is None:
        return []
    # --- A switch: a flag of its own, and one for each further word ---
    if declared.kind == "switch":
        help = f"{declared.help}  [default: on]" if default is True else declared.help
        texts = {name: (declared.spells(name), help)}
        texts |= {
            f"{name}__{word}": ([f"--{word}"], f"{declared.help[:-1]}, {word}.")
            for word in declared.choices
        }
        return [_parameter(key, _flag(bool | None, *text), None) for key, text in texts.items()]
    # --- A value: of the option's type, or one of its words ---
    kind: Any = str if declared.choices else TYPES.get(declared.kind, str)
    if declared.kind == "word":
        kind = Literal[declared.choices]
    shown = _shown("auto" if default is None and "auto" in declared.choices else default)
    help = f"{declared.help}  [default: {shown}]" if shown else declared.help
    several = list[kind] | None if declared.many else kind | None
    return [
        _parameter(
            name, _flag(several, declared.spells(name), help, metavar=declared.metavar), None
        )
    ]


def _flag(kind: Any, names: list[str], help: str, **settings: Any) -> Any:
    return Annotated[kind, typer.Option(*names, help=help, **settings)]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


def _shown(default: Any) -> str | bool:
    if isinstance(default, tuple):
        whole = bool(default) and all(isinstance(number, int) for number in default)
        return ("x" if whole else ",").join(f"{number:g}" for number in default) or False
    return False if default is None else str(default)
