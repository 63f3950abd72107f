"""The darkroom in a real browser. Its policy forbids scripts of texts, so waiting for a function is done from here."""

import io
import re
import resource
import time

import numpy as np
import psutil
import pytest
import studio_server
from PIL import Image
from studio_scenes import package, zipped_package

AREA = """() => { const m = document.querySelector('.marks').getBoundingClientRect();
  return m.width * m.height / (innerWidth * innerHeight); }"""
SELECTED = "#stage[data-selected=yes]"


RESET = """async () => {
  const headers = {'x-materialist-page': sessionStorage.getItem('page'), 'content-type': 'application/json'};
  const post = async (place, body = {}) =>
    (await fetch(`/api/${place}`, {method: 'POST', headers, body: JSON.stringify(body)})).json();
  let state = await post('deselect');
  while (state.steps.length) state = await post('act', {action: 'remove', index: 0});
  localStorage.removeItem('theme');
  addEventListener('pagehide', () => sessionStorage.removeItem('view')); }"""

DISCARD = """async () => {
  const headers = {'x-materialist-page': sessionStorage.getItem('page'), 'content-type': 'application/json'};
  const {project} = await (await fetch('/api/state', {headers})).json();
  await fetch('/api/discard', {method: 'POST', headers, body: JSON.stringify({project: project.name})}); }"""
"""Deletes the photo that a page shows."""

PICK = (
    """(n, colour) => { n.value = colour; n.dispatchEvent(new Event('input', {bubbles: true})); }"""
)

DROP = """([name, bytes]) => {
  const carried = new DataTransfer();
  carried.items.add(new File([Uint8Array.from(bytes)], name));
  for (const kind of ['dragenter', 'dragover', 'drop'])
    document.body.dispatchEvent(new DragEvent(kind, {bubbles: true, cancelable: true, dataTransfer: carried})); }"""


@pytest.fixture(scope="module")
def opened(browser, running):
    """The small scene on one page for all tests: opening a browser takes longer than most of them."""
    context = browser.new_context(
        viewport={"width": 1280, "height": 800},
        device_scale_factor=0.5,
        accept_downloads=True,
        reduced_motion="reduce",
    )
    made = context.new_page()
    made.requested = []
    made.errors = []
    made.on("request", lambda request: made.requested.append(request.url))
    made.on("pageerror", lambda error: made.errors.append(str(error)))

    def refused(message):
        if "Content Security Policy" in message.text:
            made.errors.append(message.text)

    made.on("console", refused)
    made.goto(running[0])
    made.wait_for_selector(".marks")
    made.wait_for_selector("#progress", state="hidden")
    yield made
    context.close()


@pytest.fixture
def page(opened):
    """That page without edits, selection and choices of earlier tests."""
    opened.set_default_timeout(60_000)
    opened.set_viewport_size({"width": 1280, "height": 800})
    opened.evaluate(RESET)
    opened.reload()
    opened.wait_for_selector(".marks")
    opened.wait_for_selector("#steps >> text=No edits yet")
    opened.wait_for_selector("#progress", state="hidden")
    return opened


def drag(page, handle, right, down):
    """Drag a handle of the picture by pixels of the screen."""
    box = page.locator(handle).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right, y + down, steps=6)
    page.mouse.up()


def until(page, question, argument=None, seconds=60):
    """Wait until a function of the page says yes."""
    end = time.monotonic() + seconds
    while not page.evaluate(question, argument):
        assert time.monotonic() < end, question
        page.wait_for_timeout(50)


def place(page, x, y):
    """[x, y] on the page of a share of the photo's width and height."""
    box = page.locator(".marks").bounding_box()
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


def select_block(page):
    page.get_by_role("tab", name="Material").click()
    page.mouse.click(*place(page, 0.39, 0.5))
    page.wait_for_selector(SELECTED)


def slide(page, name, value):
    script = """([name, value]) => { const r = document.querySelector(`#${name} input[type=range]`);
      r.value = value; r.dispatchEvent(new Event('input', {bubbles: true})); }"""
    page.evaluate(script, [name, value])


