"""The part of the Objects tab that turns the selection to glass, and the pictures that follow its sliders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gradio as gr
import numpy as np

from materialist.option_kinds import parse_colour
from materialist.studio.context import Context
from materialist.studio.follow import box
from materialist.studio.guard import guarded
from materialist.studio.tab_material import hex_colour

_SLIDERS = {
    "ior": (1.0, 2.5, 1.5, 0.01, "Index of refraction"),
    "transmission": (0.0, 1.0, 1.0, 0.01, "How much light goes through"),
    "roughness": (0.0, 1.0, 0.0, 0.01, "Roughness: clear to frosted"),
}
_INSIDE = [("solid", ""), ("hollow", "true"), ("open at the top", "open")]


def layout(context: Context) -> None:
    """The components."""
    parts = context.parts
    for name, (low, high, start, step, label) in _SLIDERS.items():
        part = gr.Slider(low, high, start, step=step, label=label, buttons=[], elem_id=f"glass_{name}")
        parts[f"glass_{name}"] = part
    parts["glass_tint"] = gr.ColorPicker("#ffffff", label="Tint")
    parts["glass_hollow"] = gr.Radio(_INSIDE, value="", label="Inside", elem_id="glass_hollow")
    parts["glass"] = gr.Button("Make it glass", elem_id="glass", size="sm")
    gr.Markdown("Its body is built once, in half a minute or so; from then on the picture follows the sliders.")


def wire(context: Context, live: dict[str, Any]) -> None:
    """The events; sliders change the glass in hand, and without one they are for the next."""
    parts = context.parts
    texts: dict[str, Callable[[Any], str | None]] = {
        "ior": _plain, "transmission": _plain, "roughness": lambda v: _plain(v) if v else None, "tint": tint_text,
        "hollow": lambda kind: kind or None,
    }  # fmt: skip

    @guarded
    def glass(*values: Any) -> Any:
        session = context.session(values[-1])
        session.region_step("glass", **{name: text(v) for (name, text), v in zip(texts.items(), values)})
        return context.everything(session)

    def begin(
        ior: float, transmission: float, roughness: float, tint: str, hollow: str, request: gr.Request
    ) -> dict[Any, Any]:
        return glass(ior, transmission, roughness, tint, hollow, request)

    def setter(name: str) -> Any:
        @guarded
        def moved(value: Any, request: gr.Request) -> dict[Any, Any]:
            session = context.session(request)
            if session.in_hand != "glass":
                return {}
            session.material(name, texts[name](value), "glass")
            return context.picture(session)

        return moved

    values = [parts[f"glass_{name}"] for name in texts]
    parts["glass"].click(begin, values, context.all_parts, **live)
    for name, part in zip(texts, values):
        part.input(setter(name), part, context.picture_parts, **live)
    _wire_following(context)


def _wire_following(context: Context) -> None:
    """The stage asks to be told when the glass that it waits for is there."""

    @guarded
    def follow(request: gr.Request) -> Iterator[dict[Any, Any]]:
        session, said = context.session(request), ""
        tracer = session.glass
        while tracer is not None and tracer is session.glass:
            state = tracer.state
            if not state.waiting:
                end = box(state.words, bad=True) if state.bad else box("The glass follows its sliders.")
                yield {**context.picture(session), context["progress"]: end}
                return
            if state.words != said:
                said = state.words
                yield {context["progress"]: box(said)}
            with tracer.changed:
                tracer.changed.wait(0.5)

    context["stage"].follow(
        follow, None, [*context.picture_parts, context["progress"]], trigger_mode="always_last",
        concurrency_limit=None, show_progress="hidden", api_visibility="private",
    )  # fmt: skip


def tint_text(colour: str) -> str | None:
    """A picked colour as the option `tint` of glass, linear; None for white."""
    linear = parse_colour(hex_colour(colour))
    return None if min(linear) >= 1 else ",".join(f"{v:.4g}" for v in linear)


def tint_colour(tint: Any) -> str:
    """The option `tint`, linear numbers or #rrggbb, as #rrggbb."""
    from materialist.color import linear_to_srgb

    if isinstance(tint, str) and tint.startswith("#"):
        return tint
    numbers = tint.split(",") if isinstance(tint, str) else tint
    encoded = np.round(255 * linear_to_srgb(np.array([float(v) for v in numbers], np.float32)))
    return "#" + "".join(f"{int(v):02x}" for v in encoded)


def _plain(value: float) -> str:
    return f"{float(value):.4g}"
