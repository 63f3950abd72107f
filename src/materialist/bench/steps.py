"""What one step of the material fit costs with cached transport, and what it costs with the paper's path tracing."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.types import Photo, Prediction


def step_costs(
    photo: Photo, prior: Prediction, *, seed: int = 0, device: str = "auto", cached_steps: int = 24, prb_steps: int = 2
) -> dict[str, float]:
    """Median seconds of a material step, and their ratio; in one process, one after the other.

    Both are steps of the default preset's own fit (the maps as parameters, its loss with all regularisers, Adam), at
    full resolution and with gradients of all maps; only the engine differs: cached transport, or Mitsuba's path replay
    backpropagation with the paper's 64 samples a pixel and depth 4. The first four of `cached_steps` allocate memory,
    and the one before `prb_steps` compiles kernels; neither counts. The light is a grey one, which changes no cost.

    Returns `cached_step`, `prb_step` (seconds), `prb_per_cached`, and `cache_seconds`, what tracing the cache took.
    """
    from materialist.fit.engine import PathEngine, TransportEngine
    from materialist.geometry.build import build_geometry
    from materialist.render.scene import RenderScene
    from materialist.render.variant import setup

    setup(device)
    camera, light = photo.camera, np.full((256, 512, 3), 0.6, np.float32)
    geometry = build_geometry(prior.depth, prior.normal, camera, seed=seed)
    start = time.perf_counter()
    engine: Any = TransportEngine(geometry, camera, photo.linear, seed=seed)
    problem = engine.material_problem(light)
    cache_seconds = time.perf_counter() - start
    cached = _seconds_per_step(engine, problem, photo, prior, cached_steps)[4:]
    path: Any = PathEngine(RenderScene(geometry, camera, device=device), camera, engine.pixels.numpy(), seed=seed)
    prb = _seconds_per_step(path, path.material_problem(light), photo, prior, 1 + prb_steps)[1:]
    return {
        "cached_step": float(np.median(cached)),
        "prb_step": float(np.median(prb)),
        "prb_per_cached": float(np.median(prb) / np.median(cached)),
        "cache_seconds": cache_seconds,
    }


def _seconds_per_step(engine: Any, problem: Any, photo: Photo, prior: Prediction, steps: int) -> list[float]:
    """Seconds of each of the first `steps` steps of the default preset's material fit."""
    import torch

    from materialist.color import linear_to_srgb
    from materialist.fit.materials import fit_materials, material_field
    from materialist.fit.settings import preset
    from materialist.fit.variation import edge_weights

    settings = preset("default", hdr=photo.hdr).materials
    last = settings.stages[-1]
    stage = replace(last, schedule=replace(last.schedule, max_steps=steps, patience=0))
    settings = replace(settings, stages=(stage,))
    pixels = engine.pixels.numpy()
    maps = prior.materials
    flat = [m.reshape(photo.camera.width * photo.camera.height, -1) for m in _arrays(maps)]
    held = torch.from_numpy(np.concatenate(flat, 1).astype(np.float32))[engine.pixels]
    field = material_field(held, settings, engine.pixels, photo.camera, seed=0)
    edges = edge_weights(pixels, linear_to_srgb(photo.linear)) if any(settings.smooth) else None
    target = torch.from_numpy(np.ascontiguousarray(photo.linear.reshape(-1, 3)))[engine.pixels]
    moments = [time.perf_counter()]
    tick = lambda *_: moments.append(time.perf_counter())  # noqa: E731
    fit_materials(problem, target, field, held, settings, edges, progress=tick)
    return list(np.diff(moments))


def _arrays(materials: Any) -> tuple[Any, Any, Any]:
    return materials.albedo, materials.roughness, materials.metallic
