"""Runs the shell commands of the README and the docs.

    python scripts/check/commands.py PROGRAM            all pages
    python scripts/check/commands.py PROGRAM docs/x.md  some; -v tells of every command

In: the fenced blocks (```sh) of every committed page, and scripts/check/commands.toml. A command is run there, or named
in that file with the reason why not, and the file that tries it instead; one that is neither is a fault, and so is an
entry there that no command needs. Of a command of ventriform that is not run, the flags are looked up in `--help`.

A page runs in a folder of its own, its commands in their order, with the files that it names (`files`): simulated
scans, which `ventriform phantom` makes smaller here than it would. `ventriform serve` is started on a free port, and
addresses of the page lead to it; `systemctl stop` and `start` do as they would. JOB, VOLUME, MODEL and so on are the
newest of their kind in that service. Variables hold to the end of their block.

Out: the faults, and a count. Guaranteed: every command that was run ended with 0. What it printed or wrote is not
looked at; the tests do that. Needs nibabel, pydicom and highdicom, and bash and curl. Exits with 1 if there is a fault.
"""

import concurrent.futures
import dataclasses
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

import nibabel
import numpy as np
import pydicom
import tomllib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from lib import gated_phantom
from lib.nm import LPS, nm, projections
from lib.service import reader_profile

ROOT = pathlib.Path(__file__).resolve().parents[2]
LISTED = ROOT / "scripts/check/commands.toml"
FENCE = re.compile(r"^(?P<indent> *)```(?:sh|bash|shell|console)\n(?P<text>.*?)^ *```", re.M | re.S)
# A fence without a language that holds commands: they would escape this check.
UNTOLD = re.compile(
    r"^ *```\n(?: *[$#].*\n)* *(?:\$ )?(?:(?:ventriform|curl|docker|pip|cargo) [-a-z.]|scripts/\S).*$", re.M
)
SETTINGS = re.compile(r"^ *```toml\n(.*?)^ *```", re.M | re.S)
ASSIGNMENT = re.compile(r"[A-Z_]+=")
PLACEHOLDER = re.compile(r"\b(JOB|VOLUME|MODEL|SEGMENTATION|BEAT|COMPARISON|NORMALS|TEMPLATE|READER)\b")
# For words that stand for the result of a certain scan: `made PATH FILE` uploads the file and prints the id of what
# comes of it.
MADE = """made() {
  curl -fsS -o /dev/null -D - --data-binary "@$2" -H 'Prefer: wait=600' "$U/v1/$1" |
    tr -d '\\r' | sed -n 's#^location: .*/##p'
}"""
COMMAND_SECONDS = 600
SMALL = ["--size", "64", "--spacing", "6.4"]


@dataclasses.dataclass
class Command:
    page: str
    block: int
    line: int
    text: str

    @property
    def assigns(self):
        """Whether it only sets variables, which is done before each command of the block that follows."""
        words = shlex.split(self.text, comments=True)
        return all(ASSIGNMENT.match(word) for word in words[words[:1] == ["export"] :])

    @property
    def short(self):
        first = self.text.split("\n")[0]
        return f"{self.page}:{self.line}: {first[:100]}"


def complete(text):
    """Whether a shell would take the lines as whole commands."""
    made = subprocess.run(["bash", "-n"], input=text, capture_output=True, text=True)
    return made.returncode == 0 and not made.stderr and not text.rstrip("\n").endswith("\\")


def commands(page):
    text = (ROOT / page).read_text()
    for block in FENCE.finditer(text):
        start = line = text[: block.start()].count("\n") + 1
        kept = ""
        for raw in block["text"].splitlines():
            line += 1
            kept += raw.removeprefix(block["indent"]) + "\n"
            if not kept.strip() or kept.lstrip().startswith("#"):
                kept = ""
            elif complete(kept):
                yield Command(page, start, line - kept.count("\n") + 1, kept.strip())
                kept = ""
        assert not kept, f"{page}:{line}: the block ends within a command"


