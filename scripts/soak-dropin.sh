#!/usr/bin/env bash
# A million scenes, one after the other, on our library, in the version of Debian's Embree that is installed (4 where both are): memory must stay flat. And the tests
# of the C interface, which scripts/test-dropin.sh has compiled, under valgrind.
set -euo pipefail
cd "$(dirname "$0")/.."

version=3
define=()
if [[ -e /usr/include/embree4/rtcore.h ]]; then
    version=4
    define=(-DEMBREE4)
fi
g++ -O2 -std=c++17 "${define[@]}" ffi/rtc/tests/soak.cpp -o target/dropin/soak "-lembree$version"
export LD_LIBRARY_PATH=$PWD/target/dropin
target/dropin/soak "${CYCLES:-1000000}"
valgrind --quiet --child-silent-after-fork=yes --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite --error-exitcode=9 target/dropin/conformance$version
