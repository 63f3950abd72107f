"""Which photos a batch finds, and what their results are called."""

import fsspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_batch import photos

from materialist.batches.photos import LONGEST_NAME as LONGEST
from materialist.batches.photos import list_photos, unique_names
from materialist.batches.remote import fingerprint, local_copy, without_secrets
from materialist.batches.run import batch
from materialist.errors import InputError, SetupError


def ids(source, runs="elsewhere"):
    return [photo.id for photo in list_photos(source, runs=runs)]


def test_a_folder_is_searched_with_its_subfolders_and_nothing_of_ours_is_a_photo(tmp_path):
    photos(
        tmp_path, "b", "a.JPG", "sub/c", ".hidden", ".cache/d", "k.scene/photo", "old/e", "runs/a"
    )
    (tmp_path / "k.scene/scene.json").touch()
    (tmp_path / "old/batch.jsonl").touch()
    (tmp_path / "notes.txt").touch()
    assert ids(tmp_path, tmp_path / "runs") == ["a.JPG", "b.png", "sub/c.png"]


def test_a_list_has_its_own_folder_comments_and_each_photo_once(tmp_path):
    photos(tmp_path, "a", "b")
    listing = tmp_path / "list.txt"
    listing.write_text(
        "# mine\n b.png\n\na.png\nb.png\nexample:cat\nhttps://me:secret@host/x.jpg?signature=1\nnone.png\n"
    )
    found = {photo.id: photo.location for photo in list_photos(listing, runs="r")}
    assert found["a.png"] == str(tmp_path / "a.png") and found["none.png"] == str(
        tmp_path / "none.png"
    )
    assert found["example:cat"] == "example:cat" and len(found) == 5
    assert found["https://host/x.jpg"] == "https://me:secret@host/x.jpg?signature=1"
    assert without_secrets("ftp://user:p@ss@host/x.jpg") == "ftp://host/x.jpg"


def test_a_list_may_be_utf16(tmp_path):
    (tmp_path / "list.txt").write_text("# grün\nexample:cat\n", "utf-16")
    assert [photo.id for photo in list_photos(tmp_path / "list.txt", runs="r")] == ["example:cat"]


def test_a_list_of_urls_asks_for_their_library_before_the_work(tmp_path, monkeypatch):
    def missing(protocol):
        raise ImportError(f"library of {protocol}")

    (tmp_path / "list.txt").write_text("https://host/a.jpg\n")
    monkeypatch.setattr(fsspec, "get_filesystem_class", missing)
    with pytest.raises(SetupError, match=r"^https://host/a.jpg needs .* install .*aiohttp"):
        batch(tmp_path / "list.txt", tmp_path / "runs")
    assert not (tmp_path / "runs").exists()
    for url, words in (
        ("simplecache::s3://host/a.jpg", "needs one more package: .* install s3fs"),
        ("smb://host/a.jpg", "cannot be opened: library of smb"),
    ):
        (tmp_path / "list.txt").write_text(f"{url}\n")
        with pytest.raises(SetupError, match=words):
            batch(tmp_path / "list.txt", tmp_path / "runs")


