"""The types of the compiled module. Its docstrings are in the classes themselves."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Fabric", "FabricError", "Garment", "GarmentError", "Yarns", "__version__", "drape", "swatch"]

__version__: str

_Path = str | PathLike[str]
_Unit = Literal["mm", "cm", "dm", "m", "in"]
_View = Literal["front", "back", "left", "right", "top", "iso"]

class GarmentError(ValueError):
    """A garment that can't be read or knitted."""

class FabricError(ValueError):
    """A fabric that can't be read or knitted."""

@final
class Fabric:
    """A fabric: its bars or feeders, their yarns, and its densities."""

    @staticmethod
    def named(name: str) -> Fabric: ...
    @staticmethod
    def names() -> list[str]: ...
    @staticmethod
    def from_chains(
        chains: str | Sequence[str],
        threading: str | Sequence[str] | None = None,
        yarn: str | Sequence[str] = "44 dtex",
        *,
        wales_per_cm: float | None = None,
        courses_per_cm: float | None = None,
    ) -> Fabric: ...
    @staticmethod
    def load(path: _Path) -> Fabric: ...
    @staticmethod
    def parse(text: str) -> Fabric: ...
    def at_densities(
        self, wales_per_cm: float | None = None, courses_per_cm: float | None = None
    ) -> Fabric: ...
    def to_toml(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def about(self) -> str: ...
    @property
    def wales_per_cm(self) -> float: ...
    @property
    def courses_per_cm(self) -> float: ...
    @property
    def lappings(self) -> list[str]: ...
    @property
    def colors(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Garment:
    """A garment: panels, flat and draped."""

    @staticmethod
    def load(
        flat: _Path,
        draped: _Path | None = None,
        *,
        unit: _Unit | None = None,
        uv_scale: float | None = None,
        grain: float = 0.0,
        turn: bool = False,
        allow_loss: bool = False,
    ) -> Garment: ...
    @staticmethod
    def from_arrays(
        flat: ArrayLike,
        draped: ArrayLike,
        faces: ArrayLike,
        *,
        unit: _Unit = "mm",
        uv_scale: float | None = 1.0,
        grain: float = 0.0,
        turn: bool = False,
    ) -> Garment: ...
    @property
    def panels(self) -> int: ...
    @property
    def triangles(self) -> int: ...
    @property
    def unit(self) -> str: ...
    @property
    def area_cm2(self) -> float: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def notes(self) -> list[str]: ...

@final
class Yarns:
    """The yarns of a cloth, as arrays: n points in s strands."""

    @property
    def points(self) -> NDArray[np.float64]: ...
    @property
    def normals(self) -> NDArray[np.float64]: ...
    @property
    def flat(self) -> NDArray[np.float64]: ...
    @property
    def course(self) -> NDArray[np.int32]: ...
    @property
    def wale(self) -> NDArray[np.int32]: ...
    @property
    def offsets(self) -> NDArray[np.int64]: ...
    @property
    def yarn(self) -> NDArray[np.int32]: ...
    @property
    def panel(self) -> NDArray[np.int32]: ...
    @property
    def bar(self) -> NDArray[np.int32]: ...
    @property
    def radius(self) -> NDArray[np.float64]: ...
    @property
    def stitch_counts(self) -> NDArray[np.int64]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def fabric(self) -> Fabric: ...
    @property
    def stitches(self) -> int: ...
    @property
    def report(self) -> dict[str, Any]: ...
    def to_mesh(
        self, st: int = 10, sr: int = 6, *, flatten: float = 1.0, caps: bool = False
    ) -> tuple[
        NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32], NDArray[np.float32]
    ]: ...
    def render(
        self,
        size: tuple[int, int] = (800, 600),
        view: _View = "front",
        *,
        zoom: float = 1.0,
        background: str | None = None,
        spp: int = 4,
        shape: Literal["tube", "ribbon"] = "tube",
        studio: bool | None = None,
        body: _Path | None = None,
        body_cloth: bool = False,
        sun: tuple[float, float] | None = None,
        environment: _Path | None = None,
        environment_turn: float = 0.0,
    ) -> NDArray[np.uint8]: ...
    def save(
        self,
        *paths: _Path,
        st: int | None = None,
        sr: int | None = None,
        flatten: float | None = None,
        caps: bool = False,
        curves: bool = False,
        size: tuple[int, int] = (1600, 1200),
        view: _View = "front",
        file_unit: Literal["mm", "cm", "m"] = "mm",
        up: Literal["y", "z"] = "y",
        usd_curves: Literal["bezier", "linear"] = "bezier",
        inp: Literal["calculix", "abaqus"] = "calculix",
        glb_precision: Literal["u16", "f32"] = "u16",
        nodes: Literal["bar", "yarn"] = "bar",
        glb_meshopt: bool = False,
        npz_precision: Literal["f64", "f32"] = "f64",
        npz_compress: bool = False,
    ) -> None: ...
    def _repr_png_(self) -> bytes: ...
    def __len__(self) -> int: ...

def drape(
    garment: Garment,
    fabric: Fabric | str,
    wales_per_cm: float | None = None,
    mapping: Literal["relaxed", "smooth", "frame"] = "relaxed",
    *,
    courses_per_cm: float | None = None,
    enlarge: float | None = None,
    edge: Literal["clip", "drop"] = "clip",
    sweeps: bool | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> Yarns:
    """Knits a fabric onto a garment."""

def swatch(fabric: Fabric | str, wales: int = 14, courses: int = 16) -> Yarns:
    """Knits a flat piece of fabric."""
