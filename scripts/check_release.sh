#!/usr/bin/env bash
# Installs what scripts/release.sh made in a bare Debian and tries it there.
#
#   scripts/check_release.sh [SUITE]      trixie unless given
#
# Needs root and Debian's packages, of which mmdebstrap makes a chroot. Checked: checksums; the Debian package installs, its
# program makes and measures a model, its user and folders exist, its unit is well formed, and it can be removed; the archive's
# program runs; the wheel installs into a fresh environment with NumPy alone and segments a scan; the library needs no newer glibc than 2.17.
set -euo pipefail
cd "$(dirname "$0")/.."
suite=${1:-trixie}
dist=$PWD/dist
[ -f "$dist/SHA256SUMS" ] || { echo "run scripts/release.sh first"; exit 1; }
(cd "$dist" && sha256sum --quiet -c SHA256SUMS)
command -v mmdebstrap >/dev/null || { apt-get update -qq && apt-get install -y -qq --no-install-recommends mmdebstrap; }

out=$(mktemp -d)
trap 'umount "$out/root/proc" 2>/dev/null || true; rm -rf "$out"' EXIT
mmdebstrap --quiet --variant=minbase --include=python3-venv,python3-pip,adduser,procps,systemd "$suite" "$out/root"
mount -t proc proc "$out/root/proc"
# NumPy comes from this machine's index, so that nothing inside needs the network.
python=$(chroot "$out/root" python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')
python3 -m pip download -q --no-deps --only-binary :all: --python-version "$python" --dest "$out/root/numpy" numpy
mkdir "$out/root/dist"
cp "$dist"/* "$out/root/dist"

cat >"$out/root/try.sh" <<'TRY'
set -euo pipefail
cd "$(mktemp -d)"
dpkg -i /dist/ventriform_*_amd64.deb
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

tar -xzf /dist/ventriform-*-x86_64-unknown-linux-gnu.tar.gz
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
chroot "$out/root" bash /try.sh

python3 -m zipfile -e "$dist"/ventriform-*_x86_64.whl "$out/wheel"
newest=$(objdump -T "$out/wheel/ventriform/_native.abi3.so" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
echo "the wheel's library needs $newest"
[ "$(printf '%s\n' "$newest" GLIBC_2.17 | sort -V | tail -n 1)" = GLIBC_2.17 ]
