"""Commands of other distributions, and what is said where the laboratory is not installed."""

from importlib.metadata import EntryPoint

import pytest
import typer

from materialist.cli import plugins
from materialist.cli.generate import group
from materialist.cli.outcome import run_to_exit_code
from materialist.install import laboratory_command

greeting = group("greet", "Greetings.")


@greeting.command()
def once():
    typer.echo("hello")


@greeting.command()
def twice():
    typer.echo("hello, hello")


def program(monkeypatch, *points):
    """The program where these entry points are installed."""
    monkeypatch.setattr(plugins, "entry_points", lambda group: points)
    app = group("materialist", "A program.")
    plugins.add_to(app)
    return app


def entry_point(value):
    return EntryPoint(name="greet", value=value, group=plugins.GROUP)


@pytest.mark.parametrize(
    "arguments", [["bench"], ["bench", "light", "--help"], ["train", "data", "-o", "DIR"]]
)
def test_without_the_laboratory_one_sentence_says_how_to_install_it(monkeypatch, capsys, arguments):
    assert run_to_exit_code(program(monkeypatch), arguments) == 2
    shown = capsys.readouterr()
    sentence = f"materialist {arguments[0]} is in the laboratory, which is not installed"
    assert shown.err == f"Error: {sentence}; install it with: {laboratory_command()}\n"
    assert not shown.out


def test_a_command_of_another_distribution_is_ours(monkeypatch, capsys):
    monkeypatch.setattr(EntryPoint, "load", lambda point: greeting)
    assert (
        run_to_exit_code(program(monkeypatch, entry_point("greetings:app")), ["greet", "once"]) == 0
    )
    assert capsys.readouterr().out == "hello\n"


def test_one_that_cannot_be_loaded_harms_no_other(monkeypatch, capsys):
    app = program(monkeypatch, entry_point("no_such_module:app"))
    assert run_to_exit_code(app, ["greet"]) == 2
    assert "cannot be loaded from no_such_module:app" in capsys.readouterr().err
    assert run_to_exit_code(app, ["--help"]) == 0
    assert "greet" in capsys.readouterr().out
