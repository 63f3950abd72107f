"""The mesh, the photo's own pixels, colours of surfaces, and clicks that open edits, by requests."""

import io
import json
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from PIL import Image
from studio_scenes import HEIGHT, WIDTH

from materialist.darkroom import state
from materialist.studio.live import views


def mesh(client):
    """(header, positions [V, 3], colours [V, 4], faces [F, 3]) as the page reads them."""
    data = client.get("/api/mesh").content
    start = 4 + int.from_bytes(data[:4], "little")
    header = json.loads(data[4:start])
    count, faces = header["vertices"], header["faces"]
    assert len(data) == start + count * 16 + faces * 12 and start % 4 == 0
    positions = np.frombuffer(data, "<f4", count * 3, start).reshape(-1, 3)
    colours = np.frombuffer(data, np.uint8, count * 4, start + count * 12).reshape(-1, 4)
    return (
        header,
        positions,
        colours,
        np.frombuffer(data, "<u4", faces * 3, start + count * 16).reshape(-1, 3),
    )


def stand(client, name="Cube", at=(50, 40), **options):
    client.post("/api/object", json={"name": name})
    if options:
        client.post("/api/set", json={"kind": "insert", "options": options})
    return client.post("/api/place", json={"at": at}).json()


def test_the_mesh_has_the_surface_and_what_was_put_in(client, monkeypatch):
    header, positions, colours, faces = mesh(client)
    assert faces.max() < len(positions) and not colours.any()
    assert np.allclose(np.unique(positions[np.unique(faces), 2].round(2)), [-3, -2])
    assert abs(header["aspect"] - WIDTH / HEIGHT) < 1e-6 and header["middle"] == 3.0
    stand(client, material="#00ff00")
    after, _, painted, more = mesh(client)
    assert more.max() < after["vertices"] and len(more) == len(faces) + 12
    assert (painted[painted[:, 3] > 0] == (0, 255, 0, 255)).all()
    # A large one is thinned out, and keeps its borders: no face spans the block and the wall.
    monkeypatch.setattr(views, "MESH_FACES", 800)
    client.post("/api/undo", json={})
    _, thin, _, few = mesh(client)
    assert 100 < len(few) < 1000
    assert np.ptp(thin[few][..., 2], axis=1).max() < 0.01


def test_the_photo_with_all_its_pixels_and_a_colour_without_its_light(client):
    photo = client.get("/api/photo?full=1")
    size = Image.open(io.BytesIO(photo.content)).size
    assert list(size) == client.get("/api/state").json()["original"]
    colour = client.post("/api/colour", json={"at": [25, 24]}).json()["colour"]
    found = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    encoded = np.array([0.797, 0.381, 0.313]) * 255  # sRGB of 0.6, 0.12, 0.08
    assert np.abs(found - encoded).max() < 4
    assert client.post("/api/colour", json={"at": [-1, 2]}).status_code == 400


def test_the_photo_with_all_its_pixels_is_encoded_once(client, monkeypatch):
    """A large one takes a gigabyte of the server meanwhile."""
    encode = state.srgb_levels
    made = []

    def slow(photo):
        made.append(photo)
        time.sleep(0.1)
        return encode(photo)

    monkeypatch.setattr(state, "srgb_levels", slow)
    client.studio.page("b" * 32, "me").session.live.photos.clear()
    with ThreadPoolExecutor(4) as threads:
        answers = [*threads.map(client.get, ["/api/photo?full=1"] * 4)]
    assert len({answer.content for answer in answers}) == 1
    assert len(made) == 1


def test_a_click_on_what_was_edited_opens_its_edit(client):
    def pick(x, y, mode="new"):
        body = {"tool": "click", "at": [x, y], "mode": mode}
        return client.post("/api/pick", json=body).json()

    region = pick(25, 24)["stage"]["region"]
    client.post("/api/set", json={"kind": "edit", "options": {"hue": 90}})
    stand(client)
    state = client.get("/api/state").json()
    assert state["current"] == 1
    client.post("/api/deselect", json={})
    # Its outline is shown under the pointer, and its selection comes with it.
    assert client.post("/api/point", json={"at": [30, 20]}).json()["region"] == region
    state = pick(30, 20)
    assert state["current"] == 0 and state["stage"]["region"] == region
    assert pick(50, 39)["current"] == 1  # the cube
    assert pick(5, 44)["current"] is None  # neither


def test_alt_takes_a_part_of_a_selection_away(client):
    def pick(**body):
        return client.post("/api/pick", json=body).json()["stage"]["region"]

    # Two things at once, in one selection.
    pick(tool="box", at=[0, 6, 63, 47])
    both = pick(tool="click", at=[25, 24], mode="add")
    left = pick(tool="click", at=[25, 24], mode="remove")
    assert left and left != both
    assert pick(tool="click", at=[25, 24], mode="remove") == left  # it is out already
