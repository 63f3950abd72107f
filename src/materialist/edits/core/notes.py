"""Notes of edits in the provenance of a scene, and warnings in its report."""

from dataclasses import replace
from typing import Any

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.core.operation import new_edits
from materialist.types import Array, Scene

LITTLE = 5 / 255
"""Mean change of a picture (sRGB-encoded) below which another light is hardly seen."""
REACHED = 1 / 3
"""Share of the photo's surfaces below which the command says why a sun reaches no more."""
MENTIONED = 0.05
"""Share of them from which on a cause of that is named."""
MEASURED = 2_000_000
"""Pixels that a mean change is measured on."""
PICTURED = "Glass of the two-interface model is a picture in the photo: "
"""The beginning of messages about glass that no rendering shows."""


def noted(scene: Scene, kind: str, facts: dict[str, Any]) -> Scene:
    """The scene with one more entry in `provenance["edits"]`, which reports and packages carry along.

    Values of None are left out.
    """
    said = {name: value for name, value in facts.items() if value is not None}
    entries = [*scene.provenance.get("edits", []), {"kind": kind, **said}]
    return replace(scene, provenance={**scene.provenance, "edits": entries})


def warned(scene: Scene, *notes: str) -> Scene:
    """The scene with further warnings in its report; a warning that an earlier edit gave is repeated."""
    return replace(
        scene,
        report=replace(scene.report, warnings=(*scene.report.warnings, *dict.fromkeys(notes))),
    )


def warnings_since(scene: Scene, edited: Scene) -> list[str]:
    """The warnings of the edits that led from one scene to another, each once."""
    return list(dict.fromkeys(edited.report.warnings[len(scene.report.warnings) :]))


def mean_change(scene: Scene, picture: Array) -> float:
    """How much a composite [H0, W0, 3] linear differs from the photo, sRGB-encoded.

    Of a large photo every k-th row and column is compared, MEASURED pixels or more.
    """
    step = max(1, int(np.sqrt(picture.shape[0] * picture.shape[1] / MEASURED)))
    after = linear_to_srgb(picture[::step, ::step])
    before = linear_to_srgb(scene.photo.original[::step, ::step])
    return float(np.abs(after - before).mean())


def effect_notes(scene: Scene, edited: Scene, change: float) -> list[str]:
    """What to say of another light whose picture, or most changed frame, has no more than that `mean_change`."""
    asked = new_edits(scene, edited)
    suns = [step["sun"] for step in asked if step["kind"] == "light" and "sun" in step]
    if suns and (notes := sun_notes(edited, *suns[-1])):
        return notes
    if change >= LITTLE or not any(step["kind"] == "light" for step in asked):
        return []
    return [
        f"The new light changes the picture by {255 * change:.1f} of 255 levels in the mean: the light that was found "
        "is nearly even, or the new one does not reach what the photo shows. A lamp, a stronger or lower sun, or a "
        "smaller ambient shows more."
    ]


def sun_notes(scene: Scene, azimuth: float, elevation: float) -> list[str]:
    """What to say of a sun that reaches little of what the photo shows."""
    from materialist.edits.core.reach import better_sun, sun_reach

    facing, lit = sun_reach(scene, azimuth, elevation)
    if lit >= REACHED:
        return []
    causes = {
        "of it faces away from the sun": 1 - facing,
        "lies behind walls or things of the photo": facing - lit,
    }
    reasons = [f"{share:.0%} {cause}" for cause, share in causes.items() if share >= MENTIONED]
    better, share = better_sun(scene, azimuth, elevation)
    return [
        f"The sun reaches {lit:.0%} of what the photo shows, and the rest is darker than before: "
        f"{' and '.join(reasons)}. From {better[0]:g},{better[1]:g} it would reach {share:.0%}."
    ]


def noise_notes(denoise: bool = True) -> list[str]:
    """What to say of a picture that was to be denoised, where the denoiser cannot be loaded."""
    from materialist.render.denoise import denoiser_problem

    problem = denoiser_problem() if denoise else None
    if problem is None:
        return []
    return [
        f"The picture is not denoised, so it is grainy: pyoidn cannot be loaded ({problem}). "
        "`materialist doctor` says how to install it; more paths a pixel help, too."
    ]


def is_pictured(scene: Scene) -> bool:
    """Whether the photo of an edited scene shows glass that no rendering of the scene has."""
    return any(step.get("model") == "two-interface" for step in scene.provenance.get("edits", ()))


def is_edited(scene: Scene) -> bool:
    """Whether a scene has edits that its photo and its re-rendering do not show."""
    saved = [
        len(stage.get("edits", ())) for stage in scene.report.stages if stage.get("name") == "edit"
    ]
    return len(scene.provenance.get("edits", ())) > max(saved, default=0)
