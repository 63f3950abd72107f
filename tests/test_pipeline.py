"""The main job on a tiny photograph with maps: every field of the scene, both engines, bad options."""

from dataclasses import replace

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest
from geometry_scenes import room, sphere_depth

import materialist as mt
from materialist.color import srgb_levels
from materialist.edits.composite.composite import composite
from materialist.edits.material.material import edit
from materialist.errors import InputError
from materialist.io.exr import read_exr, write_exr
from materialist.io.image import write_png
from materialist.io.package import load_scene, save_scene
from materialist.io.photo import read_photo
from materialist.metrics import psnr
from materialist.pipeline import invert, render_scene
from materialist.types import Camera, Materials, Prediction

WIDTH = 24
HEIGHT = 18
pytestmark = pytest.mark.usefixtures("mitsuba", "one_thread")  # Mitsuba before torch, as in a run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A photo of a lit corner and its maps, in the project's conventions."""
    folder = tmp_path_factory.mktemp("photo")
    camera = Camera(WIDTH, HEIGHT, 45.0)
    depth, normal, label = room(camera)
    ball, ball_normal = sphere_depth(camera, (0.85, -0.5, -3.4), 0.5)
    closer = ball < depth
    depth = np.where(closer, ball, depth)
    normal = np.where(closer[..., None], ball_normal, normal)
    shade = 0.4 + 0.3 * np.clip(normal @ np.array([-0.4, 0.7, 0.4]), 0, 1)
    albedo = np.array([[0.6, 0.5, 0.4], [0.5, 0.5, 0.6], [0.3, 0.5, 0.3]])[label]
    write_png(folder / "photo.png", (albedo * shade[..., None]).astype(np.float32))
    maps = {"albedo": albedo, "depth": depth, "normal": normal}
    maps |= {"roughness": np.full(depth.shape, 0.5), "metallic": np.full(depth.shape, 0.1)}
    for name, values in maps.items():
        write_exr(folder / f"{name}.exr", np.ascontiguousarray(values, np.float32))
    return folder


def options(folder, **changes) -> dict:
    """Arguments of a run that takes a second."""
    from materialist.fit.settings import PRESETS

    name = changes.pop("settings", "default")
    settings = name and PRESETS[name].at_most(changes.pop("steps", 10))
    return {
        "photo": folder / "photo.png",
        "predictor": f"maps:{folder}",
        "fov": 45.0,
        "size": WIDTH,
        "envmap_size": (32, 16),
        "spp": 8,
        "settings": settings,
        "device": "cpu",
        **changes,
    }


@pytest.fixture(scope="module")
def stages():
    """What the run of `scene` told by `on_stage`, filled by it."""
    return {}


@pytest.fixture(scope="module")
def scene(folder, stages):
    return invert(**options(folder), on_stage=stages.setdefault)


def test_scene_has_every_field(scene):
    size = (HEIGHT, WIDTH)
    assert (scene.camera.width, scene.camera.height, scene.camera.fov) == (WIDTH, HEIGHT, 45.0)
    assert scene.photo.linear.shape == (*size, 3)
    for materials in (scene.materials, scene.prior.materials):
        assert materials.albedo.shape == (*size, 3)
        assert materials.roughness.shape == materials.metallic.shape == size
        assert all(
            np.isfinite(m).all()
            for m in (materials.albedo, materials.roughness, materials.metallic)
        )
    assert scene.normal.shape == scene.rerender.shape == (*size, 3)
    assert scene.depth.shape == scene.geometry.plane_label.shape == size
    assert scene.envmap.shape == (16, 32, 3)
    assert scene.envmap.dtype == scene.rerender.dtype == np.float32
    assert float(scene.envmap.min()) >= 0
    assert len(scene.geometry.mesh.faces) >= 2 * WIDTH * HEIGHT


