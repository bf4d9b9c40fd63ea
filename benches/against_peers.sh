#!/usr/bin/env bash
# What a user would take instead, timed in turn with warpknit on the same inputs: ratios of the CPU time of one thread, medians of several runs.
# Stages for which PEERS has no program stand beside what bounds them, or alone.
#
#     benches/against_peers.sh PEERS
#
# PEERS is a folder with make_inputs.py and what there is of embree_locate (built), numpy_tube.py, three_tube.mjs and node_modules/three (npm i three).
# A peer that isn't there is named and left out. PYTHON names a python3 with numpy; PEER_INPUTS a folder of inputs that are made already.
set -euo pipefail
[ $# -eq 1 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
peers=$(realpath "$1")
inputs=${PEER_INPUTS:+$(realpath "$PEER_INPUTS")}
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo build --quiet --release
cargo bench --quiet --no-run
warpknit() { cargo run --quiet --release -- "$@"; }
# Whether a command runs here.
has() { command -v "$1" >/dev/null; }
has_numpy() { "$python" -c 'import numpy' 2>/dev/null; }
left_out() { echo "$1: no $2 in $peers; left out"; }

if [ -z "$inputs" ]; then
    if [ -f "$peers/make_inputs.py" ] && has_numpy; then
        inputs=$scratch/inputs
        "$python" "$peers/make_inputs.py" "$inputs"
    else
        echo "inputs: no make_inputs.py in $peers, or no numpy in $python; locate, map and tubes are left out"
    fi
fi
unset PEER_INPUTS
[ -z "$inputs" ] || export PEER_INPUTS=$inputs

# Milliseconds of CPU of one of our benches, by its name.
bench() {
    cargo bench --quiet --bench pipeline -- --output-format bencher "^$1\$" >"$scratch/figures" 2>"$scratch/log" || { cat "$scratch/log" >&2; exit 1; }
    awk '/ns\/iter/ { for (i = 1; i <= NF; i++) if ($i == "ns/iter") { gsub(",", "", $(i - 1)); print $(i - 1) / 1e6 } }' "$scratch/figures"
}
# A number of a peer's JSON line.
field() { sed "s/.*\"$1\": *\([0-9.]*\).*/\1/"; }
# A row: what, ours, theirs.
row() { awk -v what="$1" -v own="$2" -v other="$3" 'BEGIN { times = other / own; printf "%-34s %10.2f %10.2f %8.*f\n", what, own, other, times < 1 ? 2 : 1, times }'; }
heading() { printf '\n%-34s %10s %10s %8s\n' "$1" warpknit "$2" times; }

locate() {
    [ -x "$peers/embree_locate" ] || { left_out Embree embree_locate; return; }
    heading "locate, build and query, ms" "Embree x16"
    for pair in 20k/26180 20k/1m 200k/26180 200k/1m; do
        own=$(bench "locate/$pair")
        other=$("$peers/embree_locate" "$inputs" "${pair%/*}" "${pair#*/}" | field total_ms)
        row "$pair triangles/stitches" "$own" "$other"
    done
}

# The locate stage of a drape, and that with mapping: it also follows yarns from point to point and cuts them at edges. Embree searches the same points.
drape() {
    [ -x "$peers/embree_locate" ] || { left_out Embree embree_locate; return; }
    heading "drape, ms" "Embree x16"
    export WARPKNIT_DRAPE_INPUTS=$scratch/drape
    mkdir "$WARPKNIT_DRAPE_INPUTS"
    for size in 26180 262k 1m; do
        read -r own both < <(bench "drape, locate.*/$size" | xargs)
        other=$("$peers/embree_locate" "$WARPKNIT_DRAPE_INPUTS" skirt "skirt_$size" | field total_ms)
        row "$size stitches, locate stage" "$own" "$other"
        row "$size stitches, with map" "$both" "$other"
    done
    unset WARPKNIT_DRAPE_INPUTS
}

# No peer: what mapping adds to location, for each point.
map() {
    printf '\n%-34s %10s\n' "map after locate, ns a point" warpknit
    local points both
    points=$(($(stat -c %s "$inputs/points_1m.bin") / 12))
    for mapping in frame smooth; do
        both=$(bench "locate and map $mapping/20k/1m")
        own=$(bench locate/20k/1m)
        awk -v both="$both" -v own="$own" -v points="$points" -v what="$mapping" \
            'BEGIN { printf "%-34s %10.2f\n", what, (both - own) * 1e6 / points }'
    done
}

tubes() {
    heading "tubes, 26180 stitches 10 x 5, ms" peer
    if [ -f "$peers/numpy_tube.py" ] && has_numpy; then
        own=$(bench "tubes streamed/26180/10x5")
        other=$("$python" "$peers/numpy_tube.py" "$inputs" 26180 10 5 | field cpu_ms)
        row "numpy" "$own" "$other"
    else
        left_out numpy "numpy_tube.py, or no numpy in $python,"
    fi
    if has_three; then
        own=$(bench "tubes streamed/26180/10x5")
        other=$(three "$inputs" 26180 10)
        row "three.js" "$own" "$other"
    fi
}

has_three() {
    [ -f "$peers/three_tube.mjs" ] && [ -d "$peers/node_modules/three" ] && has node ||
        { left_out three.js "three_tube.mjs with node_modules/three, or no node,"; return 1; }
}
three() { (cd "$peers" && node --expose-gc three_tube.mjs "$1" "$2" "$3" 5) | field cpu_ms; }

# The eight named points of each loop of a plain weft knit of N x N loops, as three_tube.mjs reads them.
weft_points() {
    warpknit swatch --fabric jersey --wales "$1" --courses "$1" --quiet -o "$scratch/points.csv" >"$scratch/numbers"
    node - "$scratch" "$1" <<'JS'
const fs = require('fs');
const [, , dir, side] = process.argv;
const [head, ...rows] = fs.readFileSync(`${dir}/points.csv`, 'utf8').trim().split('\n').map((row) => row.split(','));
const at = (name) => head.indexOf(name);
const places = ['draped_x', 'draped_y', 'draped_z'].map(at);
// Between the named points lie those halfway, and after the last loop its end.
const named = rows.filter((row) => row[at('point')] % 2 == 1 && +row[at('wale')] < +side);
if (named.length != side * side * 8) throw new Error(`${named.length} points of ${side} x ${side} loops`);
fs.writeFileSync(`${dir}/points_${side}.bin`, Float32Array.from(named.flatMap((row) => places.map((place) => +row[place]))));
fs.writeFileSync(`${dir}/points_${side}.txt`, `${side} ${side}\n`);
JS
}

# Plain weft knits from motif to tubes; three.js starts from points. Ours is measured anew for each row, so that both sides run one after the other.
weft() {
    has_three || return 0
    heading "weft, loops and segments, ms" three.js
    for side in 20 50 100; do
        weft_points "$side"
        for st in 15 20 50; do
            own=$(warpknit bench --weft --threads 1 --quiet | awk -v side="$side" -v st="$st" '$1 == side && $4 == st { print $9 }')
            other=$(three "$scratch" "$side" "$st")
            row "$side x $side, $st" "$own" "$other"
        done
    done
}

# Files of the tubes of 26180 stitches, beside as many bytes as the .glb has, only written.
write() {
    heading "write, 1.8 M vertices, ms" "bytes"
    local format
    for format in glb ply obj usdc; do
        own=$(bench "write/$format")
        other=$(bench write/bytes)
        row "$format" "$own" "$other"
    done
}

# Time on the wall.
threads() {
    heading "threads, 262 k with tubes, wall ms" "one thread"
    own=$(bench "wall, 262k with tubes/threads/2")
    other=$(bench "wall, 262k with tubes/threads/1")
    row "two threads" "$own" "$other"
}

# No peers: ours alone.
alone() {
    printf '\n%-34s %10s\n' "no program in PEERS, ms" warpknit
    local stage
    for stage in "read/skirt" "relax/tricot" "lay/tricot/1024" "render 400x300/tricot/50 x 50" "render 400x300/tricot/400 x 400"; do
        own=$(bench "$stage")
        printf '%-34s %10.2f\n' "$stage" "$own"
    done
}

if [ -n "$inputs" ]; then
    locate
    map
    tubes
fi
drape
weft
write
threads
alone
