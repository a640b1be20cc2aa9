#!/usr/bin/env bash
# Builds the image where no container engine is: deploy/build-image.sh [NAME], as root, with buildah.
#
# Base images that cannot be pulled are made under the same names, of Debian's packages (debootstrap) and of the Rust, Node and certificates
# of this machine. Such a build tries the Dockerfile and the program on Debian's libraries, not the published base images.
set -euo pipefail
cd "$(dirname "$0")/.."
export BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
debian=$work/debian

has() { buildah inspect --type image "$1" >/dev/null 2>&1 || buildah pull --quiet "$1" >/dev/null 2>&1; }

# stand_in IMAGE STAGE: an image of the folder that the function named after the stage has filled.
stand_in() {
    echo "$1 cannot be pulled and is made here" >&2
    [ -d "$debian" ] || debootstrap --variant=minbase --include=ca-certificates,gcc,libc6-dev,tzdata bookworm "$debian" >"$work/log" ||
        { tail "$work/log" >&2; return 1; }
    local container root
    container=$(buildah from scratch)
    root=$(buildah mount "$container")
    "$2" "$root"
    cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
    buildah config --env PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin --env CARGO_HOME=/usr/local/cargo \
        --env NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt "$container"
    buildah commit --quiet --rm --format docker --disable-compression "$container" "$1"
}

page() {
    cp -a "$debian/." "$1"
    mkdir -p "$1/usr/local/lib/node_modules"
    cp -L "$(command -v node)" "$1/usr/local/bin/"
    cp -a "$(npm root --global)/npm" "$1/usr/local/lib/node_modules/"
    ln -s ../lib/node_modules/npm/bin/npm-cli.js "$1/usr/local/bin/npm"
}

build() {
    cp -a "$debian/." "$1"
    cp -a "$(rustc --print sysroot)"/{bin,lib} "$1/usr/local/"
}

# Unpacked, not installed: no shell, no package manager.
last() {
    local package
    for package in base-files ca-certificates libc6 libgcc-s1 tzdata; do
        dpkg-deb --extract "$debian/var/cache/apt/archives/${package}"_*.deb "$1"
    done
    echo nonroot:x:65532:65532:nonroot:/home/nonroot:/sbin/nologin >"$1/etc/passwd"
}

version() { sed -n "s/^ARG $1_VERSION=//p" Dockerfile; }
for base in "docker.io/library/node:$(version NODE)-bookworm-slim page" "docker.io/library/rust:$(version RUST)-bookworm build" \
    "$(sed -n 's/^FROM \(.*nonroot\)$/\1/p' Dockerfile) last"; do
    has "${base% *}" || stand_in "${base% *}" "${base#* }"
done

# Docker's format: that of OCI has no health check.
buildah build --format docker --layers=false --pull=never --build-arg CAGER_COMMIT="$(git rev-parse --short=10 HEAD)" --tag "${1:-cager}" .
