"""From Blender's meshes to yarns, and from yarns to curves.

In: a garment object whose UV map is the pattern, or a flat and a draped object with the same faces. Out: a curve object with a
spline for each strand and a material for each bar. Nothing here knows operators or panels.

Blender's places are metres, z up, and warpknit's are mm; axes stay as they are.
"""

import warnings

import bpy
import numpy as np
import warpknit

# Edges of the tubes from which centre lines are taken: the fewest that have a middle.
EDGES = 3
# A garment that is larger or smaller than these, mm, has probably been imported at a wrong scale.
LARGEST, SMALLEST = 20_000.0, 20.0
# Corners of a vertex whose UVs differ by less than this share of the UV map have one place on the pattern. Modifiers compute UVs face by
# face, and round them to a share of some 1e-7: a smaller tolerance cuts the cloth at each edge. A larger one sews narrow seams together.
SAME_UV = 1e-5
# A flat object may be this share of its second longest side thick, such as layers of panels.
FLAT = 0.02


class KnitError(Exception):
    """What can't be knitted, in one line for the user."""


def fabric_of(name, chains):
    """The built-in fabric of that name, or that of chains with blanks or ` + ` between, front bar first."""
    return warpknit.Fabric.from_chains(chains.replace(" + ", " ").split()) if chains.strip() else warpknit.Fabric.named(name)


def millimetres(scene):
    """The length of one of Blender's units, mm."""
    return 1000.0 * scene.unit_settings.scale_length


def _corners(owner, depsgraph, layer=None):
    """The triangles of an object as it is in this frame: places of vertices, vertex of each corner, and its UV."""
    evaluated = owner.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        mesh.calc_loop_triangles()
        places = np.empty((len(mesh.vertices), 3))
        mesh.vertices.foreach_get("co", places.ravel())
        loops = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("loops", loops)
        vertices = np.empty(len(mesh.loops), dtype=np.int32)
        mesh.loops.foreach_get("vertex_index", vertices)
        uv = None
        if layer is not None:
            uvs = mesh.uv_layers.get(layer)
            if uvs is None:
                raise KnitError(f"{owner.name}: there is no UV map {layer!r} in this frame: a modifier has removed it")
            uv = np.empty((len(mesh.loops), 2))
            uvs.uv.foreach_get("vector", uv.ravel())
    finally:
        evaluated.to_mesh_clear()
    if not len(loops):
        raise KnitError(f"{owner.name}: there are no faces to knit on")
    matrix = np.array(evaluated.matrix_world)
    return places @ matrix[:3, :3].T + matrix[:3, 3], vertices[loops], None if uv is None else uv[loops]


def _grouped(groups, numbers, tolerance):
    """Groups that are parted where their numbers, in order, lie further apart than a tolerance."""
    order = np.lexsort((numbers, groups))
    begins = (np.diff(groups[order]) != 0) | (np.diff(numbers[order]) > tolerance)
    parted = np.empty(len(groups), dtype=np.int64)
    parted[order] = np.concatenate([[0], np.cumsum(begins)])
    return parted


def _firsts(groups):
    """The first corner of each group, and for each triangle the groups of its corners."""
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    return first, inverse.reshape(-1, 3).astype(np.uint32)


