"""Judges the dependencies by deny.toml, and lists them in a software bill of materials.

    python scripts/release/dependencies.py check             licences, bans and sources
    python scripts/release/dependencies.py program           prints ventriform.cdx.json (scripts/generate.sh writes it)
    python scripts/release/dependencies.py python            prints the bill of the Python package
    python scripts/release/dependencies.py image PACKAGES    prints that of an image; PACKAGES: the file of image.sh

The bill is CycloneDX 1.6. It holds what the program is built of: every crate that the default features need at run
time or at build time on Linux, the C libraries inside of them, and the npm packages inside of the page. That of the
Python package has no page; NumPy, which it needs, is not inside of it. That of an image has the program's and the
Debian packages. None has a date, so that the same Cargo.lock gives the same bytes. Needs
cyclonedx-python-lib[json-validation]; no network beyond what cargo needs to have the crates.

`cargo deny check` judges by the same deny.toml and by the advisories of rustsec.org as well; it needs
cargo-deny and the network.
"""

import json
import pathlib
import re
import subprocess
import sys
import urllib.parse
import uuid

import tomllib
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from license_expression import get_spdx_licensing

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLATFORM = "x86_64-unknown-linux-gnu"

# C libraries inside of crates: the crate, the library, its header, and the line that has its version.
BUNDLED = {
    "libsqlite3-sys": ("sqlite", "sqlite3.h", r'#define SQLITE_VERSION\s+"([\d.]+)"'),
    "libdeflate-sys": ("libdeflate", "libdeflate.h", r'#define LIBDEFLATE_VERSION_STRING\s+"([\d.]+)"'),
    "libmimalloc-sys": ("mimalloc", "mimalloc.h", r"#define MI_MALLOC_VERSION\s+(\d+)"),
}


def metadata(*flags):
    command = ["cargo", "metadata", "--format-version", "1", "--locked", *flags]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)


def judge():
    """What breaks a rule of deny.toml, in words."""
    rules = tomllib.loads((ROOT / "deny.toml").read_text())
    allowed, banned = set(rules["licenses"]["allow"]), {ban["crate"] for ban in rules["bans"]["deny"]}
    sources = {"registry+" + url for url in rules["sources"]["allow-registry"]}
    licensing = get_spdx_licensing()

    def satisfied(node):
        if type(node) is licensing.AND:
            return all(map(satisfied, node.args))
        if type(node) is licensing.OR:
            return any(map(satisfied, node.args))
        return str(node) in allowed

    for package in metadata("--all-features")["packages"]:
        name = f"{package['name']} {package['version']}"
        if package["source"] is None:
            continue
        if not package["license"]:
            yield f"{name} states no licence"
        elif not satisfied(licensing.parse(package["license"].replace("/", " OR "))):
            yield f"{name} has the licence {package['license']}, which deny.toml does not allow"
        if package["name"] in banned:
            yield f"{name} is banned"
        if package["source"] not in sources:
            yield f"{name} comes from {package['source'].split('+')[0]}, which deny.toml does not allow"


def bundled(package):
    """The C library inside of a crate."""
    if package["name"] not in BUNDLED:
        return []
    name, header, pattern = BUNDLED[package["name"]]
    for path in sorted(pathlib.Path(package["manifest_path"]).parent.rglob(header)):
        if found := re.search(pattern, path.read_text(errors="replace")):
            reference = f"{package['name']}/{name}"
            return [{"type": "library", "bom-ref": reference, "name": name, "version": found[1]}]
    raise SystemExit(f"{package['name']}: no version of {name} in {header}")


def debian(packages):
    """The Debian packages of an image, as components. In: lines of name, version, architecture, source and its version.

    Debian's notices of faults name sources, so a source that is called otherwise stands in the purl, as syft writes it.
    """
    suite = re.search(r"^FROM debian:([a-z]+)", (ROOT / "Dockerfile").read_text(), re.M)[1]
    for line in packages.read_text().splitlines():
        name, version, architecture, source, source_version = line.split()
        qualifiers = {"arch": architecture, "distro": suite}
        if (source, source_version) != (name, version):
            qualifiers["upstream"] = source if source_version == version else f"{source}@{source_version}"
        quoted = [urllib.parse.quote(text, safe="") for text in (name, version)]
        purl = f"pkg:deb/debian/{quoted[0]}@{quoted[1]}?{urllib.parse.urlencode(qualifiers)}"
        yield {"type": "library", "bom-ref": purl, "name": name, "version": version, "purl": purl}


