"""`materialist train data` from the command line."""

import json
import os

from materialist.procedural.dataset import sample_path


def test_makes_resumes_and_draws(run, tmp_path):
    folder, sheet = tmp_path / "set", tmp_path / "sheet.png"
    make = ("train", "data", "-o", folder, "--size", 32, "--spp", 1, "--seed", 5, "--device", "cpu", "--count")
    for count, resume in ((1, ()), (2, ("--resume",))):
        code, out, _ = run(*make, count, *resume, "--json")
        told = json.loads(out.splitlines()[-1])
        assert (code, told["rendered"], told["existing"]) == (0, 1, count - 1)
    draw = ("train", "data", "-o", folder, "--sheet", sheet)
    assert run(*draw)[0] == 0
    drawn = sheet.read_bytes()
    code, _, err = run(*draw)
    assert code == 2 and "--force" in err and sheet.read_bytes() == drawn
    assert run(*draw, "--force")[0] == 0
    os.truncate(sample_path(folder, 1), 900)
    code, _, err = run(*draw, "--force")
    assert code == 2 and "0000001.npz cannot be read" in err