class Scans:
    """Simulated scans, made once, that pages ask for by the names of their files."""

    def __init__(self, program, folder):
        self.program, self.folder, self.lock = program, folder, threading.Lock()

    def phantom(self, name, *flags):
        out = self.folder / name
        if not out.exists():
            made = subprocess.run([self.program, "phantom", "-o", out, *SMALL, *flags], capture_output=True, text=True)
            assert made.returncode == 0, made.stderr
        return out

    def dicom(self, path, name, number, gates=1):
        image = nibabel.load(self.phantom(*name) / "spect.nii.gz")
        voxels, affine = np.asarray(image.dataobj, float), image.affine
        if gates > 1:
            voxels, affine = gated_phantom.beat(self.phantom(*name), gates)
        nm(path, voxels.clip(0).round(), LPS @ affine, number, gates)

    def make(self, page, name, folder):
        """Puts the file or folder `name` of a page into its folder; `settings.toml` has the settings that the page
        shows."""
        rest, stress = ("rest", "--seed", "2"), ("stress", "--seed", "2", "--defect", "8:0.7")
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with self.lock:
            if name in ("scan.nii.gz", "rest.nii.gz", "r.nii.gz", "phantom/spect.nii.gz"):
                shutil.copy(self.phantom(*rest) / "spect.nii.gz", path)
            elif name in ("expert.nii.gz", "phantom/lv_truth.nii.gz"):
                shutil.copy(self.phantom(*rest) / "lv_truth.nii.gz", path)
            elif name in ("stress.nii.gz", "s.nii.gz"):
                shutil.copy(self.phantom(*stress) / "spect.nii.gz", path)
            elif name == "fresh.nii.gz":
                shutil.copy(self.phantom("fresh", "--seed", "3") / "spect.nii.gz", path)
            elif name in ("scan.dcm", "rest.dcm"):
                self.dicom(path, rest, 1)
            elif name == "stress.dcm":
                # The same patient in another study.
                self.dicom(path, stress, 2)
                check = pydicom.dcmread(path)
                check.PatientID = "PH1"
                check.save_as(path)
            elif name == "gated.dcm":
                self.dicom(path, rest, 3, gates=8)
            elif name == "raw.dcm":
                image = nibabel.as_closest_canonical(nibabel.load(self.phantom(*rest) / "spect.nii.gz"))
                spacing = float(np.linalg.norm(image.affine[:3, 0]))
                projections(path, image.get_fdata()[::-1, ::-1], spacing, 4)
            elif name == "gated.nii.gz":
                self.gated(path)
            elif found := re.fullmatch(r"(gate|g)(\d+)\.nii\.gz", name):
                whole = self.folder / "gated.nii.gz"
                if not whole.exists():
                    self.gated(whole)
                image = nibabel.load(whole)
                gate = np.asarray(image.dataobj)[..., int(found[2]) - 1]
                nibabel.save(nibabel.Nifti1Image(gate, image.affine), path)
            elif name == "lv.json":
                self.run("generate", self.phantom(*rest) / "spect.nii.gz", "-o", path)
            elif name == "reader.json":
                path.write_text(json.dumps(reader_profile()))
            elif name == "cohort/":
                # Of an evaluation: a template and a patient, with masks.
                for case, flags in (("t1", ["--seed", "5"]), ("p1", ["--seed", "6"])):
                    shutil.copytree(self.phantom(case, *flags), path / case)
                    shutil.copy(path / case / "lv_truth.nii.gz", path / case / "lv_expert_img.nii.gz")
            elif name == "normals.json":
                limits = self.folder / name
                if not limits.exists():
                    self.run("phantom", "-o", self.folder / "people", "--normal", "--cases", "24", "--seed", "5")
                    self.run("normals", "build", self.folder / "people", "-o", limits)
                shutil.copy(limits, path)
            elif name == "settings.toml":
                path.write_text("\n".join(SETTINGS.findall((ROOT / page).read_text())))
            elif name == "Cargo.toml":
                path.write_text('[package]\nname = "mine"\nversion = "0.1.0"\nedition = "2024"\n')
                (folder / "src").mkdir()
                (folder / "src/lib.rs").touch()
                (folder.parent / "ventriform").symlink_to(ROOT)
            else:
                raise ValueError(f"scripts/check/commands.toml asks for a file that this script does not make: {name}")

    def gated(self, path):
        voxels, affine = gated_phantom.beat(self.phantom("rest", "--seed", "2"))
        image = nibabel.Nifti1Image(voxels.astype(np.int16), affine)
        image.header.set_xyzt_units("mm", "sec")
        nibabel.save(image, path)

    def run(self, *words):
        made = subprocess.run([self.program, *map(str, words)], capture_output=True, text=True)
        assert made.returncode == 0, made.stderr