def bill(of="program", installed=None):
    """The bill of materials of the program, of the Python package (`python`), or of an image with Debian packages, as
    text."""
    graph = metadata("--filter-platform", PLATFORM)
    packages = {package["id"]: package for package in graph["packages"]}
    nodes = {node["id"]: node for node in graph["resolve"]["nodes"]}
    checksums = {
        (p["name"], p["version"]): p.get("checksum")
        for p in tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    }
    root = graph["resolve"]["root"]
    if of == "python":
        root = next(package["id"] for package in graph["packages"] if package["name"] == "ventriform-python")

    def needs(node):
        return sorted(
            dep["pkg"]
            for dep in nodes[node]["deps"]
            if any(kind["kind"] in (None, "build") for kind in dep["dep_kinds"])
        )

    reached, open_ = {root}, [root]
    while open_:
        for need in needs(open_.pop()):
            if need not in reached:
                reached.add(need)
                open_.append(need)

    def purl(package):
        return f"pkg:cargo/{package['name']}@{package['version']}"

    def component(package, kind):
        entry = {"type": kind, "bom-ref": purl(package), "name": package["name"], "version": package["version"]}
        if package["description"]:
            entry["description"] = " ".join(package["description"].split())
        if checksum := checksums.get((package["name"], package["version"])):
            entry["hashes"] = [{"alg": "SHA-256", "content": checksum}]
        entry["licenses"] = [{"expression": package["license"].replace(" / ", "/").replace("/", " OR ")}]
        entry["purl"] = purl(package)
        if package["repository"]:
            entry["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
        if inside := bundled(package):
            entry["components"] = inside
        return entry

    # What the page is built of, apart from its tools: web/dist holds it.
    locked = json.loads((ROOT / "web/package-lock.json").read_text())["packages"]
    page = [
        {
            "type": "library",
            "bom-ref": f"pkg:npm/{name}@{one['version']}",
            "name": name,
            "version": one["version"],
            "licenses": [{"expression": one["license"]}],
            "purl": f"pkg:npm/{name}@{one['version']}",
        }
        for name, one in ((name, locked[f"node_modules/{name}"]) for name in sorted(locked[""]["dependencies"]))
    ]
    page = [] if of == "python" else page

    libraries = sorted((packages[i] for i in reached - {root}), key=lambda p: (p["name"], p["version"]))
    document = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": component(packages[root], "library" if of == "python" else "application")},
        "components": [component(package, "library") for package in libraries] + page,
        "dependencies": [
            {"ref": purl(packages[i]), "dependsOn": sorted(purl(packages[d]) for d in needs(i))}
            for i in sorted(reached, key=lambda i: purl(packages[i]))
        ],
    }
    subject = document["metadata"]["component"]
    if of == "python":
        wheel = f"pkg:pypi/ventriform@{subject['version']}"
        document = json.loads(json.dumps(document).replace(json.dumps(subject["purl"]), json.dumps(wheel)))
        document["metadata"]["component"]["name"] = "ventriform"
    if of == "image":
        image = f"ventriform:{subject['version']}"
        document["metadata"]["component"] = {
            "type": "container",
            "bom-ref": image,
            "name": "ventriform",
            "version": subject["version"],
            "description": "Image of a container: the program on Debian's essential packages",
        }
        inside = list(debian(installed))
        document["components"] = [subject, *document["components"], *inside]
        document["dependencies"].append(
            {"ref": image, "dependsOn": [subject["bom-ref"], *(one["bom-ref"] for one in inside)]}
        )
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(document, sort_keys=True))
    document["serialNumber"] = f"urn:uuid:{serial}"
    return json.dumps(document, indent=1) + "\n"


def main():
    command, *rest = sys.argv[1:]
    if command == "check":
        faults = list(judge())
        print(*faults, sep="\n")
        print(f"{len(faults)} faults")
        sys.exit(bool(faults))
    text = bill(command, *map(pathlib.Path, rest))
    invalid = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    if invalid:
        sys.exit(f"the bill is not valid: {invalid}")
    print(text, end="")


main()
