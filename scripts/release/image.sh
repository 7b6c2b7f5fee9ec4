#!/usr/bin/env bash
# Packs a program as an image of a container, by the last stage of the Dockerfile and without an engine.
#
#   SOURCE_DATE_EPOCH=SECONDS scripts/release/image.sh PROGRAM LICENCES OUT
#
# In: a program for x86_64, and the licence texts of what it contains. Out: OUT.image.tar.gz, named ventriform:VERSION,
# which `docker load` and `podman load` read; and OUT.image.packages, the Debian packages in it: name, version,
# architecture, source, version of the source.
#
# mmdebstrap makes the base layer: the essential packages of the suite that the Dockerfile names, without apt,
# translations and manuals. buildah executes the Dockerfile's last stage on it, so that user, environment, volume, port,
# health check and labels are written there alone. The format is Docker's, because the image of an OCI archive cannot
# have a health check.
#
# The same program, Dockerfile and Debian packages give the same bytes, by the same versions of mmdebstrap and buildah.
# Debian's packages are those of the day, with its security updates.
#
# Needs root.
set -euo pipefail
cd "$(dirname "$0")/../.."
program=$(realpath "$1")
licences=$(realpath "$2")
out=$(realpath -m "$3")
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:?the time of all files, in seconds since 1970}
umask 022
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
base=$(sed -n 's/^FROM \(debian:.*\)/\1/p' Dockerfile)
suite=$(sed -n 's/^debian:\([a-z]*\)-slim$/\1/p' <<<"$base")
[ -n "$suite" ] || { echo "the Dockerfile has no line FROM debian:SUITE-slim"; exit 1; }
if ! command -v mmdebstrap >/dev/null || ! command -v buildah >/dev/null; then
  apt-get update -qq && apt-get install -y -qq --no-install-recommends mmdebstrap buildah golang-github-containers-common netavark
fi

work=$(mktemp -d)
# A storage of its own, so that no image of this machine is taken for the base and none is left behind.
buildah=(buildah --root "$work/storage" --runroot "$work/run" --storage-driver vfs)
trap '"${buildah[@]}" rm --all >/dev/null 2>&1 || true; rm -rf "$work"' EXIT

# In the base: an engine puts its own over hostname, hosts and resolv.conf; mmdebstrap would leave those of this
# machine.
cat >"$work/settle.sh" <<'SETTLE'
set -eu
cd "$1"
: >etc/hostname
: >etc/resolv.conf
printf '127.0.0.1 localhost\n::1 localhost\n' >etc/hosts
rm -f etc/apt/sources.list etc/dpkg/dpkg.cfg.d/*
dpkg-query --admindir=var/lib/dpkg -W -f '${Package} ${Version} ${Architecture} ${source:Package} ${source:Version}\n'
SETTLE
mmdebstrap --quiet --variant=essential --architectures=amd64 --skip=output/dev \
  --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/info/*' \
  --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
  --customize-hook="sh '$work/settle.sh' \"\$1\" >'$work/packages'" \
  "$suite" "$work/base.tar"
# The certificate authorities of Debian's package, not those that this machine trusts.
mmdebstrap --quiet --variant=extract --architectures=amd64 --include=ca-certificates "$suite" "$work/authorities"
zcat "$work/authorities/usr/share/doc/ca-certificates/changelog.gz" |
  sed -n '1s/^ca-certificates (\([^)]*\)).*/ca-certificates \1 all ca-certificates \1/p' >>"$work/packages"

# What the Dockerfile copies: from its build stage, and from this folder, with the modes of a checkout under umask 022.
build=$work/build context=$work/context
install -D -m 0755 "$program" "$build/build/target/dist/ventriform"
install -d "$build/etc/ssl/certs" "$context"
(LC_ALL=C && cat "$work"/authorities/usr/share/ca-certificates/mozilla/*.crt) >"$build/etc/ssl/certs/ca-certificates.crt"
install -m 0644 LICENSE-APACHE LICENSE-MIT ventriform.cdx.json "$context"
install -m 0644 "$licences" "$context/THIRD-PARTY"
sed -n '/^FROM debian:/,$p' Dockerfile >"$work/Dockerfile"

container=$("${buildah[@]}" from scratch)
"${buildah[@]}" add --quiet "$container" "$work/base.tar" / >/dev/null
"${buildah[@]}" config --cmd bash --env PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
  --created-by "mmdebstrap --variant=essential $suite" "$container"
settled=(--quiet --format docker --timestamp "$SOURCE_DATE_EPOCH" --identity-label=false)
"${buildah[@]}" commit "${settled[@]}" --rm "$container" "docker.io/library/$base" >/dev/null
# Limits below those of any machine: buildah would raise them, which is not allowed everywhere.
"${buildah[@]}" build "${settled[@]}" --layers=false --isolation chroot --ulimit nofile=1024:1024 --ulimit nproc=1024:1024 \
  --pull-never --build-context "build=$build" \
  --label "org.opencontainers.image.version=$version" --tag "docker.io/library/ventriform:$version" \
  --file "$work/Dockerfile" "$context" >/dev/null
"${buildah[@]}" push --quiet "docker.io/library/ventriform:$version" "docker-archive:$work/image.tar:docker.io/library/ventriform:$version"

# buildah gives its containers names by chance and writes them into the image; nothing reads them there.
mkdir "$work/image"
tar -xf "$work/image.tar" -C "$work/image" --no-same-permissions
python3 - "$work/image" <<'PYTHON'
import hashlib, json, pathlib, sys

folder = pathlib.Path(sys.argv[1])
[image] = json.loads((folder / "manifest.json").read_text())
config = json.loads((folder / image["Config"]).read_text())
for by_chance in ("container", "container_config", "parent"):
    config.pop(by_chance, None)
config["config"].pop("Hostname", None)
text = json.dumps(config, sort_keys=True, separators=(",", ":"))
image["Config"] = hashlib.sha256(text.encode()).hexdigest() + ".json"
layers = {layer: (folder / layer).read_bytes() for layer in image["Layers"]}
assert config["rootfs"]["diff_ids"] == ["sha256:" + hashlib.sha256(layer).hexdigest() for layer in layers.values()]
(folder / image["Config"]).write_text(text)
(folder / "manifest.json").write_text(json.dumps([image]))
(folder / "files").write_text("\n".join(["manifest.json", image["Config"], *image["Layers"]]))
PYTHON
# As gzip, which every docker reads; podman 4.3 (Debian 12) reads it unpacked alone.
tar --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner --mode=0644 -C "$work/image" -T "$work/image/files" -cf - |
  gzip -9n >"$out.image.tar.gz"
LC_ALL=C sort "$work/packages" >"$out.image.packages"