class Page:
    """The folder of a page, what its commands have set, and the service that they have started."""

    def __init__(self, page, settings, program, scans, folder):
        self.settings, self.folder = settings, folder / "here"
        self.folder.mkdir(parents=True)
        self.block, self.prelude, self.service, self.address, self.log = 0, [], None, None, folder / "log"
        for name in settings.get("files", []):
            scans.make(page, name, self.folder)
        programs = folder / "bin"
        programs.mkdir()
        # A scan of 128 voxels a side takes ten times as long as it shows more.
        small = shlex.join(SMALL)
        (programs / "ventriform").write_text(
            f'#!/bin/sh\ncase "$1 $*" in\n*--normal*) ;;\n"phantom "*) set -- "$@" {small} ;;\nesac\n'
            f'exec {shlex.quote(str(program))} "$@"\n'
        )
        (programs / "ventriform").chmod(0o755)
        self.environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}
        for name in [name for name in self.environment if name.startswith(("VENTRIFORM_", "AWS_"))]:
            del self.environment[name]
        self.environment["VENTRIFORM_WAIT_LIMIT"] = f"{COMMAND_SECONDS}s"
        self.environment.update(settings.get("environment", {}))
        for text in settings.get("before", []):
            fault = self.run(Command(page, 0, 0, text))
            assert not fault, f"{page}: {text}: {fault}"

    def run(self, command):
        """What went wrong, or None."""
        text = command.text
        if command.block != self.block:
            self.block, self.prelude = command.block, []
        for old, new in self.settings.get("replace", {}).items():
            text = text.replace(old, new)
        if command.assigns:
            self.prelude.append(text)
            return None
        if re.match(r"systemctl stop ventriform\b", text):
            return self.stop()
        if re.match(r"systemctl start ventriform\b", text):
            return self.start("ventriform serve --data-dir data")
        if re.match(r"ventriform serve\b", text):
            return self.start(text)
        if "$U" in text and not self.address:
            self.start("ventriform serve --data-dir data")
        if self.address:
            text = text.replace("http://127.0.0.1:8080", self.address)
            # Pages ask to wait as long as proxies allow, which a job outlasts on a busy machine.
            text = re.sub(r"\bPrefer: wait=\d+", f"Prefer: wait={COMMAND_SECONDS}", text)
            try:
                text = PLACEHOLDER.sub(lambda found: self.newest(found[1]), text)
            except LookupError as error:
                return str(error)
        prelude = "\n".join([*self.prelude, *([f"U={self.address}", MADE] if self.address else [])])
        try:
            made = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", f"{prelude}\n{text}"],
                cwd=self.folder,
                env=self.environment,
                capture_output=True,
                timeout=COMMAND_SECONDS,
                stdin=subprocess.DEVNULL,
            )
        except subprocess.TimeoutExpired:
            return f"took longer than {COMMAND_SECONDS} s"
        if made.returncode == 0:
            return None
        told = (made.stdout[-500:] + made.stderr[-1500:]).decode(errors="replace").strip()
        return f"exit status {made.returncode}: {told}"

    def start(self, text):
        self.stop()
        text = re.sub(r" --listen \S+", "", re.sub(r"\s+(#|>|2>|&).*", "", text)) + " --listen 127.0.0.1:0"
        with self.log.open("wb") as out:
            words = ["bash", "-euc", "\n".join([*self.prelude, f"exec {text}"])]
            self.service = subprocess.Popen(words, cwd=self.folder, env=self.environment, stdout=out, stderr=out)
        for _ in range(300):
            found = re.search(r"http://127\.0\.0\.1:\d+", self.log.read_text(errors="replace"))
            if found:
                self.address = found[0]
                return None
            if self.service.poll() is not None:
                break
            time.sleep(0.1)
        return f"the service does not start: {self.log.read_text(errors='replace')[-1500:]}"

    def stop(self):
        if self.service:
            self.service.terminate()
            self.service.wait(60)
        self.service = self.address = None

    def get(self, path):
        return json.load(urllib.request.urlopen(f"{self.address}{path}", timeout=60))

    def newest(self, word):
        """The id that a word of a page stands for. What is not there yet is waited for while a job may make it."""
        kind = "normals" if word == "NORMALS" else f"{word.lower()}s"
        for _ in range(10 * COMMAND_SECONDS):
            # Jobs first: one that ends between the two questions has made what the second asks for.
            working = any(self.get(f"/v1/jobs?state={state}&limit=1")["jobs"] for state in ("queued", "running"))
            items = self.get(f"/v1/{kind}?limit=1")[kind]
            if items:
                return items[0]["id"]
            if not working:
                break
            time.sleep(0.1)
        jobs = [(job["state"], job.get("error")) for job in self.get("/v1/jobs?limit=5")["jobs"]]
        raise LookupError(f"there is no {word} in the service, whose last jobs are {jobs}")


