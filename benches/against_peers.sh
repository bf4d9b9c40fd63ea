#!/usr/bin/env bash
# What a user would take instead, timed in turn with warpknit on the same yarns: ratios of the CPU time of one thread, medians of several runs.
#
#     benches/against_peers.sh PEERS
#
# PEERS is a folder with three_tube.mjs and node_modules/three in it (npm i three). A peer that isn't there is named and left out.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 1 ] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
peers=$(realpath "$1")
inputs=$(mktemp -d)
trap 'rm -rf "$inputs"' EXIT

cargo build --quiet --release
warpknit() { cargo run --quiet --release -- "$@"; }

# The eight named points of each loop of a plain weft knit of N x N loops, as three_tube.mjs reads them.
weft_points() {
    warpknit swatch --fabric jersey --wales "$1" --courses "$1" --quiet -o "$inputs/points.csv" >"$inputs/numbers"
    node - "$inputs" "$1" <<'JS'
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

# Milliseconds of CPU of ours, by the table; measured anew for each row, so that both sides of a row run one after the other.
ours() { warpknit bench --weft --threads 1 --quiet | awk -v side="$1" -v st="$2" '$1 == side && $4 == st { print $9 }'; }

if [ -f "$peers/three_tube.mjs" ] && [ -d "$peers/node_modules/three" ]; then
    echo "plain weft knits from motif to tubes (Sr 5), ms of CPU: warpknit, three.js TubeGeometry (from points to tubes alone), times"
    for side in 20 50 100; do
        weft_points "$side"
        for st in 15 20 50; do
            own=$(ours "$side" "$st")
            other=$(cd "$peers" && node --expose-gc three_tube.mjs "$inputs" "$side" "$st" 5 | sed 's/.*"cpu_ms":\([0-9.]*\).*/\1/')
            awk -v side="$side" -v st="$st" -v own="$own" -v other="$other" \
                'BEGIN { printf "%3d x %-3d  %2d segments  %9.2f  %9.2f  %6.1f\n", side, side, st, own, other, other / own }'
        done
    done
else
    echo "three.js: no three_tube.mjs with node_modules/three in $peers; left out"
fi
