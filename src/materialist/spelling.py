"""Misspelt keywords, as errors that say which one may be meant."""

import difflib
import functools
import inspect
from collections.abc import Callable, Collection, Iterable
from typing import Any, TypeVar

from materialist.errors import InputError

Function = TypeVar("Function", bound=Callable[..., Any])


def check_names(names: Iterable[str], known: Collection[str], called: str) -> None:
    """Raise an InputError for a name that is no option of what is `called` so; it says which one may be meant."""
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            meant = f" Do you mean '{near[0]}'?" if near else ""
            raise InputError(
                f"{called} has no option '{name}'; it takes {', '.join(known)}.{meant}"
            )


def spelled(function: Function) -> Function:
    """Decorate a function: a keyword that it does not take is an InputError, as `check_names` says it."""
    known = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def checked(*args: Any, **values: Any) -> Any:
        check_names(values, known, function.__name__)
        return function(*args, **values)

    return checked  # type: ignore[return-value]