def unknown_flags(program, text):
    """Flags of a command of ventriform that its help does not have."""
    unknown = []
    for part in re.findall(
        r"(?:^|[;&|]\s*|ventriform )ventriform ((?:[a-z]+ )+)([^|;&\n]*)", " " + re.sub(r"\s+#.*", "", text)
    ):
        words = part[0].split()
        told = subprocess.run([program, *words, "--help"], capture_output=True, text=True)
        if told.returncode:
            told = subprocess.run([program, words[0], "--help"], capture_output=True, text=True)
        if told.returncode:
            unknown.append(f"no command {part[0]}")
        known = set(re.findall(r"--[a-z0-9-]+", told.stdout))
        unknown += sorted(set(re.findall(r"(?<=\s)--[a-z0-9-]+", " " + part[1])) - known)
    return unknown


class Entry:
    """A command that is not run, and why."""

    def __init__(self, of):
        self.page, self.command, self.reason, self.by = of["page"], of["command"], of["reason"], of.get("by")
        self.used = False

    def names(self, command):
        if command.page == self.page and re.search(self.command, command.text, re.M):
            self.used = True
            return True
        return False


def main():
    verbose = "-v" in sys.argv
    arguments = [a for a in sys.argv[1:] if a != "-v"]
    program, chosen = pathlib.Path(arguments[0]).resolve(), arguments[1:]
    listed = tomllib.loads(LISTED.read_text())
    entries = [Entry(of) for of in listed["not_run"]]
    faults = [
        f"{LISTED.name}: {entry.by} is no file" for entry in entries if entry.by and not (ROOT / entry.by).exists()
    ]
    tracked = subprocess.run(
        ["git", "ls-files", "*.md"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.split()
    faults += [
        f"{page}: a block of commands is not marked as ```sh: {found[0].splitlines()[1].strip()}"
        for page in tracked
        for found in UNTOLD.finditer((ROOT / page).read_text())
    ]
    lock, counts = threading.Lock(), {"run": 0, "listed": 0}

    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        (folder / "scans").mkdir()
        scans = Scans(program, folder / "scans")

        def check(page):
            begun, found, run, left = time.monotonic(), [], 0, 0
            state = None
            try:
                for command in commands(page):
                    if any([entry.names(command) for entry in entries]):
                        left += 1
                        for flag in unknown_flags(program, command.text):
                            found.append(f"{command.short}: {flag} is not in the help")
                        continue
                    state = state or Page(
                        page, listed["pages"].get(page, {}), program, scans, folder / page.replace("/", "-")
                    )
                    at = time.monotonic()
                    fault = state.run(command)
                    run += not command.assigns
                    if verbose:
                        print(f"{time.monotonic() - at:6.2f} s  {command.short}", flush=True)
                    if fault:
                        found.append(
                            f"{command.short}\n    {fault}\n    Correct it, or name it in "
                            f"scripts/check/commands.toml with the reason why it cannot be run."
                        )
            finally:
                if state:
                    state.stop()
            with lock:
                counts["run"] += run
                counts["listed"] += left
                faults.extend(found)
                if run:
                    print(f"{page}: {run} run, {left} listed, {time.monotonic() - begun:.1f} s", flush=True)

        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            # The longest first, so that none is left alone at the end.
            pages = sorted(chosen or tracked, key=lambda page: -len(listed["pages"].get(page, {}).get("files", [])))
            list(pool.map(check, pages))
    if not chosen:
        faults += [f"{LISTED.name}: no command of {e.page} is named by {e.command!r}" for e in entries if not e.used]
    for fault in faults:
        print(fault)
    print(f"{counts['run']} commands run, {counts['listed']} listed with a reason; {len(faults)} faults")
    sys.exit(bool(faults) or not counts["run"])


if __name__ == "__main__":
    main()
