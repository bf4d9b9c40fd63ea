"""Opens every file that `warpknit` writes with a reader that is not ours, and compares yarns, points and bounding boxes. See README.md beside this file."""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import mitsuba
import numpy as np
import trimesh
import vtk
from pxr import Usd, UsdGeom, UsdValidation
from vtk.util.numpy_support import vtk_to_numpy

ROOT = Path(__file__).resolve().parents[2]
GARMENT = [ROOT / "meshes/skirt_flat.obj", ROOT / "meshes/skirt_draped.obj"]
# Boxes of the same points may differ by so much, mm: what four decimals and 32 bits leave.
NEAR = 1e-3


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--binary", default="warpknit", help="the program [default: the one on the path]")
    parser.add_argument("--validator", type=Path, help="a node_modules folder with gltf-validator; without it .glb is opened but not validated")
    parser.add_argument("--fabric", default="locknit")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        names = ["glb", "obj", "ply", "usda", "bcc", "curves.txt", "inp", "npz", "csv", "json"]
        outputs = [flag for name in names for flag in ("-o", folder / f"skirt.{name}")]
        subprocess.run([arguments.binary, "drape", *GARMENT, "--fabric", arguments.fabric, "--quiet", "--glb-precision", "f32", "--nodes", "yarn", *outputs], check=True)
        report = json.loads((folder / "skirt.json").read_text())
        arrays = np.load(folder / "skirt.npz")
        checks = [
            ("npz", "numpy", lambda: numpy_arrays(arrays, report)),
            ("csv", "numpy", lambda: csv(folder / "skirt.csv", arrays, report)),
            ("glb", "trimesh", lambda: glb(folder / "skirt.glb", report, arguments.validator)),
            ("obj", "trimesh", lambda: tubes(folder / "skirt.obj", report, strands(arrays))),
            ("ply", "trimesh", lambda: tubes(folder / "skirt.ply", report, strands(arrays))),
            ("usda", "usd-core", lambda: usda(folder / "skirt.usda", arrays)),
            ("inp", "meshio", lambda: beams(folder / "skirt.inp", arrays, report)),
            ("curves.txt", "mitsuba", lambda: curves(folder / "skirt.curves.txt", arrays)),
        ]
        boxes = {name: (reader, check()) for name, reader, check in checks}
        print(f"{'file':12} {'reader':10} {'yarns or strands':>16} {'points':>9}  box, mm")
        for name, (reader, (yarns, points, box)) in boxes.items():
            print(f"{name:12} {reader:10} {yarns:16} {points:9}  {np.round(box, 2).tolist()}")
        # Tubes are wider than their centre lines by their radius, and a bend may swing out between data points.
        reference = boxes["npz"][1][2]
        for name, (_, (_, _, box)) in boxes.items():
            if name == "csv":
                # Cut ends are no data points and may lie at the very edge; the others have been compared one by one.
                continue
            slack = NEAR if name in ("npz", "usda") else 2 * arrays["radius"].max()
            assert np.abs(box - reference).max() <= slack, f"{name}: its box is off by {np.abs(box - reference).max()} mm"
        # Those that hold the same geometry agree to a tenth of a millimetre.
        for same in (["glb", "obj", "ply"], ["inp", "curves.txt"], ["npz", "usda"]):
            off = max(np.abs(boxes[name][1][2] - boxes[same[0]][1][2]).max() for name in same)
            assert off <= 0.1, f"{same}: boxes are off by {off} mm"
            assert len({boxes[name][1][1] for name in same}) == 1, f"{same}: numbers of points differ"
        print("all files hold the same cloth")
        lines(arguments.binary, folder, arguments.fabric, arrays)
        dressed(arguments.binary, folder, arguments.validator)
        quantised(arguments.binary, folder, arguments.fabric, arguments.validator, boxes["glb"][1][2])
        sequence(arguments.binary, folder, arguments.fabric)


def box_of(points):
    return np.array([points.min(axis=0), points.max(axis=0)])


def strands(arrays):
    return len(arrays["length"])


def numpy_arrays(arrays, report):
    data = arrays["kind"] != 255
    assert data.sum() == report["data_points"] and arrays["length"].sum() == len(data)
    assert len(np.unique(arrays["yarn"])) == report["yarns"]
    return strands(arrays), len(data), box_of(arrays["draped"])


def csv(path, arrays, report):
    rows = np.genfromtxt(path, delimiter=",", names=True, usecols=("yarn", "draped_x", "draped_y", "draped_z"))
    points = np.stack([rows["draped_x"], rows["draped_y"], rows["draped_z"]], axis=1)
    assert np.array_equal(points, arrays["draped"][arrays["kind"] != 255])
    assert len(np.unique(rows["yarn"])) == report["yarns"]
    return report["yarns"], len(points), box_of(points)


