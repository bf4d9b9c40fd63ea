"""Writes the garments of `tests/garments` with Blender: one cloth in every format that Blender has. See README.md beside this file."""

import argparse
import math
from pathlib import Path

import bpy

SQUARES = (12, 8)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[1] / "garments")
    out = parser.parse_args().out
    out.mkdir(exist_ok=True)
    cloth = made()
    bpy.ops.export_scene.gltf(filepath=str(out / "blender.glb"), export_format="GLB")
    bpy.ops.wm.ply_export(filepath=str(out / "blender.ply"), export_uv=True, up_axis="Y", forward_axis="NEGATIVE_Z")
    for name in ("blender.usda", "blender.usdc", "blender.usdz"):
        bpy.ops.wm.usd_export(filepath=str(out / name))
    y_up = {"convert_orientation": True, "export_global_forward_selection": "NEGATIVE_Z", "export_global_up_selection": "Y"}
    bpy.ops.wm.usd_export(filepath=str(out / "blender_y_up.usdc"), **y_up)
    move(cloth)
    # As blend shapes of a skeleton, which are at rest for us, and as points over time.
    bpy.ops.wm.usd_export(filepath=str(out / "blender_shape_keys.usdc"), export_animation=True)
    bpy.ops.wm.usd_export(filepath=str(out / "blender_moving.usdc"), export_animation=True, export_shapekeys=False)


def made():
    """A bent cloth of half a metre by 375 mm, a metre above the ground. Its numbers are ones that 32 bits hold, as in `tests/it/formats_in.rs`."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    across, along = SQUARES
    nodes = [(column, row) for row in range(along + 1) for column in range(across + 1)]
    places = [(fine(0.25 * math.sin(2 * (x := column / across * 0.5) - 0.5)), fine(0.06 * math.cos(3 * x)), fine(row / along * 0.375)) for column, row in nodes]
    pattern = [(round(column / across * 1024) / 1024, round(row / along * 768) / 1024) for column, row in nodes]
    faces = []
    for row in range(along):
        for column in range(across):
            corner = row * (across + 1) + column
            faces += [(corner, corner + 1, corner + across + 2), (corner, corner + across + 2, corner + across + 1)]
    mesh = bpy.data.meshes.new("cloth")
    mesh.from_pydata(places, [], faces)
    layer = mesh.uv_layers.new(name="UVMap")
    for corner in mesh.loops:
        layer.data[corner.index].uv = pattern[corner.vertex_index]
    mesh.update()
    cloth = bpy.data.objects.new("cloth", mesh)
    bpy.context.collection.objects.link(cloth)
    cloth.location = (0, 0, 1)
    cloth.select_set(True)
    bpy.context.view_layer.objects.active = cloth
    return cloth


def fine(place):
    return round(place * 4096) / 4096


def move(cloth):
    """Moves the cloth forward over three frames, so that its points have time samples."""
    cloth.shape_key_add(name="start")
    end = cloth.shape_key_add(name="end")
    for point in end.data:
        point.co.y += 0.25
    for frame, value in ((1, 0), (3, 1)):
        end.value = value
        end.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 3


if __name__ == "__main__":
    main()
