"""Edits at once: pictures from cached light transport instead of path tracing."""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from materialist.buffers import placed
from materialist.camera import pixel_rays
from materialist.edits.composite.into_photo import onto_working, overall_factor
from materialist.edits.composite.layers import Layers, changed_pixels, diffuse_albedos, diffuse_kept
from materialist.edits.core.renderer import is_relit
from materialist.edits.core.surfaces import dimmed_emitters
from materialist.envmap import environment
from materialist.errors import InputError, OutputError
from materialist.io.atomic import whole_file
from materialist.types import Array, Materials, Scene

if TYPE_CHECKING:
    from materialist.transport.cache import Tables, TransportCache
    from materialist.transport.filter import Guide

RAYS = (48, 12)
"""Diffuse and specular rays a pixel, three quarters of the fit's: a new light is gathered sooner."""
SHARPEST = 0.1
"""Least roughness at which reflections are filtered: unfiltered, the few rays of the level above it show as a grid of
dots on metal, four times as strong as after the filter (4 x 4 pixels, relief 0.059 and 0.018 of log radiance)."""
VERSION = 3
"""Of the tables on disk; another one where the same scene gives other tables."""
MIN_AMBIENT = 1e-3
"""Factor on the fitted map below which the map cannot be scaled back."""


def load() -> None:
    """Import the renderer and the engine, which takes a second or two the first time."""
    from materialist.render.variant import setup

    setup()
    import materialist.transport.filter  # noqa: F401