def tubes(path, report, parts):
    """Strands are the objects of an `.obj`, as its reader has them, and in a `.ply` what hangs together."""
    mesh = trimesh.load(path, process=False, force="mesh")
    assert len(mesh.faces) == report["surface"]["triangles"], f"{path}: {len(mesh.faces)} triangles"
    assert len(mesh.vertices) == report["surface"]["vertices"], f"{path}: {len(mesh.vertices)} vertices"
    if path.suffix == ".obj":
        found = len(trimesh.load(path, process=False, split_object=True, group_material=False).geometry)
    else:
        found = len(trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces))))
    assert found == parts, f"{path}: {found} parts for {parts} strands"
    return found, len(mesh.vertices), box_of(mesh.vertices)


def glb(path, report, validator):
    if validator:
        validate(path, validator)
    scene = trimesh.load(path, process=False)
    yarns = len(scene.geometry)
    assert yarns == report["yarns"], f"{yarns} meshes"
    mesh = scene.to_geometry()
    assert len(mesh.faces) == report["surface"]["triangles"]
    return yarns, len(mesh.vertices), box_of(mesh.vertices) * 1000


def quantised(binary, folder, fabric, validator, box):
    """A .glb as it is by default: whole numbers, and a node a bar. The run before has floats and a node a yarn."""
    path = folder / "quantised.glb"
    subprocess.run([binary, "drape", *GARMENT, "--fabric", fabric, "--quiet", "-o", path], check=True)
    if validator:
        validate(path, validator)
    scene = trimesh.load(path, process=False)
    off = np.abs(scene.bounds * 1000 - box).max()
    assert off <= 0.1, f"{path}: boxes are off by {off} mm"
    print(f"a quantised .glb has {len(scene.geometry)} parts, and its box is off by {off:.4f} mm")


def lines(binary, folder, fabric, arrays):
    """An .obj of centre lines, beside curves of another format."""
    path = folder / "lines.obj"
    subprocess.run([binary, "drape", *GARMENT, "--fabric", fabric, "--quiet", "--curves", "-o", path], check=True)
    reader = vtk.vtkOBJReader()
    reader.SetFileName(str(path))
    reader.Update()
    loaded = reader.GetOutput()
    assert loaded.GetNumberOfLines() == strands(arrays) and loaded.GetNumberOfPolys() == 0
    points = vtk_to_numpy(loaded.GetPoints().GetData())
    assert np.abs(box_of(points) - box_of(arrays["draped"])).max() <= 2 * arrays["radius"].max()
    print(f"lines.obj    vtk        {loaded.GetNumberOfLines():16} {len(points):9}  polylines")


def dressed(binary, folder, validator):
    """Yarns that wear pictures: in the .glb, and beside the .obj."""
    command = [binary, "swatch", "--fabric", "locknit", "--texture", ROOT / "meshes/yarns/two-ply", "--quiet"]
    subprocess.run([*command, "-o", folder / "dressed.glb", "-o", folder / "dressed.obj"], check=True, stdout=subprocess.DEVNULL)
    if validator:
        validate(folder / "dressed.glb", validator, {"MESH_PRIMITIVE_GENERATED_TANGENT_SPACE"})
    scene = trimesh.load(folder / "dressed.glb", process=False)
    for mesh in scene.geometry.values():
        material = mesh.visual.material
        sizes = {image.size for image in (material.baseColorTexture, material.normalTexture, material.metallicRoughnessTexture)}
        assert len(sizes) == 1 and mesh.visual.uv[:, 1].max() - mesh.visual.uv[:, 1].min() > 1
    worn = trimesh.load(folder / "dressed.obj", process=False)
    materials = {mesh.visual.material.name: mesh.visual.material for mesh in worn.geometry.values()}
    assert sorted(materials) == ["bar_1", "bar_2"] and all(material.image is not None for material in materials.values())
    print(f"dressed      trimesh    {len(scene.geometry):16} yarns with pictures of {sizes.pop()}")


def sequence(binary, folder, fabric):
    """Three frames in one .usda, each where a run of its own puts it."""
    drape = GARMENT[1].read_text().splitlines()
    frames = []
    for number, scale in enumerate([1.0, 1.1, 1.2], start=1):
        frames.append(folder / f"frame_{number}.obj")
        moved = (" ".join(["v", *(repr(scale * float(x)) for x in line.split()[1:4])]) if line.startswith("v ") else line for line in drape)
        frames[-1].write_text("\n".join(moved) + "\n")
    common = ["--fabric", fabric, "--uv-scale", "10", "--unit", "cm", "--quiet"]
    subprocess.run([binary, "drape", GARMENT[0], *frames, *common, "-o", folder / "moving.usda"], check=True)
    subprocess.run([binary, "drape", GARMENT[0], frames[2], *common, "-o", folder / "still.usda"], check=True)
    moving, still = Usd.Stage.Open(str(folder / "moving.usda")), Usd.Stage.Open(str(folder / "still.usda"))
    compliant(moving)
    assert (moving.GetStartTimeCode(), moving.GetEndTimeCode(), moving.GetTimeCodesPerSecond()) == (1, 3, 24)
    for prim in still.Traverse():
        if prim.IsA(UsdGeom.BasisCurves):
            points = UsdGeom.BasisCurves(moving.GetPrimAtPath(prim.GetPath())).GetPointsAttr()
            assert points.GetTimeSamples() == [1, 2, 3]
            assert np.array_equal(points.Get(3), UsdGeom.BasisCurves(prim).GetPointsAttr().Get())
    print("moving.usda  usd-core   3 frames, the last one as a run of its own has it")


