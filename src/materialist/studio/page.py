"""The page: the stage with its tools on one side, the tabs on the other; on a phone one below the other."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import gradio as gr

from materialist.errors import InputError
from materialist.studio import tab_light, tab_look, tab_material, tab_object, tab_open, tab_take
from materialist.studio.context import Context, steps
from materialist.studio.follow import follow
from materialist.studio.guard import guarded
from materialist.studio.hub import Hub
from materialist.studio.selection import read_pick, sam_missing
from materialist.studio.session import Session
from materialist.studio.showing import Final

TITLE = "Materialist studio"
DRAFT_SPP = 16
"""Paths a pixel of a quick look at the final picture."""
_HEAD = (
    "<h1>Materialist</h1><p>One photo, taken apart into shape, material and light. Click something and change it.</p>"
)


def build(hub: Hub) -> Any:
    """The Gradio page; `server` shows it."""
    context = Context(hub)
    parts = context.parts
    with gr.Blocks(title=TITLE, analytics_enabled=False, fill_width=True) as page:
        parts["token"] = gr.BrowserState("", storage_key="materialist-person", secret="page")
        parts["last"] = gr.BrowserState("", storage_key="materialist-last", secret="page")
        gr.HTML(_HEAD, elem_id="head", js_on_load=None)
        with gr.Row(elem_id="body"):
            with gr.Column(scale=5, min_width=320, elem_id="left"):
                _left(parts)
            with gr.Column(scale=4, min_width=320), gr.Tabs(selected="open") as tabs:
                parts["tabs"] = tabs
                tab_open.layout(context)
                tab_material.layout(context)
                tab_light.layout(context)
                tab_object.layout(context)
                tab_look.layout(context)
                tab_take.layout(context)
        _wire(context)
        for tab in (tab_material, tab_light, tab_object, tab_look, tab_take):
            tab.wire(context)
        tab_open.wire(context, page)
        page.unload(_leaver(hub))
    return page


def asset(name: str) -> str:
    """The text of a file in assets."""
    return _asset(name)


@cache
def _asset(name: str) -> str:
    return (files("materialist.studio") / "assets" / name).read_text("utf-8")


def _left(parts: dict[str, Any]) -> None:
    """The stage, its tools, and the list of edits."""
    parts["stage"] = gr.HTML(
        {"picture": "", "width": 0, "height": 0, "badge": ""}, html_template=asset("stage.html"),
        js_on_load=asset("stage.js"), elem_id="stage",
    )  # fmt: skip
    with gr.Row(elem_id="tools"):
        tools = [
            ("Click", "click"),
            ("Box", "box"),
            ("Brush", "brush"),
            ("Place a lamp", "lamp"),
            ("Place an object", "place"),
        ]
        parts["tool"] = gr.Radio(tools, value="click", label="Tool", scale=3, min_width=220)
        modes = [("New", "new"), ("Add (Shift)", "add"), ("Remove (Alt)", "remove")]
        parts["mode"] = gr.Radio(modes, value="new", label="Selection", scale=3, min_width=220)
        parts["brush"] = gr.Slider(
            2, 60, 12, step=1, label="Brush size", scale=2, min_width=140, buttons=[], elem_id="brush"
        )
    missing = sam_missing()
    parts["sam"] = gr.Checkbox(
        False, label="Find objects with SAM 2", interactive=missing is None, elem_id="sam",
        info=missing or "A trained network in place of colour, depth and normals; seconds a click.",
    )  # fmt: skip
    with gr.Row():
        parts["undo"] = gr.Button("Undo", size="sm", min_width=80)
        parts["deselect"] = gr.Button("Select nothing", size="sm", min_width=110)
        parts["draft"] = gr.Button("Quick look, path traced", size="sm", min_width=150)
        parts["final"] = gr.Button("Final picture", size="sm", variant="primary", min_width=120)
        parts["stop"] = gr.Button("Stop", size="sm", variant="stop", min_width=70, visible=False)
    parts["progress"] = gr.HTML("", elem_id="progress", js_on_load=None)
    parts["steps"] = gr.HTML([], html_template=asset("steps.html"), js_on_load=asset("steps.js"), elem_id="steps")


def _wire(context: Context) -> None:
    """Events of the left side."""
    quick: dict[str, Any] = {"queue": False, "show_progress": "hidden", "api_visibility": "private"}
    for name in ("tool", "mode", "brush"):
        script = f"(v) => {{ document.body.dataset.{name} = v; }}"
        context[name].change(None, context[name], None, js=script, api_visibility="private")

    @guarded
    def pick(sam: bool, event: gr.EventData, request: gr.Request) -> dict[Any, Any]:
        session, wanted = context.session(request), read_pick(event._data)
        if wanted["tool"] == "lamp":
            tab_light.place_lamp(session, *wanted["at"])
        elif wanted["tool"] == "place":
            session.place(*wanted["at"])
        else:
            session.pick(wanted, "sam2" if sam else "network")
        return context.everything(session)

    @guarded
    def act(event: gr.EventData, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        what = str(event._data.get("what"))
        session.act(what, int(event._data.get("index", -1)))
        return {**context.everything(session), **(_turned_to(context, session) if what == "choose" else {})}

    @guarded
    def undo(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if not session.undo():
            raise InputError("There is nothing to take back.")
        return context.everything(session)

    @guarded
    def deselect(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.deselect()
        return context.everything(session)

    every = {**quick, "trigger_mode": "multiple"}  # no click is lost; the session takes them one by one
    context["stage"].pick(pick, context["sam"], context.all_parts, **every)
    context["steps"].act(act, None, [*context.all_parts, context["tabs"], context["glass_part"]], **every)
    context["undo"].click(undo, None, context.all_parts, **every)
    context["deselect"].click(deselect, None, context.all_parts, **quick)
    _wire_final(context)


def _turned_to(context: Context, session: Session) -> dict[Any, Any]:
    """The tab with the controls of the step in hand."""
    tabs = {"edit": "material", "relight": "light", "insert": "object", "drop": "object", "glass": "object"}
    tab = tabs.get(session.in_hand or "")
    found = {context["tabs"]: gr.Tabs(selected=tab)} if tab else {}
    return found | ({context["glass_part"]: gr.update(open=True)} if session.in_hand == "glass" else {})


def _wire_final(context: Context) -> None:
    """Path-traced pictures, and the button that stops the one that this page asked for."""
    hub = context.hub
    outputs = [*context.picture_parts, context["progress"], context["stop"]]

    def render(spp: int) -> Any:
        @guarded
        def run(request: gr.Request) -> Any:
            session = context.session(request)
            _ = session.scene
            steps_now = session.stack.active
            edits = session.edits_now()
            if not edits or session.project is None:
                raise gr.Error("There is no edit to render yet: change something first.", print_exception=False)
            target = session.final_file
            job = hub.jobs.submit(
                "final", session.person, session.desk, scene=str(session.project.scene), edits=edits,
                output=str(target), spp=spp,
            )  # fmt: skip
            session.asked("final", job)
            for html in follow(hub.jobs, job):
                yield {context["progress"]: html, context["stop"]: gr.update(visible=not job.over)}
            if job.state == "done":
                session.final = Final(steps_now, target, spp)
                yield {context["stage"]: session.stage(), context["steps"]: steps(session)}

        return run

    free: dict[str, Any] = {"show_progress": "hidden", "concurrency_limit": None, "api_visibility": "private"}
    context["final"].click(render(tab_take.SPP), None, outputs, **free)
    context["draft"].click(render(DRAFT_SPP), None, outputs, **free)

    @guarded
    def stop(request: gr.Request) -> None:
        context.session(request).stop(hub.jobs, "final")

    context["stop"].click(stop, None, None, queue=False, show_progress="hidden", api_visibility="private")


def _leaver(hub: Hub) -> Any:
    def leave(request: gr.Request) -> None:
        hub.leave(request.session_hash)

    return leave
