"""The brush, falling objects and live glass in a real browser."""

import pytest
from studio_browser import (
    PICTURE,
    click_photo,
    mask,
    move,
    pixels,
    place,
    press,
    select_block,
    slide,
)

MASK = "getComputedStyle(document.querySelector('#stage .fill')).maskImage"


def stroke(page, points, key=None):
    """Paint through shares of the stage with the mouse, and wait for the selection that comes of it."""
    before = page.evaluate(MASK)
    if key:
        page.keyboard.down(key)
    page.mouse.move(*place(page, *points[0]))
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*place(page, *point), steps=4)
    assert page.locator("#stage .trace.stroke").count() == 1
    page.mouse.up()
    if key:
        page.keyboard.up(key)
    page.wait_for_function(f"(old) => {MASK} !== old", arg=before)


def test_the_brush_paints_and_rubs_out(page):
    press(page, "Brush")
    move(page, "brush", 3)
    page.mouse.move(*place(page, 0.5, 0.5))
    assert page.locator("#stage .ring").get_attribute("r") == "3"
    stroke(page, [(0.2, 0.75), (0.8, 0.75)])
    painted = mask(page)
    assert (
        painted[36, 14:50].all()
        and painted[33:39, 30].all()
        and not painted[30].any()
        and not painted[42].any()
    )
    stroke(page, [(0.5, 0.25), (0.5, 0.6)])  # adds, in whatever mode
    assert mask(page)[20, 32] and mask(page)[36, 20]
    stroke(page, [(0.5, 0.6), (0.5, 0.95)], key="Alt")
    rubbed = mask(page)
    assert not rubbed[34:38, 31:34].any() and rubbed[36, 20] and rubbed[36, 44]
    press(page, "Remove (Alt)")
    stroke(page, [(0.1, 0.75), (0.4, 0.75)])
    assert not mask(page)[36, 14:25].any() and mask(page)[36, 44]
    slide(page, "hue", 120)  # what is painted can be edited
    page.wait_for_selector("#steps >> text=hue 120")
    assert not page.errors


def test_what_is_zoomed_is_hit_where_it_is_seen(page):
    press(page, "Brush")
    move(page, "brush", 2)
    wide = "parseFloat(document.querySelector('#stage .sheet').style.width)"
    x, y = place(page, 0.4, 0.5)
    page.mouse.move(x, y)
    page.mouse.wheel(0, -400)
    page.wait_for_function(f"Math.abs({wide} - 272) < 1")
    page.mouse.down(button="middle")
    page.mouse.move(x + 60, y + 40, steps=3)
    page.mouse.up(button="middle")
    assert mask(page) is None  # who drags the picture selects nothing
    page.mouse.click(x + 60, y + 40)
    page.wait_for_selector("#stage .view[data-selected=yes]")
    rows, columns = mask(page).nonzero()
    assert abs(rows.mean() + 0.5 - 0.5 * 48) < 1 and abs(columns.mean() + 0.5 - 0.4 * 64) < 1
    page.locator("#stage .view").focus()
    page.keyboard.press("0")
    page.wait_for_function(f"{wide} === 100")


def test_the_photo_is_seen_as_long_as_a_key_is_held(page):
    photo = page.evaluate(PICTURE)
    select_block(page)
    slide(page, "hue", 120)
    before = page.locator("#stage .before")
    page.locator("#before").hover()
    keys = page.keyboard
    for hold, let_go in (
        (lambda: keys.down("b"), lambda: keys.up("b")),
        (page.mouse.down, page.mouse.up),
    ):
        hold()
        assert before.is_visible() and before.get_attribute("src") == photo
        let_go()
        assert not before.is_visible()


def test_light_that_was_dragged_is_made_again_at_rest(page):
    page.get_by_role("tab", name="Light").click()
    page.locator("#lights button").nth(5).click()
    page.wait_for_selector("#steps >> text=sunset")
    page.evaluate("""() => { window.seen = 0; new MutationObserver(() => window.seen++).observe(
        document.querySelector('#stage .photo'), {attributes: true, attributeFilter: ['src']}); }""")
    move(page, "rotate", 90)
    page.wait_for_function("window.seen === 2")


