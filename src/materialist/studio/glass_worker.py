"""The process that traces glass for one page while its sliders move: keeps the bodies, and makes picture after picture.

It reads requests from stdin, one JSON object a line, and takes the newest: `{"ask": n, "scene", "folder", "others":
[[kind, options], ...], "glass": options}`. It tells `{"ask": n, "stage": "load" | "build" | "trace"}` and then
`{"ask": n, "pane": {...}}` (see `pane`) or `{"ask": n, "error": "one sentence"}`. It ends itself when its stdin breaks,
and after IDLE seconds without a request.
"""

from __future__ import annotations

import base64
import json
import os
import queue
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edits.recipe import Step, apply, glass_arguments
from materialist.studio.worker import sentence, teller
from materialist.types import Array

IDLE = 900.0
"""Seconds."""
NICE = 3
"""After live previews, before inversions and final pictures: somebody waits at a slider."""
KEPT = 2
"""Bodies that are kept: going to and fro between two objects builds nothing anew."""
VALUES = ("ior", "transmission", "tint", "roughness")
"""Options of a glass step that its body does not depend on."""
Request = dict[str, Any]


def main() -> None:
    """Answer until stdin ends."""
    tell = teller()
    requests: queue.Queue[Request] = queue.Queue()
    threading.Thread(target=_read, args=(requests,), daemon=True).start()
    os.nice(NICE)
    bench = Bench()
    while True:
        try:
            request = requests.get(timeout=IDLE)
        except queue.Empty:
            break
        while not requests.empty():  # only the newest counts
            request = requests.get()
        answer(bench, request, tell, requests.empty)
    sys.stderr.flush()
    os._exit(0)


def answer(bench: Bench, request: Request, tell: Callable[[dict[str, Any]], None], newest: Callable[[], bool]) -> None:
    """Tell the stages and the pane of one request; nothing more once `newest` says that another one came."""
    ask = request["ask"]
    try:
        preview, values = bench.preview(request, lambda stage: tell({"ask": ask, "stage": stage}))
        if newest():
            tell({"ask": ask, "stage": "trace"})
            tell({"ask": ask, "pane": pane(preview, preview.picture(**values))})
    except Exception as error:
        tell({"ask": ask, "error": sentence(error)})


class Bench:
    """The scene, and the last few glass bodies in it."""

    def __init__(self) -> None:
        self._scene: tuple[str, Any] | None = None
        self._built: OrderedDict[str, Any] = OrderedDict()

    def preview(self, request: Request, stage: Callable[[str], None]) -> tuple[Any, dict[str, Any]]:
        """(the `GlassPreview`, values for its picture) that a request wants. Raises InputError."""
        folder, key = Path(request["folder"]), body_key(request["scene"], request["others"], request["glass"])
        stage("load")
        scene = self._loaded(request["scene"])
        region, options = glass_arguments(scene, Step("glass", request["glass"], folder))
        if key not in self._built:
            from materialist.edits.glass.preview import GlassPreview

            stage("build")
            edited = apply(scene, [Step(kind, given, folder) for kind, given in request["others"]])
            fixed = {name: value for name, value in options.items() if name not in VALUES}
            self._built[key] = GlassPreview(edited, region, **fixed)
        self._built.move_to_end(key)
        while len(self._built) > KEPT:
            self._built.popitem(last=False)
        return self._built[key], {name: options[name] for name in VALUES if name in options}

    def _loaded(self, path: str) -> Any:
        if self._scene is None or self._scene[0] != path:
            from materialist.io.package import load_scene

            self._built.clear()
            self._scene = (path, load_scene(path))
        return self._scene[1]


def body_key(scene: str, others: list[list[Any]], glass: dict[str, Any]) -> str:
    """What a body and its background depend on: two requests with the same key differ in the glass alone."""
    return json.dumps([scene, others, {k: v for k, v in glass.items() if k not in VALUES}], default=str)


def pane(preview: Any, picture: Array) -> dict[str, Any]:
    """The rectangle of a picture [H, W, 3] that is not the photo, as JSON.

    `box` top, bottom, left, right; `picture` half floats [h, w, 3]; `share` of the glass, bytes [h, w], 255 is all;
    `filled` bytes [h, w]: 1 where the photo is filled in. Arrays in base64.
    """
    seen = (preview.share > 0) | preview.filled
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    cut = (slice(top, bottom), slice(left, right))
    return {
        "box": [top, bottom, left, right],
        "picture": _text(np.clip(picture[cut], 0, 65_000).astype("<f2")),
        "share": _text(np.round(preview.share[cut] * 255).astype(np.uint8)),
        "filled": _text(preview.filled[cut].astype(np.uint8)),
    }


def _text(values: Array) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def _read(requests: queue.Queue[Request]) -> None:
    for line in sys.stdin:
        requests.put(json.loads(line))
    os._exit(3)


if __name__ == "__main__":
    main()