def colour(page, x=0.39, y=0.5):
    """[3] uint8 of the picture that is seen at a share of the photo, outlines and handles aside."""
    left, top = place(page, x, y)
    clip = {"x": left - 2, "y": top - 2, "width": 4, "height": 4}
    pixels = np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))))
    return pixels[len(pixels) // 2, len(pixels) // 2, :3].astype(int)


def becomes(page, test, x=0.39, y=0.5):
    """Wait until the colour at a place passes a test."""
    end = time.monotonic() + 60
    while not test(colour(page, x, y)):
        assert time.monotonic() < end, colour(page, x, y)
        page.wait_for_timeout(100)


def green(rgb):
    return rgb[1] > rgb[0] + 40


def red(rgb):
    return rgb[0] > rgb[1] + 40


def test_the_photo_takes_most_of_the_window_and_everything_is_in_sight(page):
    for (width, height), share in (((1440, 900), 0.55), ((1024, 768), 0.4), ((1920, 1080), 0.5)):
        page.set_viewport_size({"width": width, "height": height})
        until(page, f"() => ({AREA})() > {share}", seconds=5)  # of a photo of 4:3
        for part in ("#undo", "#compare", "#final", "#take", "#steps"):
            box = page.locator(part).bounding_box()
            assert box["y"] >= 0 and box["y"] + box["height"] <= height, part
        assert page.evaluate("document.documentElement.scrollHeight") <= height


def test_select_change_undo_and_reload(page):
    becomes(page, red)
    select_block(page)
    slide(page, "hue", 120)
    page.wait_for_selector("#steps >> text=hue 120")
    becomes(page, green)
    assert np.abs(colour(page, 0.8, 0.8) - colour(page, 0.9, 0.8)).max() < 60
    page.get_by_role("checkbox", name=re.compile("On or off")).uncheck()
    becomes(page, red)
    page.get_by_role("checkbox", name=re.compile("On or off")).check()
    becomes(page, green)
    page.keyboard.down("b")
    becomes(page, red)
    page.keyboard.up("b")
    page.reload()
    page.wait_for_selector("#steps >> text=hue 120")
    page.wait_for_selector(SELECTED)  # the selection, and what can be undone
    becomes(page, green)
    # Both switches are taken back, then the edit itself, and the selection. Keys that come faster than answers, and
    # more of them than there are changes, are no mistake.
    for _ in range(8):
        page.keyboard.press("Control+z")
    page.wait_for_selector("#steps >> text=No edits yet")
    page.wait_for_selector("#undo:disabled")
    becomes(page, red)
    for _ in range(8):
        page.keyboard.press("Control+Shift+z")
    page.wait_for_selector("#steps >> text=hue 120")
    page.wait_for_selector("#redo:disabled")
    assert page.locator("#message").count() == 0
    assert not page.errors


def test_sliders_numbers_colours_presets_and_the_divider(page):
    select_block(page)
    page.locator("#hue input[type=range]").focus()
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    page.wait_for_selector("#steps >> text=hue 6")
    number = page.locator("#hue .number")
    number.fill("")
    number.press("Enter")
    page.wait_for_selector("#steps >> text=hue 6", state="hidden")
    assert number.input_value() == "0°" and page.locator("#message").count() == 0
    number.fill("45")
    number.press("Enter")
    page.wait_for_selector("#steps >> text=hue 45")
    page.locator("#hue input[type=range]").dblclick()
    page.wait_for_selector("#steps >> text=hue 45", state="hidden")
    # A picked colour appears as it was picked, whatever hue was set before.
    slide(page, "hue", 120)
    becomes(page, green)
    page.locator(".colour input").first.evaluate(PICK, "#2040e0")
    becomes(page, lambda rgb: rgb[2] > rgb[1] + 40 and rgb[2] > rgb[0] + 40)
    page.wait_for_selector("#steps >> text=hue", state="hidden")
    # One from the photo, without the light on it: that of the grey wall.
    page.get_by_role("button", name="Take a colour from the photo").first.click()
    page.mouse.click(*place(page, 0.8, 0.6))
    becomes(page, lambda rgb: np.ptp(rgb) < 30)
    page.get_by_role("button", name="Take a colour from the photo").first.click()
    page.keyboard.press("Escape")
    page.wait_for_selector(".stage.dropper", state="detached")
    # A preset, and the divider before it.
    page.get_by_role("button", name="Gold").click()
    page.wait_for_selector("#steps >> text=metallic 1")
    page.locator("#compare").click()
    divider = page.get_by_role("slider", name="Before and after")
    box = divider.bounding_box()
    page.mouse.move(box["x"] + 14, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(*place(page, 0.95, 0.2), steps=4)
    page.mouse.up()
    becomes(page, red)
    divider.press("ArrowLeft")
    assert int(divider.get_attribute("aria-valuenow")) < 95
    page.keyboard.press("c")
    page.wait_for_selector(".divider", state="hidden")
    # A click on what was edited opens its edit, also when something else was chosen meanwhile.
    page.keyboard.press("Escape")
    page.wait_for_selector(SELECTED, state="detached")
    select_block(page)
    page.wait_for_selector("#steps .chip.current >> text=metallic 1")


def test_the_pointer_outlines_what_a_click_takes(page):
    page.mouse.move(*place(page, 0.4, 0.5))
    page.wait_for_selector(".marks .hover", state="attached")
    outline = page.locator(".marks .hover").get_attribute("d")
    page.mouse.move(*place(page, 0.42, 0.52))
    page.mouse.click(*place(page, 0.42, 0.52))
    page.wait_for_selector(SELECTED)
    assert page.locator(".marks .ants").get_attribute("d") == outline
    page.keyboard.press("Escape")
    page.wait_for_selector(SELECTED, state="detached")


def test_box_brush_shift_and_alt(page):
    page.keyboard.press("2")
    page.mouse.move(*place(page, 0.2, 0.28))
    page.mouse.down()
    page.mouse.move(*place(page, 0.56, 0.7), steps=5)
    assert page.locator(".marks .trace").count() == 1
    page.mouse.up()
    page.wait_for_selector(SELECTED)
    outline = "() => document.querySelector('.marks .ants')?.getAttribute('d') ?? ''"
    first = page.evaluate(outline)
    page.keyboard.press("3")
    paint = [place(page, 0.7, 0.8), place(page, 0.9, 0.8)]
    for key in (None, "Alt"):
        before = page.evaluate(outline)
        if key:
            page.keyboard.down(key)
        page.mouse.move(*paint[0])
        page.mouse.down()
        page.mouse.move(*paint[1], steps=5)
        page.mouse.up()
        if key:
            page.keyboard.up(key)
        until(page, f"(old) => ({outline})() !== old", before)
    assert page.evaluate(outline).count("M") >= first.count("M")
    # --- A click takes less or more; either there is such a thing, or the page says that there is none ---
    assert page.locator("#larger").count() == 0
    page.keyboard.press("1")
    page.keyboard.press("Escape")
    until(page, f"() => ({outline})() === ''")
    select_block(page)
    for name, key in (("larger", "]"), ("smaller", "[")):
        page.wait_for_selector(f"#{name}")
        before = page.evaluate(outline)
        page.keyboard.press(key)
        said = f"document.body.innerText.includes('Nothing {name}')"
        until(page, f"(old) => ({outline})() !== old || {said}", before)
        if page.evaluate(f"() => {said}"):
            page.keyboard.press("Escape")


def test_a_swipe_selects_nothing(browser, running):
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    page.goto(running[0])
    page.wait_for_selector(".marks")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    # Tabs of one person share the selection, which an earlier test may have left.
    page.keyboard.press("Escape")
    page.wait_for_selector(SELECTED, state="detached")
    x, y = place(page, 0.3, 0.5)
    swipe = """([x, y]) => { const stage = document.querySelector('#stage');
      const send = (kind, dx) => stage.dispatchEvent(new PointerEvent(kind, {pointerId: 5,
        pointerType: 'touch', isPrimary: true, bubbles: true, clientX: x + dx, clientY: y}));
      stage.setPointerCapture = () => undefined;
      send('pointerdown', 0); for (let dx = 10; dx < 90; dx += 10) send('pointermove', dx);
      send('pointerup', 90); }"""
    picked = []
    page.on(
        "request", lambda request: picked.append(request.url) if "pick" in request.url else None
    )
    page.evaluate(swipe, [x, y])
    assert not picked and page.locator(SELECTED).count() == 0
    page.touchscreen.tap(*place(page, 0.39, 0.5))
    page.wait_for_selector(SELECTED)
    stage = page.locator("#stage").bounding_box()
    panel = page.locator("#panel").bounding_box()
    assert stage["y"] + stage["height"] <= panel["y"] + 1 <= 844
    context.close()


def test_an_object_is_placed_moved_turned_and_scaled(page):
    page.get_by_role("tab", name="Objects").click()
    # Without an object there is nothing to place, and that is said.
    page.keyboard.press("5")
    page.mouse.click(*place(page, 0.5, 0.8))
    page.wait_for_selector("#message >> text=Choose an object")
    page.keyboard.press("Escape")
    page.wait_for_selector("#message", state="detached")
    page.get_by_role("button", name="Cube").click()
    page.wait_for_selector(".stage.place")
    page.mouse.click(*place(page, 0.7, 0.8))
    page.wait_for_selector(".handle.thing")
    # It lands where it is released.
    page.mouse.move(*place(page, 0.7, 0.8))
    page.mouse.down()
    page.mouse.move(*place(page, 0.35, 0.85), steps=8)
    page.mouse.up()
    # Its ring, and with it the other handles, follow as the server answers.
    for mark in (".handle.thing .knob", ".ground-ring"):
        until(
            page,
            f"() => Math.abs(document.querySelector('{mark}').getAttribute('cx') - 22.4) < 1.5",
        )
    assert page.locator("#steps li").count() == 1
    drag(page, ".handle.scale .knob", 40, -40)
    page.wait_for_selector("#steps >> text=/scale 1[.][1-9]/")
    drag(page, ".handle.turn .knob", 60, -10)
    page.wait_for_selector("#steps >> text=/turn [1-9]/")
    page.locator(".handle.turn").press("ArrowLeft")
    # A click elsewhere leaves it; one on it takes it up again.
    page.keyboard.press("Escape")
    page.wait_for_selector(".handle.thing", state="detached")
    page.mouse.click(*place(page, 0.35, 0.82))
    page.wait_for_selector(".handle.thing")


def test_light_sun_and_lamps(page):
    page.get_by_role("tab", name="Light").click()
    page.get_by_role("radio", name="Sunset").click()
    page.wait_for_selector("#steps >> text=sunset")
    page.get_by_role("switch", name="A sun in the sky").check()
    page.wait_for_selector(".sunpad")
    page.locator(".sunpad").press("ArrowUp")
    page.wait_for_selector("#steps >> text=sun 45,43")
    page.keyboard.press("4")
    page.mouse.click(*place(page, 0.6, 0.8))
    page.wait_for_selector(".handle.lamp")
    dark = colour(page, 0.7, 0.9)
    drag(page, ".handle.strength .knob", 60, 0)
    becomes(page, lambda rgb: rgb.sum() > dark.sum() + 20, 0.7, 0.9)  # before the final picture
    assert page.locator("#panel .card").count() == 1
    page.locator(".handle.lamp").press("Delete")
    page.wait_for_selector(".handle.lamp", state="detached")


def seen(page, left, top, right, bottom):
    """[h, w, 3] of a part of the picture, by shares of the photo."""
    x0, y0 = place(page, left, top)
    x1, y1 = place(page, right, bottom)
    clip = {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0}
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")).astype(int)


class Held:
    """Requests to a place that are held back, so that the page is on its own."""

    def __init__(self, page, place):
        self.page = page
        self.place = f"**/api/{place}"
        self.routes = []
        self.holds = True
        page.route(self.place, self._take)

    def _take(self, route):
        if self.holds:
            self.routes.append(route)
        else:
            route.continue_()

    def release(self):
        """Let them go, and wait for the server's picture."""
        self.holds = False
        with self.page.expect_response("**/api/state", timeout=60_000):
            for route in self.routes:
                route.continue_()
        self.page.unroute(self.place)
        self.page.wait_for_timeout(300)  # until it is decoded


def same_by_the_server(page, held, step, inside):
    """What the page has drawn is the server's picture but for the JPEG, when the held requests have made `step`."""
    until(
        page,
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))",
    )
    mine = seen(page, *inside)
    held.release()
    page.wait_for_selector(f"#steps >> text={step}")
    theirs = seen(page, *inside)
    assert np.abs(mine - theirs).max() <= 8 and np.abs(mine - theirs).mean() < 3


