#!/usr/bin/env bash
# Compiles the tests of the C interface (ffi/rtc/tests/conformance) and runs them on Embree and on our library: they must pass on both.
#
#   scripts/test-dropin.sh [3|4] [FOLDER]     which version (default: that of Debian's Embree that is installed, 4 where both are), and where our library is (default target/dropin)
set -euo pipefail
cd "$(dirname "$0")/.."

installed=3
[[ ! -e /usr/include/embree4/rtcore.h ]] || installed=4
version=${1:-$installed}
folder=$(realpath "${2:-target/dropin}")
program=target/dropin/conformance$version
define=()
[[ $version == 3 ]] || define=(-DEMBREE4)
g++ -O1 -g -std=c++17 -Wall "${define[@]}" ffi/rtc/tests/conformance/*.cpp -o "$program" "-lembree$version" -lpthread

echo "on Embree:"
"$program"
echo "on $folder:"
CONFORMANCE_OURS=1 LD_LIBRARY_PATH=$folder "$program"
