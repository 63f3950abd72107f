"""Downloads through huggingface_hub, against a hub on this machine; nothing here touches the network."""

import hashlib
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from materialist.errors import WeightsError
from materialist.predict.models import (
    download,
    folder_of,
    hub_model,
    is_complete,
    needed_files,
    require,
    weights_file,
)
from materialist.predict.weights import verify_folder

MODEL = hub_model("matnet")
CONTENT = {
    "config.json": b"{}",
    "matnet_weights.pth": bytes(range(256)) * 9000,
    "README.md": b"not needed",
}
COMMIT = "1" * 40


class Hub(BaseHTTPRequestHandler):
    """As much of a model hub as a download needs; the server holds `files`, `claims` and the `log` of fetched ones."""

    def do_HEAD(self):
        self.answer_file(body=False)

    def do_GET(self):
        if not self.path.startswith("/api/models/Lez/MatNet"):
            return self.answer_file(body=True)
        files = [
            {
                "rfilename": name,
                "size": len(c),
                "lfs": {"size": len(c), "pointerSize": 9, "sha256": self.digest(name)},
            }
            for name, c in self.server.files.items()
        ]
        return self.answer(
            200, json.dumps({"id": "Lez/MatNet", "sha": COMMIT, "siblings": files}).encode(), {}
        )

    def digest(self, name):
        return self.server.claims.get(name, hashlib.sha256(self.server.files[name]).hexdigest())

    def answer_file(self, body):
        name = self.path.rpartition("/resolve/")[2].partition("/")[2]
        if not self.path.startswith("/Lez/MatNet/") or name not in self.server.files:
            return self.answer(404, b"Entry not found", {"X-Error-Code": "RepoNotFound"})
        self.server.log += [name] * body
        headers = {"X-Repo-Commit": COMMIT, "ETag": f'"{self.digest(name)}"'}
        return self.answer(200, self.server.files[name], headers, body=body)

    def answer(self, status, content, headers, body=True):
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        if body:
            self.wfile.write(content)

    def log_message(self, *_):
        pass


@pytest.fixture(autouse=True)
def folder(models, monkeypatch):
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", False)
    return folder_of(MODEL)


@pytest.fixture
def hub(monkeypatch):
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hub)
    server.files = dict(CONTENT)
    server.claims = {}
    server.log = []
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{server.server_port}")
    yield server
    server.shutdown()
    server.server_close()


def test_a_download_is_whole_checked_listed_and_not_repeated(hub, folder):
    assert not is_complete(MODEL)
    assert download(MODEL) == folder == require(MODEL)
    assert (folder / "matnet_weights.pth").read_bytes() == CONTENT["matnet_weights.pth"]
    assert hub.log == ["config.json", "matnet_weights.pth"]
    assert weights_file(folder).name == "matnet_weights.pth" and len(verify_folder(folder)) == 64
    sums = (folder / "SHA256SUMS").read_text()
    assert (
        f"{hashlib.sha256(CONTENT['matnet_weights.pth']).hexdigest()}  matnet_weights.pth\n" in sums
    )
    hub.log.clear()
    assert download(MODEL) == folder and hub.log == []
    download(MODEL, force=True)
    assert hub.log == ["config.json", "matnet_weights.pth"]


def test_a_file_that_came_damaged_is_not_kept(hub, folder):
    hub.claims["matnet_weights.pth"] = "0" * 64
    with pytest.raises(WeightsError, match=r"matnet_weights\.pth came damaged"):
        download(MODEL)
    assert not is_complete(MODEL) and not (folder / "matnet_weights.pth").exists()


def test_an_unknown_or_odd_repository_is_refused(hub):
    # Another predictor would not do instead of what no predictor needs.
    with pytest.raises(WeightsError, match=r"cannot be fetched.*; or [a-z ]*do without it"):
        download(hub_model("nobody/nothing"))
    hub.files = {"README.md": b"x"}
    with pytest.raises(WeightsError, match="no file of weights"):
        download(MODEL)
    hub.files = {"../../evil.pth": b"x"}
    with pytest.raises(WeightsError):
        download(MODEL)
    assert not list(folder_of(MODEL).parent.parent.rglob("evil*"))


def test_the_best_format_of_each_folder_is_chosen():
    names = [
        "model_index.json",
        "README.md",
        "figure.png",
        "tokenizer/vocab.json",
        "tokenizer/merges.txt",
        "unet/config.json",
        "unet/a.safetensors",
        "unet/a.fp16.safetensors",
        "unet/a.bin",
        "vae/b.safetensors",
        "vae/b.bin",
        "old/c.bin",
        "old/c.fp16.bin",
        "w.pth",
    ]
    assert set(needed_files(names)) == {
        "model_index.json",
        "tokenizer/vocab.json",
        "tokenizer/merges.txt",
        "unet/config.json",
        "unet/a.fp16.safetensors",
        "vae/b.safetensors",
        "old/c.fp16.bin",
        "w.pth",
    }
