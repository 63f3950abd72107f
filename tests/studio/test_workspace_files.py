"""Files of the desk: lists of edits may name those, and none elsewhere."""

import numpy as np
import pytest

from materialist.edits.recipe import Step
from materialist.errors import InputError, OutputError
from materialist.studio.workspace import confined, write_mask


def test_every_file_of_a_list_is_looked_at(tmp_path):
    (tmp_path / "mesh-1.ply").write_text("ply")
    step = Step("drop", {"mesh": ["mesh-1.ply", "mesh-1.ply"], "at": ["3", "4"]})
    assert confined(step, tmp_path).folder == tmp_path
    for other, words in [("../secret.ply", "plain file name"), ("mesh-2.ply", "is not here"), ([["x.ply"]], "plain")]:
        with pytest.raises(InputError, match=words):
            confined(Step("drop", {"mesh": ["mesh-1.ply", other], "at": ["3", "4"]}), tmp_path)


def test_a_file_that_was_not_written_whole_is_written_again(tmp_path, monkeypatch):
    from materialist.io import image

    mask, real = np.eye(20, 30) > 0, image.write_png_bytes

    def full(path, pixels):
        path.write_bytes(b"\x89PNG")
        raise OutputError(f"{path} cannot be written: no space left.")

    monkeypatch.setattr(image, "write_png_bytes", full)
    with pytest.raises(OutputError):
        write_mask(tmp_path, mask)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(image, "write_png_bytes", real)
    assert (image.read_mask(tmp_path / write_mask(tmp_path, mask), mask.shape) > 0.5).sum() == mask.sum()
