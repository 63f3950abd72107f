"""Rendering of an edited scene beside the fitted one, and lamps."""

from __future__ import annotations

from typing import Any

import numpy as np

from materialist.edits.composite.layers import Render, is_relit
from materialist.edits.composite.sparing import Begun
from materialist.errors import InputError
from materialist.render.share import Share
from materialist.types import Array, Lamp, Scene


class Studio:
    """Renderings of one fitted scene and of its edits, with the same random numbers on both sides.

    Under another light the directions that aim at it are others, too, and noise cancels less.

    What is alike is built once: scenes of one geometry, bodies and lamps share a Mitsuba scene, and a base picture
    that was rendered before is not rendered again.
    """

    def __init__(self, scene: Scene, *, device: str = "auto"):
        self.scene, self.device = scene, device
        self._built: list[tuple[Scene, Any]] = []
        self._base: dict[tuple[int, int, int, int], Array] = {}

    def twins(self, edited: Scene) -> tuple[Render, Render]:
        """render(spp, seed) of the base and of `edited`, by the same tracer; `spp` counts paths a pixel.

        The splitting tracer serves most light; with lamps, a sun or glass on either side both go to
        Mitsuba's path tracer, which aims at the lights and follows paths through glass.
        """
        depth, paths = self._tracer(edited)

        def base(spp: int, seed: int) -> Array:
            key = (depth, paths, spp, seed)
            if key not in self._base:
                self._base[key] = self._render(self.scene, depth, paths, spp, seed)
            return self._base[key]

        missing = self._missing_sky(edited)
        if missing is None:
            return base, lambda spp, seed: self._render(edited, depth, paths, spp, seed)
        where, more, less = missing

        def before_sky(spp: int, seed: int) -> Array:
            sky = self._render(more, depth, paths, spp, seed) - self._render(less, depth, paths, spp, seed)
            return self._render(edited, depth, paths, spp, seed) + np.where(where, sky, 0)

        return base, before_sky

    def _missing_sky(self, edited: Scene) -> tuple[Array, Scene, Scene] | None:
        """([H, W, 1] where new glass is seen, the edit under the photo's sky alone, and under what the fit has there).

        None where no new glass stands before sky, or where the light is another than the photo's.
        """
        from materialist.edits.glass.sky import only_lit_by, sky_maps
        from materialist.render.bodies import is_transparent

        old = self.scene.bodies
        new = [f"body{k}" for k, b in enumerate(edited.bodies) if b not in old and is_transparent(b.surface)]
        maps = None if not new or is_relit(self.scene, edited) else sky_maps(edited)
        if maps is None:
            return None
        more, less = (only_lit_by(edited, envmap) for envmap in maps)
        return self._seen(edited, new)[..., None] > 0, more, less

    def begun(self, edited: Scene) -> tuple[Begun, Begun] | None:
        """A share of the base and of `edited`, None where the tracer of `twins` knows no shares.

        Both have the random numbers of `twins`, and no picture is kept.
        """
        depth, paths = self._tracer(edited)
        if depth:
            return None

        def begin(scene: Scene) -> Begun:
            def render(spp: int, seed: int, share: Share) -> tuple[Array, int]:
                rays = -(-spp // paths)
                return self._dressed(scene).render(spp=rays, seed=seed, share=share), share.rays(rays)

            return render

        return begin(self.scene), begin(edited)

    def beside(self, edited: Scene, other: Scene) -> Render:
        """render(spp, seed) of `other` by the tracer that `twins` takes for `edited`."""
        depth, paths = self._tracer(edited)
        return lambda spp, seed: self._render(other, depth, paths, spp, seed)

    def _tracer(self, edited: Scene) -> tuple[int, int]:
        """Which tracer the base and `edited` take: path length of Mitsuba's, 0 for the splitting one, and how many
        paths this follows from a camera ray on either side."""
        depth = max(_path_depth(s) for s in (self.scene, edited))
        return depth, 1 if depth else max(self._dressed(s).paths for s in (self.scene, edited))

    def _render(self, scene: Scene, depth: int, paths: int, spp: int, seed: int) -> Array:
        """By Mitsuba's path tracer to that depth, by the splitting one for 0."""
        target = self._dressed(scene)
        if depth:
            return target.render_path(spp=spp, seed=seed, max_depth=depth)
        return target.render(spp=-(-spp // paths), seed=seed)

    def covered(self, edited: Scene) -> Array:
        """[H, W] bool: where a body or lamp is seen, at least in part, that the other of the two scenes lacks."""
        seen = np.zeros(self.scene.depth.shape, bool)
        for scene, other in ((self.scene, edited), (edited, self.scene)):
            own = [f"body{k}" for k, body in enumerate(scene.bodies) if body not in other.bodies]
            own += _new_lamps(other, scene)
            if own:
                seen |= self._seen(scene, own) > 0
        return seen

    def portrait(self, edited: Scene, *, spp: int, seed: int, clean: bool):
        """The bodies and lamps that are new in `edited` at native size (`portrait.Portrait`), None for none in sight.

        Bodies that take the place of a surface of the photo are left to the photo's own outlines. Under another light
        every lamp counts as new: it stays as bright as it was, and what changes beside it must not colour its rim.
        """
        from materialist.edits.insert.portrait import free_bodies, portrait
        from materialist.render.scene import MAX_DEPTH

        lamps = [f"lamp{k}" for k in range(len(edited.lamps))]
        if not is_relit(self.scene, edited):
            lamps = _new_lamps(self.scene, edited)
        names = free_bodies(self.scene, edited) + lamps
        if not names:
            return None
        depth = _path_depth(edited) or MAX_DEPTH
        return portrait(
            self._dressed(edited), self.scene, edited, names, spp=spp, seed=seed, max_depth=depth, clean=clean
        )  # fmt: skip

    def bodies_seen(self, scene: Scene) -> Array:
        """[H, W] share of each pixel in which one of its bodies is seen."""
        names = [f"body{k}" for k in range(len(scene.bodies))]
        return self._seen(scene, names) if names else np.zeros(scene.depth.shape, np.float32)

    def photo_lights(self, edited: Scene) -> Array:
        """[H, W] bool: where lights of the photo that became surfaces (`glows.dimmed`) are seen, past all else."""
        from materialist.edits.light.glows import NAME

        names = [f"body{k}" for k, body in enumerate(edited.bodies) if body.name.startswith(NAME)]
        return self._seen(edited, names) > 0.5 if names else np.zeros(edited.depth.shape, bool)

    def bodies_in(self, scene: Scene, size: tuple[int, int], box: tuple[int, int, int, int]) -> Array:
        """The same in a box (top, bottom, left, right) of a picture of another size (H, W)."""
        from materialist.render.portrait import look

        bodies = {f"body{k}": body for k, body in enumerate(scene.bodies)}
        return look(self._target(scene).mi_scene, scene.camera, bodies, size, box).share

    def guides(self, edited: Scene) -> tuple[Array, Array]:
        """Albedo and normal [H, W, 3] of the edited scene for the denoiser, with those of the bodies that are seen."""
        covered = self.bodies_seen(edited) > 0
        return self.body_guides(edited, covered) if covered.any() else (edited.materials.albedo, edited.normal)

    def body_guides(self, edited: Scene, covered: Array) -> tuple[Array, Array]:
        """Albedo and normal [H, W, 3] of the edited scene for the denoiser, with its bodies' own where `covered`."""
        from materialist.render.portrait import look

        bodies = {f"body{k}": body for k, body in enumerate(edited.bodies)}
        rows, columns = np.flatnonzero(covered.any(1)), np.flatnonzero(covered.any(0))
        box = (int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)
        sight = look(self._target(edited).mi_scene, edited.camera, bodies, covered.shape, box)
        albedo, normal = edited.materials.albedo.copy(), edited.normal.copy()
        part = np.s_[box[0] : box[1], box[2] : box[3]]
        share = np.where(covered[part], sight.share, 0)[..., None]
        albedo[part] = share * sight.albedo + (1 - share) * albedo[part]
        normal[part] = share * sight.normal + (1 - share) * normal[part]
        return albedo, normal

    def _seen(self, scene: Scene, names: list[str]) -> Array:
        """[H, W] share of each pixel in which the named bodies are seen."""
        from materialist.render.seen import bodies_seen

        return bodies_seen(self._target(scene).mi_scene, scene.camera, names)

    def _dressed(self, scene: Scene):
        """Its `RenderScene` with its materials and its light."""
        target = self._target(scene)
        target.set_materials(scene.materials)
        target.set_envmap(scene.envmap)
        return target

    def _target(self, scene: Scene):
        """A `RenderScene` of its geometry, lamps and bodies, with the materials and light of whoever used it last."""
        for other, target in self._built:
            if other.geometry is scene.geometry and (other.lamps, other.bodies) == (scene.lamps, scene.bodies):
                return target
        target = _built(scene, self.device)
        if self._built:
            target.aim_as(self._built[0][1])
        # The base, and the last edit of another shape: a moving lamp must not fill the memory.
        self._built = [*self._built[:1], (scene, target)]
        return target


def _new_lamps(scene: Scene, edited: Scene) -> list[str]:
    """Names of the shapes of lamps that `edited` has and `scene` has not; a second one like the first is new."""
    known, names = list(scene.lamps), []
    for k, lamp in enumerate(edited.lamps):
        if lamp in known:
            known.remove(lamp)
        else:
            names.append(f"lamp{k}")
    return names


def rendered(scene: Scene, *, spp: int, seed: int = 0, denoise: bool = False, device: str = "auto") -> Array:
    """[H, W, 3] float32 linear: the scene as it stands, with its bodies and lamps; `spp` camera rays a pixel.

    Raises SetupError with `denoise` where the denoiser is not installed.
    """
    studio = Studio(scene, device=device)
    target = studio._dressed(scene)
    depth = _path_depth(scene) if scene.bodies or scene.lamps else 0
    picture = target.render_path(spp=spp, seed=seed, max_depth=depth) if depth else target.render(spp=spp, seed=seed)
    if denoise:
        from materialist.render.denoise import denoise as clean

        albedo, normal = studio.guides(scene)
        picture = clean(picture, albedo=albedo, normal=normal)
    return picture


def _path_depth(scene: Scene) -> int:
    """Length of the paths that Mitsuba's tracer must follow; 0 where the splitting tracer does."""
    from materialist.render.bodies import is_glowing, is_transparent
    from materialist.render.envmap import is_sunny
    from materialist.render.scene import GLASS_DEPTH, MAX_DEPTH

    if any(is_transparent(body.surface) for body in scene.bodies):
        return GLASS_DEPTH
    glows = any(is_glowing(body.surface) for body in scene.bodies)
    return MAX_DEPTH if glows or scene.lamps or is_sunny(scene.envmap) else 0


def _built(scene: Scene, device: str):
    from materialist.render.scene import RenderScene

    target = RenderScene(scene.geometry, scene.camera, bodies=scene.bodies, device=device)
    if scene.lamps:
        add_lamps(target, scene.lamps)
    return target


def add_lamps(target, lamps: tuple[Lamp, ...]) -> None:
    """Put lamps into a `RenderScene`: small glowing spheres, which the path tracer aims at."""
    mi = target.mi
    shapes = {f"lamp{k}": _sphere(lamp) for k, lamp in enumerate(lamps)}
    shapes |= {name: shape for name, shape in _parts(target.mi_scene).items()}
    target.mi_scene = mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **shapes})
    target.params = mi.traverse(target.mi_scene)
    target.params.keep([k for k in list(target.params.keys()) if k == "light.data" or ".bsdf." in k])


def _parts(scene) -> dict:
    """The sensor, environment and shapes of a Mitsuba scene under names of their own."""
    shapes = {shape.id(): shape for shape in scene.shapes()}
    return {"sensor": scene.sensors()[0], "light": scene.environment(), **shapes}


def _sphere(lamp: Lamp) -> dict:
    """A sphere whose radiant flux is the lamp's."""
    return {
        "type": "sphere", "center": [float(v) for v in lamp.position], "radius": float(lamp.radius),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(lamp.radiance)}},
    }  # fmt: skip


def kelvin_colour(kelvin: float) -> Array:
    """[3] linear Rec.709 of a black body of that temperature, with luminance 1 and no channel below 0.

    Chromaticity by the cubic fits of Kim et al. (2002). Raises InputError outside 1667 to 25000 K.
    """
    from materialist.color import LUMINANCE

    if not 1667 <= kelvin <= 25000:
        raise InputError(f"The lamp has {kelvin:g} K; a colour temperature lies between 1667 and 25000.")
    t = 1000.0 / kelvin
    if kelvin < 4000:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
    else:
        x = -3.0258469 * t**3 + 2.1070379 * t**2 + 0.2226347 * t + 0.240390
    if kelvin < 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin < 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    xyz = np.array([x / y, 1.0, (1 - x - y) / y])
    to_rgb = np.array(
        [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
    )
    rgb = np.maximum(to_rgb @ xyz, 0)
    return (rgb / (LUMINANCE @ rgb)).astype(np.float32)
