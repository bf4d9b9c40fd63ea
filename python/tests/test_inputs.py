"""Fabrics and garments: what goes in, and what is refused, in the command's words with Python's keywords."""

import pickle
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
import warpknit

SQUARE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
BODY = np.column_stack([SQUARE, [0.0, 0.0, 30.0, 0.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)


def test_version() -> None:
    assert warpknit.__version__.count(".") == 2


def test_named_fabrics() -> None:
    names = warpknit.Fabric.names()
    assert len(names) == 46 and "locknit" in names
    for name in names:
        fabric = warpknit.Fabric.named(name)
        assert fabric.name == name and fabric.about and fabric.warnings == []
        assert len(fabric.lappings) == len(fabric.colors) >= 1
    with pytest.raises(warpknit.FabricError, match=r"`Fabric.names\(\)` lists them, .*; did you mean 'locknit'"):
        warpknit.Fabric.named("lokcnit")


def test_chains() -> None:
    fabric = warpknit.Fabric.from_chains(["2-3/1-0//", "1-0/1-2//"])
    assert fabric.lappings == ["2-3/1-0//", "1-0/1-2//"]
    assert fabric.wales_per_cm == warpknit.Fabric.named("tricot").wales_per_cm
    # Four times the count is twice the diameter, and the cloth keeps its cover.
    coarse = warpknit.Fabric.from_chains(["2-3/1-0//", "1-0/1-2//"], None, "176 dtex")
    assert coarse.wales_per_cm == pytest.approx(fabric.wales_per_cm / 2)
    half = warpknit.Fabric.from_chains(["1-0/1-2//", "1-2/1-0//"], threading=["I.", ".I"], yarn=["44 dtex", "20 den"])
    assert 'threading = "I."' in half.to_toml() and '"20 den"' in half.to_toml()
    for chains in [("1-0/0-1//",), "1-0/0-1//"]:
        assert warpknit.Fabric.from_chains(chains, "I").lappings == ["1-0/0-1//"]


@pytest.mark.parametrize(
    ("chains", "keywords", "words"),
    [
        ([], {}, "no chains"),
        ("", {}, "chain is empty"),
        (["1-0/1-7//"], {}, "overlap over 6 needles"),
        (["1-0/1-2//"], {"threading": "Ix"}, "no threading mark"),
        (["1-0/1-2//"], {"threading": ["I", ".I"]}, "2 marks for 1 chains"),
        (["1-0/1-2//"], {"yarn": "thick"}, "no yarn count"),
        (["1-0/1-2//"], {"yarn": ["44 dtex"] * 2}, "given 2 times"),
        (["1-0/1-2//"], {"wales_per_cm": 0.0}, "wales_per_cm"),
    ],
)
def test_chains_that_are_refused(chains: str | list[str], keywords: dict[str, object], words: str) -> None:
    with pytest.raises(warpknit.FabricError, match=words) as caught:
        warpknit.Fabric.from_chains(chains, **keywords)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_yarns_that_do_not_fit_are_warned_of() -> None:
    with pytest.warns(UserWarning, match="cover") as caught:
        warpknit.Fabric.from_chains(["1-0/1-2//"], yarn="440 dtex", wales_per_cm=15.0)
    assert caught[0].filename == __file__, "the user's line is named"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warpknit.Fabric.from_chains(["1-0/1-2//"], yarn="440 dtex")


def test_cloth_that_cannot_keep_its_yarns_lengths_is_warned_of() -> None:
    stretched = BODY * [1.6, 1.6, 1.0]
    garment = warpknit.Garment.from_arrays(SQUARE, stretched, FACES, uv_scale=1.0)
    with pytest.warns(UserWarning, match="further than its loops can follow"):
        warpknit.drape(garment, warpknit.Fabric.named("tricot"), 1.0)
    with pytest.warns(UserWarning, match="as if they were rubber"):
        warpknit.drape(garment, warpknit.Fabric.named("cable"), 1.0, sweeps=False)


def test_fabric_files(tmp_path: Path) -> None:
    fabric, path = warpknit.Fabric.named("hex-net-5"), tmp_path / "net.toml"
    path.write_text(fabric.to_toml())
    assert warpknit.Fabric.load(path) == warpknit.Fabric.parse(fabric.to_toml()) == fabric
    assert warpknit.Fabric.load(str(path)) != warpknit.Fabric.named("satin")
    path.write_text(fabric.to_toml().replace("wales_per_cm", "wales_per_inch"))
    with pytest.raises(warpknit.FabricError, match=r"net\.toml:\d+: .*wales_per_inch"):
        warpknit.Fabric.load(path)
    with pytest.raises(warpknit.FabricError, match="nothere.toml: can't read"):
        warpknit.Fabric.load(tmp_path / "nothere.toml")


def test_equal_fabrics_have_equal_hashes() -> None:
    one, other = (warpknit.Fabric.from_chains(["1-0/1-2//"]) for _ in range(2))
    assert one == other and len({one, other, warpknit.Fabric.named("locknit")}) == 2


def test_a_name_is_a_built_in_fabric() -> None:
    named = warpknit.swatch(warpknit.Fabric.named("jersey"), 3, 4)
    assert (warpknit.swatch("jersey", 3, 4).points == named.points).all()
    garment = warpknit.Garment.from_arrays(SQUARE, BODY, FACES)
    assert warpknit.drape(garment, "jersey", 2.0).fabric.name == "jersey"
    with pytest.raises(warpknit.FabricError, match="did you mean 'jersey'"):
        warpknit.drape(garment, "jersye")
    with pytest.raises(TypeError, match="^fabric is of type int, but must be a Fabric or the name of a built-in one$"):
        warpknit.swatch(5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"^garment is of type str, but must be a Garment: Garment\.load reads files$"):
        warpknit.drape("shirt.obj", "jersey")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="^must be a text, or a list of texts with one for each bar"):
        warpknit.Fabric.from_chains([3])  # type: ignore[list-item]


def test_cloth_that_is_too_tight_is_warned_of() -> None:
    wide = warpknit.Fabric.from_chains(["1-0/20-21//", "1-0/20-21//"])
    with pytest.warns(UserWarning, match="cut each other"):
        warpknit.swatch(wide, 24, 4)
    garment = warpknit.Garment.from_arrays(SQUARE, BODY, FACES)
    with pytest.warns(UserWarning, match="cut each other"):
        warpknit.drape(garment, wide, 2.0, "smooth")


@pytest.mark.parametrize("times", [0.0, -2.0, float("nan"), float("inf")])
def test_enlargements_are_above_0(times: float) -> None:
    garment = warpknit.Garment.from_arrays(SQUARE, BODY, FACES)
    with pytest.raises(ValueError, match="must be a number above 0"):
        warpknit.drape(garment, "tricot", enlarge=times)


def test_fabrics_pickle() -> None:
    fabric = warpknit.Fabric.named("locknit").at_densities(2.0)
    assert pickle.loads(pickle.dumps(fabric)) == fabric


def test_arrays_of_the_right_types_are_read_where_they_lie() -> None:
    side = 300
    across, along = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    flat = np.column_stack([across.ravel(), along.ravel()])
    draped = np.column_stack([flat, np.zeros(len(flat))])
    corner = (np.arange(side - 1) + side * np.arange(side - 1)[:, None]).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, side], corner[:, None] + [1, side + 1, side]])

    def copied(*arrays: np.ndarray) -> int:
        """The most memory that numpy takes meanwhile, bytes."""
        tracemalloc.start()
        warpknit.Garment.from_arrays(*arrays)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    assert copied(flat, draped, faces.astype(np.uint32)) < 100_000
    assert copied(flat.astype(np.float32), draped, faces.astype(np.uint32)) >= flat.nbytes


