"""The studio in a real browser."""

import re
import subprocess
import urllib.error
import urllib.parse
import urllib.request

import numpy as np
import pytest
from PIL import Image
from studio_browser import READY, click_photo, move, opened, pixels, select_block, slide
from studio_scenes import package
from studio_server import studio

from materialist.io.photo import example_path


def test_select_edit_undo(page):
    first = pixels(page)
    select_block(page)
    slide(page, "hue", 120)
    green = pixels(page)
    assert green[24, 25, 1] > green[24, 25, 0] + 40 and first[24, 25, 0] > first[24, 25, 1] + 40
    assert np.abs(green[40, 55].astype(int) - first[40, 55]).max() < 6
    assert "Material: hue 120" in page.inner_text("#steps")
    page.locator("#steps input").uncheck()
    page.wait_for_function("document.querySelector('#stage .badge').textContent === 'Photo'")
    page.locator("#steps input").check()
    page.wait_for_function("document.querySelector('#stage .badge').textContent === 'Live preview'")
    page.get_by_role("tab", name="Light").click()
    page.locator("#lights button").nth(5).click()
    page.wait_for_selector("#steps >> text=sunset")
    for keys, count in (("Control+z", 1), ("Control+Shift+z", 2), ("Control+z", 1)):
        page.keyboard.press(keys)
        page.wait_for_function(f"document.querySelectorAll('#steps li').length === {count}")
    page.reload()
    page.wait_for_selector("#steps >> text=hue 120")  # nothing is lost
    page.wait_for_selector(READY)
    page.get_by_role("button", name="Remove: edit 1").click()
    page.wait_for_function("document.querySelectorAll('#steps li').length === 0")
    assert not page.errors


def test_progress_is_at_the_picture_and_stop_never_under_the_cursor(page):
    page.set_viewport_size({"width": 1280, "height": 720})
    select_block(page)
    slide(page, "hue", 120)
    page.get_by_role("button", name="Final picture").dblclick()
    page.wait_for_selector("#frame #progress .bar")
    for part in ("#progress", "#stop"):
        box = page.locator(part).bounding_box()
        assert box["y"] + box["height"] <= 720, part
    page.wait_for_selector("#stage .badge >> text=Path traced")
    page.wait_for_selector("#stop", state="hidden")


def test_what_cannot_be_done_is_said_on_the_page(page):
    page.get_by_role("button", name="Select nothing").click()
    move(page, "hue", 90)
    page.wait_for_selector("#message:visible >> text=Click the object")
    page.locator("#message").click()
    page.wait_for_selector("#message", state="hidden")


def test_nothing_is_asked_of_anyone_else(page, running):
    for name in ("Open", "Light", "Objects", "Take away", "Look"):
        page.get_by_role("tab", name=name).click()
    page.wait_for_selector("#report >> text=dB from the photo")
    outside = [u for u in page.requested if not u.startswith((running[0], "data:", "blob:"))]
    assert not outside and len(page.requested) > 20 and not page.errors
    assert any("/heartbeat/" in url for url in page.requested)  # whose end is the page's


def test_by_keyboard_alone(page):
    page.locator("#stage .view").focus()
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    page.wait_for_selector("#stage .view[data-selected=yes]")
    for key, tool in (("2", "Box"), ("3", "Brush"), ("1", "Click")):
        page.keyboard.press(key)
        assert page.get_by_role("radio", name=tool, exact=True).is_checked()
    outline = "getComputedStyle(document.activeElement.closest('label') || document.activeElement).outlineStyle"
    page.keyboard.press("Tab")  # to the tools
    assert page.evaluate(outline) == "solid"
    page.locator("#hue input[type=range]").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    assert page.evaluate(outline) == "solid"
    page.wait_for_selector("#steps >> text=/hue [1-3]/")
    page.locator("#steps [data-key=remove-0]").focus()
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelectorAll('#steps li').length === 0")


