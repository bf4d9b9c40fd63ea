"""A row for each file that others open or run: python rows.py [--binary warpknit] [--million]. See README.md beside this file.

Each row names its reader, what it found, and fails where that is wrong. A reader that isn't installed is skipped, and the last line counts rows.
"""

import argparse
import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
TSHIRT = HERE.parents[1] / "meshes/tshirt.obj"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--binary", type=Path, default=shutil.which("warpknit"), help="the program [default: the one on the path]")
    parser.add_argument("--validator", type=Path, help="a node_modules folder with gltf-validator and meshoptimizer")
    parser.add_argument("--million", action="store_true", help="open a .usdc of a million stitches too, which takes minutes to knit")
    arguments = parser.parse_args()
    binary, million, validator = arguments.binary.resolve(), arguments.million, arguments.validator
    decoder = validator and (validator / "meshoptimizer").exists()
    ready = {name: importlib.util.find_spec(name) is not None for name in ("pxr", "newton", "bpy", "MaterialX")}
    ccx = shutil.which("ccx")
    rows = [
        (".usdc", "usd-core", ready["pxr"], lambda folder: usdc(binary, folder, ["--wales", "60", "--courses", "60"])),
        (".usdc, 10^6", "usd-core", ready["pxr"] and million, lambda folder: usdc(binary, folder, ["--wales", "1000", "--courses", "500"], 1_000_000)),
        (".usda", "Newton", ready["newton"], lambda folder: newton(binary, folder)),
        (".inp", "CalculiX", ccx is not None, lambda folder: inp(binary, folder, ccx)),
        (".bcc", "as YarnBall reads", True, lambda folder: bcc(binary, folder)),
        (".glb", "gltf-validator", validator is not None, lambda folder: validated(binary, folder, validator)),
        (".glb compressed", "meshoptimizer", bool(decoder), lambda folder: meshopt(binary, folder, validator)),
        (".glb .ply .obj .usdc", "Blender", ready["bpy"], lambda folder: blender(binary, folder)),
        (".npz", "numpy", True, lambda folder: npz(binary, folder)),
        ("tile: .u3m", "as its schema says", True, lambda folder: u3m(binary, folder)),
        ("tile: .mtlx", "MaterialX", ready["MaterialX"], lambda folder: materialx(binary, folder)),
        ("tile: .usda", "usd-core", ready["pxr"], lambda folder: usd_materials(binary, folder)),
        ("tile: .glb", "gltf-validator", validator is not None, lambda folder: gltf_materials(binary, folder, validator)),
    ]
    skipped = 0
    for file, reader, is_ready, run in rows:
        found = "skipped"
        if is_ready:
            with tempfile.TemporaryDirectory() as folder:
                found = run(Path(folder))
        else:
            skipped += 1
        print(f"{file:20} {reader:18} {found}", flush=True)
    print(f"{len(rows) - skipped} rows, {skipped} skipped")


def swatch(binary, folder, *flags):
    subprocess.run([binary, "swatch", "--fabric", "tricot", "--quiet", *flags], cwd=folder, check=True, capture_output=True)


def usdc(binary, folder, size, stitches=0):
    """Opens at once: in under 0.1 s, with all arrays of curves."""
    from pxr import Usd, UsdGeom

    Usd.Stage.CreateInMemory()  # Loads the plug-ins, which no file is to blame for.
    swatch(binary, folder, *size, "-o", "a.usdc", "-o", "a.json")
    found = json.loads((folder / "a.json").read_text())["stitches"]
    start = time.perf_counter()
    stage = Usd.Stage.Open(str(folder / "a.usdc"))
    points = sum(len(UsdGeom.BasisCurves(prim).GetPointsAttr().Get()) for prim in stage.Traverse() if prim.IsA(UsdGeom.BasisCurves))
    took = time.perf_counter() - start
    assert points > found >= stitches and took < 0.1, (points, found, took)
    return f"{found} stitches, {points} points in {1e3 * took:.1f} ms, {(folder / 'a.usdc').stat().st_size / 1e6:.1f} MB"


