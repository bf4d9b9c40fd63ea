"""Yarns: their arrays, tubes, pictures, files and report."""

import itertools
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warpknit
from numpy.typing import NDArray

ENDINGS = [".png", ".html", ".glb", ".obj", ".ply", ".usda", ".usdc", ".bcc", ".curves.txt", ".inp", ".npz", ".csv", ".json"]


def test_arrays_have_the_shapes_and_types_that_the_docs_say(yarns: warpknit.Yarns) -> None:
    n, s = len(yarns.points), len(yarns)
    assert n > 1000 and s > 10
    arrays: list[tuple[NDArray[Any], tuple[int, ...], str]] = [
        (yarns.points, (n, 3), "float64"),
        (yarns.normals, (n, 3), "float64"),
        (yarns.flat, (n, 3), "float64"),
        (yarns.course, (n,), "int32"),
        (yarns.wale, (n,), "int32"),
        (yarns.offsets, (s + 1,), "int64"),
        (yarns.yarn, (s,), "int32"),
        (yarns.panel, (s,), "int32"),
        (yarns.bar, (s,), "int32"),
        (yarns.radius, (s,), "float64"),
        (yarns.stitch_counts, (s,), "int64"),
    ]
    for array, shape, kind in arrays:
        assert array.shape == shape and array.dtype == kind
        assert not array.flags.writeable and array.flags.c_contiguous
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.setflags(write=True)
    assert yarns.offsets[0] == 0 and yarns.offsets[-1] == n
    assert (np.diff(yarns.offsets) >= 2).all()
    assert set(yarns.bar) == {0, 1} and (yarns.radius > 0).all()
    assert np.allclose(np.linalg.norm(yarns.normals, axis=1), 1.0)


def owner(array: NDArray[Any]) -> object:
    """What the memory of an array belongs to: an array of numpy, or what numpy only borrows from."""
    base: object = array
    while isinstance(base, np.ndarray) and base.base is not None:
        base = base.base
    return base


def test_arrays_are_handed_over_without_a_copy(yarns: warpknit.Yarns) -> None:
    arrays = [getattr(yarns, name) for name in ["points", "normals", "flat", "course", "offsets", "radius"]]
    # The memory is that of Rust, which a copy's would not be.
    for array in [*arrays, *yarns.to_mesh(), yarns.render(size=(8, 6))]:
        assert type(owner(array)).__name__ == "PySliceContainer"
    assert isinstance(owner(yarns.points.copy()[1:]), np.ndarray)
    assert yarns.points.ctypes.data == yarns.points.ctypes.data


def test_arrays_outlive_their_yarns(locknit: warpknit.Fabric) -> None:
    points = warpknit.swatch(locknit, 3, 4).points
    copy = points.copy()
    warpknit.swatch(locknit, 5, 4)
    assert (points == copy).all()


def test_yarns_lie_on_the_body(yarns: warpknit.Yarns, meshes: Path) -> None:
    lines = (meshes / "tube_draped.obj").read_text().splitlines()
    body = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=float)
    # The file is in mm or in another unit, which the reader has found.
    scale = {"mm": 1, "cm": 10, "m": 1000}[
        warpknit.Garment.load(meshes / "tube_flat.obj", meshes / "tube_draped.obj").unit
    ]
    low, high = scale * body.min(axis=0) - 5, scale * body.max(axis=0) + 5
    assert (yarns.points >= low).all() and (yarns.points <= high).all()


def test_courses_and_wales_are_those_of_the_flat_cloth(locknit: warpknit.Fabric) -> None:
    swatch = warpknit.swatch(locknit, wales=5, courses=7)
    assert swatch.course.min() == 0 and swatch.course.max() == 6
    # Along a wale, the mean height of the points grows by a course each.
    heights = [swatch.flat[swatch.course == course, 1].mean() for course in range(7)]
    assert np.allclose(np.diff(heights), 10 / locknit.courses_per_cm, rtol=0.2)


