"""How a command ends: the one place where exceptions become exit codes and the last line of --json is written.

0 done; 2 bad input or setup (one sentence on stderr); 130 interrupted; 1 a bug of ours (with the traceback). A command
that is terminated tidies up and dies by that signal.
"""

import json
import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer

from materialist.errors import MaterialistError
from materialist.plain import plain

OK = 0
BUG = 1
BAD_INPUT = 2
INTERRUPTED = 130
KEEPING = frozenset({"train", "batch", "bench", "models", "studio"})
"""Commands that write as they go; the others write whole results, or nothing."""
GRACE = 5.0
"""Seconds in which a command that is told to end may take its unfinished files away."""
RETRY = 0.05
"""Seconds after which Ctrl-C is looked at again."""
_KEYWORD = re.compile(r"`(\w+)=([^`]+)`")
"""A keyword of Python in a message, as in `force=True` or `device="cpu"`."""
_SENTENCES = {"notes", "warnings"}
"""Facts that are sentences for people."""
FLAGS = {"method": "with"}
"""Keywords whose flags have other names."""


def run_to_exit_code(app: typer.Typer, arguments: Sequence[str]) -> int:
    """Run the command line and return the exit code; no exception leaves except SystemExit of a signal."""
    wants_json = "--json" in arguments
    try:
        with _tidy_when_terminated(), _interrupted_between_imports(), _unwrapped():
            result = app(args=list(arguments), standalone_mode=False, prog_name="materialist")
        if result == INTERRUPTED:  # how some versions of typer report Ctrl-C
            raise KeyboardInterrupt
        return result if isinstance(result, int) else OK
    except MaterialistError as error:
        return _fail(type(error).__name__, with_flags(str(error)), error.exit_code, wants_json)
    except (KeyboardInterrupt, typer.Abort):
        done = (
            "what was finished is kept"
            if KEEPING.intersection(arguments[:1])
            else "nothing was written"
        )
        return _fail("Interrupted", f"Interrupted; {done}.", INTERRUPTED, wants_json)
    except _Terminated:
        os.kill(os.getpid(), signal.SIGTERM)
        return BUG  # not reached
    except typer.Exit as stop:
        return stop.exit_code
    except BrokenPipeError:  # the reader of a pipe left, as `head` does
        sys.stderr.close()
        return OK
    except OSError as error:  # a name that is too long, a full disk
        said = f"The system refused {error.filename or 'it'}: {(error.strerror or str(error)).lower()}."
        return _fail("OSError", said, BAD_INPUT, wants_json)
    except Exception as error:
        # --- Not a bug: a package that is not installed, or a flag that does not exist ---
        if isinstance(error, ModuleNotFoundError) and not (error.name or "").startswith(
            "materialist"
        ):
            return _fail(
                "SetupError",
                f"{error.name} is not installed; see: materialist doctor",
                BAD_INPUT,
                wants_json,
            )
        if _is_usage_error(error):
            return _usage(error, wants_json)
        # --- A bug of ours ---
        traceback.print_exc()
        message = f"This is a bug in Materialist, not your mistake: please report it with the lines above ({error})."
        return _fail(type(error).__name__, message, BUG, wants_json)


class _Terminated(BaseException):
    """SIGTERM, as an exception."""


@contextmanager
def _tidy_when_terminated() -> Iterator[None]:
    """Within it SIGTERM ends the command as an exception does, so that nothing half-written stays; soon in any case."""

    def stop(number: int, frame: Any) -> None:
        # A second SIGTERM ends the process at once, and so does a timer.
        signal.signal(number, signal.SIG_DFL)
        last = threading.Timer(
            GRACE, os.kill, (os.getpid(), number)
        )  # a renderer deep in its work hears nothing
        last.daemon = True
        last.start()
        raise _Terminated

    # Handlers belong to the main thread, and one that somebody else has set stays.
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGTERM) is stop:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _unwrapped() -> Iterator[None]:
    """Within it a stop that reached Python inside a renderer, which reports it as an error of its own, is one again."""
    try:
        yield
    except Exception as error:
        cause = error.__cause__
        while cause is not None:
            if isinstance(cause, (_Terminated, KeyboardInterrupt)):
                raise cause from None
            cause = cause.__cause__
        raise


@contextmanager
def _interrupted_between_imports() -> Iterator[None]:
    """Within it Ctrl-C waits for the end of an import, GRACE seconds at most.

    Libraries swallow it while they are imported, so that the command goes on, or report that they are damaged.
    """
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    waiting: list[threading.Timer] = []

    # While a library is imported, the signal is sent again a moment later.
    def stop(number: int, frame: Any) -> None:
        if not _is_importing(frame) or len(waiting) * RETRY >= GRACE:
            waiting.clear()
            raise KeyboardInterrupt
        again = threading.Timer(RETRY, os.kill, (os.getpid(), number))
        again.daemon = True
        waiting.append(again)
        again.start()

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        for timer in waiting:
            timer.cancel()
        if signal.getsignal(signal.SIGINT) is stop:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_importing(frame: Any) -> bool:
    """Whether a frame is one of a module that is being imported."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def with_flags(message: str) -> str:
    """A message in the words of the command line: flags for the keywords of Python."""
    return _KEYWORD.sub(_flag, message)


def _flag(keyword: re.Match[str]) -> str:
    # True and False become a flag and its opposite, other values follow their flag.
    name, value = keyword.groups()
    flag = FLAGS.get(name, name).replace("_", "-")
    if value in ("True", "False"):
        return f"--{flag}" if value == "True" else f"--no-{flag}"
    return f"--{flag} " + value.strip('"')


def report_success(command: str, as_json: bool, lines: Sequence[str], **facts: Any) -> None:
    """Tell a person in `lines`, or with `as_json` a program in one last line on stdout."""
    if as_json:
        for name in _SENTENCES & facts.keys():
            facts[name] = [with_flags(sentence) for sentence in facts[name]]
        typer.echo(json.dumps(plain({"ok": True, "command": command, **facts})))
    else:
        for line in lines:
            typer.echo(with_flags(line))


def _fail(kind: str, message: str, code: int, wants_json: bool) -> int:
    typer.echo(f"Error: {message}" if code != INTERRUPTED else message, err=True)
    if wants_json:
        typer.echo(json.dumps({"ok": False, "error": kind, "message": message, "exit_code": code}))
    return code


def _usage(error: Any, wants_json: bool) -> int:
    """An option that does not exist or does not parse; the parser knows best how to show it."""
    error.show()
    if wants_json:
        return _fail("UsageError", error.format_message(), BAD_INPUT, True)
    return BAD_INPUT


def _is_usage_error(error: Exception) -> bool:
    """Whether the option parser raised it; its base class is private in some versions of typer, so ask by family."""
    family = {base.__name__ for base in type(error).__mro__}
    return "ClickException" in family and hasattr(error, "show")