def newton(binary, folder):
    """Finds bodies, and runs 100 steps without a crossing."""
    swatch(binary, folder, "--wales", "4", "--courses", "4", "--usd-curves", "linear", "-o", "a.usda")
    run = subprocess.run([sys.executable, HERE / "newton_run.py", "a.usda", "100"], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    return "; ".join(line for line in run.stdout.splitlines() if "bodies" in line or "crossings" in line)


def inp(binary, folder, ccx):
    """Runs a step as it is."""
    swatch(binary, folder, "--wales", "4", "--courses", "4", "-o", "a.inp")
    run = subprocess.run([ccx, "a"], cwd=folder, capture_output=True, text=True)
    lines = run.stdout.splitlines()
    errors = [line.strip() for line in lines if "*ERROR" in line]
    steps = (folder / "a.sta").read_text().splitlines()
    assert run.returncode == 0 and not errors and "Job finished" in run.stdout, lines[-20:]
    warnings = sum("*WARNING" in line for line in lines)
    return f"job finished, {len(errors)} errors, {warnings} warnings, last increment: {' '.join(steps[-1].split())}"


def bcc(binary, folder):
    """Reads curves as uniform Catmull-Rom from the second point to the last but one, and measures what that drops."""
    swatch(binary, folder, "--wales", "12", "--courses", "12", "-o", "a.bcc", "-o", "a.npz")
    data = (folder / "a.bcc").read_bytes()
    count = int.from_bytes(data[8:16], "little")
    place, curves = 64, []
    for _ in range(count):
        length = int.from_bytes(data[place : place + 4], "little")
        curves.append(np.frombuffer(data, "<f4", 3 * length, place + 4).reshape(-1, 3))
        place += 4 + 12 * length
    assert place == len(data)
    arrays = np.load(folder / "a.npz")
    ends = np.concatenate([[0], np.cumsum(arrays["length"].astype(int))])
    assert len(curves) == len(arrays["length"])
    # What is read begins and ends where the strand does.
    off = max(max(np.abs(curve[1] - arrays["draped"][first]).max(), np.abs(curve[-2] - arrays["draped"][last - 1]).max()) for curve, first, last in zip(curves, ends[:-1], ends[1:]))
    assert off < 1e-3, off
    beside = json.loads((folder / "a.bcc.json").read_text())
    return f"{count} curves, read ends are off by {off:.1e} mm at most; beside it {sorted(beside)}"


def validated(binary, folder, validator):
    """Without an error."""
    subprocess.run([binary, "drape", TSHIRT, "--fabric", "locknit", "--wales-per-cm", "2", "--quiet", "-o", "a.glb"], cwd=folder, check=True)
    return issues_of(folder / "a.glb", validator)


def issues_of(path, validator):
    """The errors and warnings of Khronos' validator."""
    script = (
        "const fs = require('fs'), v = require(process.argv[1] + '/gltf-validator');"
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 0 }).then((r) => console.log(JSON.stringify(r.issues)));"
    )
    run = subprocess.run(["node", "-e", script, validator.resolve(), path], check=True, capture_output=True, text=True)
    issues = json.loads(run.stdout)
    assert issues["numErrors"] == 0, issues
    return f"{issues['numErrors']} errors, {issues['numWarnings']} warnings"


def meshopt(binary, folder, modules):
    """Unpacks to the arrays of the file that isn't compressed."""
    for name, flags in (("a.glb", []), ("b.glb", ["--glb-meshopt"])):
        swatch(binary, folder, "--wales", "20", "--courses", "20", *flags, "-o", name)
    command = ["node", HERE / "meshopt.mjs", modules.resolve(), "a.glb", "b.glb"]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


