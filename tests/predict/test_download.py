"""Downloads, against a hub on this machine; nothing here touches the network."""

import hashlib
import json
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.download import Remote, chosen, download
from materialist.predict.models import KNOWN, folder_of, hub_model, is_complete, is_hub_id, require, weights_file
from materialist.predict.weights import verify_folder

MODEL = hub_model("matnet")
CONTENT = {"config.json": b"{}", "matnet_weights.pth": bytes(range(256)) * 9000, "README.md": b"not needed"}


class Hub(BaseHTTPRequestHandler):
    """As much of a model hub as a download needs; the server holds `files`, `claims` and `log`."""

    def do_GET(self):
        server = self.server
        server.log.append((self.path, self.headers.get("Range")))
        if self.path.startswith("/api/models/Lez/MatNet"):
            files = [
                {"rfilename": n, "size": len(c), "lfs": {"sha256": server.claims.get(n, hashlib.sha256(c).hexdigest())}}
                for n, c in server.files.items()
            ]
            return self.answer(200, json.dumps({"siblings": files}).encode())
        name = self.path.removeprefix("/Lez/MatNet/resolve/main/")
        if name not in server.files:
            return self.answer(404, b"Entry not found")
        content, start = server.files[name], self.headers.get("Range")
        if start and server.resumes:
            return self.answer(206, content[int(start.removeprefix("bytes=").rstrip("-")) :])
        return self.answer(200, content)

    def answer(self, status, content):
        self.send_response(status)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content[: self.server.cut] if self.server.cut and status != 404 else content)

    def log_message(self, *_):
        pass


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path / "models"))
    return folder_of(MODEL)


@pytest.fixture
def hub(monkeypatch):
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hub)
    server.files, server.claims, server.log, server.resumes, server.cut = dict(CONTENT), {}, [], True, 0
    threading.Thread(target=server.serve_forever, daemon=True).start()
    monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{server.server_port}/")
    yield server
    server.shutdown()
    server.server_close()


def fetched(hub):
    """The files asked for, in order."""
    return [path.rsplit("/", 1)[1] for path, _ in hub.log if "/resolve/" in path]


def test_a_download_is_whole_checked_and_listed(hub, folder):
    steps = []
    assert not is_complete(MODEL)
    where, size = download(MODEL, progress=lambda *step: steps.append(step))
    assert where == folder == require(MODEL) and size == len(CONTENT["matnet_weights.pth"]) + 2
    assert (folder / "matnet_weights.pth").read_bytes() == CONTENT["matnet_weights.pth"]
    assert fetched(hub) == ["config.json", "matnet_weights.pth"] and not list(folder.glob("*.partial"))
    assert weights_file(folder).name == "matnet_weights.pth" and len(verify_folder(folder)) == 64
    assert steps[-1] == ("matnet_weights.pth", 2, 2)
    sums = (folder / "SHA256SUMS").read_text()
    assert f"{hashlib.sha256(CONTENT['matnet_weights.pth']).hexdigest()}  matnet_weights.pth\n" in sums


def test_what_is_here_already_is_not_fetched_again_unless_forced(hub, folder):
    download(MODEL)
    hub.log.clear()
    assert download(MODEL)[1] == 0 and fetched(hub) == []
    (folder / "matnet_weights.pth").write_bytes(b"damaged")
    assert download(MODEL)[1] == len(CONTENT["matnet_weights.pth"]) and fetched(hub) == ["matnet_weights.pth"]
    hub.log.clear()
    download(MODEL, force=True)
    assert fetched(hub) == ["config.json", "matnet_weights.pth"]


@pytest.mark.parametrize("resumes", [True, False])
def test_an_interrupted_download_goes_on(hub, folder, resumes):
    folder.mkdir(parents=True)
    (folder / "matnet_weights.pth.partial").write_bytes(CONTENT["matnet_weights.pth"][:1000])
    hub.resumes = resumes
    download(MODEL)
    assert (folder / "matnet_weights.pth").read_bytes() == CONTENT["matnet_weights.pth"]
    assert [ranged for path, ranged in hub.log if path.endswith(".pth")] == ["bytes=1000-"]