def test_on_a_phone(browser, running):
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    opened(page, running[0])
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.locator("#stage .view").tap(position={"x": 0.39 * 300, "y": 0.5 * 225})
    page.wait_for_selector("#stage .view[data-selected=yes]")
    page.locator("#metallic").scroll_into_view_if_needed()
    box = page.locator("#stage .view").bounding_box()
    assert box["y"] + box["height"] > 60, "the picture is out of sight while its sliders move"
    page.evaluate("scrollTo(0, 0)")
    for name in ("Open", "Material", "Light", "Objects", "Look", "Take away"):
        box = page.get_by_role("tab", name=name).bounding_box()
        assert box["y"] + box["height"] <= 844, name
    for name in ("Open", "Light"):
        page.get_by_role("tab", name=name).click()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
    context.close()


CONTRAST = """() => {
  const lum = (c) => { const f = (v) => { v /= 255; return v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; };
    return .2126 * f(c[0]) + .7152 * f(c[1]) + .0722 * f(c[2]); };
  const rgba = (s) => { const m = s.match(/[\\d.]+/g).map(Number); return m.length > 3 ? m : [...m, 1]; };
  const low = [];
  for (const n of document.querySelectorAll('button, label, span, p, h1, h2, li, summary, input')) {
    const text = [...n.childNodes].some((c) => c.nodeType === 3 && /\\w/.test(c.textContent));
    if (!text || n.disabled || n.closest(':disabled') ) continue;
    if (!n.checkVisibility({visibilityProperty: true, opacityProperty: true})) continue;
    if (n.closest('#stage, .sr-only')) continue;
    const style = getComputedStyle(n), ink = rgba(style.color);
    let paper = null;
    for (let p = n; p && !paper; p = p.parentElement) {
      const b = rgba(getComputedStyle(p).backgroundColor); if (b[3] > .99) paper = b; }
    const [a, b] = [lum(ink), lum(paper || [255, 255, 255])].sort((x, y) => y - x);
    const ratio = (a + .05) / (b + .05);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.5 && +style.fontWeight >= 700);
    if (ratio < (large ? 3 : 4.5))
      low.push([n.tagName, n.textContent.trim().slice(0, 40), style.color, ratio.toFixed(2)]);
  }
  return low; }"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable_and_things_have_names(page, scheme):
    page.emulate_media(color_scheme=scheme)
    page.reload()
    page.wait_for_selector(READY)
    paper = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert (max(page.evaluate(paper)) < 64) == (scheme == "dark")
    for name in ("Open", "Material", "Light", "Objects", "Look", "Take away"):
        page.get_by_role("tab", name=name).click()
        page.wait_for_timeout(300)
        assert page.evaluate(CONTRAST) == [], name
        unnamed = """() => [...document.querySelectorAll('button, input, textarea, [role=application]')]
            .filter((n) => n.checkVisibility() && !n.innerText && !n.ariaLabel && !n.title
                    && !(n.labels && n.labels.length) && !n.closest('label') && n.type !== 'file')
            .map((n) => n.outerHTML.slice(0, 160))"""
        assert page.evaluate(unnamed) == [], name


def test_files_outside_the_cache_are_not_served(running):
    address, work = running
    for path in (
        "/etc/passwd",
        str(work / "photo-001" / "project.json"),
        str(work),
        "../pyproject.toml",
        "pyproject.toml",
        "http://127.0.0.1:9/x.png",
    ):
        quoted = urllib.parse.quote(path)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"{address}/gradio_api/file={quoted}")
        assert refused.value.code in (403, 404), path


@pytest.mark.slow
def test_a_password_closes_the_door(tmp_path):
    pytest.importorskip("gradio", reason="needs gradio")
    with studio(tmp_path, "--password", "open sesame") as (process, address):
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with pytest.raises(urllib.error.HTTPError, match="401"):
            browser.open(f"{address}/config")
        data = urllib.parse.urlencode({"password": "open sesame"}).encode()
        assert (
            browser.open(f"{address}/login", data).status
            == browser.open(f"{address}/config").status
            == 200
        )
        process.send_signal(2)
        assert process.wait(20) in (0, 130)


@pytest.mark.slow
def test_two_people_at_once(browser, tmp_path):
    """Where others can reach it: on one's own machine two browsers are one person, and share the edits."""
    with studio(tmp_path, str(package(tmp_path)), "--host", "0.0.0.0", "--open") as (_, address):
        contexts = [browser.new_context() for _ in range(2)]
        pages = [context.new_page() for context in contexts]
        for page in pages:
            opened(page, address)
        for page in pages:
            click_photo(page, 0.39, 0.5)
        for page in pages:
            page.wait_for_selector("#stage .view[data-selected=yes]")
        slide(pages[0], "hue", 120)
        slide(pages[1], "hue", -120)
        green = pixels(pages[0])[24, 25]
        blue = pixels(pages[1])[24, 25]
        assert green.argmax() == 1 and blue.argmax() == 2
        assert "hue 120" in pages[0].inner_text("#steps") and "hue -120" in pages[1].inner_text(
            "#steps"
        )
        for context in contexts:
            context.close()