def test_arrays() -> None:
    garment = warpknit.Garment.from_arrays(SQUARE, BODY, FACES)
    assert (garment.panels, garment.triangles, garment.unit) == (1, 2, "mm")
    assert garment.area_cm2 == pytest.approx(100.0)
    fabric = warpknit.Fabric.named("tricot")
    points = warpknit.drape(garment, fabric, 2.0).points
    # Lists, other types and other orders are the same garment.
    for flat, draped, faces in [
        (SQUARE.tolist(), BODY.tolist(), FACES.tolist()),
        (SQUARE.astype(np.float32), np.asfortranarray(BODY), FACES.astype(np.int64)),
        (np.asfortranarray(SQUARE), BODY[:, :], np.asfortranarray(FACES)),
        (np.repeat(SQUARE, 2, axis=0)[::2], BODY, FACES.astype(np.uint8)),
    ]:
        same = warpknit.Garment.from_arrays(flat, draped, faces)
        assert (warpknit.drape(same, fabric, 2.0).points == points).all()


def test_arrays_of_a_uv_map() -> None:
    # A square of 300 mm in metres, its pattern in the unit square.
    metres = 0.3 * np.column_stack([SQUARE / 100, np.zeros(4)])
    garment = warpknit.Garment.from_arrays(SQUARE / 100, metres, FACES, unit="m", uv_scale=None)
    assert garment.area_cm2 == pytest.approx(900.0)
    yarns = warpknit.drape(garment, warpknit.Fabric.named("tricot"), 2.0, "smooth")
    turned = warpknit.Garment.from_arrays(SQUARE / 100, metres, FACES, unit="m", uv_scale=300, grain=90)
    across = warpknit.drape(turned, warpknit.Fabric.named("tricot"), 2.0, "smooth")
    assert yarns.points.max() == pytest.approx(300, abs=2)
    # A wale runs along y, or along x where the grain is turned.
    spread = [np.ptp(cloth.points[cloth.wale == 20], axis=0) for cloth in (yarns, across)]
    assert spread[0][1] > 250 > 50 > spread[0][0] and spread[1][0] > 250 > 50 > spread[1][1]


