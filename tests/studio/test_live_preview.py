"""What the live preview shades."""

from edit_scenes import balls
from made_meshes import box_file

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio import live_preview
from materialist.studio.workspace import write_mask


def test_metal_with_normals_of_its_outline_is_shaded_with_all_other_steps(tmp_path, monkeypatch):
    """An inserted lamp would be no light."""

    def build(*_):
        raise InputError("Nothing is shaded here.")

    monkeypatch.setattr(live_preview, "_build", build)
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    live = live_preview.LivePreview(scene)
    mask = write_mask(tmp_path, number == 0)
    metal = Step("edit", {"mask": mask, "metallic": "1"}, tmp_path)
    box = str(box_file(tmp_path / "box.ply"))
    lamp = Step("insert", {"mesh": box, "at": ["70", "60"], "emission": "2"}, tmp_path)
    edited = live.edited((metal, lamp))
    assert edited.geometry is not scene.geometry and edited.bodies
    assert live._surfaces((metal, lamp)) is edited
