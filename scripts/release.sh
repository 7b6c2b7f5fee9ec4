#!/usr/bin/env bash
# Builds what is handed out, into dist/: the Python package as a wheel and as sources, the program as tar.gz, as a
# Debian package and as an image of a container, the bill of materials of each, licence texts, and the checksums of all.
#
#   scripts/release.sh              x86_64; also aarch64 where the compiler has that target
#
# The target aarch64 comes from `rustup target add`, or beside Debian's compiler rustc-web from
# libstd-rust-web-dev:arm64. The image is for x86_64; scripts/release/image.sh makes it, which needs root.
#
# First scripts/release/check_semver.sh compares the library's interface with the newest release's.
#
# Programs and wheels run on any Linux with glibc 2.17 or newer: zig, which PyPI has, is compiler and linker. The same
# commit gives the same bytes wherever it lies: paths are mapped, times are the commit's, and archives are sorted. Only
# the image has Debian's packages of the day, which its bill of materials lists, and depends on the version of buildah.
# What was changed since the commit is refused, unless DIRTY=1.
#
# WHEELS, PROGRAM: a folder of wheels and a program to pack instead of building them, to try this script.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
dist=$root/dist
venv=$root/target/test-tools/release
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)

if [ -n "$(git status --porcelain)" ] && [ -z "${DIRTY:-}" ]; then
  echo "there are changes that no commit has; commit them, or set DIRTY=1"
  exit 1
fi
scripts/release/check_semver.sh
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
# The order of file names is that of the locale.
export LC_ALL=C.UTF-8
umask 022

[ -d "$venv" ] || python3 -m venv "$venv"
"$venv/bin/pip" install -q maturin==1.16.0 ziglang==0.17.1 cargo-zigbuild==0.24.1 "$(grep '^cyclonedx' scripts/requirements.txt)"
export PATH=$venv/bin:$PATH
sysroot=$(rustc --print sysroot)
# Also in place of the flags of a developer's own configuration.
export RUSTFLAGS="--remap-path-prefix=$root=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo --remap-path-prefix=$sysroot=rust"
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DIST_STRIP=symbols

targets=(x86_64-unknown-linux-gnu)
if [ -d "$sysroot/lib/rustlib/aarch64-unknown-linux-gnu" ]; then
  targets+=(aarch64-unknown-linux-gnu)
else
  echo "without aarch64: rustup target add aarch64-unknown-linux-gnu"
fi

# archive FOLDER FILE: packs a folder beside it, sorted, with the commit's time and without owners.
archive() {
  tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$(dirname "$1")" \
    -cf - "$(basename "$1")" | gzip -9n >"$2"
}

# accompany FOLDER: what goes with the program: licences and the bill of materials.
accompany() {
  install -m 0644 LICENSE-MIT LICENSE-APACHE README.md CHANGELOG.md ventriform.cdx.json "$1"
  python3 scripts/release/licences.py ventriform-program >"$1/THIRD-PARTY"
}

# helpers PROGRAM FOLDER: completions and manual pages, which the program prints itself.
helpers() {
  mkdir -p "$2/completions" "$2/man"
  "$1" completions bash >"$2/completions/ventriform"
  "$1" completions zsh >"$2/completions/_ventriform"
  "$1" completions fish >"$2/completions/ventriform.fish"
  "$1" man >"$2/man/ventriform.1"
  for command in generate segment beat compare measure calibrate evaluate inspect phantom serve keys doctor backup; do
    "$1" man "$command" >"$2/man/ventriform-$command.1"
  done
}

