"""Messages of the library in the words of the command line."""

import json
import signal
import time

import pytest
import typer

from materialist.cli.outcome import report_success, run_to_exit_code, with_flags


@pytest.mark.parametrize(
    ("python", "flags"),
    [
        ("give `force=True` to replace it", "give --force to replace it"),
        ("render with `denoise=False`.", "render with --no-denoise."),
        ('choose `device="cpu"`, or', "choose --device cpu, or"),
        ('with `depth="moge:A B"`, `normal="x"`', "with --depth moge:A B, --normal x"),
        ('leave `method="sam2"` out', "leave --with sam2 out"),
        ("give it as `max_triangles=N`.", "give it as --max-triangles N."),
        ("see: `materialist doctor` and a = b", "see: `materialist doctor` and a = b"),
    ],
)
def test_keywords_become_flags(python, flags):
    assert with_flags(python) == flags


def test_notes_for_programs_name_flags_too(capsys):
    report_success("export", True, [], notes=["give `residual=False`"], output="a `b=1`")
    told = json.loads(capsys.readouterr().out)
    assert told["notes"] == ["give --no-residual"] and told["output"] == "a `b=1`"


def test_an_error_of_the_library_names_flags(refused, tmp_path):
    (tmp_path / "a.scene").mkdir()
    assert "give --force" in refused("invert", "example:coffee", "-o", tmp_path / "a.scene")


def test_a_library_cannot_swallow_ctrl_c_while_it_is_imported(
    request, tmp_path, monkeypatch, capsys
):
    swallow = "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept BaseException:\n    pass\n"
    (tmp_path / "greedy_library.py").write_text(swallow)
    monkeypatch.syspath_prepend(tmp_path)
    before = signal.default_int_handler
    old = signal.signal(signal.SIGINT, before)  # another test may have left its own
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, old))
    app = typer.Typer()

    @app.command()
    def go() -> None:
        import greedy_library  # noqa: F401

        time.sleep(3)

    assert run_to_exit_code(app, []) == 130
    assert "nothing was written" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_that_a_renderer_reports_as_its_own_error_is_no_bug(capsys):
    app = typer.Typer()

    @app.command()
    def go() -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as stop:
            raise RuntimeError("error while performing a custom operation") from stop

    assert run_to_exit_code(app, []) == 130
    assert "bug" not in capsys.readouterr().err
