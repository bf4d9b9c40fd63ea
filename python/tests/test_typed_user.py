"""The program that mypy checks also runs."""

from pathlib import Path

from typed_user import main


def test_the_typed_program_runs(tmp_path: Path) -> None:
    numbers = main(tmp_path)
    assert numbers["mm"] > 100 and numbers["pixels"] == 4800 and numbers["grams"] > 50
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cloth.ply", "cloth.usda"]