@pytest.mark.slow
def test_the_page_draws_changes_as_the_server_does(page):
    # --- A material: by the same formula, so but for the JPEG the same picture ---
    select_block(page)
    page.wait_for_selector("#stage[data-drawn=material]")
    held = Held(page, "set")
    inside = (0.3, 0.4, 0.48, 0.6)
    slide(page, "hue", 120)
    becomes(page, green)
    for name, value in (
        ("saturation", -0.3),
        ("value", 0.4),
        ("roughness", 0.2),
        ("metallic", 0.5),
    ):
        slide(page, name, value)
    same_by_the_server(page, held, "metallic 0.5", inside)
    # --- A new colour keeps the fine shading, here and there ---
    held = Held(page, "set")
    page.locator(".colour input").first.evaluate(PICK, "#3060c0")
    slide(page, "metallic", 0.3)
    same_by_the_server(page, held, "metallic 0.3", inside)
    # --- A lamp that is dragged: without the server its light goes along ---
    page.get_by_role("tab", name="Light").click()
    page.locator("#stage").focus()
    page.keyboard.press("4")
    page.mouse.click(*place(page, 0.3, 0.75))
    page.wait_for_selector("#stage[data-drawn=lamps]")
    held = Held(page, "lamps")
    wall = (0.6, 0.4, 0.95, 0.7)
    before = seen(page, *wall)
    drag(page, ".handle.lamp", 0.35 * page.locator(".marks").bounding_box()["width"], 0)
    until(page, "() => new Promise((done) => setTimeout(() => done(true), 200))")
    mine = seen(page, *wall)
    assert (mine - before).mean() > 5
    held.release()
    theirs = seen(page, *wall)
    assert np.quantile(np.abs(mine - theirs), 0.98) <= 14
    assert np.abs(mine - theirs).mean() < 6
    # --- An object: what was sketched at one place is seen at the other ---
    page.get_by_role("tab", name="Objects").click()
    page.get_by_role("button", name="Ball").click()
    page.mouse.click(*place(page, 0.3, 0.9))
    page.wait_for_selector("#stage[data-drawn=thing]")
    held = Held(page, "place")
    there = (0.72, 0.86, 0.74, 0.88)
    before = seen(page, *there)
    drag(page, ".handle.thing", 0.45 * page.locator(".marks").bounding_box()["width"], 0)
    end = time.monotonic() + 30
    while np.abs(seen(page, *there) - before).max() <= 15:
        assert time.monotonic() < end
        page.wait_for_timeout(100)
    held.release()
    assert np.abs(seen(page, *there) - before).max() > 15
    assert not page.errors


