"""Tiny made-up folders in the layouts of `bench real`."""

import json

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.io.exr import write_exr

LAMPS = [[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [-0.6, 0.0, 0.8]]
SIZE = (24, 32)


def write_png(path, values):
    """uint8 or uint16, colours as RGB."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), values[..., ::-1] if values.ndim == 3 else values)


def photo(size=SIZE, shade=0.5):
    """uint8 [H, W, 3]: a ramp, so that it is no flat colour."""
    ramp = np.linspace(0.2, 1, size[1])[None, :, None] * np.array([1, 0.8, 0.6]) * shade
    return np.round(255 * linear_to_srgb(np.broadcast_to(ramp, (*size, 3)))).astype(np.uint8)


def floor(size=SIZE, focal=32.0):
    """[H, W] metres: a level floor 0.4 metres below the camera, and a wall three metres away."""
    row = np.arange(size[0])[:, None] + 0.5 - size[0] / 2
    depth = np.minimum(0.4 * focal / np.maximum(row, 1e-3), 3.0)
    return np.broadcast_to(depth, size).astype(np.float32)


def write_object(folder):
    """A ball of two paints under three lamps: its photos are exactly albedo times cosine."""
    height, width = SIZE
    y, x = np.meshgrid(
        (height - 1) / 2 - np.arange(height), np.arange(width) - (width - 1) / 2, indexing="ij"
    )
    square = (x**2 + y**2) / 11**2
    mask = square < 0.9
    normal = np.stack([x / 11, y / 11, np.sqrt(np.maximum(1 - square, 0))], -1) * mask[..., None]
    paint = np.where(y[..., None] > 0, [0.8, 0.4, 0.2], [0.3, 0.5, 0.6])
    albedo = (paint * mask[..., None]).astype(np.float32)
    folder.mkdir(parents=True)
    (folder / "lights.json").write_text(json.dumps({"direction_to_light": LAMPS}))
    write_exr(folder / "normal.exr", normal.astype(np.float32))
    write_exr(folder / "albedo.exr", albedo)
    write_png(folder / "mask.png", (255 * mask).astype(np.uint8))
    for k, lamp in enumerate(LAMPS):
        shading = np.maximum(normal @ np.array(lamp), 0)[..., None]
        linear = np.minimum(0.02 + albedo * shading, 1)
        write_png(folder / f"light_{k:02d}.png", np.round(255 * linear).astype(np.uint8))
    return folder


def write_room(folder):
    write_png(folder / "photo.jpg", photo())
    write_png(folder / "depth.png", np.round(1000 * floor()).astype(np.uint16))


def write_garage(folder):
    write_png(folder / "motorcycle_garage.png", photo())
    disparity = np.full(SIZE, 20, np.float32)
    disparity[:, :4] = np.inf
    np.savez(folder / "motorcycle_garage_disp.npz", disparity)


def write_published(folder):
    write_png(folder / "photo.png", photo())
    (folder / "maps").mkdir()
    write_exr(folder / "maps" / "albedo.exr", np.full((*SIZE, 3), 0.4, np.float32))
    write_exr(folder / "maps" / "depth.exr", floor())


def write_nyu(folder):
    size = (480, 640)
    write_png(folder / "bathroom" / "rgb_00045.jpg", photo(size))
    write_png(folder / "bathroom" / "sync_depth_00045.png", np.full(size, 2500, np.uint16))
    write_png(folder / "bathroom" / "rgb_00046.jpg", photo(size))  # without a depth


def write_diode(folder):
    place = folder / "val" / "indoors" / "scene_00019" / "scan_00183"
    write_png(place / "00019_00183.png", photo())
    valid = np.ones(SIZE, np.float32)
    valid[0] = 0
    np.save(place / "00019_00183_depth.npy", floor()[..., None])
    np.save(place / "00019_00183_depth_mask.npy", valid)


def write_iiw(folder):
    write_png(folder / "17.png", photo())
    points = [{"id": k, "x": x, "y": 0.5, "opaque": True} for k, x in enumerate((0.1, 0.9))]
    darker = {"point1": 0, "point2": 1, "darker": "1", "darker_score": 1.0}
    judged = {"intrinsic_points": points, "intrinsic_comparisons": [darker]}
    (folder / "17.json").write_text(json.dumps(judged))


def write_interiorverse(folder):
    scene = folder / "dataset_85" / "L3D1"
    scene.mkdir(parents=True)
    (scene.parent / "test.txt").write_text("L3D1\n")
    values = {
        "im": photo() / 255,
        "albedo": 0.25,
        "material": 0.3,
        "normal": [0, 0, 1],
        "depth": 2000,
        "mask": 1,
    }
    for name, value in values.items():
        write_exr(
            scene / f"000_{name}.exr",
            np.broadcast_to(np.float32(value), (*SIZE, 3)).astype(np.float32),
        )


def write_wildrelight(folder):
    for k, column in enumerate((4, 12, 20)):
        envmap = np.full((16, 32, 3), 0.01, np.float32)
        envmap[6, column] = 100
        for name in ("photo", "envmap"):
            (folder / "park" / name).mkdir(parents=True, exist_ok=True)
        write_exr(folder / "park" / "envmap" / f"time{k}_envmap.exr", envmap)
        write_exr(
            folder / "park" / "photo" / f"time{k}_hdr.exr",
            (photo() * np.float32(3 * k + 1)).astype(np.float32),
        )


def write_multi_illumination(folder):
    for k, column in enumerate((20, 44)):
        ball = np.full((64, 64, 3), 5, np.uint8)
        ball[28:36, column - 4 : column + 4] = 255
        write_png(folder / "everett_dining1" / "probes" / f"dir_{k}_chrome256.jpg", ball)
        write_png(folder / "everett_dining1" / f"dir_{k}_mip2.jpg", photo(shade=0.5 + 0.2 * k))


WRITERS = {
    "real_light": lambda place: write_object(place / "ball"),
    "real_room": write_room,
    "photos/indoor": write_garage,
    "official_indoor": write_published,
    "nyu": write_nyu,
    "diode": write_diode,
    "iiw": write_iiw,
    "interiorverse": write_interiorverse,
    "wildrelight": write_wildrelight,
    "multi_illumination": write_multi_illumination,
}
"""Folder of a layout -> what writes one there."""
