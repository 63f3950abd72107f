"""What a page needs to draw a change itself, before the server's picture: of a material, an object, and lamps.

Each kind is one block of bytes that stays good as long as its key does: a slider or a drag asks for nothing. The page
draws them by the formulas of `edits.preview` and `studio.live.sketch`; a test in a browser compares the pictures.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from materialist.bsdf.disney import DIELECTRIC_R0
from materialist.color import srgb_levels
from materialist.edits.composite.into_photo import SETTINGS as COMPOSITE
from materialist.edits.composite.layers import diffuse_albedos
from materialist.edits.core.operation import REGION
from materialist.edits.insert.operation import INSERT
from materialist.edits.light.relight import SETTINGS as LAMPS
from materialist.edits.light.relight import kelvin_colour
from materialist.edits.material.detail import UNCLIPPED, core_of, highlights, shading_detail
from materialist.edits.material.material import base_colour, changed, weight_of
from materialist.edits.material.normals import is_metal
from materialist.edits.material.operation import EDIT
from materialist.edits.recipe import Step, options_of
from materialist.geometry.silhouette import window
from materialist.io import display
from materialist.studio import SETTINGS
from materialist.studio.edit_list import key_of, with_options
from materialist.studio.live import glass
from materialist.studio.live.preview import LivePreview
from materialist.studio.live.process import Live
from materialist.studio.live.sketch import draw_bodies
from materialist.studio.session import Session
from materialist.types import Array, Materials, Scene

MOVED = ("hue", "saturation", "value", "albedo", "roughness", "metallic")
"""Options of a material that the page draws; others, as a texture, are in what it is sent."""
KELVINS = np.geomspace(1667, 25000, 48)
"""Colour temperatures whose colours are sent; the page interpolates."""
FAINT = 0.03
"""Share of the light whose loss in an object's shadow a drag does not show."""
DEPTH_SIDE = 96
"""Longer side of the depth map by which an object that is dragged grows and shrinks, pixels."""


@dataclass(frozen=True)
class Drawing:
    """One kind of change: the step that is changed, and the list of edits around it."""

    panes: glass.Panes
    before: tuple[Step, ...]
    step: Step
    after: tuple[Step, ...]
    fixed: Step
    """The changed step without what the page draws."""
    region: Array | None = None
    metal: bool = False
    """Whether the changed step gives the region the normals of metal."""

    @property
    def others(self) -> tuple[Step, ...]:
        return (*self.before, *self.after)

    def key(self, live: Live) -> str:
        """What the bytes depend on, as a short text."""
        steps = (*self.before, self.fixed, *self.after)
        panes = [id(self.panes.get(glass.place(step))) for step in steps if glass.is_traced(step)]
        region = b"" if self.region is None else np.packbits(self.region).tobytes()
        parts = [id(live), live.fine, len(self.before), key_of(steps), panes, self.metal]
        return hashlib.sha1(json.dumps(parts).encode() + region).hexdigest()[:16]


def keys(session: Session) -> dict[str, str]:
    """Kind of change -> the key of what `content` would give for it; kinds that a page cannot draw now are left out."""
    drawings = {kind: _drawing(session, kind) for kind in KINDS}
    return {kind: pair[1].key(pair[0]) for kind, pair in drawings.items() if pair}


def content(session: Session, kind: str) -> bytes | None:
    """The bytes of a kind of change, and their key in their header; None where the page cannot draw it now.

    They begin with the length of a JSON header, uint32, and the header, filled up to a multiple of 4 bytes. Its
    `arrays` are [name, type, shape] each; their bytes, each filled up likewise, follow in this order, little-endian.
    """
    pair = _drawing(session, kind)
    if pair is None:
        return None
    live, drawing = pair
    key = drawing.key(live)
    steps = (*drawing.before, drawing.step, *drawing.after)
    content: bytes | None = live.call(block, kind=kind, drawing=drawing, key=key, steps=steps)
    return content


def block(
    live: LivePreview, kind: str, drawing: Drawing, key: str, steps: tuple[Step, ...]
) -> bytes | None:
    """The bytes of a kind of change in a list of edits, `steps`; a call of `studio.live.process`."""
    made = KINDS[kind](live, drawing)
    if made is None:
        return None
    header, arrays = made
    described = [[name, str(values.dtype), values.shape] for name, values in arrays.items()]
    text = json.dumps({"key": key, **header, "arrays": described}).encode()
    blocks = [text, *(values.tobytes() for values in arrays.values())]
    padded = [block + b" " * (-len(block) % 4) for block in blocks]
    return len(padded[0]).to_bytes(4, "little") + b"".join(padded)