@pytest.mark.slow
def test_the_whole_story(page, tmp_path):
    """A dropped photo, cancelled and begun again, reloaded in the middle, edited, traced, taken away."""
    page.set_default_timeout(300_000)
    Image.open(example_path("coffee")).resize((150, 100)).save(
        tmp_path / "coffee.png"
    )  # nothing is enlarged
    page.get_by_role("tab", name="Open").click()
    page.set_input_files("#file input[type=file]", str(tmp_path / "coffee.png"))
    page.wait_for_selector("#facts >> text=is ready")
    page.get_by_label("Working size").click()
    page.get_by_role("option", name="256").click()
    page.click("#start")
    page.wait_for_selector("#stage .badge >> text=being taken apart")  # the photo is on the stage
    assert pixels(page).shape[:2] == (100, 150)
    page.click("#stop")
    page.wait_for_selector("#progress >> text=Stopped")
    page.wait_for_selector("#stop", state="hidden")
    page.click("#start")
    page.wait_for_selector("#stop", state="visible")
    page.wait_for_timeout(2000)
    page.reload()
    page.wait_for_selector("#progress .bar")  # the work goes on
    page.wait_for_selector(READY)
    click_photo(page, 0.3, 0.8)
    page.wait_for_selector("#stage .view[data-selected=yes]")
    slide(page, "hue", 100)
    page.get_by_role("button", name="Final picture").click()
    page.wait_for_selector("#stage .badge >> text=Path traced")
    page.get_by_role("tab", name="Look").click()
    page.get_by_role("button", name="Show the mesh").click()
    page.wait_for_selector("#mesh canvas")
    page.get_by_role("tab", name="Take away").click()
    page.get_by_label(re.compile("edits.yaml with")).check()
    page.click("#make")
    with page.expect_download() as download:
        page.click("#download")
    file = tmp_path / "edits.zip"
    download.value.save_as(file)
    assert subprocess.run(["unzip", "-tq", str(file)], capture_output=True).returncode == 0
    page.get_by_label("Picture, PNG").check()
    page.click("#make")
    page.wait_for_selector("#download >> text=coffee-edited.png")
    with page.expect_download() as download:
        page.click("#download")
    download.value.save_as(tmp_path / "a.png")
    picture = np.asarray(Image.open(tmp_path / "a.png"))
    assert picture.shape[:2] == (100, 150) and not page.errors


@pytest.mark.slow
def test_every_tab_opens_without_a_scene(empty_page, tmp_path):
    page = empty_page
    with studio(tmp_path) as (_, address):
        page.goto(address)
        for name in ("Material", "Light", "Objects", "Take away", "Look", "Open"):
            page.get_by_role("tab", name=name).click()
            page.wait_for_timeout(700)
            assert not page.locator(".toast-wrap .error, .toast-body.error").count(), name
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.locator("#file").bounding_box()["y"] < 250  # the first thing on a phone
        page.locator("#examples button").first.click()
        page.wait_for_selector("#facts >> text=coffee.png is ready")
        assert not page.errors