def validate(path, validator, noted=frozenset()):
    """Khronos' validator: no error, and no warning but those that are `noted`."""
    script = (
        "const fs = require('fs'), v = require(process.argv[1] + '/gltf-validator');"
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 0, ignoredIssues: ['UNUSED_OBJECT'] }).then((r) => console.log(JSON.stringify(r)));"
    )
    found = subprocess.run(["node", "-e", script, validator.resolve(), path], check=True, capture_output=True, text=True)
    issues = json.loads(found.stdout)["issues"]
    warnings = [message for message in issues["messages"] if message["severity"] == 1 and message["code"] not in noted]
    print(f"gltf-validator, {path.name}: {issues['numErrors']} errors, {len(warnings)} warnings")
    assert issues["numErrors"] == 0 and not warnings, issues["messages"]


def compliant(stage):
    """usd-core's validators find nothing."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not errors, [error.GetErrorAsString() for error in errors]
    print(f"usd-core: {len(validators)} validators, no error")


def usda(path, arrays):
    stage = Usd.Stage.Open(str(path))
    compliant(stage)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.001 and UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    boxes, count, points = [], 0, 0
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.BasisCurves):
            continue
        curves = UsdGeom.BasisCurves(prim)
        counts = np.array(curves.GetCurveVertexCountsAttr().Get())
        control = np.array(curves.GetPointsAttr().Get())
        assert counts.sum() == len(control) and (counts % 3 == 1).all()
        data = int((counts + 2).sum()) // 3
        for name, size in [("course", data), ("wale", data), ("st", data), ("yarn", len(counts))]:
            primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
            assert len(primvar.Get()) == size, f"{prim.GetPath()}.{name}"
        bar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("bar").Get()
        width = curves.GetWidthsAttr().Get()[0]
        assert abs(width / 2 - arrays["radius"][bar - 1]) < 1e-6
        low, high = curves.GetExtentAttr().Get()
        computed = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), Usd.TimeCode.Default())
        assert np.abs(np.array([low, high]) - np.array(computed)).max() < 1e-3, f"{prim.GetPath()}: its extent is not that of its curves"
        firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        on_curve = np.concatenate([np.arange(first, first + size, 3) for first, size in zip(firsts, counts)])
        boxes.append(box_of(control[on_curve]))
        count += len(counts)
        points += data
    assert count == strands(arrays) and points == len(arrays["draped"])
    return count, points, box_of(np.concatenate(boxes))


def beams(path, arrays, report):
    mesh = meshio.read(path)
    lines = sum(len(block.data) for block in mesh.cells if block.type == "line")
    assert len(mesh.points) - lines == strands(arrays), "an element less than nodes in each strand"
    return strands(arrays), len(mesh.points), box_of(mesh.points)


def curves(path, arrays):
    mitsuba.set_variant("scalar_rgb")
    shape = {"type": "linearcurve", "filename": str(path)}
    loaded = mitsuba.load_dict(shape)
    box = loaded.bbox()
    middle, size = np.array(box.center()), np.array(box.extents())
    eye = middle + np.array([0, 0, 1.2]) * size.max()
    transform = mitsuba.ScalarTransform4f().look_at(origin=eye.tolist(), target=middle.tolist(), up=[0, 1, 0])
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 3},
            "sensor": {"type": "perspective", "fov": 50, "to_world": transform, "film": {"type": "hdrfilm", "width": 256, "height": 256}},
            "sky": {"type": "constant"},
            "yarns": shape | {"bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.3, 0.3]}}},
        }
    )
    image = np.array(mitsuba.render(scene, spp=4))
    covered = (image[..., 1] < 0.9).mean()
    assert 0.05 < covered < 0.9, f"{covered} of the picture is yarn"
    text = path.read_text()
    count = sum(1 for block in text.split("\n\n") if block.strip())
    assert count == strands(arrays)
    points = sum(1 for line in text.splitlines() if line)
    radius = arrays["radius"].max()
    return count, points, np.array([np.array(box.min) + radius, np.array(box.max) - radius])


if __name__ == "__main__":
    sys.exit(main())
