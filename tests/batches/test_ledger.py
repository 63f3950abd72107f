"""The ledger: whole lines, one batch at a time, no one else's folder."""

import pytest

from materialist.batches.ledger import LEDGER, open_ledger, read_events
from materialist.errors import InputError, OutputError

OPTIONS = {"size": 64}


def write(runs, *entries, **how):
    with open_ledger(runs, OPTIONS, **how) as ledger:
        for kind, id in entries:
            ledger.append(kind, id=id, name=id[0])
    return ledger


def test_a_line_that_was_cut_off_is_passed_over_and_spoils_no_other(tmp_path):
    write(tmp_path, ("done", "a.png"), ("done", "b.png"))
    path = tmp_path / LEDGER
    path.write_bytes(path.read_bytes()[:-9])
    ledger = write(tmp_path, ("done", "c.png"), resume=True)
    assert set(ledger.last) == {"a.png", "c.png"}
    assert [e["id"] for e in read_events(path) if "id" in e] == ["a.png", "c.png"]


def test_a_folder_that_holds_something_is_refused_or_gone_on_with_or_begun_anew(tmp_path):
    write(tmp_path, ("done", "a.png"))
    with pytest.raises(InputError, match="`resume=True` to go on"):
        write(tmp_path)
    for how in ({"force": True}, {"resume": True}):  # begun anew, also after the next stop
        assert write(tmp_path, **how).last["a.png"]["key"] is None
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").touch()
    for how in ({}, {"resume": True}, {"force": True}):
        with pytest.raises(InputError, match="holds no batch"):
            write(mine, **how)
    assert [file.name for file in mine.iterdir()] == ["thesis.txt"]


def test_other_options_are_refused_by_name(tmp_path):
    write(tmp_path, ("done", "a.png"))
    with (
        pytest.raises(InputError, match="size 64, not 96"),
        open_ledger(tmp_path, {"size": 96}, resume=True),
    ):
        pass
    with open_ledger(tmp_path, {"size": 96}, resume=True, force=True) as ledger:
        assert ledger.last["a.png"]["key"] != ledger.key


def test_two_batches_do_not_share_a_folder(tmp_path):
    with (
        open_ledger(tmp_path, OPTIONS),
        pytest.raises(OutputError, match="Another batch is at work"),
    ):
        write(tmp_path, resume=True)
    write(tmp_path, resume=True)
