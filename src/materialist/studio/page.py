"""The page: the stage with its tools on one side, the tabs on the other; on a phone one below the other."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import gradio as gr

from materialist.edits.glass.operation import GLASS
from materialist.edits.light.operation import RELIGHT
from materialist.edits.material.operation import EDIT
from materialist.edits.select import sam
from materialist.errors import InputError
from materialist.studio import (
    asset,
    tab_light,
    tab_look,
    tab_material,
    tab_object,
    tab_open,
    tab_take,
)
from materialist.studio.lights import place_lamp
from materialist.studio.objects import place
from materialist.studio.selection import read_pick
from materialist.studio.session import Session
from materialist.studio.stage import stage
from materialist.studio.studio import Studio
from materialist.studio.widgets import PageContext, Updates, steps

TABS = (tab_material, tab_light, tab_object, tab_look, tab_take)
_HEAD = (
    "<h1>Materialist</h1><p>One photo, taken apart "
    "into shape, material and light. Click something and change it.</p>"
)


def build(studio: Studio) -> Any:
    context = PageContext(studio)
    parts = context.parts

    with gr.Blocks(title="Materialist studio", analytics_enabled=False, fill_width=True) as page:
        gr.State()  # with one, a page holds a request as long as it is open
        gr.HTML(_HEAD, elem_id="head", js_on_load=None)
        # --- The stage on the left, the tabs on the right ---
        with gr.Row(elem_id="body"):
            with gr.Column(scale=5, min_width=320, elem_id="left"):
                _left(parts)
            with (
                gr.Column(scale=4, min_width=320),
                gr.Tabs(selected="open", overflow_behavior="wrap") as tabs,
            ):
                parts["tabs"] = tabs
                for tab in (tab_open, *TABS):
                    tab.layout(context)
        # --- Events: all components are there now ---
        _wire(context)
        for tab in TABS:
            tab.wire(context)
        tab_open.wire(context, page)
    return page


def _left(parts: dict[str, Any]) -> None:
    with gr.Column(elem_id="frame"):
        parts["stage"] = gr.HTML(
            {"picture": "", "width": 0, "height": 0, "badge": ""},
            html_template=asset("stage.html"),
            js_on_load=asset("stage.js"),
            elem_id="stage",
        )
        # Not beside a button that starts a job: it must not come to lie where one was just clicked.
        with gr.Row(elem_id="strip"):
            parts["before"] = gr.Button(
                "Before (hold, or B)", size="sm", min_width=90, elem_id="before"
            )
            parts["progress"] = gr.HTML("", elem_id="progress", js_on_load=None)
            parts["stop"] = gr.Button(
                "Stop", size="sm", variant="stop", visible=False, min_width=70, elem_id="stop"
            )
    with gr.Row(elem_id="tools"):
        # --- Tools of the pointer, and what a selection does to the one before ---
        tools = [("Click", "click"), ("Box", "box"), ("Brush", "brush"), ("Place a lamp", "lamp")]
        tools.append(("Place an object", "place"))
        parts["tool"] = gr.Radio(
            tools, value="click", label="Tool (keys 1 to 5)", scale=3, min_width=220
        )
        modes = [("New", "new"), ("Add (Shift)", "add"), ("Remove (Alt)", "remove")]
        parts["mode"] = gr.Radio(modes, value="new", label="Selection", scale=3, min_width=220)
        parts["brush"] = gr.Slider(
            2,
            60,
            12,
            step=1,
            label="Brush size",
            scale=2,
            min_width=140,
            buttons=[],
            elem_id="brush",
        )
    # Shown even where it cannot be used, with the way to get it.
    missing = sam.sam_problem()
    parts["sam"] = gr.Checkbox(
        False,
        label="Find objects with SAM 2",
        interactive=missing is None,
        elem_id="sam",
        info=missing or "A trained network in place of colour, depth and normals; seconds a click.",
    )
    with gr.Row():
        parts["undo"] = gr.Button("Undo", size="sm", min_width=70, elem_id="undo")
        parts["redo"] = gr.Button("Redo", size="sm", min_width=70, elem_id="redo")
        parts["deselect"] = gr.Button("Select nothing", size="sm", min_width=110)
        parts["final"] = gr.Button("Final picture", size="sm", variant="primary", min_width=120)
    parts["steps"] = gr.HTML(
        [], html_template=asset("steps.html"), js_on_load=asset("steps.js"), elem_id="steps"
    )


def _wire(context: PageContext) -> None:
    parts = context.parts
    for name in ("tool", "mode", "brush"):
        script = f"(v) => {{ document.body.dataset.{name} = v; }}"
        parts[name].change(None, parts[name], None, js=script, api_visibility="private")
    # No click is lost; the session takes them one by one.
    every: dict[str, Any] = {"everything": True, "trigger_mode": "multiple"}
    context.live(parts["stage"].pick, _pick, "sam", "kelvin", "power", "before", data=True, **every)
    context.live(parts["steps"].act, _act, data=True, more=("tabs", "glass_part"), **every)
    for name, change in (("undo", Session.undo), ("redo", partial(Session.undo, again=True))):
        context.live(parts[name].click, change, **every)
    context.live(parts["deselect"].click, Session.deselect, everything=True, trigger_mode="once")
    context.long(parts["final"].click, partial(_render, context))
    context.long(parts["stop"].click, partial(_stop, context))


def _pick(
    session: Session, data: Any, sam: bool, kelvin: float, power: float, before: float
) -> None:
    picked = read_pick(data)
    if picked["tool"] == "lamp":
        x, y = picked["at"]
        place_lamp(session, x, y, kelvin, power, before)
    elif picked["tool"] == "place":
        place(session, *picked["at"])
    else:
        session.pick(picked, "sam2" if sam else "network")


def _act(session: Session, data: Any) -> Updates:
    """One of the buttons of the list; an edit that is chosen shows its tab."""
    session.act(str(data.get("what")), int(data.get("index", -1)))
    kind = session.current_kind
    if data["what"] != "choose" or kind is None:
        return {}
    # What has no tab of its own is among the objects.
    tab = {EDIT.name: "material", RELIGHT.name: "light"}.get(kind, "object")
    updates = {"tabs": gr.Tabs(selected=tab)}
    return updates | ({"glass_part": gr.update(open=True)} if kind == GLASS.name else {})


def _stop(context: PageContext, session: Session) -> Iterator[Updates]:
    """Stop whatever this page asked for; whoever follows it says so."""
    session.stop(context.studio.jobs)
    yield {}


def _render(context: PageContext, session: Session) -> Iterator[Updates]:
    """A path-traced picture."""
    _ = session.scene
    if not session.edits.active:
        raise InputError("There is no edit to render yet: change something first.")
    if (yield from context.traced(session)) is not None:
        yield {"stage": stage(session), "steps": steps(session)}
