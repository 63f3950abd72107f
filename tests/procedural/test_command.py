"""`materialist train data` from the command line."""

import json

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code


def run(capsys, *arguments):
    code = run_to_exit_code(app, ["train", "data", *map(str, arguments)])
    return code, capsys.readouterr()


def test_makes_resumes_refuses_and_draws(tmp_path, capsys):
    folder = tmp_path / "set"
    common = ("-o", folder, "--size", 32, "--spp", 1, "--seed", 5, "--device", "cpu")
    code, out = run(capsys, *common, "--count", 1, "--json")
    assert code == 0
    assert json.loads(out.out.splitlines()[-1])["rendered"] == 1
    code, out = run(capsys, *common, "--count", 2, "--resume", "--json")
    told = json.loads(out.out.splitlines()[-1])
    assert (code, told["rendered"], told["existing"]) == (0, 1, 1)
    code, out = run(capsys, *common, "--count", 2)
    assert code == 2
    assert "--resume" in out.err
    code, out = run(capsys, "-o", folder, "--sheet", tmp_path / "sheet.png")
    assert code == 0
    drawn = (tmp_path / "sheet.png").read_bytes()
    code, out = run(capsys, "-o", folder, "--sheet", tmp_path / "sheet.png")
    assert (code, (tmp_path / "sheet.png").read_bytes()) == (2, drawn)
    assert "--force" in out.err
    assert run(capsys, "-o", folder, "--sheet", tmp_path / "sheet.png", "--force")[0] == 0
