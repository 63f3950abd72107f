"""What was found of a photo: pictures of its maps, and how good they are in words."""

import numpy as np

from materialist.color import srgb_levels
from materialist.io import display
from materialist.types import Array, Scene


def named_maps(scene: Scene) -> list[tuple[Array, str]]:
    """[H, W, 3] uint8 pictures of everything that was found, each with its name in plain words."""
    shown = display.maps(scene)
    origin = (
        "path traced" if is_traced(scene) else "as the fit sees it, before its paths are traced"
    )
    return [
        (shown["albedo"], "Albedo: colour without light"),
        (shown["roughness"], "Roughness: black is a mirror, white is chalk"),
        (shown["metallic"], "Metallic: white is metal"),
        (shown["normal"], "Normals: which way surfaces face"),
        (shown["depth"], "Depth: near is bright"),
        (display.light(scene.envmap), "Light, all around; ahead is the middle"),
        (srgb_levels(scene.rerender), f"Re-rendering: the scene, {origin}"),
        (
            display.error(scene.photo.linear, scene.rerender),
            "Error: where it misses the photo (x 4)",
        ),
    ]


def is_traced(scene: Scene) -> bool:
    """Whether the re-rendering of a scene is path traced; else it is the fit's own, which an inversion replaces."""
    return scene.provenance.get("spp") != 0


def quality(scene: Scene) -> str:
    """How good the scene is, in Markdown and plain words."""
    metrics = scene.report.metrics
    value = metrics.get("rerender_psnr_path", float("nan"))
    quality = (
        f"Rendered from its maps and light, the scene is {value:.1f} dB from the photo. "
        "Edits start from the photo."
    )
    lines = [quality] if np.isfinite(value) else []
    camera = scene.camera
    source = {
        "exif": "from the photo's EXIF data",
        "default": "assumed",
        "option": "as chosen",
    }.get(scene.photo.fov_source, f"from the {_safe(scene.photo.fov_source)}")
    lines.append(
        f"Worked at {camera.width} × {camera.height} pixels; field of view {camera.fov:.1f}° ({source}); first guess "
        f"by `{_safe(scene.prior.predictor).replace('`', '')}`."
    )
    notes = scene.warnings
    lines += ["", "**What to beware of**", *(f"- {_safe(note)}" for note in notes)] if notes else []
    return "\n".join(lines)


def _safe(text: str) -> str:
    """A text that may hold a file name, without meaning in Markdown or HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("[", "&#91;")
