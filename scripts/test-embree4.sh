#!/usr/bin/env bash
# Runs the test suite on Debian 13, whose Embree is version 4 and whose OpenImageIO is 2.5.
#
# A Debian 13 root is made once, with debootstrap, in the user's cache folder, and reused. Everything that is mounted
# into it is mounted in a mount namespace of this script's own, so nothing stays mounted however the script ends. The
# source tree is read-only in there; what cargo builds goes to the cache folder.
#
#   TWINCAST_DEBIAN_MIRROR   URL that packages come from; by default the Debian mirror in this machine's apt sources
#   TWINCAST_CACHE           the cache folder; by default $XDG_CACHE_HOME/twincast or ~/.cache/twincast
#
# Arguments go to `cargo test`. Where no mirror can be reached it says that it skipped and exits 0.
set -euo pipefail

script=$(realpath "$0")
source_tree=$(dirname "$(dirname "$script")")
cd "$source_tree"
PATH=$PATH:/usr/sbin:/sbin # chroot and debootstrap, which `su` may leave out
suite=trixie
cache=${TWINCAST_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/twincast}
root=$cache/$suite
target=$cache/target-$suite
cargo_home=${CARGO_HOME:-$HOME/.cargo}

say() { echo "test-embree4: $*"; }
fail() { say "$@" >&2; exit 1; }

# First pass, as the user: what needs the user's own Rust. Then once more, as root, in a mount namespace.
if [ -z "${TWINCAST_IN_NAMESPACE:-}" ]; then
    sysroot=$(rustc --print sysroot) || fail "needs a Rust toolchain"
    [ -x "$sysroot/bin/cargo" ] || fail "the Rust toolchain in $sysroot has no cargo"
    cargo fetch --locked --quiet
    mkdir -p "$cache" "$target"
    as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo > /dev/null || fail "needs root or sudo to make a Debian 13 root"
        as_root=(sudo)
    fi
    exec "${as_root[@]}" env TWINCAST_IN_NAMESPACE=1 TWINCAST_CACHE="$cache" CARGO_HOME="$cargo_home" \
        ${CARGO_INCREMENTAL:+"CARGO_INCREMENTAL=$CARGO_INCREMENTAL"} ${CARGO_TARGET_DIR:+"CARGO_TARGET_DIR=$CARGO_TARGET_DIR"} \
        TWINCAST_DEBIAN_MIRROR="${TWINCAST_DEBIAN_MIRROR:-}" SYSROOT="$sysroot" OWNER="$(id -u):$(id -g)" \
        unshare --mount --propagation private "$script" "$@"
fi

# The user's mirror and whatever apt settings it takes to reach it.
apt_settings() {
    apt-config dump | grep -E '^Acquire::(https?::(Proxy|CAInfo|Verify)|Check-)' || true
}

mirror() {
    if [ -n "${TWINCAST_DEBIAN_MIRROR:-}" ]; then
        echo "$TWINCAST_DEBIAN_MIRROR"
        return
    fi
    # shellcheck disable=SC2016  # apt's own placeholder
    apt-get indextargets --format '$(REPO_URI)' 2> /dev/null | grep -E '/debian/?$' | sort -u | head -n 1 || true
}

mount_into_root() { # SOURCE PLACE [ro]
    mkdir -p "$root$2"
    mount --bind "$1" "$root$2"
    [ "${3:-}" != ro ] || mount -o remount,bind,ro "$root$2"
}