def test_what_is_passed_over_is_named(tmp_path):
    photos(tmp_path, "b", "a.JPG")
    for name in ("c.jxl", "d.psd", ".hidden", "Thumbs.db", "sub/e.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    notes = []
    list_photos(tmp_path, runs="r", notes=notes)
    assert notes == ["Passed over, as their names are no photo's: c.jxl, d.psd, sub/e.txt."]
    (tmp_path / "list.txt").write_text("b.png\na.JPG\nb.png\n")
    notes.clear()
    assert len(list_photos(tmp_path / "list.txt", runs="r", notes=notes)) == 2
    assert notes == ["More than one line of list.txt names b.png; each is done once."]


def test_reported_names_are_photos(real_data):
    folder = real_data("data/reported/batch_names")
    notes = []
    assert [photo.id for photo in list_photos(folder, runs="r", notes=notes)] == [
        "one.jfif",
        "two.hif",
    ]
    assert notes == ["Passed over, as their names are no photo's: README."]
    assert [photo.id for photo in list_photos(folder / "one.jfif", runs="r")] == [
        str(folder / "one.jfif")
    ]


@pytest.mark.parametrize(
    ("make", "said"),
    [("nothing", "There is no folder"), ("empty", "holds no photo"), ("bytes", "no list")],
)
def test_what_holds_no_photo_is_refused(tmp_path, make, said):
    (tmp_path / "empty").mkdir()
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\xfd")
    with pytest.raises(InputError, match=said):
        list_photos(tmp_path / make, runs="r")


def test_urls_are_listed_versioned_and_fetched(tmp_path):
    photos(tmp_path, "x", "deep/y.jpg")
    store = fsspec.filesystem("memory")
    for name in ("x.png", "deep/y.jpg"):
        store.pipe(f"/bucket/{name}", (tmp_path / name).read_bytes())
    store.pipe("/bucket/readme.txt", b"no")
    assert ids("memory://bucket") == ["memory:///bucket/deep/y.jpg", "memory:///bucket/x.png"]
    assert ids("memory://bucket/*.png") == ["memory:///bucket/x.png"]
    url = "memory://bucket/x.png"
    assert ids(url) == [url]
    with local_copy(url) as file:
        assert file.read_bytes() == (tmp_path / "x.png").read_bytes() and file.suffix == ".png"
    assert not file.exists()
    before = fingerprint(url)
    assert fingerprint(url) == before
    store.pipe("/bucket/x.png", b"other")
    assert fingerprint(url) != before
    with (
        pytest.raises(InputError, match=r"nothing at memory://bucket/none\.png"),
        local_copy("memory://bucket/none.png"),
    ):
        pass
    with pytest.raises(InputError, match=r"cannot be read|nothing at"):
        list_photos("nosuchstore://bucket", runs="r")


def test_a_store_out_of_reach_is_not_called_empty(monkeypatch):
    def unreachable(self, path, detail=True, **options):
        raise OSError("Cannot connect to host")

    # fsspec's search of folders passes over such errors.
    monkeypatch.setattr(fsspec.get_filesystem_class("memory"), "ls", unreachable)
    with pytest.raises(InputError, match="cannot be read: Cannot connect to host"):
        list_photos("memory://bucket/photos", runs="r")


def test_names_are_stems_as_long_as_those_are_unique():
    names = unique_names(
        ["a/k.png", "b/k.jpg", "c.png", "d.png", "d.jpg", "x y/é.png", "http://h/p/z.jpg"]
    )
    assert names == {
        "a/k.png": "a_k.png",
        "b/k.jpg": "b_k.jpg",
        "c.png": "c",
        "d.png": "d.png",
        "d.jpg": "d.jpg",
        "x y/é.png": "é",
        "http://h/p/z.jpg": "z",
    }


@settings(deadline=None)
@given(
    st.lists(
        st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=150),
        min_size=1,
        unique=True,
    ),
    st.randoms(),
)
def test_names_are_legal_distinct_and_the_same_in_any_order(texts, random):
    names = unique_names(texts)
    assert len({name.casefold() for name in names.values()}) == len(texts)
    for name in names.values():
        assert (
            name
            and not set(name) & set('/\\\0:*?"<>|{}')
            and name[0] not in "._"
            and len(name.encode()) <= LONGEST
        )
    shuffled = list(texts)
    random.shuffle(shuffled)
    assert unique_names(shuffled) == names


def test_a_batch_behind_a_url_resumes_with_what_has_changed(tmp_path):
    photos(tmp_path / "in", "a", "b", "c")
    (tmp_path / "in/c.png").rename(tmp_path / "c.png")
    options = {"function": "made_batch:made_up", "workers": 1, "device": "cpu"}
    first = batch(f"file://{tmp_path}/in", tmp_path / "runs", **options)
    assert first.count("done") == 2 and {row["name"] for row in first.rows} == {"a", "b"}
    (tmp_path / "c.png").rename(tmp_path / "in/b.png")
    again = batch(f"file://{tmp_path}/in", tmp_path / "runs", resume=True, **options)
    assert again.kept == 1 and again.count("done") == 2
    hashes = [
        {row["name"]: row["photo_hash"] for row in outcome.rows} for outcome in (first, again)
    ]
    assert hashes[0]["a"] == hashes[1]["a"] and hashes[0]["b"] != hashes[1]["b"]


def test_one_file_under_several_names_is_one_photo(tmp_path):
    photos(tmp_path, "a")
    (tmp_path / "list.txt").write_text(f"a.png\n./a.png\n{tmp_path / 'a.png'}\n")
    notes = []
    listed = list_photos(tmp_path / "list.txt", runs="r", notes=notes)
    assert [photo.id for photo in listed] == ["a.png"]
    assert notes == ["More than one line of list.txt names a.png; each is done once."]