def test_report_and_provenance_tell_what_happened(scene):
    metrics = scene.report.metrics
    assert metrics["rerender_psnr_path"] > 20
    assert 0 < metrics["rerender_ssim_path"] <= 1
    assert metrics["total_seconds"] > 0 and metrics["peak_rss_mb"] > 50
    for name in ("albedo", "roughness", "metallic"):
        moved = np.abs(getattr(scene.materials, name) - getattr(scene.prior.materials, name)).mean()
        assert metrics[f"prior_l1_{name}"] == pytest.approx(float(moved), abs=1e-6)
    names = [stage["name"] for stage in scene.report.stages]
    assert {"predict", "geometry", "light", "albedo", "rerender"} <= set(names)
    assert names[-1] == "rerender"
    assert all(stage["seconds"] >= 0 for stage in scene.report.stages)
    told = scene.provenance
    assert (told["engine"], told["preset"], told["seed"], told["spp"]) == (
        "transport",
        "default",
        0,
        8,
    )
    assert told["envmap_size"] == [32, 16]
    assert told["predictor"].startswith("maps")
    assert told["completion_asked"] in ("auto", told["completion"]) and told["mask"] is None


def test_the_fitted_scene_comes_before_its_rerendering(folder, scene, stages):
    early = stages["scene"]
    assert list(stages)[-1] == "scene" and early.report.metrics == {}
    assert early.provenance == {**scene.provenance, "spp": 0}
    for name in ("albedo", "roughness", "metallic"):
        np.testing.assert_array_equal(
            getattr(early.materials, name), getattr(scene.materials, name)
        )
    np.testing.assert_array_equal(early.envmap, scene.envmap)
    assert early.geometry is scene.geometry
    # Without noise, and with what the photo shows as indirect light: near to the traced paths.
    assert psnr(early.rerender, scene.rerender) > 25
    assert not np.array_equal(early.rerender, scene.rerender)
    # Of traced paths there is no picture without noise. The paper's light has 512 x 256 texels, which take long.
    short = options(folder, settings="paper", steps=1, engine="path", spp=1)
    light = replace(short["settings"].light, height=16)
    short["settings"] = replace(short["settings"], light=light)
    traced: dict = {}
    invert(**short, on_stage=traced.setdefault)
    assert traced and "scene" not in traced


def test_equal_seeds_give_equal_scenes(folder, scene):
    again = invert(**options(folder))
    np.testing.assert_array_equal(again.materials.albedo, scene.materials.albedo)
    np.testing.assert_array_equal(again.materials.roughness, scene.materials.roughness)
    np.testing.assert_array_equal(again.materials.metallic, scene.materials.metallic)
    np.testing.assert_array_equal(again.envmap, scene.envmap)


def test_rerendering_is_the_scenes_rendering(scene):
    """Rendering the scene afresh gives the re-rendering, up to noise."""
    assert psnr(render_scene(scene, spp=64), scene.rerender) > 25
    with pytest.raises(InputError, match="spp"):
        render_scene(scene, spp=0)


@pytest.mark.slow
def test_papers_engine_gives_a_scene(folder, monkeypatch):
    from materialist.fit import engine

    monkeypatch.setitem(engine.PathEngine.__init__.__kwdefaults__, "spp", 2)
    told = []
    scene = invert(
        **options(
            folder, engine="path", settings="paper", steps=3, progress=lambda *a: told.append(a[0])
        )
    )
    assert scene.provenance["engine"] == "path"
    assert scene.provenance["preset"] == "paper"
    stages = {stage["name"]: stage for stage in scene.report.stages}
    fit = [name for name, stage in stages.items() if "steps" in stage]
    assert fit[:4] == ["light", "roughness+metallic", "light 2", "materials"]
    assert stages["light"]["loss_last"] < stages["light"]["loss_first"]
    assert scene.envmap.shape == (16, 32, 3)
    assert {"read", "predict", "geometry", "light", "rerender"} <= set(told)


def test_the_papers_preset_takes_nothing_that_the_paper_does_not(folder, monkeypatch):
    """No continued planes, no pasted sky; an MLP at 512 x 256; the photo is indirect light once alone."""
    from materialist.fit import invert as fitting
    from materialist.transport.cache import TransportCache

    sent = []
    slots = TransportCache.slot_radiance
    monkeypatch.setattr(
        fitting, "paste_visible_sky", lambda *_, **__: pytest.fail("a sky was pasted")
    )
    monkeypatch.setattr(
        TransportCache, "slot_radiance", lambda self, r: sent.append(r) or slots(self, r)
    )
    given = options(folder, preset="paper", settings=None, steps=2)
    scene = invert(**{name: value for name, value in given.items() if name != "envmap_size"})
    assert scene.envmap.shape == (256, 512, 3) and scene.provenance["completion"] == "none"
    assert (scene.geometry.mesh.face_plane < 0).all()
    assert sent[0] is scene.photo.linear and not any(
        radiance is scene.photo.linear for radiance in sent[1:]
    )
    assert scene.provenance["steps"] == 2
    assert all(stage["steps"] <= 2 for stage in scene.report.stages if "steps" in stage)


