#!/usr/bin/env bash
# Installs Debian packages that are missing: scripts/install-packages.sh [PACKAGE...], by default those in scripts/packages.
set -euo pipefail

packages=("$@")
if [ $# -eq 0 ]; then
    mapfile -t packages < "$(dirname "$0")/packages"
fi

if ! command -v dpkg-query > /dev/null; then
    echo "no dpkg here: install Embree 3.13 or later, OpenImageIO 2.4 or later and libclang by hand;" \
        "the build will say what it does not find" >&2
    exit 0
fi

missing=()
for package in "${packages[@]}"; do
    status=$(dpkg-query --show --showformat '${db:Status-Status}' "$package" 2> /dev/null || true)
    [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo > /dev/null; then
        echo "missing Debian packages; as root, run: apt-get install ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo)
fi

echo "installing ${missing[*]}"
"${as_root[@]}" apt-get update --quiet --quiet
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install --yes --quiet --quiet --no-install-recommends "${missing[@]}"