# debian PROGRAM HELPERS ARCHITECTURE: the Debian package, with a user, folders and a unit of systemd.
debian() {
  local tree=$work/debian-$3
  install -D -m 0755 "$1" "$tree/usr/bin/ventriform"
  install -D -m 0644 "$2/completions/ventriform" "$tree/usr/share/bash-completion/completions/ventriform"
  install -D -m 0644 "$2/completions/_ventriform" "$tree/usr/share/zsh/vendor-completions/_ventriform"
  install -D -m 0644 "$2/completions/ventriform.fish" "$tree/usr/share/fish/vendor_completions.d/ventriform.fish"
  for page in "$2"/man/*.1; do
    install -d "$tree/usr/share/man/man1"
    gzip -9n <"$page" >"$tree/usr/share/man/man1/$(basename "$page").gz"
  done
  install -d "$tree/usr/share/doc/ventriform" "$tree/lib/systemd/system" "$tree/DEBIAN"
  accompany "$tree/usr/share/doc/ventriform"
  {
    echo "Licence of ventriform: MIT or Apache-2.0, at your choice: LICENSE-MIT, LICENSE-APACHE."
    echo "Licences of what it contains: THIRD-PARTY."
  } >"$tree/usr/share/doc/ventriform/copyright"
  sed -e 's#/usr/local/bin/ventriform#/usr/bin/ventriform#' -e '/^#   /d' deploy/systemd/ventriform.service \
    >"$tree/lib/systemd/system/ventriform.service"
  install -D -m 0640 /dev/null "$tree/etc/ventriform/ventriform.toml"
  echo "# Settings of the service: docs/operations.md lists them." >"$tree/etc/ventriform/ventriform.toml"
  echo /etc/ventriform/ventriform.toml >"$tree/DEBIAN/conffiles"
  cat >"$tree/DEBIAN/control" <<CONTROL
Package: ventriform
Version: $version
Architecture: $3
Maintainer: The developers of ventriform <ventriform@localhost>
Installed-Size: $(find "$tree" -printf '%y %s\n' | awk '{ kib += $1 == "f" ? int(($2 + 1023) / 1024) : 1 } END { print kib }')
Depends: libc6 (>= 2.17), adduser, procps
Recommends: ca-certificates
Section: science
Priority: optional
Description: surface models of the left ventricle from cardiac SPECT
 Finds the left ventricle in a scan, fits a model to it and measures it: a command,
 and a service with a page for browsers. The service is installed and not started:
 systemctl enable --now ventriform
CONTROL
  cat >"$tree/DEBIAN/postinst" <<'POSTINST'
#!/bin/sh
set -e
if [ "$1" = configure ]; then
  if ! getent passwd ventriform >/dev/null; then
    adduser --system --group --home /var/lib/ventriform --no-create-home --quiet ventriform
  fi
  install -d -m 0750 -o ventriform -g ventriform /var/lib/ventriform
  chgrp ventriform /etc/ventriform /etc/ventriform/ventriform.toml
  chmod 0750 /etc/ventriform
  chmod 0640 /etc/ventriform/ventriform.toml
  if [ -d /run/systemd/system ]; then systemctl daemon-reload || true; fi
fi
POSTINST
  cat >"$tree/DEBIAN/prerm" <<'PRERM'
#!/bin/sh
set -e
if [ "$1" = remove ] && [ -d /run/systemd/system ]; then systemctl disable --now ventriform || true; fi
PRERM
  # What was measured of patients is not erased with the program; purging says so.
  cat >"$tree/DEBIAN/postrm" <<'POSTRM'
#!/bin/sh
set -e
if [ "$1" = purge ] && [ -d /var/lib/ventriform ]; then echo "ventriform: /var/lib/ventriform was kept; remove it yourself"; fi
POSTRM
  chmod 0755 "$tree/DEBIAN/postinst" "$tree/DEBIAN/prerm" "$tree/DEBIAN/postrm"
  # Several threads compress to other bytes than one.
  dpkg-deb --root-owner-group -Zxz --threads-max=1 --build "$tree" "$dist/ventriform_${version}_$3.deb" >/dev/null
}

work=$(mktemp -d)
third_party=$root/LICENSE-THIRD-PARTY
trap 'rm -rf "$work" "$third_party"' EXIT
rm -rf "$dist"
mkdir "$dist"

# maturin's own bill has the paths of this machine, so pyproject.toml turns it off.
python3 scripts/release/dependencies.py python >"$dist/ventriform-python.cdx.json"
maturin sdist --out "$dist" >"$work/sdist.log" 2>&1 || { cat "$work/sdist.log"; exit 1; }
# The wheel contains the work of others; the sources, above, do not.
python3 scripts/release/licences.py ventriform-python >"$third_party"
for target in "${targets[@]}"; do
  if [ -n "${WHEELS:-}" ]; then
    cp "$WHEELS"/*.whl "$dist"
  else
    maturin build --quiet --locked --profile dist --zig --target "$target" --compatibility manylinux2014 \
      --sbom-include dist/ventriform-python.cdx.json --out "$dist"
  fi
  program=${PROGRAM:-}
  if [ -z "$program" ]; then
    cargo zigbuild --quiet --locked --profile dist --target "$target.2.17" --bin ventriform
    program=$root/target/$target/dist/ventriform
  fi
  # Only a program for this machine can print its own completions; they are the same for all.
  [ -d "$work/helpers" ] || helpers "$program" "$work/helpers"
  name=ventriform-$version-$target
  mkdir "$work/$name"
  install -m 0755 "$program" "$work/$name/ventriform"
  cp -r "$work/helpers/completions" "$work/helpers/man" "$work/$name"
  accompany "$work/$name"
  archive "$work/$name" "$dist/$name.tar.gz"
  case $target in
    x86_64-*)
      debian "$program" "$work/helpers" amd64
      if [ "$(id -u)" = 0 ]; then
        scripts/release/image.sh "$program" "$work/$name/THIRD-PARTY" "$work/ventriform-$version-x86_64"
        mv "$work/ventriform-$version-x86_64.image.tar.gz" "$dist"
        python3 scripts/release/dependencies.py image "$work/ventriform-$version-x86_64.image.packages" >"$dist/ventriform-image.cdx.json"
      else
        echo "without an image: call this as root"
      fi
      ;;
    aarch64-*) debian "$program" "$work/helpers" arm64 ;;
  esac
done
install -m 0644 ventriform.cdx.json "$dist"
(cd "$dist" && sha256sum ./* | sed 's#\./##' >"$work/SHA256SUMS" && mv "$work/SHA256SUMS" .)
ls -l "$dist"