def _drawing(session: Session, kind: str) -> tuple[Live, Drawing] | None:
    """What a change of that kind would be about now; None for nothing."""
    # --- The state of this moment; the rest works on copies ---
    with session.lock:
        live = session.live
        edits = session.edits
        client = session.glass
        mask = session.selection.mask
    if live is None or not live.ready or client is None:
        return None
    active = edits.active
    # --- Which step the page would change ---
    step = edits.current_step
    if kind == "lamps" and edits.light is not None:
        step = edits.steps[edits.light]
    if kind == "material" and step is None and mask is not None:
        # A new edit goes to the end of the list: with the first move of a slider nothing changes here.
        step = Step(EDIT.name, {}, session.workspace)
        active = (*active, step)
    if step not in active:
        return None
    # --- The list around it, without what the page draws itself ---
    place = active.index(step)
    around = (active[:place], step, active[place + 1 :])
    panes = client.panes(active)
    if kind == "material" and step.kind == EDIT.name and mask is not None:
        fixed = with_options(step, **dict.fromkeys((*MOVED, *REGION)))
        metal = has_metal_normals(live.scene, step, mask)
        return live, Drawing(panes, *around, fixed, mask, metal)
    if kind == "thing" and step.kind == INSERT.name:
        return live, Drawing(panes, *around, step)
    if kind == "lamps" and "lamps" in step.options:
        return live, Drawing(panes, *around, with_options(step, lamps=None))
    return None


def has_metal_normals(scene: Scene, step: Step, region: Array) -> bool:
    """Whether a material step gives a region [H, W] bool the normals of metal, as far as the fitted scene tells."""
    options = options_of(step)
    return is_metal(changed(scene.materials.metallic, options.metallic), region, options)


Made = tuple[dict[str, Any], dict[str, Array]] | None