def test_a_mesh_has_the_triangles_of_the_paper(yarns: warpknit.Yarns) -> None:
    vertices, faces, normals, uv = yarns.to_mesh(st=4, sr=5)
    assert len(faces) == 2 * 4 * 5 * yarns.stitches
    assert vertices.dtype == normals.dtype == uv.dtype == np.float32 and faces.dtype == np.uint32
    assert faces.max() == len(vertices) - 1
    assert len(vertices) == ((4 * yarns.stitch_counts + 1) * (5 + 1)).sum()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    # A triangle faces as its normals do, where rings are near each other for the bends of a loop.
    vertices, faces, normals, _ = yarns.to_mesh(st=32, sr=6)
    a, b, c = (vertices[faces[:, corner]].astype(float) for corner in range(3))
    outward = np.cross(b - a, c - a)
    facing = (outward * normals[faces[:, 0]]).sum(axis=1)
    assert (facing > 0).mean() > 0.99


@pytest.mark.parametrize("arguments", [{"st": 0}, {"st": -1}, {"st": 257}, {"sr": 2}, {"sr": 65}, {"flatten": 0.0}])
def test_meshes_out_of_range_are_refused(yarns: warpknit.Yarns, arguments: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be between"):
        yarns.to_mesh(**arguments)  # type: ignore[arg-type]


def test_pictures_are_arrays_and_png(yarns: warpknit.Yarns) -> None:
    picture = yarns.render(size=(80, 60), view="back")
    assert picture.shape == (60, 80, 4) and picture.dtype == np.uint8
    assert (picture[..., 3] == 255).all() and (picture[30, 40, :3] != 255).any()
    clear = yarns.render(size=(80, 60), background="transparent")
    assert clear[0, 0, 3] == 0 and clear[30, 40, 3] > 200
    white = yarns.render(size=(80, 60), background="white")
    assert (white == yarns.render(size=(80, 60), studio=False)).all() and (white[0, 0] == 255).all()
    png = yarns._repr_png_()
    assert png.startswith(b"\x89PNG") and png[16:24] == (800).to_bytes(4, "big") + (600).to_bytes(4, "big")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"view": "side"}, "front, back"),
        ({"size": (0, 5)}, "width in size is 0"),
        ({"size": (5, -1)}, "height in size is -1"),
        ({"background": "mauve"}, "no background"),
        ({"shape": "rope"}, "tube, ribbon"),
        ({"spp": 0}, "spp is 0"),
        ({"zoom": 0.0}, "zoom is 0"),
        ({"zoom": float("nan")}, "zoom is NaN"),
        ({"environment": "sky.hdr", "environment_turn": float("inf")}, "environment_turn is inf"),
        ({"environment_turn": 90.0}, "needs an environment"),
        ({"environment": "sky.hdr", "sun": (10.0, 20.0)}, "either sun or environment"),
        ({"sun": (10.0, 91.0)}, r"sun is \[10.0, 91.0\]"),
        ({"sun": (float("nan"), 20.0)}, "sun is"),
        ({"body": "body.obj", "body_cloth": True}, "either body or body_cloth"),
        ({"body": "none.obj"}, r"none\.obj"),
    ],
)
def test_pictures_of_nonsense_are_refused(yarns: warpknit.Yarns, arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        yarns.render(**arguments)  # type: ignore[arg-type]


def test_an_environment_lights_yarns_and_is_seen(yarns: warpknit.Yarns, tmp_path: Path) -> None:
    # Radiance's old form: a byte for each of red, green, blue and their exponent.
    sky, ground = bytes([40, 60, 255, 128]), bytes([20, 40, 10, 128])
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + sky * 256 + ground * 256)
    seen = yarns.render(size=(80, 60), environment=path)
    red, _, blue = map(int, seen[0, 0, :3])
    assert blue > red + 50
    lit = yarns.render(size=(80, 60), background="white", environment=str(path), environment_turn=90.0)
    assert (lit[0, 0] == 255).all() and (lit != yarns.render(size=(80, 60))).any()
    with pytest.raises(ValueError, match=r"none\.hdr"):
        yarns.render(environment=tmp_path / "none.hdr")


