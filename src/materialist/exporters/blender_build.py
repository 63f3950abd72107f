"""Build a .blend from the files beside this script; Blender 4.2 or later.

    blender -b --factory-startup --python build.py -- -o scene.blend
    python build.py -- -o scene.blend        (with the module bpy: pip install bpy)

Options: --shadow-catcher shows the photo, with the reconstruction catching the shadows and reflections of what you
add; --fitted-material takes the model of the fit instead of Principled (Blender 4.3 or later); --render FILE.png or
.exr renders the scene too, with --samples N.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Read the options after `--`, build, save, and render where asked."""
    parser = argparse.ArgumentParser(prog="build.py")
    parser.add_argument("-o", "--output", default=str(HERE / "scene.blend"))
    parser.add_argument("--shadow-catcher", action="store_true")
    parser.add_argument("--fitted-material", action="store_true")
    parser.add_argument("--render")
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    facts = json.loads((HERE / "scene.json").read_text("utf-8"))
    # --- An empty file, filled with the scene ---
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    add_meshes(scene, facts, options.fitted_material)
    add_camera(scene, facts)
    add_light(scene)
    add_lamps(scene, facts)
    add_text(facts)
    set_rendering(scene, options.samples, facts["bounces"])
    if options.shadow_catcher:
        catch_shadows(scene, facts)
    # --- Saved with all pictures in it, and rendered where that is asked for ---
    bpy.ops.file.pack_all()
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(options.output).resolve()), compress=True)
    if options.render:
        scene.render.filepath = str(Path(options.render).resolve())
        exr = options.render.lower().endswith(".exr")
        scene.render.image_settings.file_format = "OPEN_EXR" if exr else "PNG"
        if exr:
            scene.render.image_settings.color_depth = "32"
        bpy.ops.render.render(write_still=True)


def add_meshes(scene, facts, additive) -> None:
    """The parts in a collection of their own. Our frame is +Y up and looks along -Z; Blender's is +Z up, along +Y."""
    collection = bpy.data.collections.new("Reconstruction")
    scene.collection.children.link(collection)
    with np.load(HERE / "meshes.npz") as arrays:
        for name in facts["parts"]:
            x, y, z = arrays[f"{name}_vertices"].T
            mesh = bpy.data.meshes.new(name)
            faces = arrays[f"{name}_faces"]  # [F, 3]
            mesh.from_pydata(np.stack([x, -z, y], 1), [], faces)
            mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
            uv = arrays[f"{name}_uv"][faces.ravel()]  # [3 F, 2], v down
            uv[:, 1] = 1 - uv[:, 1]
            mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", uv.ravel())
            x, y, z = arrays[f"{name}_normals"].T
            mesh.normals_split_custom_set_from_vertices(np.stack([x, -z, y], 1))
            mesh.materials.append(material(name, facts["parts"][name], additive))
            mesh.update()
            collection.objects.link(bpy.data.objects.new(name, mesh))


def material(name, look, additive):
    """Material of a part: its maps; glass over them, and what it gives off."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    output.location = (600, 0)
    # --- Shaders: the BRDF, glass in the place of a share of it, and glow added ---
    result, slots = (add_lobes if additive else add_principled)(nodes, links)
    if "glass" in look:
        result = add_glass(nodes, links, look["glass"], result)
    if "emission" in look:
        glow = nodes.new("ShaderNodeEmission")
        glow.inputs["Color"].default_value = (*look["emission"], 1)
        glow.inputs["Strength"].default_value = 1
        result = added(nodes, links, result, glow.outputs["Emission"])
    links.new(result, output.inputs["Surface"])
    # --- A texture for each map, into all inputs that it feeds ---
    for row, (key, sockets) in enumerate(slots.items()):
        source = add_texture(nodes, look, key, (-700, 300 - 300 * row))
        for socket in sockets:
            links.new(source, socket)
    return material


def added(nodes, links, one, other):
    """The sum of two shaders."""
    both = nodes.new("ShaderNodeAddShader")
    both.location = (300, 0)
    links.new(one, both.inputs[0])
    links.new(other, both.inputs[1])
    return both.outputs["Shader"]


def add_principled(nodes, links):
    """Blender's Principled BSDF: the output, and the inputs for each map."""
    surface = nodes.new("ShaderNodeBsdfPrincipled")
    surface.distribution = "GGX"
    surface.inputs["IOR"].default_value = 1.5
    slots = {"albedo": "Base Color", "metallic": "Metallic", "roughness": "Roughness"}
    return surface.outputs["BSDF"], {key: [surface.inputs[slot]] for key, slot in slots.items()}


