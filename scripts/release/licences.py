"""Writes the licence texts of all crates that a package is built of, one after the other.

    python scripts/release/licences.py PACKAGE > THIRD-PARTY

Of every crate that PACKAGE (`ventriform-program`, `ventriform-python`) needs at run time on Linux: name, version, the
licence that it states, and the texts that lie beside its sources; crates with the same text share it. Crates that come
without a text are listed at the end. Needs cargo alone.
"""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLATFORM = "x86_64-unknown-linux-gnu"
# Names of files with licences.
NAMES = ("license", "licence", "copying", "unlicense", "notice", "copyright")
# Works of third parties inside a crate whose licence its own file does not name.
INSIDE = {
    "noto-sans-mono-bitmap": "Its glyphs are drawn from the font Noto Sans Mono, copyright The Noto Project Authors, "
    "under the SIL Open Font License "
    "1.1: https://openfontlicense.org"
}
# Licences whose texts are these, whoever holds the copyright.
SHARED = {"Apache-2.0": "LICENSE-APACHE"}


def metadata():
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", PLATFORM]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)


def needed(graph, name):
    """The packages of other people that the package needs, in the order of their names."""
    packages = {package["id"]: package for package in graph["packages"]}
    nodes = {node["id"]: node for node in graph["resolve"]["nodes"]}
    start = next(package["id"] for package in packages.values() if package["name"] == name)
    reached, left = {start}, [start]
    while left:
        for dependency in nodes[left.pop()]["deps"]:
            normal = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if normal and dependency["pkg"] not in reached:
                reached.add(dependency["pkg"])
                left.append(dependency["pkg"])
    foreign = (packages[one] for one in reached if packages[one]["source"])
    return sorted(foreign, key=lambda package: (package["name"], package["version"]))


def texts(package):
    """The licence texts beside the sources."""
    folder = pathlib.Path(package["manifest_path"]).parent
    files = [path for path in folder.iterdir() if path.is_file() and path.name.lower().startswith(NAMES)]
    if package.get("license_file"):
        files.append(folder / package["license_file"])
    return [path.read_text(errors="replace").strip() for path in sorted(set(files))]


def main():
    sections, without = {}, []
    for package in needed(metadata(), sys.argv[1]):
        stated = package["license"] or "see the text"
        found = texts(package)
        found += [INSIDE[package["name"]]] if package["name"] in INSIDE else []
        if not found:
            shared = next((file for licence, file in SHARED.items() if licence in stated), None)
            if shared is None:
                without.append(f"{package['name']} {package['version']} ({stated}), {package['repository']}")
                continue
            found = [(ROOT / shared).read_text().strip()]
        for text in found:
            sections.setdefault(text, []).append(f"{package['name']} {package['version']} ({stated})")
    rule = "=" * 100
    print("ventriform contains the work of others, under the licences that follow.")
    for text, crates in sorted(sections.items(), key=lambda section: section[1]):
        print(f"\n{rule}\n" + "\n".join(crates) + f"\n{rule}\n\n{text}")
    if without:
        print(
            f"\n{rule}\nCrates without a text beside their sources, under the licence that they state:\n"
            + "\n".join(without)
        )


main()
