#!/usr/bin/env bash
# Makes the pictures of README.md and of the pages in docs anew: run it anywhere in a checkout. The pictures of a sock need
# madypg_sock/cloth.obj in the folder that WARPKNIT_GARMENTS names, which is MADYPG's (https://github.com/kamleshbhalui/MADYPG).
set -euo pipefail
cd "$(dirname "$0")/.."

knit() { cargo run --quiet --release -- "$@" --quiet >/dev/null; }
sides() { knit swatch --fabric "$1" --wales 8 --courses 9 --view "$2" --size 800x600 --spp 16 -o "docs/$1_$2.png"; }

knit drape meshes/skirt_flat.obj meshes/skirt_draped.obj --size 1200x900 --spp 16 -o docs/skirt.png
knit drape meshes/tshirt.obj --fabric tulle-5 --enlarge 5 --body meshes/tshirt_body.obj --loupe off --size 800x600 --spp 16 -o docs/worn.png
knit drape meshes/tshirt.obj --fabric tulle-5 --background '#203040' --loupe off --size 800x600 -o docs/sheer.png
sides locknit front
sides locknit back
knit drape meshes/tshirt.obj --fabric jersey --zoom 120 --size 800x600 --spp 16 -o docs/hairs.png
knit swatch --fabric hex-net-5 --wales 14 --courses 20 --size 800x600 --spp 16 -o docs/net.png
knit swatch --fabric locknit --wales 8 --courses 9 --shape ribbon --texture meshes/yarns/two-ply --size 800x600 --spp 16 -o docs/ribbon.png
knit swatch --fabric cable --wales 32 --courses 36 --size 1000x920 --spp 8 -o docs/cable.png
cargo run --quiet --release -- inspect --fabric locknit -o docs/locknit_lapping.svg >/dev/null

made=$(mktemp -d)
trap 'rm -r "$made"' EXIT

# Mappings are compared on regular cloth. A square of it, pulled to 1.25 times its width and .92 times its height.
square() { printf 'v 0 0 0\nv %s 0 0\nv %s %s 0\nv 0 %s 0\nf 1 2 3\nf 1 3 4\n' "$1" "$1" "$2" "$2"; }
square 100 100 >"$made/flat.obj"
square 125 92 >"$made/pulled.obj"
for mapping in smooth relaxed; do
    knit drape "$made/flat.obj" "$made/pulled.obj" --unit mm --fabric jersey --wales-per-cm 1 --mapping "$mapping" --regular --background white --size 560x460 --zoom 2 --spp 16 -o "docs/pulled_$mapping.png"
done

# A sock's heel and instep, and a dress's bust.
for mapping in smooth relaxed; do
    [ -n "${WARPKNIT_GARMENTS:-}" ] || break
    knit drape "$WARPKNIT_GARMENTS/madypg_sock/cloth.obj" --fabric jersey --wales-per-cm 3 --mapping "$mapping" --regular --background white --eye=-100,-90,300 --look-at=-105,-92,20 --fov 8 --size 420x345 --spp 16 --loupe off -o "docs/heel_$mapping.png"
    knit drape "$WARPKNIT_GARMENTS/da_dress/ours.obj" --fabric jersey --wales-per-cm 2.5 --mapping "$mapping" --regular --background white --eye=-69,1188,700 --look-at=-69,1188,60 --fov 3.6 --size 420x345 --spp 16 --loupe off -o "docs/bust_$mapping.png"
done
knit bench --only yarn-length -o docs/yarn_length.svg
knit bench --only reading -o docs/reading.svg

knit swatch --fabric jersey --view front --wales 24 --courses 30 --flatten 1 --zoom 1.5 --size 800x800 --background '#101010' -o "$made/photo.png"
knit capture "$made/photo.png" --structure free -o "$made/cloth"
knit drape meshes/tshirt.obj --fabric "$made/cloth/fabric.toml" --size 800x800 --spp 16 -o docs/captured_shirt.png
knit drape meshes/tshirt.obj --fabric "$made/cloth/fabric.toml" --size 800x800 --enlarge auto --zoom 12 -o docs/captured_fibres.png