def add_lobes(nodes, links):
    """The fitted model but for Disney's diffuse lobe: (1 - M) A / pi plus GGX with Schlick's C0 = 0.04 (1 - M) + M A.

    Principled takes from the diffuse lobe what the specular one reflects, so it is darker, most of all at grazing
    angles; the fit does not. The metallic node with a white edge tint is Schlick's formula.
    """
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    specular = nodes.new("ShaderNodeBsdfMetallic")
    specular.distribution = "GGX"
    specular.fresnel_type = "F82"
    specular.inputs["Edge Tint"].default_value = (1, 1, 1, 1)
    colours = []
    shares = []
    # Each lobe's colour goes from metallic 0 to 1: one end is the albedo, the other a grey.
    for lobe, slot, albedo_at, grey in (
        (diffuse, "Color", 0, 0.0),
        (specular, "Base Color", 1, 0.04),
    ):
        mix = nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        ends = [socket for socket in mix.inputs if socket.type == "RGBA"]
        ends[1 - albedo_at].default_value = (grey, grey, grey, 1)
        colours.append(ends[albedo_at])
        shares.append(
            next(
                socket
                for socket in mix.inputs
                if socket.name == "Factor" and socket.type == "VALUE"
            )
        )
        links.new(
            next(socket for socket in mix.outputs if socket.type == "RGBA"), lobe.inputs[slot]
        )
        mix.location = (-300, 200 - 300 * len(shares))
    # f_d and f_s are added, as in the paper: nothing is taken from one for the other.
    both = added(nodes, links, diffuse.outputs["BSDF"], specular.outputs["BSDF"])
    return both, {
        "albedo": colours,
        "metallic": shares,
        "roughness": [specular.inputs["Roughness"]],
    }


def add_glass(nodes, links, glass, opaque):
    """A dielectric interface in place of `share` of the opaque one; light that has entered meets it alone.

    Principled shares the tint between the ways in and out, as we do, and reflects white.
    """
    interface = nodes.new("ShaderNodeBsdfPrincipled")
    interface.distribution = "MULTI_GGX"  # loses no light among its facets, as ours
    values = {
        "Base Color": (*glass["tint"], 1),
        "Roughness": glass["roughness"],
        "IOR": glass["ior"],
    }
    for slot, value in {**values, "Transmission Weight": 1, "Metallic": 0}.items():
        interface.inputs[slot].default_value = value
    interface.location = (0, -300)
    if glass["share"] >= 1:
        return interface.outputs[0]
    # Inside, on backfacing sides, all is glass; outside, its share: max(backfacing, T).
    side, share, mixed = (
        nodes.new(f"ShaderNode{kind}") for kind in ("NewGeometry", "Math", "MixShader")
    )
    share.operation = "MAXIMUM"
    share.inputs[1].default_value = glass["share"]
    links.new(side.outputs["Backfacing"], share.inputs[0])
    links.new(share.outputs[0], mixed.inputs[0])
    links.new(opaque, mixed.inputs[1])
    links.new(interface.outputs[0], mixed.inputs[2])
    for column, node in enumerate((side, share)):
        node.location = (200 * column, 300)
    mixed.location = (400, 0)
    return mixed.outputs[0]


def add_texture(nodes, look, key, location):
    """The output of a map. The photo's are looked up without filtering: neighbours may lie on different surfaces."""
    texture = nodes.new("ShaderNodeTexImage")
    texture.location = location
    texture.image = image(
        f"{look['maps']}{key}.exr", "Linear Rec.709" if key == "albedo" else "Non-Color"
    )
    texture.interpolation, texture.extension = (
        ("Linear", "REPEAT") if look["repeat"] else ("Closest", "EXTEND")
    )
    return texture.outputs["Color"]


def image(file, space):
    """A picture beside the script in a colour space."""
    loaded = bpy.data.images.load(str(HERE / file))
    loaded.colorspace_settings.name = space
    return loaded


