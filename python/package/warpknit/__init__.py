"""Knits warp-knit fabric, yarn by yarn, onto a garment from a pattern tool. Lengths are in mm.

    import warpknit

    garment = warpknit.Garment.load("tshirt.obj")
    yarns = warpknit.drape(garment, warpknit.Fabric.named("locknit"))
    yarns.save("tshirt.glb")
"""

from ._warpknit import (
    Fabric,
    FabricError,
    Garment,
    GarmentError,
    Yarns,
    __version__,
    drape,
    swatch,
)

__all__ = [
    "Fabric",
    "FabricError",
    "Garment",
    "GarmentError",
    "Yarns",
    "__version__",
    "drape",
    "swatch",
]