@pytest.mark.slow
def test_final_picture_and_download(page, tmp_path):
    page.set_default_timeout(300_000)
    select_block(page)
    slide(page, "hue", 120)
    page.wait_for_selector("#steps >> text=hue 120")
    page.locator("#final").click()
    page.wait_for_selector("#progress .stop")
    page.wait_for_selector("#stage[data-kind=final]")
    becomes(page, green)
    page.locator("#take").click()
    with page.expect_download() as download:
        page.locator("#take-png").click()
    assert download.value.suggested_filename == "room-edited.png"
    download.value.save_as(tmp_path / "a.png")
    picture = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    assert green(picture[24, 25, :3])


@pytest.mark.slow
def test_a_dropped_scene_opens_and_photos_are_kept(page, tmp_path):
    file = zipped_package(tmp_path)
    page.get_by_role("button", name="Photos").click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose a file").click()
    chooser.value.set_files(str(file))
    page.wait_for_selector(".bar h1[title=a]")
    page.wait_for_selector("#progress", state="hidden")
    # Deleted on another page, this one has photos to choose from in place of an empty window.
    other = page.context.new_page()
    other.goto(page.url)
    other.wait_for_selector(".marks")
    other.evaluate(DISCARD)
    page.wait_for_selector(".veil.open")
    other.close()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose a file").click()
    chooser.value.set_files(str(file))
    page.wait_for_selector(".bar h1[title=a]")
    page.wait_for_selector("#progress", state="hidden")
    page.get_by_role("button", name="Photos").click()
    assert page.locator("#projects li").count() >= 2
    page.locator("#projects li").first.hover()
    page.get_by_role("button", name=re.compile("^Rename")).first.click()
    page.locator("#projects input").fill("Kitchen")
    page.keyboard.press("Enter")
    page.wait_for_selector("#projects >> text=Kitchen")
    page.get_by_role("button", name="Delete: Kitchen").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    page.wait_for_selector("#projects >> text=Kitchen", state="detached")
    page.locator("#projects .photo").first.click()
    page.wait_for_selector(".marks")
    assert not page.errors