def blender(binary, folder):
    """Opens upright and at the right size, the .glb of a T-shirt in under 5 s of the processor."""
    import bpy
    import mathutils

    # As docs/formats say for each, and opened with Blender's own settings.
    command = [binary, "drape", TSHIRT, "--fabric", "locknit", "--quiet", "--file-unit", "m"]
    subprocess.run([*command, "-o", "a.glb", "-o", "a.obj", "-o", "a.usdc", "-o", "a.npz"], cwd=folder, check=True)
    subprocess.run([*command, "-o", "a.ply", "--up", "z"], cwd=folder, check=True)
    points = np.load(folder / "a.npz")["draped"]
    # Blender has z up, and our y is up.
    wide, tall, deep = np.ptp(points, axis=0) / 1000
    found = []
    importers = {
        "a.glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
        "a.ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
        "a.obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
        "a.usdc": lambda path: bpy.ops.wm.usd_import(filepath=path),
    }
    for name, read in importers.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        start = time.process_time()
        read(str(folder / name))
        took = time.process_time() - start
        objects = [thing for thing in bpy.data.objects if thing.type in ("MESH", "CURVES")]
        bpy.context.view_layer.update()
        corners = np.array([thing.matrix_world @ mathutils.Vector(corner) for thing in objects for corner in thing.bound_box])
        size = np.ptp(corners, axis=0)
        assert np.abs(size - [wide, deep, tall]).max() < 0.005, (name, size, [wide, deep, tall])
        assert took < 5 or name != "a.glb", took
        found.append(f"{name[1:]} {len(objects)} objects, {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m in {took:.1f} s")
    return "; ".join(found)


def npz(binary, folder):
    """Floats of 32 bits and compression lose no more than they say."""
    small = ["--wales", "12", "--courses", "12"]
    swatch(binary, folder, *small, "-o", "a.npz")
    swatch(binary, folder, *small, "--npz-precision", "f32", "--npz-compress", "-o", "b.npz")
    a, b = np.load(folder / "a.npz"), np.load(folder / "b.npz")
    assert a.files == b.files and b["draped"].dtype == np.float32
    assert all(np.abs(a[name] - b[name].astype(a[name].dtype)).max() < 1e-5 for name in a.files)
    sizes = [(folder / name).stat().st_size for name in ("a.npz", "b.npz")]
    return f"{sizes[0]} bytes as it is, {sizes[1]} as compressed 32 bits"


def tile(binary, folder):
    """The maps of a net, whose material has all that a material can have."""
    subprocess.run([binary, "tile", "--fabric", "hex-net-5", "--quiet", "-o", "maps"], cwd=folder, check=True, capture_output=True)
    return folder / "maps"


# Keys of U3M 1.1 whose value is a number, and the least and the most of its constant where the schema limits it.
U3M_NUMBERS = {
    **dict.fromkeys(["alpha", "anisotropy_rotation", "metalness", "transmission"], (0, 1)),
    **dict.fromkeys(["anisotropy_value", "clearcoat_value", "clearcoat_roughness", "ior", "displacement", "roughness", "sheen_value"], None),
    **dict.fromkeys(["sheen_tint", "specular_value", "specular_tint", "subsurface_radius", "subsurface_value"], None),
}


