"""`materialist train data` from the command line."""

import os

from materialist.procedural.dataset import sample_path


def test_makes_resumes_and_draws(done, refused, tmp_path):
    folder, sheet = tmp_path / "set", tmp_path / "sheet.png"
    make = ("train", "data", "-o", folder, "--size", 32, "--spp", 1, "--seed", 5, "--device", "cpu", "--count")
    for count, resume in ((1, ()), (2, ("--resume",))):
        told = done(*make, count, *resume)
        assert (told["rendered"], told["existing"]) == (1, count - 1)
    draw = ("train", "data", "-o", folder, "--sheet", sheet)
    done(*draw)
    drawn = sheet.read_bytes()
    assert "--force" in refused(*draw) and sheet.read_bytes() == drawn
    done(*draw, "--force")
    os.truncate(sample_path(folder, 1), 900)
    assert "0000001.npz cannot be read" in refused(*draw, "--force")