def test_the_look_panel_shows_brightness_maps_and_the_mesh(page):
    select_block(page)
    page.get_by_role("tab", name="Look").click()
    page.wait_for_selector("#histogram path")
    before = page.locator("#histogram path").first.get_attribute("d")
    grey = colour(page, 0.8, 0.6)
    slide(page, "exposure", -2)
    becomes(page, lambda rgb: rgb.sum() < grey.sum() / 1.5, 0.8, 0.6)
    page.locator("#exposure input[type=range]").dblclick()
    # Maps and counts are those of the edited scene.
    page.get_by_role("tab", name="Material").click()
    slide(page, "hue", 120)
    page.wait_for_selector("#steps >> text=hue 120")
    page.get_by_role("tab", name="Look").click()
    changed = "(old) => document.querySelector('#histogram path')?.getAttribute('d') !== old"
    until(page, changed, before)
    page.wait_for_selector("text=It is too dark")
    page.locator("#show-mesh").click()
    page.wait_for_selector("#mesh[data-ready=yes]")
    middle = place(page, 0.39, 0.5)

    def seen():
        clip = {"x": middle[0] - 40, "y": middle[1] - 40, "width": 80, "height": 80}
        return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))))[..., :3].astype(int)

    end = time.monotonic() + 30
    while not green(seen()[20, 20]):
        assert time.monotonic() < end
    front = seen()
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    while np.abs(seen() - front).max() < 40:
        assert time.monotonic() < end
    page.keyboard.press("Escape")
    page.wait_for_selector("#mesh", state="detached")
    page.locator("#stage").focus()
    page.keyboard.press("z")
    page.wait_for_selector("#own-pixels[aria-pressed=true]")
    page.keyboard.press("z")
    page.wait_for_selector("#own-pixels[aria-pressed=false]")