def u3m(binary, folder):
    """Has the keys, types and sizes of the format's schema, which closes every object but two."""
    import re

    maps = tile(binary, folder)
    document = json.loads((maps / "hex-net-5.u3m").read_text())
    closed(document, "schema material custom")
    material = document["material"]
    closed(material, "id name description created modified front back side physics metadata")
    assert document["schema"] == "1.1" and re.fullmatch(r"[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}", material["id"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", material["created"])
    pictures = [picture for side in ("front", "back") for picture in u3m_visual(material[side])]
    for picture in pictures:
        width, height = png_size(maps / picture["path"])
        assert abs(picture["dpi"]["x"] - width / (picture["width"] / 25.4)) < 1e-9
        assert abs(picture["dpi"]["y"] - height / (picture["height"] / 25.4)) < 1e-9
    physics = material["physics"]
    closed(physics, "thickness weight composition devices material_type construction")
    assert physics["devices"] == {"fab": "null"} and physics["material_type"] == {"type": "Knit", "name": None}
    assert physics["construction"]["type"] == "other" and physics["construction"]["name"]
    return f"{len(pictures)} pictures, {physics['weight']:.1f} g/m2, {physics['thickness']:.3f} mm"


def u3m_visual(visual):
    """The pictures of a side, all but its preview."""
    closed(visual, " ".join(["shader preview basecolor subsurface_color normal clearcoat_normal", *U3M_NUMBERS]))
    closed(visual["preview"], "path width height dpi")
    assert visual["shader"] == "principled"
    parts = {"basecolor": "mode factor image", "subsurface_color": "mode factor image", "normal": "scale image", "clearcoat_normal": "scale image"}
    pictures = []
    for key in [*parts, *U3M_NUMBERS]:
        value = visual[key]
        closed(value, "constant texture")
        if key in U3M_NUMBERS:
            low, high = U3M_NUMBERS[key] or (-np.inf, np.inf)
            assert low <= value["constant"] <= high, (key, value["constant"])
        if value["texture"] is not None:
            closed(value["texture"], parts.get(key, "factor offset image"))
            image = value["texture"]["image"]
            closed(image, "path width height dpi repeat")
            assert image["repeat"] == {"mode": "normal", "rotation": 0}
            pictures.append(image)
    return pictures


def closed(found, keys):
    assert set(found) == set(keys.split()), sorted(set(found) ^ set(keys.split()))


def png_size(path):
    data = path.read_bytes()
    # Red, green and blue: readers of U3M need not take grey pictures.
    assert data[:4] == b"\x89PNG" and data[25] == 2, path
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def materialx(binary, folder):
    """Is valid against the standard library, and becomes a shader."""
    import MaterialX
    import MaterialX.PyMaterialXGenGlsl as glsl
    import MaterialX.PyMaterialXGenShader as shader

    maps = tile(binary, folder)
    paths, library = MaterialX.getDefaultDataSearchPath(), MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), paths, library)
    document = MaterialX.createDocument()
    MaterialX.readFromXmlFile(document, str(maps / "hex-net-5.mtlx"))
    document.setDataLibrary(library)
    is_valid, why = document.validate()
    assert is_valid, why
    generator = glsl.GlslShaderGenerator.create()
    context = shader.GenContext(generator)
    context.registerSourceCodeSearchPath(paths)
    colors = shader.DefaultColorManagementSystem.create(generator.getTarget())
    colors.loadLibrary(library)
    generator.setColorManagementSystem(colors)
    surfaces = shader.findRenderableElements(document)
    lengths = [len(generator.generate("fabric", surface, context).getSourceCode("pixel")) for surface in surfaces]
    for name in document.getNodeGraphs()[0].getNodes("tiledimage"):
        assert (maps / name.getInputValue("file")).is_file()
    return f"{MaterialX.getVersionString()}: valid, {len(surfaces)} materials as GLSL of {lengths} bytes"


def usd_materials(binary, folder):
    """Has a material on each side, whose pictures are there, and passes all validators."""
    from pxr import Usd, UsdShade, UsdValidation

    maps = tile(binary, folder)
    stage = Usd.Stage.Open(str(maps / "hex-net-5.usda"))
    meshes = [prim for prim in stage.Traverse() if prim.GetTypeName() == "Mesh"]
    pictures = 0
    for mesh in meshes:
        material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        surface, _, _ = material.ComputeSurfaceSource()
        for given in surface.GetInputs():
            source = given.GetConnectedSources()[0][0].source
            path = UsdShade.Shader(source.GetPrim()).GetInput("file").Get()
            assert (maps / path.path).is_file(), path
            pictures += 1
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not errors, [error.GetMessage() for error in errors]
    return f"{len(meshes)} meshes with materials of {pictures} pictures, {len(validators)} validators, no error"


def gltf_materials(binary, folder, validator):
    """Without an error."""
    return issues_of(tile(binary, folder) / "hex-net-5.glb", validator)


if __name__ == "__main__":
    main()
