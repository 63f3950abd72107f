"""One HTML page that holds everything and asks the network for nothing."""

import base64
import json
import math
import zlib
from collections.abc import Iterable
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Template

from materialist.color import srgb_levels
from materialist.edits.core.surfaces import texels
from materialist.exporters.parts import Part, farthest
from materialist.geometry.boundary import joined_faces
from materialist.io import display
from materialist.types import Array, Camera, Scene

_VERTEX = np.dtype(
    [("position", "<f4", 3), ("normal", "i1", 4), ("uv", "<u2", 2), ("colour", "u1", 4)]
)
"""A vertex as page.js reads it; colour with alpha 0 means the texture."""
_NAMES = {
    "rerender_psnr_path": ("Re-rendering, PSNR", "{:.2f} dB"),
    "rerender_ssim_path": ("Re-rendering, SSIM", "{:.3f}"),
    "rerender_psnr_residual": ("Re-rendering times shading residual, PSNR", "{:.2f} dB"),
    "prior_l1_albedo": ("Albedo, distance from prior", "{:.3f}"),
    "prior_l1_roughness": ("Roughness, distance from prior", "{:.3f}"),
    "prior_l1_metallic": ("Metallic, distance from prior", "{:.3f}"),
    "clipped_fraction": ("Clipped pixels", "{:.1%}"),
    "poor_fraction": ("Pixels off by more than 0.1", "{:.1%}"),
    "total_seconds": ("Time", "{:.0f} s"),
    "peak_rss_mb": ("Peak memory", "{:.0f} MB"),
}


def page(scene: Scene, parts: list[Part], before: Array | None = None) -> str:
    """A slider between photo and re-rendering, the mesh to turn, maps, light and report, as text.

    before: [H, W, 3] linear photo before the edits, where the scene's is the edited picture; the slider then goes
    from one to the other.
    The template escapes whatever came from outside, and a policy in it forbids any request.
    """
    assets = files("materialist.exporters") / "assets"
    camera = scene.camera
    native = scene.photo.original.shape
    template = Template((assets / "page.html").read_text("utf-8"), autoescape=True)
    return template.render(
        title=scene.photo.name,
        subtitle=f"{native[1]} × {native[0]} photo, worked at {camera.width} × {camera.height}, "
        f"{camera.fov:.1f}° wide ({scene.photo.fov_source}), predictor {scene.prior.predictor}",
        warnings=scene.warnings,
        width=camera.width,
        height=camera.height,
        photo=_image(srgb_levels(scene.photo.linear), quality=94),
        before="" if before is None else _image(srgb_levels(before), quality=94),
        rerender=_image(srgb_levels(scene.rerender), quality=94),
        triangles=f"{sum(len(part.mesh.faces) for part in parts):,}",
        maps=_maps(scene),
        envmap=_image(display.light(scene.envmap)),
        light_note=f"The centre looks along the view; brightest {scene.envmap.max():.3g}.",
        metrics=[_figure(key, value) for key, value in scene.report.metrics.items()],
        stages=[
            (s.get("name", ""), f"{s['seconds']:.1f} s" if "seconds" in s else "–")
            for s in scene.report.stages
        ],
        provenance=_options(scene),
        scene=json.dumps(_packed(camera, scene.depth, parts)),
        style=(assets / "page.css").read_text("utf-8"),
        script=(assets / "page.js").read_text("utf-8"),
    )


def _options(scene: Scene) -> Iterable[tuple[str, Any]]:
    """What the scene was made with, in few words."""
    for key, value in scene.provenance.items():
        if isinstance(value, list | tuple):
            plain = all(isinstance(one, int | float | str) for one in value)
            yield key, " x ".join(map(str, value)) if plain and value else f"{len(value)} of them"
        elif value is not None and not isinstance(value, dict):
            yield key, value


def _maps(scene: Scene) -> list[tuple[str, str, str]]:
    """(id, caption, data URL) of each map."""
    m = scene.materials
    captions = {
        "albedo": "Albedo",
        "roughness": f"Roughness, mean {m.roughness.mean():.2f}",
        "metallic": f"Metallic, mean {m.metallic.mean():.2f}",
        "normal": "Normal, camera frame",
        "depth": "Depth, near bright",
        "error": f"Error of the re-rendering × {display.ERROR_GAIN}",
    }
    shown = {**display.maps(scene), "error": display.error(scene.photo.linear, scene.rerender)}
    return [(name, captions[name], _image(pixels)) for name, pixels in shown.items()]


def _figure(key: str, value: Any) -> tuple[str, str]:
    name, form = _NAMES.get(key, (key, "{:.4g}"))
    finite = isinstance(value, int | float) and math.isfinite(value)
    return name, form.format(value) if finite else "–"


def _image(pixels: Array, quality: int = 90) -> str:
    data = display.encoded(pixels, "JPEG", quality=quality, subsampling=0)
    return "data:image/jpeg;base64," + base64.b64encode(data).decode()


def _packed(camera: Camera, depth: Array, parts: list[Part]) -> dict[str, Any]:
    """What page.js needs: the meshes one after the other, deflated, and the camera. Continued planes come last."""
    # The page may leave the planes out: their triangles come last.
    shown = [parts[0], *(part for part in parts if part.surface is not None)]
    parts = [*shown, *(part for part in parts[1:] if part.surface is None)]
    vertices = np.concatenate([_vertices(part) for part in parts])
    indices = joined_faces([part.mesh for part in parts])[1].astype("<u4")
    seen = depth[depth > 0]
    return {
        "vertices": _deflated(vertices),
        "indices": _deflated(indices),
        "surface": 3 * sum(len(part.mesh.faces) for part in shown),
        "all": indices.size,
        "tangent": math.tan(math.radians(camera.fov) / 2),
        "aspect": camera.width / camera.height,
        "pivot": float(np.median(seen)),
        "near": float(seen.min()) * 0.05,
        "far": farthest(parts) * 4,
    }


def _vertices(part: Part) -> Array:
    """[V] records of one part; in those of a body, or of a constant part, is the colour."""
    mesh = part.mesh
    vertices = np.zeros(len(mesh.vertices), _VERTEX)
    vertices["position"] = mesh.vertices
    vertices["normal"][:, :3] = np.round(np.clip(mesh.normals, -1, 1) * 127)
    vertices["uv"] = np.round(np.clip(mesh.uv, 0, 1) * 65535)
    # The page has textures for the photo's surface alone: others are colours at the vertices.
    if part.constant or part.surface is not None:
        vertices["colour"][:, :3] = srgb_levels(texels(part.materials.albedo, mesh.uv))
        vertices["colour"][:, 3] = 255
    return vertices


def _deflated(array: Array) -> str:
    return base64.b64encode(zlib.compress(array.tobytes(), 9)).decode()