def test_a_broken_connection_leaves_a_part_and_no_model(hub, folder):
    hub.cut = 5000  # the listing fits into it
    with pytest.raises(WeightsError, match=r"matnet_weights\.pth broke off \(after 5000 of 2304000 bytes\)"):
        download(MODEL)
    assert not is_complete(MODEL) and not (folder / "matnet_weights.pth").exists()
    assert (folder / "matnet_weights.pth.partial").read_bytes() == CONTENT["matnet_weights.pth"][:5000]
    hub.cut = 0
    download(MODEL)
    assert is_complete(MODEL) and hub.log[-1] == ("/Lez/MatNet/resolve/main/matnet_weights.pth", "bytes=5000-")


def test_a_file_that_came_damaged_is_not_kept(hub, folder):
    hub.claims["matnet_weights.pth"] = "0" * 64
    with pytest.raises(WeightsError) as error:
        download(MODEL)
    good = hashlib.sha256(CONTENT["matnet_weights.pth"]).hexdigest()
    assert "matnet_weights.pth came damaged" in str(error.value) and good in str(error.value)
    assert "0" * 64 in str(error.value)
    assert (
        not is_complete(MODEL) and not (folder / "matnet_weights.pth").exists() and not list(folder.glob("*.partial"))
    )


def test_a_hub_out_of_reach_is_told_fast_with_the_alternatives(monkeypatch):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{free.getsockname()[1]}")
        start = time.monotonic()
        with pytest.raises(WeightsError) as error:
            download(MODEL)
    assert time.monotonic() - start < 3
    for word in ("cannot be reached", "matnet_weights.pth", "Lez/MatNet", "matnet:FILE", "maps:DIR"):
        assert word in str(error.value)


def test_a_silent_hub_is_given_up(monkeypatch):
    monkeypatch.setattr("materialist.predict.download.TIMEOUT", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{silent.getsockname()[1]}")
        with pytest.raises(WeightsError, match="cannot be reached"):
            download(MODEL)


def test_an_unknown_or_odd_repository_is_refused(hub):
    with pytest.raises(WeightsError, match=r"404.*no such public model"):
        download(hub_model("nobody/nothing"))
    hub.files = {"README.md": b"x"}
    with pytest.raises(WeightsError, match="no file of weights"):
        download(MODEL)
    hub.files = {"../../evil.pth": b"x"}
    with pytest.raises(WeightsError, match="outside its own folder"):
        download(MODEL)
    hub.files, hub.cut = dict(CONTENT), 20
    with pytest.raises(WeightsError, match="not like a model hub"):
        download(MODEL)


def test_a_folder_that_cannot_be_written_is_an_output_error(hub, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path / "file"))
    with pytest.raises(OutputError, match="MATERIALIST_MODELS"):
        download(MODEL)


def test_the_best_format_of_each_folder_is_chosen():
    names = [
        "model_index.json", "README.md", "figure.png", "tokenizer/vocab.json", "tokenizer/merges.txt",
        "unet/config.json", "unet/a.safetensors", "unet/a.fp16.safetensors", "unet/a.bin",
        "vae/b.safetensors", "vae/b.bin", "old/c.bin", "old/c.fp16.bin", "w.pth",
    ]  # fmt: skip
    picked = {remote.name for remote in chosen([Remote(name, 1, None) for name in names])}
    assert picked == {
        "model_index.json", "tokenizer/vocab.json", "tokenizer/merges.txt", "unet/config.json",
        "unet/a.fp16.safetensors", "vae/b.safetensors", "old/c.fp16.bin", "w.pth",
    }  # fmt: skip


def test_verify_finds_every_kind_of_damage(hub, folder):
    download(MODEL)
    whole = verify_folder(folder)
    (folder / "config.json").write_bytes(b"[]")
    with pytest.raises(WeightsError, match=r"config\.json is damaged.*expected"):
        verify_folder(folder)
    (folder / "config.json").unlink()
    with pytest.raises(WeightsError, match=r"lacks config\.json"):
        verify_folder(folder)
    (folder / "config.json").write_bytes(b"{}")
    assert verify_folder(folder) == whole
    (folder / "SHA256SUMS").write_text("")
    with pytest.raises(WeightsError, match="no list of checksums"):
        verify_folder(folder)


def test_names_and_ids():
    assert hub_model("Lez/MatNet") is hub_model("matnet") is KNOWN[0]
    assert hub_model("someone/theirs").repo == "someone/theirs"
    with pytest.raises(InputError, match="matnet, marigold-appearance"):
        hub_model("nonsense")
    assert is_hub_id("a/b-c_d.e") and not is_hub_id("a/b.pth") and not is_hub_id("./b") and not is_hub_id("a/b/c")
