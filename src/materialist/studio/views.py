"""What the page shows of a session: data URLs for the stage, pictures for the gallery, words for the report."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np

from materialist.color import srgb_levels
from materialist.types import Array, Scene

_QUALITY = 88
"""JPEG quality of live pictures."""


def jpeg_url(linear: Array) -> str:
    """A linear picture [H, W, 3] as a data URL."""
    return _url(srgb_levels(linear), ".jpg", "image/jpeg")


def mask_urls(mask: Array | None) -> dict[str, str]:
    """A mask [H, W] bool as two see-through pictures, `fill` and `outline`; empty texts for none."""
    import cv2

    if mask is None:
        return {"fill": "", "outline": ""}
    inside = mask.astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    light = inside - cv2.erode(inside, kernel)
    dark = cv2.dilate(inside, kernel) - inside
    outline = np.zeros((*mask.shape, 4), np.uint8)
    outline[light > 0] = (255, 255, 255, 255)
    outline[dark > 0] = (20, 30, 60, 200)
    fill = np.zeros((*mask.shape, 4), np.uint8)
    fill[mask] = (255, 255, 255, 255)
    return {"fill": _url(fill, ".png", "image/png"), "outline": _url(outline, ".png", "image/png")}


def file_url(path: Path) -> str:
    """A picture file as a data URL."""
    kind = "image/png" if path.suffix == ".png" else "image/jpeg"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def maps(scene: Scene) -> list[tuple[Array, str]]:
    """[H, W, 3] uint8 pictures of everything that was found, each with its name in plain words."""
    from materialist.exporters import pictures

    materials = scene.materials
    return [
        (srgb_levels(materials.albedo), "Albedo: colour without light"),
        (pictures.grey(materials.roughness), "Roughness: black is a mirror, white is chalk"),
        (pictures.grey(materials.metallic), "Metallic: white is metal"),
        (pictures.normals(scene.normal), "Normals: which way surfaces face"),
        (pictures.nearness(scene.depth), "Depth: near is bright"),
        (pictures.light(scene.envmap), "Light, all around; ahead is the middle"),
        (srgb_levels(scene.rerender), "Re-rendering: the scene, path traced"),
        (pictures.error(scene.photo.linear, scene.rerender), "Residual: where it misses the photo (x 4)"),
    ]


def report(scene: Scene) -> str:
    """How good the scene is, in Markdown and plain words."""
    metrics = scene.report.metrics
    value = metrics.get("rerender_psnr_path", float("nan"))
    verdict = (
        "very close to the photo" if value > 33 else "close to the photo" if value > 28 else "only roughly the photo"
    )
    lines = [f"The re-rendering is **{verdict}** ({value:.1f} dB)."] if np.isfinite(value) else []
    camera = scene.camera
    source = {"exif": "from the photo's EXIF data", "default": "assumed", "option": "as chosen"}.get(
        scene.photo.fov_source, f"from the {scene.photo.fov_source}"
    )
    lines.append(
        f"Worked at {camera.width} × {camera.height} pixels; field of view {camera.fov:.1f}° ({source}); first guess "
        f"by `{scene.prior.predictor}`."
    )
    notes = list(dict.fromkeys((*scene.photo.warnings, *scene.prior.warnings, *scene.report.warnings)))
    lines += ["", "**What to beware of**", *(f"- {_safe(note)}" for note in notes)] if notes else []
    return "\n".join(lines)


def _safe(text: str) -> str:
    """A text that may hold a file name, without meaning in Markdown or HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("[", "&#91;")


def _url(pixels: Array, suffix: str, kind: str) -> str:
    import cv2

    order = [2, 1, 0, 3][: pixels.shape[-1]]
    quality = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if suffix == ".jpg" else []
    data: Any = cv2.imencode(suffix, np.ascontiguousarray(pixels[..., order]), quality)[1]
    return f"data:{kind};base64,{base64.b64encode(data.tobytes()).decode()}"