def test_a_garment_stands_in_a_studio_with_its_body(tube: warpknit.Garment, tmp_path: Path) -> None:
    yarns = warpknit.drape(tube, "hex-net-5", mapping="smooth")
    studio, bare = yarns.render(size=(80, 60)), yarns.render(size=(80, 60), studio=False)
    assert (bare[0, 0] == 255).all() and (studio[0, 0, :3] < 255).all() and (studio[..., 3] == 255).all()
    assert (yarns.render(size=(80, 60), background="white") == bare).all()
    assert (yarns.render(size=(80, 60), sun=(60.0, 20.0)) != studio).any()
    lined = yarns.render(size=(80, 60), studio=False, body_cloth=True)
    assert (lined != bare).any(axis=-1).mean() > 0.05, "a lining hides the ground behind a net"
    # A box around the tube's axis, narrower than the tube, in the tube's unit.
    assert tube.unit == "cm"
    corners = yarns.points.mean(axis=0) / 10.0 + np.array(list(itertools.product((-1, 1), repeat=3)))
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    lines = [f"v {x} {y} {z}\n" for x, y, z in corners] + [f"f {face}\n" for face in faces]
    path = tmp_path / "body.obj"
    path.write_text("".join(lines))
    worn = yarns.render(size=(80, 60), studio=False, body=path)
    assert 0.0 < (worn != bare).any(axis=-1).mean() < (lined != bare).any(axis=-1).mean()


def test_a_swatch_has_a_studio_but_no_body() -> None:
    yarns = warpknit.swatch("locknit", 3, 4)
    bare, studio = yarns.render(size=(80, 60)), yarns.render(size=(80, 60), studio=True)
    assert (bare[0, 0] == 255).all() and (studio[0, 0, :3] < 255).all()
    with pytest.raises(ValueError, match="a swatch has no body"):
        yarns.render(body_cloth=True)


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_ending_of_the_command_is_written(
    locknit: warpknit.Fabric, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"cloth{ending}"
    warpknit.swatch(locknit, 3, 4).save(path, size=(320, 240))
    assert path.stat().st_size > 100


def test_files_hold_the_yarns_of_the_arrays(yarns: warpknit.Yarns, tmp_path: Path) -> None:
    yarns.save(tmp_path / "cloth.npz", tmp_path / "cloth.json")
    saved = np.load(tmp_path / "cloth.npz")
    assert (saved["draped"] == yarns.points).all()
    assert (saved["length"] == np.diff(yarns.offsets)).all() and (saved["bar"] == yarns.bar).all()
    whole = saved["kind"] != 255
    assert not whole.all(), "the garment cuts yarns"
    assert (saved["course"] == yarns.course).all() and (saved["wale"] == yarns.wale).all()
    report = json.loads((tmp_path / "cloth.json").read_text())
    assert report["data_points"] == whole.sum()


def test_reports_tell_notes_from_warnings(tube: warpknit.Garment) -> None:
    said = [warpknit.drape(tube, "tricot", mapping="smooth").report["garment"] for _ in range(2)]
    assert said[0] == said[1] and said[0]["warnings"] == tube.warnings
    assert any(note.startswith("the report has about") for note in said[0]["notes"])


INTERRUPTED = """
import os, signal, threading, time, warpknit
garment = warpknit.Garment.load(MESH)
yarns = warpknit.swatch("tricot")
sent = []
def interrupt():
    sent.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)
threading.Timer(1.0, interrupt).start()
try:
    WORK
except KeyboardInterrupt:
    print(time.monotonic() - sent[0])
"""


@pytest.mark.parametrize(
    "work",
    [
        # Undisturbed, this drape takes minutes, all of them before the first block of yarns. The program ends
        # as any other, while the work goes on.
        'warpknit.drape(garment, warpknit.Fabric.from_chains(["1-0/60-61//"]))',
        "yarns.render(size=(4000, 3000), spp=64)",
    ],
)
def test_ctrl_c_is_heard(meshes: Path, tmp_path: Path, work: str) -> None:
    code = INTERRUPTED.replace("MESH", repr(str(meshes / "tshirt.obj"))).replace("WORK", work)
    uncached = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=True, capture_output=True, text=True, env=uncached)
    assert 0.0 <= float(done.stdout) < 10.0


