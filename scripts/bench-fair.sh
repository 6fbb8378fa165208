#!/usr/bin/env bash
# Whether Twincast gets out of Embree what a plain C++ client does, so that no comparison beats a weakened Embree:
#   scripts/bench-fair.sh [SCENE...]       terrainN or an OBJ file; FILE.obj:z for a mesh with z up
# Runs benches/embree_ref.cpp and `twincast bench` in turn and compares, for each mode, kind and width, the best rates
# of both: noise only ever slows a pass down. Fails below 95 %. ROUNDS (4) turns, and once more as many if that fails.
set -euo pipefail
cd "$(dirname "$0")/.."

twincast=${TWINCAST:-target/release/twincast}
rounds=${ROUNDS:-4}
scenes=("$@")
[ ${#scenes[@]} -gt 0 ] || scenes=(terrain300 terrain1000)

version=3
[ -e /usr/include/embree4/rtcore.h ] && version=4
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
g++ -O3 -march=native -ffp-contract=off -std=c++20 "-DEMBREE$version" benches/embree_ref.cpp \
    -o "$work/embree_ref" "-lembree$version"

# Both sides as lines of: who mode kind width rate
run() {
    local scene=${1%:z} up=y mode
    [ "$scene" = "$1" ] || up=z
    for mode in fast robust; do
        "$work/embree_ref" "$scene" "$mode" medium "$up" | sed -nE \
            "s/.*\"kind\":\"([a-z]+)\",\"width\":([0-9]+),.*\"mrays_per_s\":([0-9.]+).*/plain $mode \1 \2 \3/p"
        "$twincast" bench "$scene" --up-axis "$up" --modes "$mode" \
            --rays primary,diffuse,shadow --repeat 3 --json |
            grep -oE '\{"backend":"embree","mode"[^{]*"mrays_per_s":\{[^}]*' | sed -nE \
            's/.*"mode":"([a-z]+)","width":([0-9]+),"kind":"([a-z]+)".*"max":([0-9.e+-]+).*/twincast \1 \3 \2 \4/p'
    done
}

# Prints the table of what was measured; fails where a rate is too low.
judge() {
    awk '
        { key = sprintf("%-8s%-9s%5d", $2, $3, $4); if ($5 > best[$1, key]) best[$1, key] = $5 }
        $1 == "plain" && !(key in seen) { seen[key]; order[++n] = key }
        END {
            print "mode    kind     width    plain  twincast    share"
            for (i = 1; i <= n; i++) {
                plain = best["plain", order[i]]; ours = best["twincast", order[i]]
                low = ours < 0.95 * plain; bad += low
                printf "%s%9.3f%10.3f%7.1f %%%s\n", order[i], plain, ours, 100 * ours / plain, low ? "  below 95 %" : ""
            }
            exit n == 0 || bad > 0
        }' "$1"
}

failed=0
for scene in "${scenes[@]}"; do
    echo "$scene"
    for turn in $(seq $((2 * rounds))); do
        run "$scene" >> "$work/rates"
        [ "$turn" -ne "$rounds" ] || ! judge "$work/rates" > "$work/table" || break
    done
    judge "$work/rates" || failed=1
    rm "$work/rates"
done
exit $failed
