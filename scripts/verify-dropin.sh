#!/usr/bin/env bash
# Runs Embree's own tests (embree_verify, Debian package embree-tools) on our libembree3.so.3 and on Embree's, and prints what
# each group scores on either: passed/failed. Fails where a group that must pass whole does not, or where one crashes.
#
#   scripts/verify-dropin.sh [FOLDER [GROUP ...]]     FOLDER: where our library is (default target/dropin)
#
# INTENSITY (default 0.3) is how many rays and sizes are tried; NATIVE=0 leaves Embree's own run out.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(realpath "${1:-target/dropin}")
shift $(($# > 0 ? 1 : 0))
intensity=${INTENSITY:-0.3}

whole="triangle_hit quad_hit inactive_rays watertight_triangles watertight_quads watertight_grids empty_scene user_geometry_id"
some="intersection_filter instancing ray_alignment_test point_query interpolate get_bounds get_linear_bounds buffer_stride
    update build empty_geometry overlapping_primitives new_delete_geometry enable_disable_geometry disable_detach_geometry
    ray_masks sphere_filter_multi_hit_tests"
groups=${*:-$whole $some}

# Passed and failed of a group; "crash" with the exit code where the run did not come to its end.
score() {
    local out code=0
    out=$(cd /tmp && timeout 600 env LD_LIBRARY_PATH="$1" embree_verify --isa avx2 --run "AVX2\.$2.*" --intensity "$intensity" 2>&1) ||
        code=$?
    awk -v code="$code" '
        /Tests passed:/ { passed = $3; seen = 1 }
        /Tests failed:/ { failed = $3 }
        END { if (seen) print passed "/" failed; else print "crash(" code ")" }' <<<"$out"
}

bad=0
printf '%-32s %12s %12s\n' group ours Embree
for group in $groups; do
    ours=$(score "$folder" "$group")
    native=-
    [[ ${NATIVE:-1} == 0 ]] || native=$(score "" "$group")
    verdict=
    if [[ " $whole " == *" $group "* && ! $ours =~ ^[1-9][0-9]*/0$ ]]; then
        verdict='  must pass whole'
        bad=1
    elif [[ $ours == crash* ]]; then
        verdict='  must not crash'
        bad=1
    fi
    printf '%-32s %12s %12s%s\n' "$group" "$ours" "$native" "$verdict"
done
exit $bad