def test_nothing_is_asked_of_anyone_else_and_the_page_is_small(page, running):
    for name in ("Light", "Objects", "Look", "Material"):
        page.get_by_role("tab", name=name).click()
    page.keyboard.press("?")
    page.wait_for_selector("text=Keys and gestures")
    outside = [u for u in page.requested if not u.startswith((running[0], "data:", "blob:"))]
    assert not outside and not page.errors
    sizes = page.evaluate(
        """() => Promise.all(performance.getEntriesByType('resource')
          .filter((e) => e.name.includes('/assets/'))
          .map(async (e) => (await (await fetch(e.name)).arrayBuffer()).byteLength))"""
    )
    assert 10_000 < sum(sizes) < 500_000


CONTRAST = """() => {
  const lum = (c) => { const f = (v) => { v /= 255; return v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; };
    return .2126 * f(c[0]) + .7152 * f(c[1]) + .0722 * f(c[2]); };
  const rgba = (s) => { const m = s.match(/[\\d.]+/g).map(Number); return m.length > 3 ? m : [...m, 1]; };
  const low = [];
  for (const n of document.querySelectorAll('button, label, span, p, h1, h2, h3, b, li, summary, code, input')) {
    const text = [...n.childNodes].some((c) => c.nodeType === 3 && /\\w/.test(c.textContent));
    const icon = n.matches('.icon-only[aria-pressed=true]');
    if (!(text || icon) || n.disabled || n.closest(':disabled')) continue;
    if (!n.checkVisibility({visibilityProperty: true, opacityProperty: true}) || n.closest('#stage')) continue;
    const ink = rgba(getComputedStyle(n).color);
    let paper = null;
    for (let p = n; p && !paper; p = p.parentElement) {
      const b = rgba(getComputedStyle(p).backgroundColor); if (b[3] > .8) paper = b; }
    const [a, b] = [lum(ink), lum(paper || [255, 255, 255])].sort((x, y) => y - x);
    if ((a + .05) / (b + .05) < 4.5) low.push([n.tagName, n.ariaLabel || n.textContent.trim().slice(0, 40)]);
  }
  return low; }"""
