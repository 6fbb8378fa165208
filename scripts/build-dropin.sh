#!/usr/bin/env bash
# Builds target/dropin/libembree3.so.3 and target/dropin/libembree4.so.4 (RTCRayHit of 96 bytes; of 80 with COMPACT_RAY_HIT=1), and
# holds what they export to what Embree exports.
#
# DROPIN_PROFILE=dev builds slower libraries with every debug assertion, on the core that the tests without default features are compiled with:
# after `make check` nothing but the interface is left to compile, and the Python package, which cargo cannot leave out then.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo=${CARGO:-cargo}
profile=${DROPIN_PROFILE:-foreign}
built=target/$profile
# Beside all that the core is compiled for then, since what depends on a crate decides on its features.
beside=()
if [[ $profile == dev ]]; then
    built=target/debug
    beside=(-p twincast -p twincast-python --lib --test twincast)
fi
if [[ $profile == test ]]; then
    echo "DROPIN_PROFILE=test: the profile of tests is dev" >&2
    exit 2
fi
mkdir -p target/dropin

# One version at a time: the core is compiled once, the interface for each.
build() {
    local version=$1 features=twincast-rtc/$2 name=libembree$1.so.$1
    $cargo build --locked --profile "$profile" -p twincast-rtc "${beside[@]}" --no-default-features --features "$features"
    cp "$built/libtwincast_rtc.so" "target/dropin/$name"
    nm -D --defined-only "target/dropin/$name" | awk '$3 ~ /^rtc/ { print $3 }' | sort >"target/dropin/exported-$version"
    sort "ffi/rtc/symbols-$version.txt" | diff - "target/dropin/exported-$version" || {
        echo "$name: exports other functions than Embree $version does (< missing, > too many)" >&2
        exit 1
    }
    readelf -d "target/dropin/$name" | grep -q "soname: \[$name\]" || {
        echo "$name: has another soname" >&2
        exit 1
    }
    echo "target/dropin/$name: $(wc -l <"ffi/rtc/symbols-$version.txt") functions"
}

build 3 v3
build 4 "v4${COMPACT_RAY_HIT:+,twincast-rtc/compact-ray-hit}"