def test_selecting_by_clicks(page):
    select_block(page)
    first = mask(page)
    one = page.evaluate(MASK)
    click_photo(page, 0.8, 0.8, ["Shift"])
    page.wait_for_function(f"(old) => {MASK} !== old", arg=one)
    assert mask(page).sum() > first.sum()
    both = page.evaluate(MASK)
    click_photo(page, 0.39, 0.5)  # again: taken away
    page.wait_for_function(f"(old) => {MASK} !== old", arg=both)
    left = mask(page)
    assert left is None or not left[24, 25]


@pytest.mark.slow
def test_glass_follows_its_slider(page):
    page.set_default_timeout(240_000)
    select_block(page)
    page.get_by_role("tab", name="Objects").click()
    page.get_by_role("button", name="Turn the selection to glass").click()
    page.click("#glass")
    page.wait_for_selector("#stage .view[data-waiting=yes]")
    page.wait_for_selector("#progress >> text=/glass/")
    sketch = pixels(page)
    move(page, "glass_ior", 1.2)  # while the body is in the making
    page.wait_for_selector("#stage .badge >> text=Glass traced")
    assert "refraction 1.2" in page.inner_text("#steps")
    clear = pixels(page)
    assert abs(clear[18:30, 18:32].astype(int) - sketch[18:30, 18:32]).max() > 10
    move(page, "glass_transmission", 0.3)
    page.wait_for_selector("#stage .view[data-waiting=yes]")
    page.wait_for_selector("#stage .badge >> text=Glass traced")
    coated = pixels(page)[20:28, 20:30].reshape(-1, 3).mean(0)
    assert (
        coated[0] - coated[1] > clear[20:28, 20:30, 0].mean() - clear[20:28, 20:30, 1].mean() + 10
    )  # red again
    page.locator("#steps .text").click()  # no longer current, and current again
    page.wait_for_selector("#steps li:not(.current)")
    page.locator("#steps .text").click()
    page.wait_for_selector("#steps li.current")
    value = page.locator("#glass_transmission input[type=range]").input_value()
    assert float(value) == 0.3
    page.get_by_role("button", name="Remove: edit 1").click()
    page.wait_for_function("document.querySelector('#stage .badge').textContent === 'Photo'")
    assert not page.inner_text("#progress")  # nothing is said of a glass that is gone
    assert not page.errors


@pytest.mark.slow
def test_an_object_falls_on_the_page(page):
    pytest.importorskip("mujoco", reason="needs the physics extra")
    page.set_default_timeout(120_000)
    page.get_by_role("tab", name="Objects").click()
    page.get_by_label("Object", exact=True).click()
    page.get_by_role("option", name="Cube").click()
    page.wait_for_function("document.body.dataset.tool === 'place'")
    click_photo(page, 0.75, 0.8)
    page.wait_for_selector("#steps >> text=Object: cube")
    page.get_by_role("button", name="Let it fall").first.click()
    page.click("#rest")
    page.wait_for_selector("#steps >> text=/Fallen: cube/")
    page.get_by_role("button", name="Undo").click()
    page.wait_for_selector("#steps >> text=Object: cube")
    assert not page.errors


def test_a_refused_file_leaves_its_field(page, tmp_path):
    (tmp_path / "broken.png").write_bytes(b"not an image")
    (tmp_path / "empty.yaml").write_text("nothing")
    (tmp_path / "none.obj").write_text("v 0 0 0\n")
    for tab, part, name, words in (
        ("Open", "file", "broken.png", "not an image"),
        ("Light", "own_map", "broken.png", "not an image"),
        ("Take away", "recipe", "empty.yaml", "holds no list"),
        ("Objects", "own_mesh", "none.obj", "no faces|no triangles|empty"),
    ):
        page.get_by_role("tab", name=tab).click()
        page.set_input_files(f"#{part} input[type=file]", str(tmp_path / name))
        page.wait_for_selector(f"text=/{words}/")
        page.wait_for_function(
            "([part, name]) => !document.querySelector(`#${part}`).textContent.includes(name)",
            arg=[part, name.split(".")[0]],
        )
        page.wait_for_selector(f"#{part} input[type=file]", state="attached")
    page.errors.clear()