def test_a_stopped_inversion_is_a_scene_that_says_so(folder):
    scene = invert(**options(folder, preset="paper", settings=None, stop=lambda: True))
    fit = [stage for stage in scene.report.stages if "steps" in stage]
    assert [(stage["name"], stage["steps"]) for stage in fit] == [("light", 1)]
    assert any("stopped in its stage 'light', after 1 steps" in note for note in scene.warnings)
    assert np.isfinite(scene.rerender).all()


def test_mask_is_taken_at_working_size(folder):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[6:12, 4:12] = True
    scene = invert(**options(folder, mask=mask))
    assert float(np.ptp(scene.materials.roughness[mask])) < 1e-6
    assert float(np.ptp(scene.materials.metallic[mask])) < 1e-6
    assert scene.provenance["mask"]["pixels"] == 48


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engine": "raster"}, "raster.*transport, path"),
        ({"mask": np.ones((HEIGHT, WIDTH), np.float32)}, "mask > 0.5"),
        ({"mask": np.ones((3, 3), bool)}, r"\(3, 3\).*\(18, 24\)"),
        ({"mask": np.zeros((HEIGHT, WIDTH), bool)}, "empty"),
        ({"predictor": "oracle"}, "oracle"),
        ({"predictor": None}, "predictor 'None'"),
        ({"photo": "nowhere.png"}, "nowhere.png"),
    ],
    ids=lambda v: "-".join(v) if isinstance(v, dict) else "",
)
def test_bad_options_are_named(folder, changes, words):
    with pytest.raises(InputError, match=words):
        invert(**{**options(folder), **changes})


def test_a_prior_of_another_size_is_refused(folder, scene):
    with pytest.raises(
        InputError, match="prior has 24 x 18 pixels, the photo 12 x 9 at working size"
    ):
        invert(**options(folder, prior=scene.prior, size=WIDTH // 2))


def test_maps_of_several_predictors_and_the_field_of_view_of_the_depth(folder, tmp_path):
    moge = tmp_path / "moge"
    moge.mkdir()
    write_exr(moge / "depth.exr", read_exr(folder / "depth.exr") * 1.5)
    (moge / "fov.json").write_text('{"fov_x": 51.0, "fov_y": 39.0}')
    mixed = options(folder, fov="auto", depth=f"moge:{moge}", metallic="constant")
    scene = invert(**mixed)
    assert (
        scene.camera.fov == scene.provenance["fov"] == 51.0
        and scene.photo.fov_source == "predictor"
    )
    assert np.allclose(scene.depth, read_exr(folder / "depth.exr") * 1.5)
    assert scene.provenance["sources"] == {
        "albedo": f"maps:{folder}",
        "roughness": f"maps:{folder}",
        "metallic": "constant",
        "normal": f"maps:{folder}",
        "depth": f"moge:{moge}",
    }
    assert invert(**{**mixed, "fov": 45.0}).camera.fov == 45.0


@pytest.mark.parametrize("call", ["invert", "batch"])
def test_misspelt_options_are_refused(call, tmp_path):
    arguments = ["nothing.png"] if call == "invert" else [str(tmp_path), str(tmp_path / "runs")]
    with pytest.raises(InputError, match=r"no option 'predicter'; it takes predictor, "):
        getattr(mt, call)(*arguments, predicter="maps:x")
    assert not (tmp_path / "runs").exists()


def test_the_unit_of_an_hdr_photo_does_not_matter(folder, tmp_path):
    """Nor in an edit of it, which comes back in the unit of the file, its other pixels bit for bit."""
    linear = read_photo(folder / "photo.png", size=WIDTH).linear * np.float32(
        1.01
    )  # not clipped at 1
    found = {}
    for unit in (1, 2**9):
        write_exr(tmp_path / "photo.exr", np.float32(unit) * linear)
        save_scene(
            invert(**options(folder, photo=tmp_path / "photo.exr")), tmp_path / f"{unit}.scene"
        )
        scene = load_scene(tmp_path / f"{unit}.scene")
        mask = np.zeros(scene.depth.shape, bool)
        mask[4:12, 5:15] = True
        picture = composite(scene, edit(scene, mask, hue=120), spp=4)
        mt.save_image(tmp_path / f"{unit}.exr", picture, scene.photo)
        out = read_exr(tmp_path / f"{unit}.exr")
        assert (out[mask] != unit * linear[mask]).any()
        same = (picture == scene.photo.original).all(-1)
        assert same.any()
        np.testing.assert_array_equal(out[same], np.float32(unit) * linear[same])
        found[unit] = scene, out / unit
    one, picture = found[1]
    assert one.photo.hdr and one.report.metrics["rerender_psnr_path"] > 20
    scene, other = found[2**9]
    np.testing.assert_array_equal(scene.materials.albedo, one.materials.albedo)
    np.testing.assert_array_equal(scene.envmap, one.envmap)
    np.testing.assert_array_equal(other, picture)


def test_depth_in_large_units_is_warned_about(folder, scene, tmp_path):
    """Of which the scene is only a few thousandths deep."""
    for path in folder.glob("*.exr"):
        write_exr(
            tmp_path / path.name, read_exr(path) * np.float32(0.002 if path.stem == "depth" else 1)
        )
    other = invert(**options(folder, predictor=f"maps:{tmp_path}"))
    assert [any("smaller unit" in note for note in made.warnings) for made in (scene, other)] == [
        False,
        True,
    ]


unit = st.floats(0, 1)
direction = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.05, 1))


