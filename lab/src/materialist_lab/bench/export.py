"""`bench export`: how near the pictures that other programs make of an export come to the photo.

A photo is inverted and exported, and the files are rendered from its camera: Mitsuba loads its own folder; GLB and USD
are read back and rendered by Mitsuba's `principled` under the light beside them; Cycles renders what Blender builds.
PSNR against the photo, as exported and with the fitted maps (`--no-residual`), and of the latter against our
re-rendering, which `another seed` is, too; sheet.png has photo, re-rendering, and each picture as exported.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh
from PIL import Image

from materialist import pipeline
from materialist.color import srgb_to_linear
from materialist.edits.light.relight import read_envmap
from materialist.exporters.blender import find_blender, run_script
from materialist.exporters.mitsuba_xml import write_mitsuba
from materialist.exporters.parts import Part
from materialist.exporters.run import export
from materialist.io.exr import read_exr
from materialist.metrics import psnr
from materialist.option_kinds import option
from materialist.types import Array, Materials, Mesh, Scene
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row
from materialist_lab.bench.invert import photo_case
from materialist_lab.bench.report import Column, Report, side_by_side


@dataclass(frozen=True, kw_only=True)
class ExportBench(Benchmark):
    """Render the exports of one photo again; `data` as in `bench invert`, without `photo`."""

    columns = (
        Column("photo", "PSNR, photo", "higher", 1),
        Column("fitted", "... fitted maps", "higher", 1),
        Column("ours", "PSNR, re-rendering", "higher", 1),
    )

    photo: str = option("example:coffee", "As in `bench invert`.", kind="name")
    size: int = option(192, "Longer side.", **SIZE)
    spp: int = option(256, "Paths a pixel.", **COUNT)
    blender: str = option(
        "", "The program, or a Python that has bpy, if not the one that is found.", kind="name"
    )

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as temporary:
            case = photo_case(self, data, self.photo, Path(temporary), self.size)
            inversion: dict[str, Any] = {
                "predictor": case.predictor,
                "fov": case.fov,
                "size": self.size,
            }
            scene = pipeline.invert(case.photo, seed=self.seed, device=self.device, **inversion)
            ours = pipeline.render_scene(scene, spp=self.spp, seed=self.seed + 1)
            photo = scene.photo.linear
            exported = self._pictures(scene, Path(temporary) / "exported", residual=True)
            fitted = self._pictures(scene, Path(temporary) / "fitted", residual=False)
            for (name, picture), (_, plain) in zip(exported, fitted, strict=True):
                report.sheet.append(side_by_side(photo, ours, picture))
                yield {
                    "method": name,
                    "sample": "",
                    "photo": psnr(picture, photo),
                    "fitted": psnr(plain, photo),
                    "ours": psnr(plain, ours),
                }
            if find_blender(self.blender or None) is None:
                yield {"method": "Blender: none found, give --blender PROGRAM", "sample": ""}

    def _pictures(
        self, scene: Scene, folder: Path, *, residual: bool
    ) -> Iterator[tuple[str, Array]]:
        """(what renders, [H, W, 3] linear)."""
        folder.mkdir()

        def rendered(file):
            return np.array(mi.render(loaded(file, self.spp), seed=mi.UInt32(self.seed)))

        yield "another seed", pipeline.render_scene(scene, spp=self.spp, seed=self.seed + 2)
        export(scene, folder / "mitsuba", to="mitsuba", residual=residual)
        yield "Mitsuba, our material", rendered(folder / "mitsuba" / "scene_materialist.xml")
        yield "Mitsuba, principled", rendered(folder / "mitsuba" / "scene.xml")
        for to, name, light, read in (
            ("glb", "a.glb", "a.light.hdr", _glb),
            ("usd", "a", "a/envmap.exr", _usd),
        ):
            export(scene, folder / name, to=to, residual=residual)
            (folder / to).mkdir()
            lit = replace(scene, envmap=read_envmap(folder / light))
            write_mitsuba(folder / to, lit, [_part(*entry) for entry in read(folder / name)])
            yield f"{to} in Mitsuba, principled", rendered(folder / to / "scene.xml")
        if program := find_blender(self.blender or None):
            files = export(scene, folder / "blend", to="blend", residual=residual)
            script = files.path / "build.py"
            for name, flags in (("Principled", []), ("--fitted-material", ["--fitted-material"])):
                asked = ["--render", str(folder / "cycles.exr"), "--samples", str(self.spp), *flags]
                run_script(program, script, folder / "scene.blend", asked)
                yield f"Blender, {name}", read_exr(folder / "cycles.exr")[..., :3]


def loaded(file: Path, spp: int) -> Any:
    """The scene that a Mitsuba file describes."""
    threads = dr.thread_count()
    # Where Dr.Jit has a single thread, as by OMP_NUM_THREADS=1, Mitsuba waits for itself for ever.
    dr.set_thread_count(max(threads, 2))
    try:
        return mi.load_file(str(file), parallel=False, spp=spp)
    finally:
        dr.set_thread_count(threads)


def _glb(file: Path) -> Iterator[tuple]:
    """The parts of a GLB, each as `_part` takes it."""
    for name, mesh in trimesh.load_scene(file, process=False).geometry.items():
        look: Any = mesh.visual.material
        _, roughness, metallic = look.metallicRoughnessTexture.convert("RGB").split()
        maps = look.baseColorTexture, roughness, metallic
        yield name, maps, mesh.vertices, mesh.faces, mesh.vertex_normals, mesh.visual.uv


def _usd(folder: Path) -> Iterator[tuple]:
    """The parts of a stage, each as `_part` takes it."""
    from pxr import Usd, UsdGeom, UsdShade

    stage: Any = Usd.Stage.Open(str(folder / "scene.usdc"))
    for mesh in (UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)):
        name = mesh.GetPrim().GetName()
        st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
        nodes = [
            f"/Scene/Materials/{name}/{kind}" for kind in ("base_color", "roughness", "metallic")
        ]
        files = [UsdShade.Shader.Get(stage, node).GetInput("file").Get().path for node in nodes]
        faces = np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 3))
        maps = [Image.open(folder / file) for file in files]
        yield name, maps, mesh.GetPointsAttr().Get(), faces, mesh.GetNormalsAttr().Get(), st.Get()


def _part(name: str, maps: Any, *arrays: Any) -> Part:
    """maps: pictures of colour, roughness, metallic. arrays: vertices, faces, normals, and uv with v up."""
    colour, roughness, metallic = (np.asarray(one.convert("RGB"), np.float32) / 255 for one in maps)
    vertices, faces, normals, uv = map(np.array, arrays)
    unused = np.zeros(len(faces), np.int32)
    mesh = Mesh(vertices, faces, normals, uv * [1, -1] + [0, 1], unused, unused)
    return Part(name, mesh, Materials(srgb_to_linear(colour), roughness[..., 0], metallic[..., 0]))
