"""A tiny catalogue of furniture and two photographs, made up on the fly."""

import io
import zipfile

import numpy as np
from PIL import Image

from materialist_lab.procedural.catalog.cache import listing
from materialist_lab.procedural.staged.stock import Stock

HEAD = "id=made#up\nname=Made up\nlicense=CC0\n\n"
MODELS = (
    # name, category, file, width, depth, height (centimetres), more lines
    ("Table", "Living room", "table", 120, 60, 75, ""),
    ("Chair", "Living room", "chair", 45, 45, 90, "elevation#N=0\n"),
    ("Mug", "Kitchen", "mug", 8, 8, 10, ""),
    ("Wardrobe", "Bedroom", "box", 100, 60, 200, ""),
    (
        "Lamp",
        "Lights",
        "lamp",
        20,
        20,
        40,
        "lightSourceX#N=10\nlightSourceY#N=10\nlightSourceZ#N=35\n",
    ),
    ("Caf\\u00e9 sign", "Miscellaneous", "box", 40, 4, 30, "elevation#N=150\n"),
    ("Jar", "Kitchen", "jar", 10, 10, 10, ""),
    ("Net", "Kitchen", "net", 10, 10, 10, ""),
    ("Turned", "Miscellaneous", "table", 30, 40, 20, "modelRotation#N=1 0 0 0 0 -1 0 1 0\n"),
)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
MTL = """newmtl wood_top
Kd 0.8 0.8 0.8
Ks 0 0 0
Ns 10
d 1
map_Kd grain.png
newmtl chrome_legs
Kd 0.5 0.5 0.5
Ks 0.9 0.9 0.9
Ns 200
newmtl glass
Kd 0.9 0.9 0.9
d 0.2
newmtl net
Kd 0.9 0.9 0.9
map_Kd net.png
newmtl bulb
Kd 1 1 1
"""


def box_lines(low, high, start, material, uv=False):
    """OBJ lines of a box; its corners count from `start`."""
    corners = [[(low, high)[bit][k] for k, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["vt 0 0", "vt 2 0", "vt 2 2", "vt 0 2"] if uv else []
    lines.append(f"usemtl {material}")
    first = 4 * (start - 1) // 8 + 1  # texture coordinates before these
    for quad in QUADS:
        marks = [
            f"{start + corner}/{first + k}" if uv else f"{start + corner}"
            for k, corner in enumerate(quad)
        ]
        lines.append("f " + " ".join(marks))
    return lines


def obj_text(name):
    head = ["mtllib all.mtl"]
    if name == "table":
        top = box_lines((0, 7, 0), (10, 8, 5), 1, "wood_top", uv=True)
        return "\n".join([*head, *top, *box_lines((4, 0, 2), (6, 7, 3), 9, "chrome_legs")])
    material = {"jar": "glass", "net": "net", "lamp": "bulb"}.get(name, "chrome_legs")
    return "\n".join([*head, *box_lines((0, 0, 0), (2, 3, 1), 1, material, uv=name == "net")])


def png(pixels):
    memory = io.BytesIO()
    Image.fromarray(pixels).save(memory, "PNG")
    return memory.getvalue()


def grain():
    """[8, 16, 3] uint8: a picture that is not the same turned or mirrored: red from the left, green from the top."""
    pixels = np.full((8, 16, 3), 40, np.uint8)
    pixels[..., 0] += (np.arange(16) * 12).astype(np.uint8)
    pixels[..., 1] += (np.arange(8) * 20).astype(np.uint8)[:, None]
    return pixels


def make_archive(path):
    """Write the catalogue; returns its path."""
    lines = [HEAD]
    holes = np.full((8, 8, 4), 255, np.uint8)
    holes[::2, :, 3] = 0
    with zipfile.ZipFile(path, "w") as file:
        for number, (name, category, model, width, depth, height, more) in enumerate(MODELS, 1):
            lines.append(
                f"name#{number}={name}\ncategory#{number}={category}\nmodel#{number}=/made/{model}/{model}.obj\n"
                f"width#{number}={width}\ndepth#{number}={depth}\nheight#{number}={height}\ncreator#{number}=Somebody\n"
                + more.replace("#N", f"#{number}")
            )
        file.writestr("PluginFurnitureCatalog.properties", "\n".join(lines))
        for model in {model for _, _, model, *_ in MODELS}:
            file.writestr(f"made/{model}/{model}.obj", obj_text(model))
            file.writestr(f"made/{model}/all.mtl", MTL)
            file.writestr(f"made/{model}/grain.png", png(grain()))
            file.writestr(f"made/{model}/net.png", png(holes))
    return path


def make_photographs(folder):
    """Write two photographs of noise; returns their paths."""
    rng = np.random.default_rng(0)
    paths = []
    for k in range(2):
        pixels = rng.integers(0, 255, (300, 400, 3)).astype(np.uint8)
        paths.append(folder / f"photo{k}.jpg")
        Image.fromarray(pixels).save(paths[-1], quality=90)
    return tuple(paths)


def make_stock(folder):
    """A stock of the catalogue and the photographs, with a cache below `folder`."""
    archive = make_archive(folder / "made.sh3f")
    photographs = make_photographs(folder)
    return Stock(listing((archive,), photographs, folder / "cache"))
