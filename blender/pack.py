"""Packs the Blender extension: the files of blender/warpknit and the wheels of the Python package, as one .zip.

    python blender/pack.py dist/warpknit-*.whl -o warpknit-blender.zip

In: wheels, one for each platform. Out: a .zip that Blender installs, its manifest naming the wheels and their platforms.
"""

import argparse
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "warpknit"
# Words in the names of wheels, and what Blender calls their platforms.
PLATFORMS = [
    (("linux", "x86_64"), "linux-x64"),
    (("macosx", "arm64"), "macos-arm64"),
    (("macosx", "x86_64"), "macos-x64"),
    (("win", "amd64"), "windows-x64"),
]


def platform_of(wheel):
    if not wheel.is_file():
        raise SystemExit(f"error: {wheel}: there is no such wheel; build it with maturin")
    tag = wheel.stem.rpartition("-")[2]
    for words, platform in PLATFORMS:
        if all(word in tag for word in words):
            return platform
    raise SystemExit(f"error: {wheel}: Blender has no platform {tag}")


def manifest(wheels):
    """The manifest with the wheels, whose keys must stand before its first table."""
    found = [platform_of(wheel) for wheel in wheels]
    if len(set(found)) < len(found):
        raise SystemExit("error: two wheels are for one platform: remove those of older versions")
    names = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels)
    platforms = ", ".join(f'"{platform_of(wheel)}"' for wheel in wheels)
    text = (SOURCE / "blender_manifest.toml").read_text()
    return text.replace("\n[permissions]", f"platforms = [{platforms}]\nwheels = [{names}]\n\n[permissions]", 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", nargs="+", type=Path, help="made by maturin build")
    parser.add_argument("-o", "--output", type=Path, default=Path("warpknit-blender.zip"))
    arguments = parser.parse_args()
    with zipfile.ZipFile(arguments.output, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("blender_manifest.toml", manifest(arguments.wheels))
        for path in sorted(SOURCE.glob("*.py")):
            archive.write(path, path.name)
        for name in ["LICENSE-APACHE", "LICENSE-MIT"]:
            archive.write(SOURCE.parents[1] / name, name)
        for wheel in arguments.wheels:
            archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)
    print(arguments.output)


if __name__ == "__main__":
    main()