@hypothesis.settings(max_examples=6, deadline=None, database=None, derandomize=True)
@hypothesis.given(
    albedo=st.tuples(unit, unit, unit),
    roughness=unit,
    metallic=unit,
    normal=direction,
    depth=st.floats(1e-3, 1e4),
)
@hypothesis.example((0.5, 0.5, 0.5), 0.1, 0.0, (0.0, 0.0, 1.0), 3.0)  # nothing but near mirrors
@hypothesis.example((0.0, 0.0, 0.0), 0.0, 1.0, (0.0, 0.0, 1.0), 3.0)
@hypothesis.example((1.0, 1.0, 1.0), 1.0, 1.0, (0.0, 0.0, 1.0), 3.0)
def test_maps_of_one_value_each_can_be_fitted(folder, albedo, roughness, metallic, normal, depth):
    size = (HEIGHT, WIDTH)

    def constant(value):
        return np.broadcast_to(np.float32(value), (*size, *np.shape(value))).copy()

    prior = Prediction(
        Materials(constant(albedo), constant(roughness), constant(metallic)),
        constant(np.array(normal) / np.linalg.norm(normal)),
        constant(depth),
    )
    fitted = invert(**options(folder, predictor="auto", prior=prior, steps=2))
    for values in (*vars(fitted.materials).values(), fitted.envmap, fitted.rerender):
        assert np.isfinite(values).all()


def test_a_photo_and_a_prior_from_memory(folder, scene):
    known = mt.Prior(depth=scene.prior.depth, normal=scene.prior.normal)
    levels = srgb_levels(scene.photo.original)
    kept = {
        key: value for key, value in options(folder).items() if key not in ("photo", "predictor")
    }
    made = invert(levels, encoded=True, predictor="constant", prior=known, **kept)
    assert np.array_equal(made.photo.original, scene.photo.original) and np.array_equal(
        made.depth, scene.depth
    )
    assert made.prior.sources["depth"] == "arrays" and made.prior.sources["albedo"] == "constant"
    assert made != scene and made == made


@pytest.mark.parametrize("prior", [{"depth": 1}, np.ones((4, 4))])
def test_a_prior_that_is_none(folder, prior):
    with pytest.raises(
        InputError, match=r"The prior is a .*; give a materialist.Prior of arrays, or a Prediction"
    ):
        invert(**options(folder, prior=prior))


@pytest.mark.slow
def test_the_papers_preset_explains_the_published_photo_by_the_published_maps(real_data):
    """27.0 dB; 24.6 while sheets of the mesh shaded the wall in the jug's handle."""
    folder = real_data("data/official_indoor")
    scene = invert(
        folder / "photo.png",
        predictor=f"maps:{folder / 'maps'}",
        fov=35,
        preset="paper",
        size=96,
        steps=200,
    )
    assert scene.report.metrics["rerender_psnr_path"] >= 26