@pytest.mark.usefixtures("empty_cache")
def test_progress_goes_from_strain_to_yarns(tube: warpknit.Garment) -> None:
    told: list[tuple[str, float]] = []
    warpknit.drape(tube, "sharkskin", progress=lambda *reached: told.append(reached))
    assert told[0][0] == "strain" and told[-1] == ("yarns", 1.0)
    assert all(stage in ("strain", "yarns") and 0.0 <= share <= 1.0 for stage, share in told)
    assert [stage for stage, _ in told] == sorted(stage for stage, _ in told)


@pytest.mark.usefixtures("empty_cache")
def test_an_exception_in_progress_ends_the_drape(tube: warpknit.Garment) -> None:
    def refuse(stage: str, share: float) -> None:
        raise RuntimeError(f"enough of {stage}")

    with pytest.raises(RuntimeError, match="enough of strain"):
        warpknit.drape(tube, "double-cord", progress=refuse)


def test_a_mesh_that_does_not_fit_is_refused_before_the_work() -> None:
    with pytest.raises(MemoryError, match="lower st or sr"):
        warpknit.swatch("tricot", 330, 330).to_mesh(st=256, sr=64)


def test_files_are_those_of_the_command(meshes: Path, locknit: warpknit.Fabric, tmp_path: Path) -> None:
    command = os.environ.get("WARPKNIT", shutil.which("warpknit") or "")
    if not command:
        pytest.skip("no command: name it with WARPKNIT=path/to/warpknit")
    files: list[str | Path] = [meshes / "tube_flat.obj", meshes / "tube_draped.obj"]
    flags: list[str | Path] = ["--fabric", "locknit", "--quiet", "-o", tmp_path / "theirs.glb", "-o", tmp_path / "theirs.npz"]
    subprocess.run([command, "drape", *map(str, files + flags)], check=True)
    yarns = warpknit.drape(warpknit.Garment.load(*files), locknit)
    yarns.save(tmp_path / "ours.glb", tmp_path / "ours.npz")
    for ending in ["glb", "npz"]:
        assert (tmp_path / f"ours.{ending}").read_bytes() == (tmp_path / f"theirs.{ending}").read_bytes()


def test_words_of_formats_are_the_flags_of_the_command(locknit: warpknit.Fabric, tmp_path: Path) -> None:
    swatch, whole, path = warpknit.swatch(locknit, 3, 4), tmp_path / "whole.npz", tmp_path / "cloth.npz"
    swatch.save(whole)
    swatch.save(path, npz_precision="f32", npz_compress=True)
    saved = np.load(path)
    assert saved["draped"].dtype == np.float32 and np.abs(saved["draped"] - swatch.points).max() < 1e-4
    assert path.stat().st_size < 0.5 * whole.stat().st_size
    files = [tmp_path / f"cloth{ending}" for ending in (".usda", ".ply", ".obj", ".inp", ".glb")]
    swatch.save(*files, file_unit="m", up="z", usd_curves="linear", inp="abaqus", glb_precision="f32", nodes="yarn")
    usda, _, obj, inp, glb = (file.read_bytes() for file in files)
    assert b"PhysicsCurvesDeformableSimAPI" in usda and b"*CONTACT PAIR" in inp
    assert b'"yarn 0"' in glb and b"KHR_mesh_quantization" not in glb
    places = [[float(number) for number in line.split()[1:]] for line in obj.splitlines() if line.startswith(b"v ")]
    # Of a swatch, whose courses go up.
    assert np.ptp(places, axis=0)[2] == pytest.approx(1e-3 * np.ptp(swatch.points, axis=0)[1], rel=0.2)
    with pytest.raises(ValueError, match="f64, f32"):
        swatch.save(path, npz_precision="f16")  # type: ignore[arg-type]