@pytest.mark.parametrize(
    ("flat", "draped", "faces", "words"),
    [
        (SQUARE, BODY[:2], FACES, "4 flat and 2 draped"),
        (SQUARE, BODY, FACES + 4, "names vertex"),
        (SQUARE, BODY, FACES.astype(np.int64) - 1, "vertex -1"),
        (SQUARE, np.full((4, 3), np.nan), FACES, "not finite"),
        (SQUARE, BODY, FACES[:0], "no triangles"),
        (SQUARE, BODY, FACES.astype(float), "whole numbers"),
        (BODY, BODY, FACES, r"flat has the shape \(4, 3\)"),
        (SQUARE, SQUARE, FACES, r"draped has the shape \(4, 2\)"),
        (SQUARE, BODY, [[0, 1, 2, 3]], r"\(m, 3\), not \(1, 4\)"),
        (SQUARE, BODY, [0, 1, 2], r"\(m, 3\)"),
        (SQUARE.ravel(), BODY, FACES, r"flat must be numbers in the shape \(n, 2\)"),
        (SQUARE, "cloth", FACES, r"draped must be numbers in the shape \(n, 3\)"),
    ],
)
def test_arrays_that_hold_no_garment(flat: object, draped: object, faces: object, words: str) -> None:
    with pytest.raises(warpknit.GarmentError, match=words) as caught:
        warpknit.Garment.from_arrays(flat, draped, faces)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_garments_warn_of_what_they_lack() -> None:
    with pytest.warns(UserWarning, match="1 triangles have no flat area"):
        garment = warpknit.Garment.from_arrays(SQUARE, BODY, np.vstack([FACES, [[0, 1, 1]]]).astype(np.uint32))
    assert len(garment.warnings) == 1


def test_garment_files(meshes: Path, tmp_path: Path) -> None:
    garment = warpknit.Garment.load(str(meshes / "tshirt.obj"))
    assert garment.panels > 1 and "panels" in repr(garment)
    with pytest.raises(warpknit.GarmentError, match="nothere.obj: cannot be opened"):
        warpknit.Garment.load(tmp_path / "nothere.obj")
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0 0\nv 1 0 zero\n")
    with pytest.raises(warpknit.GarmentError, match=r"broken\.obj:2: .*no number"):
        warpknit.Garment.load(broken)
    with pytest.raises(warpknit.GarmentError, match="no unit"):
        warpknit.Garment.load(meshes / "tshirt.obj", unit="ell")  # type: ignore[arg-type]
    with pytest.raises(warpknit.GarmentError, match="^uv_scale is -1"):
        warpknit.Garment.load(meshes / "tshirt.obj", uv_scale=-1.0)


def test_errors_are_value_errors() -> None:
    assert issubclass(warpknit.GarmentError, ValueError) and issubclass(warpknit.FabricError, ValueError)
    assert warpknit.GarmentError.__module__ == "warpknit"


@pytest.mark.parametrize("size", [(0, 4), (4, 1001), (-1, 4), (4, 2**40)])
def test_swatches_out_of_range(size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="must be between 1 and 1000"):
        warpknit.swatch(warpknit.Fabric.named("tricot"), *size)


def test_everything_public_has_a_docstring() -> None:
    for name in warpknit.__all__:
        thing = getattr(warpknit, name)
        if name.startswith("__"):
            continue
        assert thing.__doc__, name
        if isinstance(thing, type) and not issubclass(thing, Exception):
            for attribute in dir(thing):
                if not attribute.startswith("_"):
                    assert getattr(thing, attribute).__doc__, f"{name}.{attribute}"
