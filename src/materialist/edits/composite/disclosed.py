"""The scene that an edit is compared with, where it takes an object of the photo away: without the object's shadow."""

from dataclasses import replace

import numpy as np

from materialist.edits.composite.into_photo import SETTINGS, into_photo, onto_working
from materialist.edits.composite.layers import difference, inner
from materialist.edits.core.renderer import EditRenderer, RenderOptions
from materialist.edits.core.surfaces import base_of
from materialist.geometry.build import continued_as
from materialist.geometry.membrane import membrane
from materialist.geometry.silhouette import grown
from materialist.types import Array, Materials, Scene

MIN_CHANGE = 1e-3
"""Relative change of the radiance below which a filled pixel stays as it was filled."""

RIM = 3
"""Pixels around filled ones that change as those do: there the two renderings show edges of what is gone."""


def compared(scene: Scene, edited: Scene) -> Scene:
    """The scene that an edit is compared with, which shows what the composite's photo shows.

    It is the fitted scene; with in-photo emitters as surfaces where the edit has them (`core.surfaces`). Where the
    edit discloses hidden places, it carries a photo that is filled there (`remove`): that photo stands in for the
    photo, and the fitted scene without the removed object for the fitted scene.
    """
    base = base_of(scene, edited)
    if edited.photo is scene.photo:
        return base
    hole = _disclosed(scene, edited)
    old = scene.materials
    new = edited.materials
    materials = Materials(
        np.where(hole[..., None], new.albedo, old.albedo),
        np.where(hole, new.roughness, old.roughness),
        np.where(hole, new.metallic, old.metallic),
    )
    return replace(
        base,
        photo=edited.photo,
        rerender=edited.rerender,
        materials=materials,
        depth=edited.depth,
        normal=edited.normal,
        geometry=edited.geometry,
    )


def without_traces(
    scene: Scene,
    edited: Scene,
    options: RenderOptions,
) -> Scene:
    """`compared`, and its photo changes around the hole as the rendering does when the object goes.

    Its shadow and its reflection go, and the light that it shed on other things. Filled pixels, which are like their
    surroundings, change by the factor of the surroundings.
    """
    base = compared(scene, edited)
    if base.photo is scene.photo:
        return base
    # --- What the renderings say: the scene with the object, and without it ---
    hole = _disclosed(scene, edited)
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
    # --- Their ratio, spanned over the hole, and applied to the photo ---
    factor = np.log((layers.edited + SETTINGS.floor) / (layers.base + SETTINGS.floor))
    factor = np.where(spanned[..., None], membrane(factor, ~spanned), factor)
    reached = np.where(spanned, np.abs(factor).max(-1) > MIN_CHANGE, layers.reached)
    layers = replace(
        layers, base=photo.linear, edited=photo.linear * np.exp(factor), reached=reached
    )
    return replace(
        base,
        photo=replace(
            photo, original=into_photo(photo, layers), linear=onto_working(photo, layers)
        ),
    )


def _disclosed(scene: Scene, edited: Scene) -> Array:
    """[H, W] bool: where the edit shows what was hidden."""
    hole = (edited.photo.linear != scene.photo.linear).any(-1) | (edited.depth != scene.depth)
    return hole | (edited.rerender != scene.rerender).any(-1)  # white may be filled with white
