"""`materialist bench NAME`: one command for each benchmark."""

import os

import pytest
import typer
from made_program import heavy_after, options_of

from materialist.option_kinds import declarations
from materialist_lab import bench
from materialist_lab.bench import BENCHMARKS, benchmark_class, summary_of
from materialist_lab.bench.light import LightBench
from materialist_lab.cli.bench import app


@pytest.fixture
def started(monkeypatch):
    """The runs that commands start, in place of them."""
    runs = []
    monkeypatch.setattr(
        bench, "run_benchmark", lambda benchmark, **places: runs.append((benchmark, places))
    )
    return runs


def test_flags_become_the_options_of_the_benchmark(done, tmp_path, started):
    facts = done(
        "bench",
        "light",
        "--scenes",
        10,
        "--unseen",
        "--no-relight",
        "--seed=4",
        "-o",
        tmp_path / "r",
    )
    expected = LightBench(scenes=10, unseen=True, relight=False, seed=4)
    assert started == [(expected, {"output": tmp_path / "r", "data": None, "force": False})]
    assert facts["name"] == "light" and facts["report"] == str(tmp_path / "r")


def test_the_data_folder_and_force_are_passed_on(done, tmp_path, started):
    done("bench", "photo-alone", "--data", tmp_path, "--force", "-o", tmp_path / "r")
    assert started[0][1] == {"output": tmp_path / "r", "data": tmp_path, "force": True}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["light", "-o", "OUT", "--data", "nowhere"], "nowhere"),
        (["light", "-o", "OUT", "ten"], "ten"),
        (["light", "-o", "OUT", "--colour", "3"], "--colour"),
        (["light", "-o", "OUT", "--scenes", "0"], "The scenes is 0; it must lie in [1, "),
        (["light", "-o", "OUT", "--scenes", "abc"], "--scenes"),
        (["light"], "--output"),
        (["nonsense", "-o", "OUT"], "no benchmark 'nonsense'; choose one of real, "),
    ],
)
def test_bad_input_is_exit_2_before_any_work(refused, tmp_path, started, arguments, words):
    filled = [argument.replace("OUT", str(tmp_path / "out")) for argument in arguments]
    assert words in refused("bench", *filled)
    assert not started and not os.listdir(tmp_path)


def test_help_has_every_option_of_the_benchmark(run):
    code, out, _ = run("bench", "light", "--help")
    assert code == 0 and "Usage: materialist bench light [OPTIONS]" in out
    assert all(f"--{name.replace('_', '-')}" in out for name in declarations(LightBench))
    assert "how well the light of a photograph is found" in " ".join(out.lower().split())


def test_help_of_the_group_names_each_benchmark_and_what_it_measures(run):
    code, out, _ = run("bench", "--help")
    shown = " ".join(out.split())
    assert code == 0 and all(f"{name} {summary_of(name)}" in shown for name in BENCHMARKS)


def test_listing_the_commands_loads_nothing_heavy():
    """Help of the program, of bench and of train imports these two, and reads the benchmarks without importing them."""
    statement = "from materialist_lab.cli import bench, train; bench.benchmarks.summary_of('real')"
    assert not heavy_after(statement)


def test_every_benchmark_takes_its_options_and_those_of_all_commands():
    options = options_of(typer.main.get_group(app))
    assert set(options) == set(BENCHMARKS)
    for name, flags in options.items():
        declared = {f"--{field.replace('_', '-')}" for field in declarations(benchmark_class(name))}
        assert declared | {"--output", "--data", "--force", "--seed", "--device", "--json"} <= flags
