"""An edit is what its operation says of it: one more in the registry has a command, a step and words."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import typer
from edit_scenes import MASK, flat_scene
from PIL import Image
from typer.testing import CliRunner

from materialist.cli.edits import operation_command
from materialist.cli.generate import add_command
from materialist.edits.core.notes import noted
from materialist.edits.core.operation import Operation, Target
from materialist.edits.material.material import edit
from materialist.edits.recipe import Step, apply, read_recipe
from materialist.edits.registry import OPERATIONS, picture_notes
from materialist.errors import InputError
from materialist.option_kinds import OperationOptions, declarations, option
from materialist.studio.edit_list import step_summary

SCENE = flat_scene()


@dataclass(frozen=True, kw_only=True)
class Wetting(OperationOptions):
    """How wet a region is."""

    operation = "wet"
    depth: float = option(0.0, "0 is dry, 1 soaked.", low=0, high=1)


def _apply(scene, region, options, fitted):
    old = scene.materials
    albedo = np.where(region[..., None], (1 - options.depth) * old.albedo, old.albedo)
    wet = replace(scene, materials=replace(old, albedo=albedo.astype(np.float32)))
    return noted(wet, "water", {"depth": options.depth})


WET = Operation(
    options=Wetting,
    kind="water",
    target=Target.REGION,
    apply=_apply,
    about="Wet a region.",
    label="Wet",
    needed=("depth",),
    notes=lambda scene, edited, change: [f"changed by {change:g}"],
)


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """One with a mask, and the operation in the registry."""
    monkeypatch.setitem(OPERATIONS, "wet", WET)
    Image.fromarray((MASK * 255).astype(np.uint8)).save(tmp_path / "block.png")
    return tmp_path


def steps_of(folder, text):
    (folder / "edits.yaml").write_text(text)
    return read_recipe(folder / "edits.yaml")


def test_names_keys_and_needed_options_are_those_of_the_options():
    assert [*OPERATIONS] == [operation.name for operation in OPERATIONS.values()]
    assert len({operation.kind for operation in OPERATIONS.values()}) == len(OPERATIONS)
    for operation in OPERATIONS.values():
        options = {*declarations(operation.options)}
        assert {*operation.needed} <= options and not {*operation.target.keys} & options


def test_a_further_operation_is_a_step_of_lists_of_edits(folder):
    steps = steps_of(folder, "- wet: {mask: block.png, depth: 0.5}")
    wet = apply(SCENE, steps)
    old = SCENE.materials.albedo
    np.testing.assert_allclose(wet.materials.albedo[MASK], 0.5 * old[MASK], rtol=1e-6)
    assert wet.provenance["edits"][-1] == {"kind": "water", "depth": 0.5}
    assert step_summary(steps[0]) == "Wet: depth 0.5"
    assert step_summary(Step("wet")) == "Wet: as it is"
    with pytest.raises(
        InputError,
        match="says 'hue'; wet knows mask, click, box, with, extent, same_material, exclude, depth",
    ):
        steps_of(folder, "- wet: {mask: block.png, hue: 3}")


def test_a_further_operation_is_a_command():
    app = typer.Typer()
    add_command(app, operation_command(WET), "wet")
    shown = CliRunner().invoke(app, ["--help"]).output
    assert "Wet a region." in shown and "--depth" in shown and "--click" in shown
    # Without an option that it needs, it names that one before anything is opened.
    refusal = CliRunner().invoke(app, ["no.scene", "--click", "3,4", "-o", "a.png"]).exception
    assert isinstance(refusal, InputError) and "give --depth" in str(refusal)


def test_an_operation_speaks_of_its_own_pictures_only(folder):
    wet = apply(SCENE, steps_of(folder, "- wet: {mask: block.png, depth: 0.5}"))
    assert picture_notes(SCENE, wet, 0.25) == ["changed by 0.25"]
    assert picture_notes(SCENE, edit(SCENE, MASK, hue=90), 0.25) == []
