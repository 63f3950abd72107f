"""Photos in an S3 store: a server of moto's on this machine, through s3fs. Skipped where those are not installed."""

import pytest
from made_batch import photos

from materialist.batches.photos import list_photos
from materialist.batches.run import batch

WHY = "needs moto[server] and s3fs"


@pytest.fixture
def bucket(monkeypatch):
    """put(key, bytes) into s3://photos of an empty store, which workers find, too."""
    s3fs = pytest.importorskip("s3fs", reason=WHY)
    boto3 = pytest.importorskip("boto3", reason=WHY)
    moto = pytest.importorskip("moto.server", reason=WHY)
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    address = "http://{}:{}".format(*server.get_host_and_port())
    for name, value in (
        ("AWS_ENDPOINT_URL", address), ("AWS_ACCESS_KEY_ID", "made"), ("AWS_SECRET_ACCESS_KEY", "up"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
    ):  # fmt: skip
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()  # one of another test knows another address
    store = boto3.client("s3", endpoint_url=address)
    store.create_bucket(Bucket="photos")
    yield lambda key, content: store.put_object(Bucket="photos", Key=key, Body=content)
    for entry in store.list_objects_v2(Bucket="photos").get("Contents", []):  # moto remembers beyond its server
        store.delete_object(Bucket="photos", Key=entry["Key"])
    server.stop()


def ids(source):
    return [photo.id for photo in list_photos(source, runs="elsewhere")]


def test_a_batch_resumes_with_what_has_changed(bucket, tmp_path):
    photos(tmp_path, "a", "b", "c")
    for name in ("a", "b"):
        bucket(f"{name}.png", (tmp_path / f"{name}.png").read_bytes())
    options = {"function": "made_batch:made_up", "workers": 1, "device": "cpu"}
    first = batch("s3://photos", tmp_path / "runs", **options)
    assert first.count("done") == 2 and first.exit_code == 0
    assert {row["name"] for row in first.rows} == {"a", "b"}
    assert "made" not in (tmp_path / "runs/batch.jsonl").read_text().replace("made_batch:made_up", "")
    bucket("b.png", (tmp_path / "c.png").read_bytes())
    again = batch("s3://photos", tmp_path / "runs", resume=True, **options)
    assert again.kept == 1 and again.count("done") == 2
    hashes = [{row["name"]: row["photo_hash"] for row in outcome.rows} for outcome in (first, again)]
    assert hashes[0]["a"] == hashes[1]["a"] and hashes[0]["b"] != hashes[1]["b"]
