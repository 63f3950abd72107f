"""The base of the comparison: the scene without the edit, or, after a removal, without the removed object's shadow."""

from dataclasses import replace

import numpy as np

from materialist.edits.composite.into_photo import SETTINGS, into_photo, onto_working
from materialist.edits.composite.layers import difference, inner
from materialist.edits.core.renderer import EditRenderer, RenderOptions
from materialist.edits.core.surfaces import base_of
from materialist.geometry.build import continued_as, with_normals
from materialist.geometry.membrane import membrane
from materialist.geometry.silhouette import grown
from materialist.types import Array, Materials, Scene

MIN_CHANGE = 1e-3
"""Relative change of the radiance below which a filled pixel stays as it was filled."""

RIM = 3
"""Pixels around filled ones that change as those do: there the two renderings show edges of what is gone."""


def base_scene(scene: Scene, edited: Scene) -> Scene:
    """The scene that edits are compared with.

    If an edit removed something, its filled photo and maps replace the fitted ones inside the hole; outside it new
    materials and normals belong to the edit. In-photo emitters are surfaces where the edit has them as such
    (`core.surfaces`).
    """
    base = base_of(scene, edited)
    if edited.photo is scene.photo:
        return base
    # --- Inside the hole: the maps that the removal filled in ---
    hole = _disoccluded(scene, edited)
    old = scene.materials
    new = edited.materials
    materials = Materials(
        np.where(hole[..., None], new.albedo, old.albedo),
        np.where(hole, new.roughness, old.roughness),
        np.where(hole, new.metallic, old.metallic),
    )
    # --- Outside the hole new normals belong to the edit, not to what it is compared with ---
    normal = np.where(hole[..., None], edited.normal, scene.normal)
    geometry = edited.geometry
    others = (normal != edited.normal).any(-1)
    if others.any():
        # Pixels beside them have corners in common with them.
        geometry = with_normals(geometry, normal, grown(others, 1))
    return replace(
        base,
        photo=edited.photo,
        rerender=edited.rerender,
        materials=materials,
        depth=edited.depth,
        normal=normal,
        geometry=geometry,
    )


def base_without_shadow(
    scene: Scene,
    edited: Scene,
    options: RenderOptions,
    *,
    spent: bool = False,
) -> Scene:
    """`base_scene`, whose photo changes around the hole as the rendering does when the object goes.

    The object's shadow and reflection go, and the light that it shed on other things. Filled pixels, which are like
    their surroundings, change by the ratio of the surroundings.

    spent: the edited scene's own photo is not needed any more, and may be written over.
    """
    base = base_scene(scene, edited)
    if base.photo is scene.photo:
        return base
    # --- What the renderings say: the scene with the object, and without it ---
    hole = _disoccluded(scene, edited)
    photo = base.photo
    # Planes that the rest of the picture suggests when the object is gone were there before.
    before = replace(base_of(scene, edited), geometry=continued_as(scene.geometry, base.geometry))
    guides = (
        [(shown.materials.albedo, shown.normal) for shown in (before, base)]
        if options.denoise
        else None
    )
    pair = EditRenderer(before, device=options.device).pair(base)

    def tick(_: str, done: int, total: int) -> None:
        options.tick("shadow", done, total)

    # Nothing is known under the hole: its surroundings are carried over it.
    spanned = grown(hole, RIM)
    layers = difference(
        *pair, np.zeros_like(hole), guides, replace(options, progress=tick), hidden=inner(spanned)
    )
    # --- Their ratio, spanned over the hole ---
    log_ratio = np.log((layers.edited + SETTINGS.floor) / (layers.base + SETTINGS.floor))
    log_ratio = np.where(spanned[..., None], membrane(log_ratio, ~spanned), log_ratio)
    reached = np.where(spanned, np.abs(log_ratio).max(-1) > MIN_CHANGE, layers.reached)
    # Scale the photo by the ratio through the ordinary composite, as if photo and scaled photo were
    # the two renderings.
    layers = replace(
        layers, base=photo.linear, edited=photo.linear * np.exp(log_ratio), reached=reached
    )
    linear = onto_working(photo, layers)
    original = into_photo(photo, layers, once=spent)
    return replace(base, photo=replace(photo, original=original, linear=linear))


def _disoccluded(scene: Scene, edited: Scene) -> Array:
    """[H, W] bool: where the edit shows what was hidden."""
    hole = (edited.photo.linear != scene.photo.linear).any(-1) | (edited.depth != scene.depth)
    return hole | (edited.rerender != scene.rerender).any(-1)  # white may be filled with white
