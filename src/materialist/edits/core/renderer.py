"""Renderings of a fitted scene and of its edits, with common random numbers."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from materialist.color import CLIPPED
from materialist.edits.core.surfaces import PHOTO_LIGHT
from materialist.envmap import environment, paste_visible_sky, texel_directions
from materialist.forks import check_process
from materialist.geometry.silhouette import window
from materialist.io.photo import HDR_CLIP
from materialist.options import PATHS
from materialist.render.bodies import is_glowing, is_transparent
from materialist.types import Array, Progress, Scene

SKY_ROWS = 768
"""Rows of the largest map with the photo's sky (derived: memory)."""


@dataclass(frozen=True)
class RenderOptions:
    """How the pictures of a scene and of its edit are rendered."""

    spp: int = PATHS
    """Paths a pixel, of each picture."""
    seed: int = 0
    denoise: bool = True
    """Whether they are denoised before they are compared, where the denoiser is installed."""
    device: str = "auto"
    progress: Progress | None = None

    def tick(self, stage: str, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress(stage, done, total)


Pictures = dict[tuple[int, int], tuple[Array, Array]]
"""Pictures [H, W, 3], and where they are traced [H, W] bool, by paths a pixel and seed."""


class Render:
    """render(spp, seed, where) -> [H, W, 3] float32 linear, of one scene: each pixel is traced when first asked for.

    spp: paths a pixel. seed: of their random numbers. where: [H, W] bool: pixels that are wanted, others may be 0;
    None: all. Later calls complete the same array.
    """

    def __init__(
        self, trace: Callable[..., Array], shape: tuple[int, ...], pictures: Pictures | None = None
    ):
        self._trace = trace
        self._shape = shape
        self._pictures: Pictures = {} if pictures is None else pictures

    def __call__(self, spp: int, seed: int, where: Array | None = None) -> Array:
        if (spp, seed) not in self._pictures:
            self._pictures[spp, seed] = (
                np.zeros((*self._shape, 3), np.float32),
                np.zeros(self._shape, bool),
            )
        picture, known = self._pictures[spp, seed]
        missing = ~known if where is None else where & ~known
        if missing.any():
            picture[missing] = self._trace(spp=spp, seed=seed, where=missing)[missing]
            known |= missing
        return picture


class EditRenderer:
    """Renderings of one fitted scene and of its edits, with common random numbers, so that their noise cancels.

    Under another light other directions are sampled, and less of the noise cancels. Scenes of one geometry, with the
    same bodies and lamps, share a Mitsuba scene; all edits share what of the base is traced.
    """

    def __init__(self, scene: Scene, *, device: str = "auto"):
        check_process()
        self.scene = scene
        self.device = device
        self._built: dict[bool, tuple[Scene, Any]] = {}
        """The base's (True) and those of the last edit of other shapes."""
        self._base: dict[tuple, Pictures] = {}
        self._sky: Array | None = None

    def pair(self, edited: Scene, unseen: tuple[str, ...] = ()) -> tuple[Render, Render]:
        """The renderings of the base and of `edited`, with paths of equal length.

        unseen: names of bodies and lamps of `edited` that the camera does not see; pixels full of them are 0.
        """
        # --- The photo's sky in both or in neither, and paths of equal length: noise cancels ---
        scene = self.lit(self.scene, edited)
        edited = self.lit(edited, edited)
        depth = max(path_depth(s) for s in (scene, edited))
        shape = self.scene.depth.shape
        key = (scene is self.scene, depth)
        # Only the pictures are kept: a `Render` of its own would keep this renderer alive.
        pictures = self._base.setdefault(key, {})
        base = Render(partial(self._render, scene, depth), shape, pictures)
        return base, Render(partial(self._render, edited, depth, unseen=unseen), shape)

    def lit(self, shown: Scene, edited: Scene) -> Scene:
        """The scene `shown` as `edited` needs it: before new glass the photo's own sky is part of the light."""
        old = self.scene.bodies
        if is_relit(self.scene, edited) or all(
            b in old or not is_transparent(b.surface) for b in edited.bodies
        ):
            return shown
        if self._sky is None:
            self._sky = photo_sky(self.scene)
        return replace(shown, envmap=self._sky)

    def covered(self, edited: Scene) -> Array:
        """[H, W] bool: where a body or lamp is seen, at least in part, that the other of the two scenes lacks."""
        seen = np.zeros(self.scene.depth.shape, bool)
        # In either direction: what was added, and what was taken away.
        for scene, other in ((self.scene, edited), (edited, self.scene)):
            names = [f"body{k}" for k, body in enumerate(scene.bodies) if body not in other.bodies]
            names += [f"lamp{k}" for k, lamp in enumerate(scene.lamps) if lamp not in other.lamps]
            seen |= self._seen(scene, names) > 0
        return seen

    def body_coverage(self, scene: Scene) -> Array:
        """[H, W] share of each pixel in which one of its bodies is seen."""
        return self._seen(scene, [f"body{k}" for k in range(len(scene.bodies))])

    def emitter_pixels(self, edited: Scene) -> Array:
        """[H, W] bool: where in-photo emitters of `edited` are seen."""
        names = [
            f"body{k}" for k, body in enumerate(edited.bodies) if body.name.startswith(PHOTO_LIGHT)
        ]
        return self._seen(edited, names) > 0.5

    def guides(self, edited: Scene, covered: Array | None = None) -> tuple[Array, Array]:
        """Albedo and normal [H, W, 3] of the edited scene for the denoiser.

        Where `covered` [H, W] bool, by default wherever its bodies are seen, they are those of the bodies.
        """
        from materialist.render.pixels import first_hits

        covered = self.body_coverage(edited) > 0 if covered is None else covered
        if not covered.any():
            return edited.materials.albedo, edited.normal
        bodies = {f"body{k}": body for k, body in enumerate(edited.bodies)}
        part = window(covered)
        sight = first_hits(
            self.render_scene(edited).mi_scene, edited.camera, bodies, covered.shape, part
        )
        albedo = edited.materials.albedo.copy()
        normal = edited.normal.copy()
        # --- Guides mix as the picture does: by the share of each pixel that the bodies cover ---
        share = np.where(covered[part], sight.share, 0)[..., None]
        albedo[part] = share * sight.albedo + (1 - share) * albedo[part]
        normal[part] = share * sight.normal + (1 - share) * normal[part]
        return albedo, normal

    def render_scene(self, scene: Scene):
        """The `RenderScene` of a scene's geometry, lamps and bodies, with its materials and its light."""
        target = self._target(scene)
        target.set_materials(scene.materials)
        target.set_envmap(scene.envmap)
        return target

    def _render(self, scene: Scene, depth: int, **options: Any) -> Array:
        return self.render_scene(scene).render(max_depth=depth, **options)

    def _seen(self, scene: Scene, names: list[str]) -> Array:
        """[H, W] share of each pixel in which the named bodies are seen."""
        from materialist.render.pixels import coverage

        if not names:
            return np.zeros(scene.depth.shape, np.float32)
        return coverage(self._target(scene).mi_scene, scene.camera, names, scene.depth.shape).share

    def _target(self, scene: Scene):
        """A `RenderScene` of its geometry, lamps and bodies, with the materials and light of its last use."""
        of_base = same_shapes(scene, self.scene)
        known = self._built.get(of_base)
        if known is None or not same_shapes(known[0], scene):
            from materialist.render.scene import RenderScene

            target = RenderScene(
                scene.geometry,
                scene.camera,
                bodies=scene.bodies,
                lamps=scene.lamps,
                device=self.device,
            )
            known = self._built[of_base] = scene, target
        return known[1]


def same_shapes(first: Scene, second: Scene) -> bool:
    """Whether the two scenes have the same geometry, bodies and lamps."""
    return first.geometry is second.geometry and (first.lamps, first.bodies) == (
        second.lamps,
        second.bodies,
    )


def photo_sky(scene: Scene) -> Array:
    """[h, 2h, 3] float32 linear: the environment map, with the photo's sky in full detail where the photo shows sky.

    A texel is about a pixel wide. A path through glass so meets what stands in the photo, clouds or the filled
    background of a removed object. The map as it is where the photo shows no sky.
    """
    camera = scene.camera
    if (scene.depth > 0).all():
        return scene.envmap
    rows = int(np.clip(np.pi * camera.focal, len(scene.envmap), max(SKY_ROWS, len(scene.envmap))))
    # The fitted map, enlarged until a texel is about a pixel of the photo.
    sky = environment(texel_directions(rows, 2 * rows).reshape(-1, 3), scene.envmap).reshape(
        rows, 2 * rows, 3
    )
    white = HDR_CLIP if scene.photo.hdr else CLIPPED
    return paste_visible_sky(
        sky.astype(np.float32), scene.photo.linear, scene.depth > 0, camera, white=white
    )


def is_relit(scene: Scene, edited: Scene) -> bool:
    """Whether the two scenes have different light."""
    glowing = [[body for body in s.bodies if is_glowing(body.surface)] for s in (scene, edited)]
    return (
        scene.lamps != edited.lamps
        or glowing[0] != glowing[1]
        or not np.array_equal(scene.envmap, edited.envmap)
    )


def path_depth(scene: Scene) -> int:
    """Length of the paths that the scene needs: longer ones through glass."""
    from materialist.render.scene import GLASS_DEPTH, MAX_DEPTH

    return GLASS_DEPTH if any(is_transparent(body.surface) for body in scene.bodies) else MAX_DEPTH


def rendered(
    scene: Scene, *, spp: int, seed: int = 0, denoise: bool = False, device: str = "auto"
) -> Array:
    """[H, W, 3] float32 linear: the scene as it stands, with its bodies and lamps; `spp` paths a pixel.

    Raises SetupError with `denoise` where the denoiser is not installed.
    """
    if denoise:
        from materialist.render.denoise import denoise as clean
        from materialist.render.denoise import require_denoiser

        require_denoiser()  # before the rendering, which takes long
    renderer = EditRenderer(scene, device=device)
    target = renderer.render_scene(scene)
    picture = target.render(spp=spp, seed=seed, max_depth=path_depth(scene))
    if denoise:
        picture = clean(picture, *renderer.guides(scene))
    return picture


def denoised(picture: Array, albedo: Array, normal: Array) -> Array:
    """[H, W, 3] without noise, guided by albedo and normal [H, W, 3].

    As it is where no denoiser can be loaded; `notes.noise_notes` has the sentence that says so.
    """
    from materialist.render.denoise import denoise, denoiser_problem

    if denoiser_problem() is not None:
        return picture
    return denoise(picture, albedo, normal)