class Preview:
    """A fitted scene whose rays are traced once; then a change of materials is one shading call.

    What surfaces send to each other is what the photo shows (for another light: one shading under it), so that colour
    bleeding of the edit itself is missing; lamps and what they light are not shown. Build it once (a second or two),
    keep it; it has a seventh of the rays until `prepare` has traced the others.

    file: where the finer tables of the fitted light are kept (.npz). Where it has those of this scene, nothing is
        traced before there is another light; what cannot be read, or is of another scene, is made again.
    """

    def __init__(self, scene: Scene, file: Path | None = None):
        load()
        self.scene = scene
        self._file = file
        self._key = _key(scene)
        self._other: tuple[Array, Tables, Array] | None = None
        """Another light, its tables, and the outgoing radiance of the surfaces under it."""
        self._turned: tuple[Array, TransportCache, Guide] | None = None
        """Normals [H, W, 3] of an edit, the rays of the pixels where they differ, and their surfaces."""
        self._turned_tables: tuple[Tables, Tables] | None = None
        """Tables of the scene's own normals, and the same with those of `_turned`."""
        self._outgoing = scene.photo.linear
        """[H, W, 3] outgoing radiance of the surfaces in the last picture of another light."""
        kept = None if file is None else _read(file, self._key)
        self._coarse = kept is None
        if kept is None:
            tables = self._filtered(self._quick, scene.envmap, scene.photo.linear)
            self._use(self._quick.pixels, tables)
        else:
            self._use(kept["pixels"], _restored(kept))

    def _use(self, pixels: Array, tables: Tables) -> None:
        """Shade those pixels [P] with tables of the fitted light from now on."""
        self._pixels = pixels.astype(np.int64)
        sky = np.ones(self.scene.depth.size, bool)
        sky[self._pixels] = False
        self._skies = np.flatnonzero(sky)
        self._tables = tables
        # The fitted scene, shaded once: every edit is compared with it.
        self._base = self._image(
            self._shaded(self.scene.materials, self._tables), self._sky(self.scene.envmap)
        )

    @cached_property
    def _cache(self) -> TransportCache:
        """All rays of a fine picture."""
        from materialist.transport.cache import CacheSettings

        return self._quick.with_rays(CacheSettings(*RAYS))

    @cached_property
    def _guide(self) -> Guide:
        from materialist.transport.filter import surface_guide

        return surface_guide(self._quick)

    @cached_property
    def _quick(self) -> TransportCache:
        """A few rays a pixel: enough for what surfaces pass on, which is averaged again where it arrives."""
        from materialist.transport.cache import CacheSettings, TransportCache

        return TransportCache(self.scene.geometry, self.scene.camera, CacheSettings(8, 1))

    @property
    def coarse(self) -> bool:
        """Whether pictures still have a seventh of the rays."""
        return self._coarse

    def prepare(self) -> bool:
        """Trace the next part for finer pictures and another light, a second or so; False where all is there."""
        if self._quick.trace_next() or self._cache.trace_next():
            return True
        if self._coarse:
            tables = self._filtered(self._cache, self.scene.envmap, self.scene.photo.linear)
            kept = _stored(self._cache, tables)
            self._coarse = False
            self._use(kept["pixels"], _restored(kept))
            if self._file is not None:
                with suppress(OutputError), whole_file(self._file, force=True) as whole:
                    np.savez(whole, key=self._key, **kept)
        return False

    def render(self, edited: Scene, *, coarse: bool = False) -> Array:
        """[H, W, 3] float32 linear: the edited scene by cached transport, noise-free.

        `coarse`: another light by a seventh of the rays, surfaces passing on what they did in the picture before.
        Raises InputError for other surfaces than its own; they may have other normals.
        """
        if edited.geometry.mesh.vertices is not self.scene.geometry.mesh.vertices:
            raise InputError(
                "The preview was built for another geometry; build one for this scene."
            )
        edited = self._seen(edited)
        tables = self._tables_of(edited, coarse)
        return self._image(self._shaded(edited.materials, tables), self._sky(edited.envmap))

    def _tables_of(self, seen: Scene, coarse: bool = False) -> Tables:
        fitted = np.array_equal(seen.envmap, self.scene.envmap)
        tables = self._tables if fitted else self._tables_under(seen, coarse)
        turned = (seen.normal != self.scene.normal).any(-1)
        return self._with_normals(tables, seen, turned) if turned.any() else tables

    def _with_normals(self, tables: Tables, seen: Scene, turned: Array) -> Tables:
        """The tables with those of the edit's normals at the pixels [H, W] bool where these are not the scene's."""
        import torch

        from materialist.transport.cache import CacheSettings, Tables, TransportCache
        from materialist.transport.filter import surface_guide

        if self._turned is None or not np.array_equal(self._turned[0], seen.normal):
            rays = CacheSettings(*RAYS)
            cache = TransportCache(seen.geometry, seen.camera, rays, region=turned)
            self._turned = (seen.normal, cache, surface_guide(cache))
            self._turned_tables = None
        if self._turned_tables is None or self._turned_tables[0] is not tables:
            _, cache, guide = self._turned
            fitted = tables is self._tables
            passed_on = self.scene.photo.linear if fitted else self._outgoing
            places = np.searchsorted(self._pixels, cache.pixels)
            # Coarse ones are of one roughness [P].
            roughness = tables.levels[0][places] if len(tables.levels) == 1 else None
            own = self._filtered(cache, seen.envmap, passed_on, roughness, guide)
            mixed = Tables(tables.diffuse.clone(), tables.specular.clone(), tables.levels)
            rows = torch.from_numpy(places)
            mixed.diffuse[rows] = own.diffuse
            mixed.specular[:, rows] = own.specular
            self._turned_tables = (tables, mixed)
        return self._turned_tables[1]

    def rows(self, edited: Scene, region: Array) -> dict[str, Array]:
        """What shading the surface pixels of a region [H, W] bool of a scene takes, in the order of the picture.

        `pixels` [P], row-major; `diffuse` [P, 9] and `specular` [L, P, 6] as of `transport.cache.Tables`; `base`
        [P, 3], the fitted scene; under another light also `overall` [3], by how much that is brighter as a whole.
        """
        tables = self._tables_of(self._seen(edited))
        rows = np.flatnonzero(region.ravel()[self._pixels])
        pixels = self._pixels[rows]
        tables_of_rows = {
            "pixels": pixels,
            "diffuse": tables.diffuse[rows].cpu().numpy(),
            "specular": tables.specular[:, rows].cpu().numpy(),
            "base": self._base.reshape(-1, 3)[pixels],
        }
        if is_relit(self.scene, edited):
            tables_of_rows["overall"] = overall_factor(self._base, self.render(edited))
        return tables_of_rows

    def picture(self, edited: Scene, *, coarse: bool = False) -> Array:
        """[H, W, 3] float32 linear: the edit in the photo at working size, with borders as hard as the mask."""
        # The same layers as of the composite, without noise: what differs is what the edit
        # reaches.
        picture = self.render(edited, coarse=coarse)
        base = self._base
        differs = (picture != base).any(-1)
        changed = changed_pixels(self.scene, edited) & differs
        relit = is_relit(self.scene, edited)
        kept = diffuse_kept(self.scene, edited)
        albedos = diffuse_albedos(self.scene, edited)
        layers = Layers(base, picture, differs, changed, relit, diffuse=kept, albedos=albedos)
        return onto_working(self.scene.photo, layers)

    def _seen(self, edited: Scene) -> Scene:
        """The scene as it is shaded: in-photo emitters are not shown, and their light comes from the map, as fitted."""
        emitters = dimmed_emitters(self.scene, edited)
        if emitters is None:
            return edited
        ambient = float(emitters["ambient"])
        lights = float(emitters["share"])
        # All light after the dimming, relative to the photo's.
        factor = (ambient + lights * emitters["dim"]) / max(ambient + lights, 1e-6)
        # Without its lights the map may have nothing left to be scaled.
        light = edited.envmap / ambient if ambient > MIN_AMBIENT else self.scene.envmap
        return replace(edited, envmap=(light * factor).astype(np.float32))

    def _tables_under(self, edited: Scene, coarse: bool) -> Tables:
        """The tables of another light, which surfaces pass on once; kept until there is a third light.

        Coarse ones are of the scene's own roughness alone.
        """
        if self._other is not None and np.array_equal(edited.envmap, self._other[0]):
            _, tables, self._outgoing = self._other
            return tables
        # First what surfaces pass on under this light, by few rays, at the roughness that they have; then the picture,
        # by all of them.
        before = self._outgoing if coarse else None
        roughness = edited.materials.roughness.ravel()[self._pixels]
        tables = self._filtered(self._quick, edited.envmap, before, roughness)
        self._outgoing = self._image(
            self._shaded(edited.materials, tables), self._sky(edited.envmap)
        )
        if not coarse:
            tables = self._filtered(self._cache, edited.envmap, self._outgoing)
            self._other = (edited.envmap, tables, self._outgoing)
        return tables

    def _filtered(
        self,
        cache: TransportCache,
        envmap: Array,
        passed_on: Array | None,
        roughness: Array | None = None,
        guide: Guide | None = None,
    ) -> Tables:
        """Tables of a light by the rays of one cache, without noise, of all levels or of one roughness [P] alone.

        guide: its surfaces, where they are not the scene's.
        """
        from materialist.transport.cache import levels_around
        from materialist.transport.filter import filter_tables
        from materialist.transport.shading import at_roughness

        if roughness is None:
            tables = cache.gather(envmap, passed_on)
        else:
            tables = cache.gather(envmap, passed_on, levels_around(roughness))
            # One level to filter in place of all.
            tables = at_roughness(tables, roughness)
        return filter_tables(cache, tables, guide or self._guide, sharpest=SHARPEST)

    def _shaded(self, materials: Materials, tables: Tables):
        """[P, 3] torch radiance of the surface pixels."""
        import torch

        from materialist.transport.shading import shade

        maps = (
            materials.albedo.reshape(-1, 3),
            materials.roughness.ravel(),
            materials.metallic.ravel(),
        )
        with torch.no_grad():
            return shade(tables, *(placed(values[self._pixels]) for values in maps))

    def _sky(self, envmap: Array) -> Array:
        """[S, 3] radiance of the pixels without a surface."""
        rays = pixel_rays(self.scene.camera).reshape(-1, 3)[self._skies]
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return environment(rays, envmap).astype(np.float32)

    def _image(self, shaded, sky: Array) -> Array:
        flat = np.empty((self.scene.depth.size, 3), np.float32)
        flat[self._pixels] = shaded.cpu().numpy()
        flat[self._skies] = sky
        return flat.reshape(*self.scene.depth.shape, 3)


