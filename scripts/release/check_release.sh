#!/usr/bin/env bash
# Installs what scripts/release.sh made in a bare Debian and tries it there.
#
#   scripts/release/check_release.sh [SUITE [ARCHITECTURE]]      trixie and this machine's unless given
#
# Needs root and Debian's packages, of which mmdebstrap makes a chroot; for another architecture qemu runs what is in
# it. Checked: checksums; the Debian package installs, its program makes and measures a model, its user and folders
# exist, its unit is well formed, and it can be removed; the archive's program runs; the wheel installs into a fresh
# environment with NumPy alone and segments a scan, and has its bill of materials and its licence texts; the library and
# the program need no newer glibc than 2.17; the image's service makes a model as the image's user.
#
# The image, which is for amd64, is tried by scripts/release/check_container.sh where docker answers (IN_ENGINE: see
# there). Elsewhere buildah unpacks it and runs its program in a chroot, with the image's user and environment; its
# health check is then run by this script.
set -euo pipefail
cd "$(dirname "$0")/../.."
suite=${1:-trixie}
architecture=${2:-$(dpkg --print-architecture)}
case $architecture in
  amd64) machine=x86_64 ;;
  arm64) machine=aarch64 ;;
  *) echo "releases are for amd64 and arm64, not for $architecture"; exit 2 ;;
esac
dist=$PWD/dist
[ -f "$dist/SHA256SUMS" ] || { echo "run scripts/release.sh first"; exit 1; }
(cd "$dist" && sha256sum --quiet -c SHA256SUMS)
command -v mmdebstrap >/dev/null || { apt-get update -qq && apt-get install -y -qq --no-install-recommends mmdebstrap; }
if [ "$architecture" != "$(dpkg --print-architecture)" ]; then
  # mmdebstrap asks it whether programs of that architecture run; it is among the packages that are only recommended.
  command -v arch-test >/dev/null || { apt-get update -qq && apt-get install -y -qq --no-install-recommends arch-test; }
  [ -e /proc/sys/fs/binfmt_misc/register ] || mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
  if [ ! -e "/proc/sys/fs/binfmt_misc/qemu-$machine" ]; then
    apt-get update -qq && apt-get install -y -qq --no-install-recommends qemu-user-static binfmt-support
    update-binfmts --enable "qemu-$machine"
  fi
fi