make_root() {
    command -v apt-get > /dev/null || fail "needs apt-get: it runs on Debian and its kin only"
    local from proxy settings
    from=$(mirror)
    [ -n "$from" ] || fail "apt's sources name no Debian mirror: set TWINCAST_DEBIAN_MIRROR to the URL of one"
    if ! /usr/lib/apt/apt-helper -o APT::Sandbox::User=root download-file "${from%/}/dists/$suite/InRelease" "$cache/InRelease" > /dev/null; then
        say "SKIPPED: the Debian mirror $from cannot be reached"
        exit 0
    fi
    rm -f "$cache/InRelease"
    scripts/install-packages.sh debootstrap

    say "making a Debian 13 root in $root from $from"
    rm -rf --one-file-system "$root"
    settings=$(apt_settings)
    eval "$(apt-config shell proxy Acquire::http::Proxy)"
    http_proxy=${proxy:-${http_proxy:-}} debootstrap --variant=minbase "$suite" "$root" "$from" > "$cache/debootstrap.log" 2>&1 ||
        fail "debootstrap failed; the end of $cache/debootstrap.log: $(tail -n 5 "$cache/debootstrap.log")"
    # A link that leads out of the root would make cp write to this machine's own file.
    rm -f "$root/etc/resolv.conf"
    cp -L /etc/resolv.conf "$root/etc/resolv.conf"
    if [ -e /etc/ssl/certs/ca-certificates.crt ]; then
        mkdir -p "$root/etc/ssl/certs"
        cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
    fi
    printf '%s\n' "$settings" > "$root/etc/apt/apt.conf.d/99host"
}

install_in_root() {
    mapfile -t packages < scripts/packages
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive sh -c \
        'apt-get update -qq && apt-get install -qq --no-install-recommends g++ make git "$@" && apt-get clean' \
        sh "${packages[@]}" > "$cache/apt.log" 2>&1 ||
        fail "apt-get failed in the Debian 13 root; the end of $cache/apt.log: $(tail -n 5 "$cache/apt.log")"
}

# The dependencies that tests were compiled with here serve there as well, and so does twincast-core with its tests, which asks for no library of the system.
# Our other packages are left out, and nothing is taken where the C library here is the newer one: what was linked with it would not load. It spares
# minutes and nothing else: where it fails, all is compiled.
take_compiled() {
    local built=${CARGO_TARGET_DIR:-target}/debug part=$target/debug.part
    if [ -e "$target/debug" ] || [ ! -d "$built/deps" ] ||
        ! printf '%s\n' "$(getconf GNU_LIBC_VERSION)" "$(chroot "$root" getconf GNU_LIBC_VERSION)" | sort --version-sort --check=quiet; then
        return 0
    fi
    rm -rf "$part"
    mkdir "$part"
    if (cd "$built" && find .fingerprint build deps \( -name '*twincast*' ! -name '*twincast[-_]core*' -prune \) -o -print0) |
        tar -C "$built" --format=posix --no-recursion --null --files-from=- -cf - | tar -C "$part" -xpf -; then
        say "took compiled dependencies from $built"
        chown "$OWNER" "$part"
        mv "$part" "$target/debug"
    else
        say "took no compiled dependencies from $built"
        rm -rf "$part"
    fi
}

# The stamp holds the list of packages, so that a longer list makes a new root.
stamp=$root/.complete
if ! cmp --quiet "$stamp" scripts/packages; then
    make_root
    mount -t proc proc "$root/proc"
    install_in_root
    cp scripts/packages "$stamp"
else
    mount -t proc proc "$root/proc"
fi

take_compiled

mount --rbind /dev "$root/dev"
mount_into_root "$SYSROOT" "$SYSROOT" ro
mount_into_root "$cargo_home" "$cargo_home"
mount_into_root "$source_tree" /src/twincast ro
mount_into_root "$target" /src/target
if [ -d ../shared ]; then
    mount_into_root "$(cd ../shared && pwd)" /src/shared ro
fi

say "testing with $(chroot "$root" dpkg-query --show --showformat '${Package} ${Version}, ' libembree-dev libopenimageio-dev)in $root"
# As the owner of the tree, so that nothing in cargo's home or in the cache ends up as root's.
exec chroot --userspec="$OWNER" "$root" env -i \
    HOME=/tmp PATH="$SYSROOT/bin:/usr/local/bin:/usr/bin:/bin" CARGO_HOME="$cargo_home" CARGO_TARGET_DIR=/src/target \
    CARGO_NET_OFFLINE=true ${CARGO_INCREMENTAL:+"CARGO_INCREMENTAL=$CARGO_INCREMENTAL"} RUST_BACKTRACE=1 \
    sh -c 'cd /src/twincast && exec cargo test --locked "$@"' sh "$@"
