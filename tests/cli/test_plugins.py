"""Commands of other distributions, and what is said where the laboratory is not installed."""

from importlib.metadata import EntryPoint

import pytest
import typer

from materialist.cli import plugins
from materialist.cli.generate import group
from materialist.install import laboratory_advice

greeting = group("greet", "Greetings.")


@greeting.command()
def once():
    typer.echo("hello")


@greeting.command()
def twice():
    typer.echo("hello, hello")


@pytest.fixture
def installed(monkeypatch):
    """Sets the entry points that are installed."""

    def install(*points):
        monkeypatch.setattr(plugins, "entry_points", lambda group: points)

    return install


def entry_point(value):
    return EntryPoint(name="greet", value=value, group=plugins.GROUP)


@pytest.mark.parametrize(
    "arguments", [["bench"], ["bench", "light", "--help"], ["train", "data", "-o", "DIR"]]
)
def test_without_the_laboratory_one_sentence_says_how_to_install_it(installed, run, arguments):
    installed()
    sentence = f"materialist {arguments[0]} is in the laboratory, which is not installed"
    message = f"Error: {sentence}; install it with: {laboratory_advice()}\n"
    assert run(*arguments) == (2, "", message)
    assert "In the laboratory: materialist-photo-lab." in run("--help")[1]


def test_a_command_of_another_distribution_is_ours(installed, run, monkeypatch):
    monkeypatch.setattr(EntryPoint, "load", lambda point: greeting)
    installed(entry_point("greetings:app"))
    assert run("greet", "once") == (0, "hello\n", "")
    assert "Greetings." in run("--help")[1]


def test_one_that_cannot_be_loaded_harms_no_other(installed, run):
    installed(entry_point("no_such_module:app"))
    code, out, err = run("greet")
    assert (code, out) == (2, "") and "cannot be loaded from no_such_module:app" in err
    assert run("--help")[0] == run("invert", "--help")[0] == 0


def test_other_commands_load_no_plugin(installed, run, monkeypatch):
    monkeypatch.setattr(EntryPoint, "load", lambda point: pytest.fail("it was loaded"))
    installed(entry_point("greetings:app"))
    assert run("models", "--help")[0] == 0 and run("bogus")[0] == 2