def test_what_cannot_be_written_is_said_and_nothing_is_left(
    locknit: warpknit.Fabric, tmp_path: Path
) -> None:
    swatch = warpknit.swatch(locknit, 3, 4)
    with pytest.raises(ValueError, match="no writer for this ending"):
        swatch.save(tmp_path / "cloth.docx")
    with pytest.raises(OSError, match="nowhere"):
        swatch.save(tmp_path / "nowhere" / "cloth.glb")
    with pytest.raises(ValueError, match="name a file"):
        swatch.save()
    assert list(tmp_path.iterdir()) == []


def test_a_garment_file_is_not_overwritten(tmp_path: Path, locknit: warpknit.Fabric) -> None:
    square = tmp_path / "square.obj"
    square.write_text("v 0 0 0\nv 200 0 0\nv 200 200 9\nv 0 200 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n")
    yarns = warpknit.drape(warpknit.Garment.load(square), locknit, 1.0, "smooth")
    with pytest.raises(ValueError, match="is an input"):
        yarns.save(square)


def test_a_report_has_the_numbers_of_the_cloth(locknit: warpknit.Fabric, yarns: warpknit.Yarns) -> None:
    cloth = warpknit.swatch(locknit).report["cloth"]
    # Those that README prints.
    assert round(cloth["mass_g_m2"], 1) == 94.1
    assert [round(length) for length in cloth["run_in_mm_per_rack"]] == [1804, 1431]
    assert yarns.report is not None and yarns.report["stitches"] == pytest.approx(yarns.stitches, rel=0.1)
    assert yarns.report["curved_ms"] >= yarns.report["plane_ms"] > 0


def test_the_interpreter_is_free_while_rust_works(locknit: warpknit.Fabric) -> None:
    fabric = locknit.at_densities(4.0)
    swatch = warpknit.swatch(fabric, 60, 60)
    ticks: list[float] = []
    is_done = threading.Event()

    def count() -> None:
        while not is_done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    start = time.monotonic()
    swatch.render(size=(800, 600))
    end = time.monotonic()
    is_done.set()
    counter.join()
    within = [tick for tick in ticks if start < tick < end]
    # With the lock held there would be a tick or two.
    assert len(within) > 10


def test_drapes_are_the_same_each_time(tube: warpknit.Garment, locknit: warpknit.Fabric, yarns: warpknit.Yarns) -> None:
    again = warpknit.drape(tube, locknit, wales_per_cm=2.0)
    assert (again.points == yarns.points).all()


@pytest.mark.parametrize("mapping", ["relaxed", "smooth", "frame"])
def test_mappings(tube: warpknit.Garment, locknit: warpknit.Fabric, mapping: str) -> None:
    assert warpknit.drape(tube, locknit, 1.0, mapping).stitches > 100  # type: ignore[arg-type]


def test_densities(tube: warpknit.Garment, locknit: warpknit.Fabric) -> None:
    auto = warpknit.drape(tube, locknit)
    assert 9_000 < auto.stitches < 15_000
    times = locknit.wales_per_cm / auto.fabric.wales_per_cm
    assert times > 1
    same = warpknit.drape(tube, locknit, enlarge=times)
    assert same.fabric == auto.fabric and (same.points == auto.points).all()
    with pytest.raises(ValueError, match="either densities or enlarge"):
        warpknit.drape(tube, locknit, 2.0, enlarge=2.0)
    with pytest.raises(ValueError, match="relaxed, smooth, frame"):
        warpknit.drape(tube, locknit, mapping="rubber")  # type: ignore[arg-type]
    with pytest.raises(warpknit.FabricError, match="wales_per_cm"):
        warpknit.drape(tube, locknit, wales_per_cm=-1.0)