def _material(live: LivePreview, drawing: Drawing) -> Made:
    """Tables of the pixels of a region, row by row of the picture."""
    from materialist.transport.cache import ROUGHNESS_LEVELS

    # --- The region, where shading says all that is seen of it ---
    steps = drawing.others
    before = live.edited(drawing.before)
    rest = live.edited(steps)
    assert drawing.region is not None
    options = options_of(drawing.fixed)
    region = drawing.region & (before.depth == live.scene.depth)
    weight = weight_of(before, region, options)
    inside = (weight > 0) & ~live.filled(rest)
    if not inside.any() or inside.sum() > SETTINGS.drawn_pixels:
        return None
    # What lies over the surfaces has to be known, and no later edit may change what this one makes.
    traced = [glass.place(step) for step in steps if glass.is_traced(step)]
    waits = any(place not in drawing.panes for place in traced)
    later = any(
        (old != new)[inside].any()
        for old, new in zip(vars(before.materials).values(), vars(rest.materials).values())
    )
    if waits or later:
        return None
    # --- The pixels, and their tables ---
    rows = live.rows(steps, inside, weight > 0.5 if drawing.metal else None)
    overall = rows.pop("overall", None)
    pixels = rows.pop("pixels")
    materials = before.materials
    colour, texture = base_colour(before, weight, options)
    # What a new colour keeps, as paint and as metal: `edits.material.material.edit`.
    core = core_of(weight)
    gloss = options.detail * highlights(before, weight)
    shades = [
        shading_detail(before, core, options.detail, metallic, white)
        for metallic, white in ((0.0, gloss), (1.0, 0.0))
    ]
    # A texture is darkened by one number; a plain colour by its own brightness times this.
    texels = colour.max(-1) if texture is not None else 1.0
    box = window(inside)
    top, left = box[0].start, box[1].start
    height, width = inside[box].shape
    at = (pixels // inside.shape[1] - top) * width + pixels % inside.shape[1] - left
    maps = {
        "photo": live.scene.photo.linear,
        "colour": colour if texture is not None else materials.albedo,
        "albedo": materials.albedo,
        "roughness": materials.roughness,
        "metallic": materials.metallic,
        "fitted_metallic": live.scene.materials.metallic,
        "matt": diffuse_albedos(live.scene, live.scene)[0],
        "weight": weight,
        "gloss": gloss,
        "paint_shade": shades[0],
        "metal_shade": shades[1],
    }
    over = _over(live, drawing, rest)
    rows |= {
        name: values.reshape(inside.size, -1)[pixels] for name, values in (maps | over).items()
    }
    # --- Constants of the shading and of the composite ---
    header = {
        "box": [left, top, width, height],
        "count": len(pixels),
        "levels": ROUGHNESS_LEVELS,
        "r0": DIELECTRIC_R0,
        "floor": COMPOSITE.floor,
        "black": COMPOSITE.black,
        "textured": texture is not None,
        "shade_limits": [float(np.quantile((texels * shade)[core], UNCLIPPED)) for shade in shades],
        "clipped": None if live.scene.photo.hdr else COMPOSITE.clipped_photo,
        "overall": None if overall is None else overall.tolist(),
    }
    return header, {"at": at.astype("<u4")} | {name: _halves(v) for name, v in rows.items()}


def _over(live: LivePreview, drawing: Drawing, rest: Scene) -> dict[str, Array]:
    """What lies over the surfaces: picture -> gain picture + lit albedo (1 - metallic) + added, [H, W, 3] each."""
    if not rest.lamps and not rest.bodies and not any(map(glass.is_traced, drawing.others)):
        return {}
    shape = rest.depth.shape

    def laid(value: float, matt: float) -> Array:
        albedo = np.full((*shape, 3), matt, np.float32)
        nothing = np.zeros(shape, np.float32)
        scene = replace(rest, materials=Materials(albedo, nothing, nothing))
        picture = np.full((*shape, 3), value, np.float32)
        return live.laid_over(picture, scene, drawing.others, drawing.panes)

    added = laid(0, 0)
    return {"gain": laid(1, 0) - added, "lit": laid(0, 1) - added, "added": added}


def _thing(live: LivePreview, drawing: Drawing) -> Made:
    """An object as it is sketched: what it leaves of the picture, what it adds; and the picture without it."""
    # --- The object alone: what it hides of a white picture, what it adds to a black one ---
    before = live.edited(drawing.before)
    alone = live.edited((*drawing.before, drawing.step)).bodies[len(before.bodies) :]
    scene = replace(live.edited(drawing.others), bodies=alone)
    shape = (*scene.depth.shape, 3)
    added = draw_bodies(np.zeros(shape, np.float32), scene)
    gain = (draw_bodies(np.ones(shape, np.float32), scene) - added)[..., :1]
    # The far end of the shadow is left out softly: the page draws what is changed anew for each frame.
    gain = 1 - np.maximum(1 - gain - FAINT, 0) / (1 - FAINT)
    reached = (gain[..., 0] < 1) | (added > 0).any(-1)
    if not reached.any():
        return None
    # --- Its part of the picture, and depth, by which it grows as it is dragged ---
    box = window(reached)
    scale = DEPTH_SIDE / max(scene.depth.shape)
    depth = cv2.resize(scene.depth, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    height, width = reached[box].shape
    options = options_of(drawing.step)
    header = {
        "box": [box[1].start, box[0].start, width, height],
        "at": [float(value) for value in drawing.step.options["at"]],
        "scale": options.scale,
        "size": [scene.camera.width, scene.camera.height],
    }
    arrays = {"gain": gain[box], "added": added[box], "depth": np.asarray(depth)}
    without = live.picture(drawing.others, drawing.panes)
    return header, {name: _halves(values) for name, values in arrays.items()} | _jpeg(without)


def _lamps(live: LivePreview, drawing: Drawing) -> Made:
    """Surfaces as lamps light them, and the picture without the light of lamps."""
    steps = (*drawing.before, drawing.step, *drawing.after)
    edited = live.edited(steps)
    shape = edited.depth.shape

    def laid(picture: Array) -> Array:
        return live.laid_over(picture, edited, steps, drawing.panes, lamps=False)

    # What lies over surfaces is linear: its factor is the white picture less the black.
    ones = np.ones((*shape, 3), np.float32)
    gain = np.clip(laid(ones) - laid(0 * ones), 0, 1)
    matt = edited.materials.albedo * (1 - edited.materials.metallic[..., None]) * gain
    middle = float(np.median(edited.depth[edited.depth > 0]))
    header = {
        "size": [edited.camera.width, edited.camera.height],
        "focal": edited.camera.focal,
        "flux": 4 * np.pi * np.pi * (LAMPS.lamp_unit * middle) ** 2,
        "radius": LAMPS.lamp_radius * middle,
        "kelvins": [[float(k), *kelvin_colour(float(k)).tolist()] for k in KELVINS],
    }
    return header, {
        "depth": _halves(np.where(edited.depth > 0, edited.depth, 0)),
        "normal": np.round(edited.normal * 127).astype(np.int8),
        "matt": srgb_levels(matt),
    } | _jpeg(laid(live.shaded(steps)))


KINDS: dict[str, Callable[[LivePreview, Drawing], Made]] = {
    "material": _material,
    "thing": _thing,
    "lamps": _lamps,
}


def _halves(values: Array) -> Array:
    # float16 ends at 65504.
    return np.clip(values, -6e4, 6e4).astype("<f2")


def _jpeg(linear: Array) -> dict[str, Array]:
    # Finer than a live picture: what is drawn over it shows its blocks.
    encoded = display.encoded(srgb_levels(linear), "JPEG", quality=95, subsampling=0)
    return {"under": np.frombuffer(encoded, np.uint8)}
