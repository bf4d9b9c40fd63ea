"""What the tests share: the shipped garments, small enough for a second."""

from pathlib import Path

import pytest
import warpknit

MESHES = Path(__file__).resolve().parents[2] / "meshes"


@pytest.fixture(scope="session")
def meshes() -> Path:
    return MESHES


@pytest.fixture(scope="session")
def tube() -> warpknit.Garment:
    return warpknit.Garment.load(MESHES / "tube_flat.obj", MESHES / "tube_draped.obj")


@pytest.fixture(scope="session")
def locknit() -> warpknit.Fabric:
    return warpknit.Fabric.named("locknit")


@pytest.fixture(scope="session")
def yarns(tube: warpknit.Garment, locknit: warpknit.Fabric) -> warpknit.Yarns:
    return warpknit.drape(tube, locknit, wales_per_cm=2.0)


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strained repeats have to be solved, also where the tests ran before."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