UNNAMED = """() => [...document.querySelectorAll('button, input, select, [role=application], [role=slider]')]
  .filter((n) => n.checkVisibility() && !n.innerText && !n.ariaLabel && !n.title
          && !(n.labels && n.labels.length)).map((n) => n.outerHTML.slice(0, 160))"""


def test_text_is_readable_and_things_have_names(page):
    # Dark as the system says, then light as is chosen, which is remembered.
    page.emulate_media(color_scheme="dark")
    page.reload()  # an idle page may be told of another scheme much later
    page.wait_for_selector(".marks")
    select_block(page)
    for theme in ("dark", "light"):
        page.wait_for_selector(f"html[data-theme={theme}]")
        for name in ("Material", "Light", "Objects", "Look"):
            page.get_by_role("tab", name=name).click()
            page.wait_for_selector("#panel .group")
            assert page.evaluate(CONTRAST) == [], (theme, name)
            assert page.evaluate(UNNAMED) == [], name
        # A pressed tool can be seen, too, while the pointer is over it.
        page.locator(".tools .icon-only[aria-pressed=true]").first.hover()
        assert page.evaluate(CONTRAST) == [], theme
        for opener in ("Photos", "Take away", "Help"):
            page.get_by_role("button", name=opener).first.click()
            page.wait_for_selector("[role=dialog]")
            assert page.evaluate(CONTRAST) == [], (theme, opener)
            assert page.evaluate(UNNAMED) == [], opener
            page.keyboard.press("Escape")
            page.wait_for_selector("[role=dialog]", state="detached")
        if theme == "dark":
            page.locator("#theme").click()
            page.reload()
            page.wait_for_selector(SELECTED)


def test_by_keyboard_alone(page):
    page.locator("#stage").focus()
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    page.wait_for_selector(SELECTED)
    steps = 0
    while not page.evaluate("document.activeElement.closest('#hue') !== null"):
        page.keyboard.press("Tab")
        steps += 1
        assert steps < 40
    outline = "getComputedStyle(document.activeElement).outlineStyle"
    assert page.evaluate(outline) == "solid"
    page.keyboard.press("ArrowRight")
    page.wait_for_selector("#steps >> text=hue 1")
    page.keyboard.press("Delete")
    page.wait_for_selector("#steps >> text=No edits yet")


