"""An object of the photo turned to glass (paper, Material Transparency Editing).

Two models: a closed body that is path-traced (`solids.closed`, `solids.revolution`), and the paper's two interfaces
(`edits.glass.two_interface`).
"""

from dataclasses import replace
from itertools import chain
from typing import Unpack

import numpy as np

from materialist.camera import pixel_rays
from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import checked_region
from materialist.edits.core.surfaces import PHOTO_GLASS
from materialist.edits.glass.options import Glass, GlassKeywords
from materialist.edits.glass.thickness import ThickPart, thick_parts, wall_of
from materialist.edits.remove.remove import remove
from materialist.geometry.membrane import nearest
from materialist.geometry.slopes import blurred_normals
from materialist.option_kinds import documented
from materialist.predict import resample
from materialist.predict.refraction.thickness import Thickness
from materialist.solids.closed import closed_proxy
from materialist.solids.shell import Shell, joined_shells
from materialist.types import Array, Body, Scene, Surface

SOLID = "The two-interface model knows no walls: this glass is solid."
LID = "Only a surface of revolution can be open at the top; this glass is hollow, and closed."
NARROW = "There is no room for an opening within the wall; this glass is hollow, and closed."
NO_ROOM = "There is no room for a wall around air: this glass is solid."


@documented(Glass)
def glass(
    scene: Scene,
    mask: Array,
    options: Glass | None = None,
    *,
    fitted: Scene | None = None,
    **values: Unpack[GlassKeywords],
) -> Scene:
    """The scene with the masked object made of glass, before what it hid.

    The model `closed` path-traces a closed body (`solids.closed`); `two-interface` is the paper's: every camera ray
    is bent twice and looks up the background, and there are no shadows.

    mask: [H, W] bool, or weights in [0, 1], at working size: one object, or several.
    options, values: `Glass`, or single fields of it.
    fitted: the scene before its edits: a given background is the photo's, in the light of the photo.
    Raises InputError for an option out of its range, or a mask that cannot be used; WeightsError without weights.
    """
    options = Glass.merged(options, **values)
    region = checked_region(scene, mask) > 0.5
    # --- What stands behind the object, and how thick it is ---
    removed = remove(scene, mask, options, fitted=fitted)
    parts = thick_parts(scene, region, options.thickness, behind=removed.depth)
    # --- The paper's model, or a closed body for the path tracer ---
    if options.model == "two-interface":
        edited = _two_interface(scene, removed, parts, options, (fitted or scene).envmap)
        edited = warned(edited, SOLID) if options.hollow else edited
    else:
        # All parts are one body: they have one material.
        shells, notes = zip(
            *(_shell(scene, removed, part, options.hollow) for part in parts), strict=True
        )
        shell = joined_shells(shells)
        body = Body(
            shell.vertices,
            shell.faces,
            shell.normals,
            shell.uv,
            glass_surface(scene, options),
            PHOTO_GLASS,
        )
        edited = warned(replace(removed, bodies=(*removed.bodies, body)), *chain(*notes))
    # --- What the provenance keeps ---
    facts = {
        "ior": options.ior,
        "transmission": options.transmission,
        "tint": list(options.tint),
        "roughness": options.roughness,
        "hollow": options.hollow,
        "model": options.model,
        "back": options.back,
        "thickness": ", ".join(dict.fromkeys(part.thickness.method for part in parts)),
        "pixels": int(region.sum()),
    }
    return noted(edited, "glass", facts)


def _shell(
    scene: Scene, removed: Scene, part: ThickPart, hollow: bool | str
) -> tuple[Shell, list[str]]:
    """(the body of one part, notes on a wall or an opening that could not be made)."""
    camera = scene.camera
    # --- From the maps, or as its profile is swept; a wall where it is hollow ---
    thick = part.thickness
    revolution = thick.revolution
    # Handles are solid, also those of a hollow jug.
    hollow = False if part.is_handle else hollow
    wall = wall_of(scene, part.mask, thick) if hollow else None
    if revolution is None:
        depth, normal = thick.front or (scene.depth, scene.normal)
        shell = closed_proxy(
            depth,
            normal,
            part.mask,
            thick.solid,
            camera,
            wall=wall,
            behind=removed.depth,
            back=thick.back,
        )
    else:
        opened = revolution.vessel(camera, wall) if wall and hollow == "open" else None
        if opened is not None:
            return opened, []
        shell = revolution.body(camera, wall=wall)
    # Of several reasons the note names the first that holds.
    note = NO_ROOM if not shell.hollow else LID if revolution is None else NARROW
    failed = hollow == "open" or (bool(hollow) and not shell.hollow)
    return shell, [note] if failed else []


def glass_surface(scene: Scene, options: Glass) -> Surface:
    """The material: glass, and (1 - T) of what the object was."""
    # Clear glass has no surface of its own: white, without metal.
    clear = options.transmission >= 1
    albedo = np.ones((1, 1, 3), np.float32) if clear else scene.materials.albedo
    metallic = np.zeros((1, 1), np.float32) if clear else scene.materials.metallic
    rough = np.full((1, 1), options.roughness, np.float32) if clear else scene.materials.roughness
    return Surface(
        albedo,
        rough,
        metallic,
        options.transmission,
        options.ior,
        options.tint,
        glass_roughness=options.roughness,
    )


def _two_interface(
    scene: Scene, removed: Scene, parts: list[ThickPart], options: Glass, envmap: Array
) -> Scene:
    """The removed scene with the paper's picture of the glass in its photo, in the light of the photo."""
    from materialist.edits.glass.two_interface import Backdrop, two_interface

    # --- Its picture at working size, part by part ---
    glass_seen: Array = np.zeros(scene.depth.shape, bool)
    photo = removed.photo
    picture: Array = np.zeros(scene.photo.linear.shape, np.float32)
    clear = options.transmission
    behind = Backdrop(photo.linear, removed.depth, envmap)
    for part in parts:
        thick = part.thickness
        seen, front, facing = _front(scene, part.mask, thick)
        glass_picture = two_interface(
            scene.camera, facing, front, seen, thick.solid, behind, options, thick.back
        )
        picture = np.where(seen[..., None], glass_picture, picture)
        glass_seen |= seen
    # The photo has the reflections of its own surface: that share of it takes the place of all of the glass.
    picture = clear * picture + (1 - clear) * scene.photo.linear * glass_seen[..., None]
    # --- Into the photo at both of its sizes ---
    linear = np.where(glass_seen[..., None], picture, photo.linear).astype(np.float32)
    native = photo.original.shape[:2]
    share = np.clip(resample.values(glass_seen.astype(np.float32), native), 0, 1)[..., None]
    # Glass is continued beyond its outline first: enlarging it then mixes nothing else in.
    near = resample.values(picture[nearest(glass_seen)], native)
    original = (share * near + (1 - share) * photo.original).astype(np.float32)
    return replace(removed, photo=replace(photo, linear=linear, original=original))


def _front(scene: Scene, region: Array, thick: Thickness) -> tuple[Array, Array, Array]:
    """Where glass is seen, [H, W] bool, and its front's depth and normals: of a surface of revolution, or the maps.

    Normals of the maps are blurred as for the closed proxy.
    """
    if thick.revolution is None:
        depth, normal = thick.front or (scene.depth, scene.normal)
        return region, depth, blurred_normals(normal, region, 0.01 * float(np.sqrt(region.sum())))
    depth, normal = thick.revolution.front(region, pixel_rays(scene.camera).astype(np.float64))
    return depth > 0, depth, normal
