"""A small program as a user writes it. `mypy --strict` checks it, and the tests run it."""

from pathlib import Path

import numpy as np
import warpknit
from numpy.typing import NDArray


def lengths(yarns: warpknit.Yarns) -> NDArray[np.float64]:
    """The length of the line through the points of each strand, mm."""
    steps = np.linalg.norm(np.diff(yarns.points, axis=0), axis=1)
    # The step from one strand to the next is none of yarn.
    steps[yarns.offsets[1:-1] - 1] = 0.0
    return np.add.reduceat(steps, yarns.offsets[:-1])


def main(folder: Path) -> dict[str, float]:
    """Knits, and writes a file."""
    fabric = warpknit.Fabric.from_chains(["2-3/1-0//", "1-0/1-2//"], threading="I", yarn="44 dtex")
    yarns = warpknit.swatch(fabric, wales=6, courses=8)
    yarns.save(folder / "cloth.usda", str(folder / "cloth.ply"), st=4, sr=5, file_unit="m")
    vertices, faces, normals, uv = yarns.to_mesh(st=10, sr=6)
    assert vertices.shape == normals.shape and len(uv) == len(vertices)
    picture = yarns.render(size=(80, 60), view="back")
    return {
        "mm": float(lengths(yarns).sum()),
        "triangles": float(len(faces)),
        "pixels": float(picture.shape[0] * picture.shape[1]),
        "grams": float(yarns.report["cloth"]["mass_g_m2"]),
    }
