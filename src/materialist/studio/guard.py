"""Between the page and the work: errors become one clear sentence on the page, and the server goes on."""

from __future__ import annotations

import functools
import inspect
import traceback
from collections.abc import Callable, Iterator
from typing import Any

import gradio as gr

from materialist.errors import MaterialistError

_SECONDS = 12
"""How long a message stays on the page."""


def guarded(function: Callable[..., Any]) -> Callable[..., Any]:
    """The handler (or generator) with its exceptions turned into messages of the page."""
    if inspect.isgeneratorfunction(function):

        @functools.wraps(function)
        def steps(*args: Any, **kwargs: Any) -> Iterator[Any]:
            try:
                yield from (_answer(step) for step in function(*args, **kwargs))
            except GeneratorExit:  # the page was closed
                raise
            except Exception as error:
                raise _message(error) from error

        return steps

    @functools.wraps(function)
    def once(*args: Any, **kwargs: Any) -> Any:
        try:
            return _answer(function(*args, **kwargs))
        except Exception as error:
            raise _message(error) from error

    return once


def _answer(outputs: Any) -> Any:
    """Gradio takes an empty dict for one value, not for "no component changes"."""
    return gr.skip() if isinstance(outputs, dict) and not outputs else outputs


def _message(error: Exception) -> Exception:
    if isinstance(error, gr.Error):
        return error
    if isinstance(error, MaterialistError):
        return gr.Error(_plain(str(error)), duration=_SECONDS, title="That did not work", print_exception=False)
    traceback.print_exception(error)
    text = f"Something went wrong inside ({type(error).__name__}); the terminal of the studio has the details."
    return gr.Error(text, duration=_SECONDS, title="Our mistake", print_exception=False)


def _plain(text: str) -> str:
    """Without meaning in HTML: the message may hold a name that a stranger chose."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
