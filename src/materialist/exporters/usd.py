"""USD: UsdPreviewSurface materials, the photo's camera and a dome light; one .usdz file, or a folder."""

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils, Vt

from materialist.color import srgb_levels
from materialist.exporters.advice import advice
from materialist.exporters.parts import Part, farthest, one_roughness
from materialist.io.display import encoded, to_bytes
from materialist.io.exr import write_exr
from materialist.render.bodies import is_glowing, is_transparent
from materialist.types import Camera, Lamp, Scene


def write_usd(folder: Path, scene: Scene, parts: list[Part]) -> None:
    """Fill an empty folder with `scene.usdc` and the textures beside it; our frame is USD's with the Y axis up."""
    stage = Usd.Stage.CreateNew(str(folder / "scene.usdc"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Scene").GetPrim())
    # --- Materials and meshes, camera, light and lamps ---
    UsdGeom.Scope.Define(stage, "/Scene/Materials")
    for part in parts:
        _mesh(stage, part, _material(stage, folder, part))
    _camera(stage, scene.camera, parts)
    _light(stage, folder, scene)
    for number, lamp in enumerate(scene.lamps):
        _lamp(stage, f"/Scene/lamp{number}", lamp)
    # --- What the user should know of scale and colour ---
    layer = stage.GetRootLayer()
    words = advice(scene)
    layer.documentation = f"{words['scale']} {words['colour']}"
    layer.customLayerData = {"materialist": words}
    layer.Save()


def pack_usdz(folder: Path, file: Path) -> None:
    if not UsdUtils.CreateNewUsdzPackage(str(folder / "scene.usdc"), str(file)):
        raise OSError(f"usd-core could not pack {file}")


def _mesh(stage: Any, part: Part, material: Any) -> None:
    """A mesh with normals and texture coordinates; USD's v runs up."""
    source = part.mesh
    mesh = UsdGeom.Mesh.Define(stage, f"/Scene/{part.name}")
    # --- Triangles as they are: no subdivision, both sides seen ---
    points = np.ascontiguousarray(source.vertices, np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(source.faces), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(
        Vt.IntArray.FromNumpy(np.ascontiguousarray(source.faces.ravel(), np.int32))
    )
    mesh.CreateNormalsAttr(
        Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(source.normals, np.float32))
    )
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    # --- Texture coordinates, which USD calls st ---
    uv = np.stack([source.uv[:, 0], 1 - source.uv[:, 1]], 1).astype(np.float32)  # [V, 2]
    primvars = UsdGeom.PrimvarsAPI(mesh)
    st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(uv))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _material(stage: Any, folder: Path, part: Part) -> Any:
    """Preview surface of the maps as 8-bit PNG."""
    path = f"/Scene/Materials/{part.name}"
    material = UsdShade.Material.Define(stage, path)
    kinds = Sdf.ValueTypeNames

    def shader(name: str, kind: str, **inputs: Any) -> Any:
        """A node and its inputs, each (type, value)."""
        shader = UsdShade.Shader.Define(stage, f"{path}/{name}")
        shader.CreateIdAttr(kind)
        for socket, (type_, value) in inputs.items():
            shader.CreateInput(socket, type_).Set(value)
        return shader

    # --- The surface; of glass it has the opacity and the index of refraction alone ---
    body = part.surface
    m = one_roughness(part)
    look: dict[str, tuple] = {"ior": (kinds.Float, 1.5)}
    if body is not None and is_glowing(body):
        look["emissiveColor"] = (kinds.Color3f, tuple(float(c) for c in body.emission))
    if body is not None and is_transparent(body):
        look |= {
            "ior": (kinds.Float, float(body.ior)),
            "opacity": (kinds.Float, 1 - float(body.transmission)),
        }
    surface = shader("surface", "UsdPreviewSurface", **look)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    # --- A texture a map: sRGB for colour, raw for numbers ---
    reader = shader("st", "UsdPrimvarReader_float2", varname=(kinds.String, "st"))
    wrap = (kinds.Token, "clamp" if body is None else "repeat")
    for socket, type_, name, pixels, space, output in (
        ("diffuseColor", kinds.Color3f, "base_color", srgb_levels(m.albedo), "sRGB", "rgb"),
        ("roughness", kinds.Float, "roughness", to_bytes(m.roughness), "raw", "r"),
        ("metallic", kinds.Float, "metallic", to_bytes(m.metallic), "raw", "r"),
    ):
        file = f"{part.prefix}{name}.png"
        (folder / file).write_bytes(encoded(pixels))
        asset = (kinds.Asset, f"./{file}")
        where = (kinds.Token, space)
        texture = shader(
            name, "UsdUVTexture", file=asset, sourceColorSpace=where, wrapS=wrap, wrapT=wrap
        )
        texture.CreateInput("st", kinds.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        surface.CreateInput(socket, type_).ConnectToSource(texture.ConnectableAPI(), output)
    return material


def _camera(stage: Any, photo: Camera, parts: list[Part]) -> None:
    """The photo's pinhole at the origin, which looks down -Z in USD too."""
    reach = farthest(parts)
    camera = Gf.Camera()
    camera.SetPerspectiveFromAspectRatioAndFieldOfView(
        photo.width / photo.height, photo.fov, camera.FOVHorizontal
    )
    camera.clippingRange = Gf.Range1f(reach * 1e-5, reach * 4)
    UsdGeom.Camera.Define(stage, "/Scene/Photo").SetFromCamera(camera, Usd.TimeCode.Default())


def _light(stage: Any, folder: Path, scene: Scene) -> None:
    """The environment map. The centre of USD's (OpenEXR's) lies along +Z, the centre of ours along -Z."""
    write_exr(folder / "envmap.exr", scene.envmap)
    light = UsdLux.DomeLight.Define(stage, "/Scene/Light")
    light.CreateTextureFileAttr(Sdf.AssetPath("./envmap.exr"))
    light.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    UsdGeom.Xformable(light).AddRotateYOp().Set(180.0)


def _lamp(stage: Any, path: str, lamp: Lamp) -> None:
    """A glowing sphere: intensity times colour is the radiance of its surface."""
    most = max(lamp.radiance)
    light = UsdLux.SphereLight.Define(stage, path)
    light.CreateRadiusAttr(float(lamp.radius))
    light.CreateIntensityAttr(float(most))
    light.CreateColorAttr(Gf.Vec3f(*(float(c) / max(most, 1e-30) for c in lamp.radiance)))
    UsdGeom.Xformable(light).AddTranslateOp().Set(Gf.Vec3d(*(float(c) for c in lamp.position)))
