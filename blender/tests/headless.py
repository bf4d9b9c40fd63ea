"""Tests of the extension in Blender without a window: `pip install bpy`, then

    python blender/tests/headless.py warpknit-blender.zip [--garment tshirt.obj --picture cloth.png]

It installs the .zip as a user does, knits the shipped garments, and moves a frame on. With --picture it renders the garment.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

# Before bpy: Blender's settings and extensions of this test are its own.
home = tempfile.TemporaryDirectory(prefix="warpknit-blender-")
os.environ["BLENDER_USER_RESOURCES"] = home.name

import bpy  # noqa: E402
import numpy as np  # noqa: E402

MESHES = Path(__file__).resolve().parents[2] / "meshes"


def install(archive):
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    assert hasattr(bpy.types.Scene, "warpknit"), "the extension is not enabled"


def imported(path, **keywords):
    bpy.ops.wm.obj_import(filepath=str(path), use_split_objects=False, use_split_groups=False, **keywords)
    return bpy.context.object


def points(target):
    """All points of a curve object, and those of each spline."""
    lines = []
    for spline in target.data.splines:
        line = np.empty(4 * len(spline.points), dtype=np.float32)
        spline.points.foreach_get("co", line)
        lines.append(line.reshape(-1, 4)[:, :3])
    return np.concatenate(lines), lines


def knitted(**settings):
    """The curve object of a garment."""
    before = set(bpy.data.objects)
    for name, value in {"flat": None, "lapping": "", "wales_per_cm": 0.0, **settings}.items():
        setattr(bpy.context.scene.warpknit, name, value)
    start = time.process_time()
    assert bpy.ops.warpknit.knit() == {"FINISHED"}
    (target,) = set(bpy.data.objects) - before
    print(f"{target.name}: {len(target.data.splines)} splines, {time.process_time() - start:.1f} CPU s")
    return target


def check_uv_map(shirt):
    target = knitted(garment=shirt, fabric="locknit", wales_per_cm=1.0)
    assert target.type == "CURVE" and len(target.data.splines) > 100
    assert [material.name.split(".")[0] for material in target.data.materials] == ["locknit bar 1", "locknit bar 2"]
    assert {spline.material_index for spline in target.data.splines} == {0, 1}
    assert target.data.bevel_depth > 0
    # The yarns lie on the shirt.
    body = np.array([shirt.matrix_world @ vertex.co for vertex in shirt.data.vertices])
    cloth, _ = points(target)
    assert (cloth > body.min(axis=0) - 0.02).all() and (cloth < body.max(axis=0) + 0.02).all()
    return target


def check_frames(shirt, target):
    before, lines = points(target)
    splines = [spline.as_pointer() for spline in target.data.splines]
    shirt.location.z = 0.0
    shirt.keyframe_insert("location", frame=1)
    shirt.location.z = 0.5
    shirt.keyframe_insert("location", frame=10)
    bpy.context.scene.frame_set(10)
    after, moved = points(target)
    assert np.allclose(after - before, [0, 0, 0.5], atol=1e-4), "yarns follow the frame"
    assert [spline.as_pointer() for spline in target.data.splines] == splines, "only points move"
    target.warpknit.follow = False
    bpy.context.scene.frame_set(1)
    assert np.allclose(points(target)[0], after), "yarns that don't follow stay"
    bpy.context.view_layer.objects.active = target
    assert bpy.ops.warpknit.rebuild() == {"FINISHED"}
    assert np.allclose(points(target)[0], before, atol=1e-4), "until they are knitted again"


def check_rendered_frames(shirt, target):
    """Each picture of an animation shows the yarns of its own frame, half a metre higher at the end."""
    side, extent = 32, 3.0
    scene = bpy.context.scene
    # Hidden from the camera alone: what is hidden in renders altogether is not evaluated for them.
    target.warpknit.follow, shirt.visible_camera = True, False
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", extent
    camera.location, camera.rotation_euler = (0.0, -9.0, float(points(target)[0][:, 2].mean())), (np.pi / 2, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera, scene.render.film_transparent = camera, True
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
    scene.render.resolution_x = scene.render.resolution_y = side
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 10, 9
    scene.render.filepath = str(Path(home.name) / "frame")
    bpy.ops.render.render(animation=True)
    heights = []
    for frame in (1, 10):
        image = bpy.data.images.load(f"{scene.render.filepath}{frame:04}.png")
        rows = np.array(image.pixels).reshape(side, side, 4)[..., 3].sum(axis=1)
        heights.append((rows * np.arange(side)).sum() / rows.sum() * extent / side)
    assert abs(heights[1] - heights[0] - 0.5) < 0.05, heights
    bpy.data.objects.remove(camera)


def check_modifiers(shirt, target):
    """Subdivided faces have UVs that differ in the last bits, and are one cloth all the same."""
    shirt.modifiers.new("finer", "SUBSURF")
    finer = knitted(garment=shirt, fabric="locknit", wales_per_cm=1.0)
    assert len(finer.data.splines) < 1.5 * len(target.data.splines)
    shirt.modifiers.clear()


def check_flat_and_draped():
    scale = {"global_scale": 0.01}
    flat, draped = (imported(MESHES / f"tube_{name}.obj", **scale) for name in ("flat", "draped"))
    target = knitted(garment=draped, flat=flat, lapping="2-3/1-0// + 1-0/1-2//", wales_per_cm=1.0)
    assert len(target.data.splines) > 50 and len(target.data.materials) == 2
    cloth, _ = points(target)
    body = np.array([draped.matrix_world @ vertex.co for vertex in draped.data.vertices])
    assert (cloth > body.min(axis=0) - 0.02).all() and (cloth < body.max(axis=0) + 0.02).all()


def refused(words, **settings):
    before = set(bpy.data.objects)
    for name, value in {"flat": None, "lapping": "", "wales_per_cm": 1.0, **settings}.items():
        setattr(bpy.context.scene.warpknit, name, value)
    try:
        bpy.ops.warpknit.knit()
    except RuntimeError as error:
        assert words in str(error), error
    else:
        raise AssertionError(f"{words}: nothing was refused")
    assert set(bpy.data.objects) == before, "nothing is left"


def check_refusals(shirt):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    refused("must be the same mesh", garment=shirt, flat=cube)
    refused("does not lie flat", garment=shirt, flat=shirt)
    for scale in (100.0, 1e-5):
        bpy.context.scene.unit_settings.scale_length = scale
        refused("m large in this scene: import it at its own scale", garment=shirt, wales_per_cm=10.0)
    bpy.context.scene.unit_settings.scale_length = 1.0
    while cube.data.uv_layers:
        cube.data.uv_layers.remove(cube.data.uv_layers[0])
    refused("no UV map", garment=cube)
    refused("overlap over 6 needles", garment=shirt, lapping="1-0/1-7//")
    bpy.data.objects.remove(cube)


def check_saved(target):
    path = Path(home.name) / "saved.blend"
    name, count = target.name, len(target.data.splines)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    again = bpy.data.objects[name]
    assert len(again.data.splines) == count and again.warpknit.garment is not None


def render(garment, picture, size):
    """A picture of a garment's yarns, by Cycles on the processor."""
    from mathutils import Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="bl_ext.user_default.warpknit")
    shirt = imported(garment)
    extent = max(shirt.dimensions)
    # OBJ files have no unit: a garment of over 3 m was not in metres.
    for unit in (1.0, 0.01, 0.001):
        if extent * unit < 3.0:
            shirt.scale *= unit
            break
    bpy.context.view_layer.update()
    target = knitted(garment=shirt, fabric="locknit")
    shirt.hide_render = True
    cloth, _ = points(target)
    low, high = cloth.min(axis=0), cloth.max(axis=0)
    middle, reach = Vector((low + high) / 2), float(max(high - low))
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = middle + Vector((0.35, -1.9, 0.25)) * reach
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.5, (0.8, 0.2, 0.6)
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.6
    scene.world, scene.camera = world, camera
    for each in (camera, sun):
        scene.collection.objects.link(each)
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 24, "CPU"
    scene.cycles.use_denoising = False
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.filepath = str(Path(picture).resolve())
    start = time.process_time()
    bpy.ops.render.render(write_still=True)
    print(f"{picture}: {time.process_time() - start:.0f} CPU s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("archive", type=Path)
    parser.add_argument("--garment", type=Path, default=MESHES / "tshirt.obj")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--size", type=int, default=1000)
    arguments = parser.parse_args()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    install(arguments.archive.resolve())
    shirt = imported(MESHES / "tshirt.obj", global_scale=0.01)
    target = check_uv_map(shirt)
    check_frames(shirt, target)
    check_rendered_frames(shirt, target)
    check_modifiers(shirt, target)
    check_flat_and_draped()
    check_refusals(shirt)
    check_saved(target)
    if arguments.picture:
        render(arguments.garment, arguments.picture, arguments.size)
    print("all checks passed")


if __name__ == "__main__":
    sys.exit(main())
