"""What tests do on the page: open it, click in the photo, move a slider, paint, look at the picture."""

import io
import urllib.request

import numpy as np
from PIL import Image

READY = "text=Ready: click an object"
PICTURE = "document.querySelector('#stage .photo').src"


def opened(page, address):
    page.goto(address)
    page.wait_for_selector("#stage .photo[src]")
    page.wait_for_selector(READY)


def select_block(page):
    """A click on the block of the small scene."""
    click_photo(page, 0.39, 0.5)
    page.wait_for_selector("#stage .view[data-selected=yes]")


def click_photo(page, x, y, modifiers=()):
    """A click at a share of the stage's width and height."""
    box = page.locator("#stage .view").bounding_box()
    page.locator("#stage .view").click(
        position={"x": x * box["width"], "y": y * box["height"]}, modifiers=list(modifiers)
    )


def move(page, name, value):
    """Move a slider, and wait for nothing."""
    script = """([name, value]) => { const r = document.querySelector(`#${name} input[type=range]`);
        r.value = value; r.dispatchEvent(new Event('input', {bubbles: true})); }"""
    page.evaluate(script, [name, value])


def slide(page, name, value):
    """Move a slider, and wait for the next picture."""
    before = page.evaluate(PICTURE)
    move(page, name, value)
    page.wait_for_function(
        "(old) => document.querySelector('#stage .photo').src !== old", arg=before
    )


def pixels(page):
    """[H, W, 3] uint8 of the picture on the stage."""
    url = page.evaluate(PICTURE)
    return np.asarray(Image.open(io.BytesIO(urllib.request.urlopen(url).read())).convert("RGB"))


def press(page, label):
    """Choose a tool or a mode."""
    page.get_by_role("radio", name=label, exact=True).check()


def place(page, x, y):
    """[x, y] on the page of a share of the stage's width and height."""
    box = page.locator("#stage .view").bounding_box()
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


def mask(page):
    """[H, W] bool of the selection that the stage shows; None where nothing is selected."""
    url = page.evaluate("getComputedStyle(document.querySelector('#stage .fill')).maskImage")
    if not url.startswith("url("):
        return None
    data = urllib.request.urlopen(url[5:-2]).read()
    return np.asarray(Image.open(io.BytesIO(data)))[..., 3] > 0