def _key(scene: Scene) -> str:
    """What the tables of a scene depend on, as a text."""
    mesh = scene.geometry.mesh
    total = 0
    for values in (*vars(mesh).values(), scene.photo.linear, scene.envmap):
        total = zlib.crc32(values.tobytes(), total)
    return f"{VERSION} {RAYS} {scene.camera} {total:08x}"


def _stored(cache: TransportCache, tables: Tables) -> dict[str, Any]:
    """Tables and the pixels of their rows as a file holds them, so that a scene opened again looks the same."""
    # float16 halves the file; its largest number is 65504.
    halves = {
        name: np.clip(v.cpu().numpy(), -6e4, 6e4).astype(np.float16)
        for name, v in (("diffuse", tables.diffuse), ("specular", tables.specular))
    }
    return halves | {"pixels": cache.pixels}


def _restored(kept: dict[str, Any]) -> Tables:
    """Tables as `_stored` gave them."""
    from materialist.transport.cache import Tables

    return Tables(*(placed(kept[name].astype(np.float32)) for name in ("diffuse", "specular")))


def _read(file: Path, key: str) -> dict[str, Any] | None:
    """The arrays of a file that were written under this key; None where there are none."""
    with (
        suppress(OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error),
        np.load(file) as kept,
    ):
        if str(kept["key"]) == key:
            return {name: kept[name] for name in ("pixels", "diffuse", "specular")}
    return None
