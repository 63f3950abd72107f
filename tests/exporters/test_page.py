"""The page: nothing foreign in it, and in a browser it works without the network."""

import base64
import io
import re

import numpy as np
import pytest
from export_scenes import room
from PIL import Image

from materialist.color import linear_to_srgb
from materialist.exporters.page import page
from materialist.exporters.parts import scene_parts


@pytest.fixture(scope="module")
def text():
    return page(room(), scene_parts(room()))


def test_nothing_comes_from_elsewhere(text):
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", text)
    assert not re.search(r"https?://|@import|url\(", text)
    assert "default-src 'none'" in text


def test_foreign_text_is_escaped(text):
    assert "<b>" not in text and "&lt;b&gt;ro&#34;om.png" in text
    assert "too &lt;/script&gt; dark" in text
    assert text.count("</script>") == 2 and "{{" not in text
    assert "31.25 dB" in text and "nan" not in text.split("<script")[0]


def test_in_a_browser(browser, tmp_path):
    scene = room()
    (tmp_path / "room.html").write_text(page(scene, scene_parts(scene)), "utf-8")
    tab = browser.new_page(viewport={"width": 700, "height": 800})
    asked = []
    faults = []
    tab.on("request", lambda request: asked.append(request.url.split(":")[0]))
    tab.on("pageerror", lambda fault: faults.append(str(fault)))
    tab.goto(f"file://{tmp_path}/room.html")
    tab.wait_for_selector("body[data-ready=yes]", timeout=60000)
    assert set(asked) <= {"file", "data", "blob"} and faults == []

    cover = "getComputedStyle(document.getElementById('rerender')).clipPath"
    tab.locator("#slider").fill("20")
    assert "20%" in tab.evaluate(cover)
    tab.locator("#slider").fill("90")
    assert "90%" in tab.evaluate(cover)

    # From the photo's view the mesh shows the photo, texel by texel; the sky stays empty.
    shown = _canvas(tab)
    rows, columns = ((np.arange(n) + 0.5) / n for n in (40, 64))
    pick = shown[
        np.ix_((rows * shown.shape[0]).astype(int), (columns * shown.shape[1]).astype(int))
    ]
    difference = np.abs(pick - 255 * linear_to_srgb(scene.photo.linear)).max(-1)
    assert (
        np.median(difference[scene.depth > 0]) < 8
        and np.percentile(difference[scene.depth > 0], 90) < 40
    )
    assert (np.abs(pick[scene.depth == 0] - (29, 31, 34)).max(-1) < 3).mean() > 0.95
    tab.locator("#view").focus()
    for _ in range(5):
        tab.keyboard.press("ArrowRight")
    tab.wait_for_timeout(200)
    assert np.abs(_canvas(tab) - shown).mean() > 3
    tab.locator("#home").click()
    tab.wait_for_timeout(200)
    assert np.abs(_canvas(tab) - shown).mean() < 0.1


def _canvas(tab) -> np.ndarray:
    """[h, w, 3] what the canvas shows."""
    address = tab.evaluate("document.getElementById('view').toDataURL()")
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(address.split(",")[1]))).convert("RGB")
    ).astype(float)