def kept(folder):
    """What lies in a work folder but uploads: each file with its content."""
    files = (f for f in folder.rglob("*") if f.is_file() and "cache" not in str(f))
    return {file.name: file.read_bytes() for file in files}


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="no limit of another process")
def test_a_full_disk_is_said_and_leaves_all_as_it_was(page, running):
    _, work, process = running
    select_block(page)
    page.get_by_role("button", name="Gold").click()
    page.wait_for_selector("#steps >> text=metallic 1")
    before = kept(work)
    limits = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        page.get_by_role("button", name="Rubber").click()
        page.wait_for_selector("#message >> text=edits.yaml cannot be written")
        assert "metallic 1" in page.locator("#steps").inner_text()
        drop_picture(page)
        page.wait_for_selector("#message >> text=dropped.png cannot be written")
        page.wait_for_selector("#progress", state="hidden")
        assert kept(work) == before
    finally:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, limits)
    page.locator("#message button").click()
    page.get_by_role("button", name="Rubber").click()
    page.wait_for_selector("#steps >> text=metallic 0")


def drop_picture(page):
    content = io.BytesIO()
    Image.new("RGB", (64, 48), (200, 120, 60)).save(content, "PNG")
    page.evaluate(DROP, ["dropped.png", [*content.getvalue()]])


@pytest.mark.slow
def test_a_removal_and_glass_go_on_over_a_reload(page):
    page.set_default_timeout(40_000)
    select_block(page)
    page.get_by_role("button", name="Glass", exact=True).click()
    page.wait_for_selector("#steps >> text=Glass")
    page.reload()
    page.wait_for_selector("#stage .badge >> text=/^Glass traced/")
    page.evaluate(RESET)
    select_block(page)
    page.locator("summary >> text=Remove it").click()
    page.locator("#remove").click()
    page.wait_for_selector("#progress .stop")
    page.reload()
    page.wait_for_selector("#progress .stop")
    page.wait_for_selector("#steps >> text=Removed")
    assert not page.errors


@pytest.mark.slow
def test_a_studio_that_is_ended_in_a_final_picture_keeps_what_was_saved(browser, tmp_path):
    scene = str(package(tmp_path))
    work = tmp_path / "work"
    with studio_server.studio(tmp_path, scene) as (process, address):
        page = browser.new_page()
        page.goto(address)
        page.wait_for_selector(".marks")
        page.wait_for_selector("#progress", state="hidden")
        select_block(page)
        page.get_by_role("button", name="Gold").click()
        page.wait_for_selector("#steps >> text=metallic 1")
        before = kept(work)
        page.locator("#final").click()
        page.wait_for_selector("#progress .stop")
        page.wait_for_timeout(1500)
        started = psutil.Process(process.pid).children(recursive=True)
        assert len(started) > 1
        process.terminate()
        process.wait(10)
        _, left = psutil.wait_procs(started, 5)
        assert not left
        page.close()
    assert {n: c for n, c in kept(work).items() if n in before} == before
    assert not [file for file in work.rglob("*") if "partial" in file.name or "cache" in file.name]
    with studio_server.studio(tmp_path, scene) as (process, address):
        page = browser.new_page()
        page.goto(address)
        page.wait_for_selector("#steps >> text=metallic 1")
        page.close()


@pytest.mark.slow
def test_the_whole_story(page, tmp_path):
    """A dropped photo is shown at once, stopped and begun again, reloaded in the middle, and edited."""
    page.set_default_timeout(400_000)
    from materialist.io.photo import example_path

    Image.open(example_path("coffee")).resize((150, 100)).save(tmp_path / "coffee.png")
    for stopped in (True, False):
        page.get_by_role("button", name="Photos").click()
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Choose a file").click()
        chooser.value.set_files(str(tmp_path / "coffee.png"))
        page.wait_for_selector("#progress .stop")
        if stopped:
            page.locator("#progress .stop").click()
            page.wait_for_selector(".note >> text=Stopped")
    page.wait_for_selector(".found img")  # maps as they come
    page.reload()
    page.wait_for_selector("#progress .stop")  # the work goes on
    page.wait_for_selector(".marks")
    page.wait_for_selector("#progress", state="hidden")
    page.mouse.click(*place(page, 0.3, 0.8))
    page.wait_for_selector(SELECTED)
    slide(page, "hue", 100)
    page.wait_for_selector("#steps >> text=hue 100")
    assert not page.errors