def garment_of(draped, flat, scene, depsgraph, grain=0.0, turn=False):
    """The garment of a draped object, with a flat object or with the draped object's UV map as its pattern."""
    scale = millimetres(scene)
    if flat is not None:
        places, corners, _ = _corners(draped, depsgraph)
        pattern, own, _ = _corners(flat, depsgraph)
        if len(own) != len(corners):
            raise KnitError(
                f"{flat.name} has {len(own) // 3} triangles and {draped.name} has {len(corners) // 3}: they must be the same mesh"
            )
        # The pattern lies in the plane of its two longer sides, x before y before z.
        sides = np.ptp(pattern, axis=0)
        thin, middle, _ = np.argsort(sides)
        if sides[thin] > FLAT * sides[middle]:
            raise KnitError(f"{flat.name} does not lie flat, across the scene's x, y or z: rotate it, or choose no flat object to take the UV map")
        axes = np.delete(np.arange(3), thin)
        first, faces = _firsts(_grouped(own, corners, 0))
        flat_places, uv_scale = scale * pattern[own[first]][:, axes], 1.0
    else:
        layer = draped.data.uv_layers.active
        if layer is None:
            raise KnitError(f"{draped.name}: there is no UV map to take for the pattern: unwrap it, or choose a flat object")
        places, corners, uv = _corners(draped, depsgraph, layer.name)
        tolerance = SAME_UV * np.ptp(uv, axis=0).max()
        first, faces = _firsts(_grouped(_grouped(corners, uv[:, 0], tolerance), uv[:, 1], tolerance))
        flat_places, uv_scale = uv[first], None
    places = scale * places[corners[first]]
    size = np.ptp(places, axis=0).max()
    if not SMALLEST <= size <= LARGEST:
        warnings.warn(
            f"{draped.name} is {size / 1000:.3g} m large in this scene: import it at its own scale, or change Scene > Units > Unit Scale"
        )
    return warpknit.Garment.from_arrays(flat_places, places, faces, uv_scale=uv_scale, grain=grain, turn=turn)


def centre_lines(yarns, samples):
    """The centre line of each strand as (points in mm, radius in mm, bar), `samples` points a stitch."""
    vertices = yarns.to_mesh(st=samples, sr=EDGES)[0]
    # A ring repeats its first vertex; the mean of the others is on the centre line.
    rings = vertices.reshape(-1, EDGES + 1, 3)[:, :EDGES].mean(axis=1) + np.array(yarns.origin)
    ends = np.cumsum(samples * yarns.stitch_counts + 1)
    return np.split(rings, ends[:-1]), yarns.radius, yarns.bar


def _linear(color):
    """The linear RGB of '#rrggbb'."""
    srgb = np.array([int(color[at : at + 2], 16) for at in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _materials(curves, fabric):
    """A material for each bar. One that has its slot stays, so that the user's changes stay."""
    for bar, color in enumerate(fabric.colors):
        if bar < len(curves.materials) and curves.materials[bar] is not None:
            continue
        material = bpy.data.materials.new(f"{fabric.name} bar {bar + 1}")
        rgba = (*_linear(color), 1.0)
        # Before Blender 5 a new material has no nodes.
        if material.node_tree is None:
            material.use_nodes = True
        shader = material.node_tree.nodes.get("Principled BSDF")
        if shader is not None:
            shader.inputs["Base Color"].default_value = rgba
            shader.inputs["Roughness"].default_value = 0.75
        material.diffuse_color, material.roughness = rgba, 0.75
        if bar < len(curves.materials):
            curves.materials[bar] = material
        else:
            curves.materials.append(material)
    while len(curves.materials) > len(fabric.colors):
        curves.materials.pop()


def fill(curves, yarns, scene, samples):
    """Gives a curve data-block the yarns. Where the strands are as long as before, only their points move."""
    scale = millimetres(scene)
    lines, radii, bars = centre_lines(yarns, samples)
    curves.dimensions, curves.fill_mode, curves.bevel_resolution = "3D", "FULL", 2
    # Points have the yarns' radii, and the bevel leaves them as they are: Blender's bounding box grows by the points' radii alone.
    curves.bevel_depth = 1.0
    _materials(curves, yarns.fabric)
    if [len(spline.points) for spline in curves.splines] != [len(line) for line in lines]:
        curves.splines.clear()
        for line in lines:
            curves.splines.new("POLY").points.add(len(line) - 1)
    for spline, line, radius, bar in zip(curves.splines, lines, radii, bars):
        spline.material_index = int(bar)
        spline.points.foreach_set("co", np.column_stack([line / scale, np.ones(len(line))]).ravel())
        spline.points.foreach_set("radius", np.full(len(line), radius / scale))
    curves.update_tag()