def add_camera(scene, facts) -> None:
    """The photo's camera: at the origin, looking along +Y, with the photo as background."""
    camera = bpy.data.cameras.new("Photo")
    camera.sensor_fit = "HORIZONTAL"
    camera.angle = math.radians(facts["fov"])
    camera.clip_start = facts["near"]
    camera.clip_end = facts["far"]
    camera.show_background_images = True
    # The photo lies behind the scene, as wide as the picture.
    background = camera.background_images.new()
    background.image = image("photo.png", "sRGB")
    background.alpha = 1.0
    background.display_depth = "BACK"
    placed = bpy.data.objects.new("Photo", camera)
    placed.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(placed)
    scene.camera = placed
    scene.render.resolution_x = facts["width"]
    scene.render.resolution_y = facts["height"]
    scene.render.resolution_percentage = 100


def add_light(scene) -> None:
    """The environment map. The centre of Blender's lies along +X, the centre of ours along the view, +Y."""
    world = bpy.data.worlds.new("Light")
    scene.world = world
    world.use_nodes = True
    nodes = world.node_tree.nodes
    links = world.node_tree.links
    nodes.clear()
    where = nodes.new("ShaderNodeTexCoord")
    turn = nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value = (0, 0, -math.pi / 2)
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image("envmap.exr", "Linear Rec.709")
    light = nodes.new("ShaderNodeBackground")
    output = nodes.new("ShaderNodeOutputWorld")
    # Direction, turned by a quarter about the vertical, to texel, to radiance.
    links.new(where.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], light.inputs["Color"])
    links.new(light.outputs["Background"], output.inputs["Surface"])
    for column, node in enumerate((where, turn, texture, light, output)):
        node.location = (250 * column, 0)


def add_lamps(scene, facts) -> None:
    """Spheres of light. Cycles gives one of power P and radius r the radiance P / (4 pi^2 r^2), as we do."""
    for number, lamp in enumerate(facts["lamps"]):
        most = max(lamp["power"])
        light = bpy.data.lights.new(f"lamp{number}", "POINT")
        light.energy = most
        light.shadow_soft_size = lamp["radius"]
        light.color = [part / most for part in lamp["power"]]
        if hasattr(light, "use_soft_falloff"):  # a disc that faces what it lights, else
            light.use_soft_falloff = False
        placed = bpy.data.objects.new(light.name, light)
        x, y, z = lamp["position"]
        placed.location = (x, -z, y)
        placed.visible_camera = True
        scene.collection.objects.link(placed)


def add_text(facts) -> None:
    """The advice on light, scale and colour as a text of the file; light and colour follow it already."""
    text = bpy.data.texts.new("Read me")
    text.write("\n".join(f"{key}: {words}" for key, words in facts["advice"].items()) + "\n")


def set_rendering(scene, samples, bounces) -> None:
    """Cycles as our renderer: light by way of up to three surfaces (more with glass), a box filter, plain sRGB."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_denoising = False
    cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = "BOX"
    cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.max_bounces = cycles.transmission_bounces = max(12, bounces)
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"


def catch_shadows(scene, facts) -> None:
    """Shadow-catching proxy over the photo, at the photo's own resolution. Bodies that it lacks are seen."""
    for thing in bpy.data.collections["Reconstruction"].objects:
        thing.is_shadow_catcher = thing.name in facts["in_photo"]
    scene.render.film_transparent, scene.render.dither_intensity = (
        True,
        0,
    )  # the photo stays as it is
    scene.render.resolution_x = facts["photo_width"]
    scene.render.resolution_y = facts["photo_height"]
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        tree = bpy.data.node_groups.new("Over the photo", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    photo = tree.nodes.new("CompositorNodeImage")
    layers = tree.nodes.new("CompositorNodeRLayers")
    photo.image = scene.camera.data.background_images[0].image
    fit = tree.nodes.new("CompositorNodeScale")  # renders of another size take the photo along
    if hasattr(fit, "space"):
        fit.space = "RENDER_SIZE"
    else:  # Blender 5
        fit.inputs["Type"].default_value = "Render Size"
    over = tree.nodes.new("CompositorNodeAlphaOver")
    pictures = [socket for socket in over.inputs if socket.type == "RGBA"]  # background, foreground
    tree.links.new(photo.outputs["Image"], fit.inputs["Image"])
    tree.links.new(fit.outputs["Image"], pictures[0])
    tree.links.new(layers.outputs["Image"], pictures[1])
    tree.links.new(over.outputs["Image"], output.inputs["Image"])
    for column, node in enumerate((photo, fit, layers, over, output)):
        node.location = (300 * column, 0)


if __name__ == "__main__":
    main()