out=$(mktemp -d)
service=
clean() {
  if [ -n "$service" ]; then
    kill "$service" || true
    wait "$service" || true
  fi
  umount "$out/root/proc" 2>/dev/null || true
  rm -rf "$out"
}
trap clean EXIT
mmdebstrap --quiet --variant=minbase --architectures="$architecture" --include=python3-venv,python3-pip,adduser,procps,systemd "$suite" "$out/root"
mount -t proc proc "$out/root/proc"
# NumPy comes from this machine's index, so that nothing inside needs the network.
python=$(chroot "$out/root" python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')
python3 -m pip download -q --no-deps --only-binary :all: --python-version "$python" \
  --platform "manylinux_2_28_$machine" --platform "manylinux_2_27_$machine" --platform "manylinux2014_$machine" --dest "$out/root/numpy" numpy
mkdir "$out/root/dist"
cp "$dist"/*"_$architecture.deb" "$dist"/*"-$machine-"*.tar.gz "$dist"/*"_$machine.whl" "$out/root/dist"

cat >"$out/root/try.sh" <<'TRY'
set -euo pipefail
cd "$(mktemp -d)"
dpkg -i /dist/ventriform_*.deb
ventriform phantom -o phantom --size 64 --spacing 6.4
ventriform generate phantom/spect.nii.gz -o lv.glb
ventriform segment phantom/spect.nii.gz --model auto -o out
ventriform measure out/mask.nii.gz phantom/lv_truth.nii.gz
getent passwd ventriform
[ "$(stat -c '%U %a' /var/lib/ventriform)" = 'ventriform 750' ]
systemd-analyze verify /lib/systemd/system/ventriform.service
zcat /usr/share/man/man1/ventriform-segment.1.gz | head -n 3
bash -n /usr/share/bash-completion/completions/ventriform
dpkg -r ventriform
[ ! -e /usr/bin/ventriform ]

tar -xzf /dist/ventriform-*.tar.gz
./ventriform-*/ventriform generate phantom/spect.nii.gz -o again.glb
cmp lv.glb again.glb

python3 -m venv venv
venv/bin/pip install -q --no-index --find-links /numpy /dist/ventriform-*.whl
venv/bin/python - <<'PYTHON'
import pathlib
import ventriform as vf
fit = vf.segment("phantom/spect.nii.gz")
assert fit.files["mask.nii.gz"] == pathlib.Path("out/mask.nii.gz").read_bytes()
assert vf.measure(fit, "phantom/lv_truth.nii.gz").jaccard > 0.6
print(fit)
PYTHON
TRY
# Without the settings of this machine, such as those of pip.
chroot "$out/root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 bash /try.sh

python3 -m zipfile -e "$dist"/ventriform-*"_$machine.whl" "$out/wheel"
cmp "$dist/ventriform-python.cdx.json" "$out"/wheel/ventriform-*.dist-info/sboms/ventriform-python.cdx.json
grep -q '^nalgebra ' "$out"/wheel/ventriform-*.dist-info/licenses/LICENSE-THIRD-PARTY
tar -xzf "$dist"/ventriform-*"-$machine-unknown-linux-gnu.tar.gz" -C "$out" --strip-components 1
for file in "$out/wheel/ventriform/_native.abi3.so" "$out/ventriform"; do
  newest=$(readelf --version-info --wide "$file" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
  echo "$(basename "$file") needs $newest"
  [ "$(printf '%s\n' "$newest" GLIBC_2.17 | sort -V | tail -n 1)" = GLIBC_2.17 ]
done

if [ "$architecture" != amd64 ]; then
  echo "ok: packages for $architecture installed"
  exit
fi
if docker version >/dev/null 2>&1; then
  scripts/release/check_container.sh "$dist"/ventriform-*.image.tar.gz
  exit
fi
command -v buildah >/dev/null ||
  { apt-get update -qq && apt-get install -y -qq --no-install-recommends buildah golang-github-containers-common netavark; }
buildah=(buildah --root "$out/storage" --runroot "$out/run" --storage-driver vfs)
gunzip -c "$dist"/ventriform-*.image.tar.gz >"$out/image.tar"
container=$("${buildah[@]}" from "docker-archive:$out/image.tar" 2>"$out/log") || { cat "$out/log"; exit 1; }
inside=("${buildah[@]}" run --isolation chroot)
# What the image says of itself, in the words of its configuration: entry point and command, health check, user.
said=$("${buildah[@]}" inspect --format '{{with .Docker.Config}}{{.Entrypoint}} {{.Cmd}} {{.Healthcheck.Test}} {{.User}}{{end}}' "$container")
echo "the image: $said"
[ "$said" = '[ventriform] [serve] [CMD ventriform healthcheck] 10001:10001' ]
# shellcheck disable=SC2016 # the image's shell expands it
"${inside[@]}" "$container" -- sh -euc '[ "$(id -u):$(id -g)" = 10001:10001 ] && ! touch /usr/local/bin/x 2>/dev/null && touch /data/x && rm /data/x'
# buildah leaves the network as it is, so the port is one that is free here; loopback needs no key.
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
"${inside[@]}" --env "VENTRIFORM_LISTEN=127.0.0.1:$port" "$container" -- ventriform serve >"$out/log" 2>&1 &
service=$!
for _ in $(seq 60); do
  if "${inside[@]}" --env "VENTRIFORM_LISTEN=127.0.0.1:$port" "$container" -- ventriform healthcheck 2>/dev/null; then healthy=yes; break; fi
  sleep 0.5
done
[ -n "${healthy:-}" ] || { cat "$out/log"; exit 1; }
"${inside[@]}" "$container" -- ventriform phantom -o /data/phantom --size 64 --spacing 6.4
"${inside[@]}" "$container" -- cat /data/phantom/spect.nii.gz >"$out/spect.nii.gz"
curl -fsS --data-binary @"$out/spect.nii.gz" -H 'Prefer: wait=60' \
  -H 'Accept: model/gltf-binary' "http://127.0.0.1:$port/v1/models?points=150" -o "$out/lv.glb"
[ "$(head -c 4 "$out/lv.glb")" = glTF ]
echo "ok: packages installed, image unpacked, its service made a model"
