"""Runs a sample of mutants in one build; called by mutants.sh, which says what it does.

usage: mutants.py CLEAN TREE RESULTS [--size N] [--offset N] [--all] [--only REGEX] [--fast SECONDS]

CLEAN and TREE are clones at one commit. The mutants are listed in the first and made in the second, where files
are written only if they change, so that what is built stays built.

cargo-mutants lists the mutants. Each mutated body is put beside the original one in its function,
behind a switch that an environment variable turns on when a test runs: one build serves all mutants.
Constants, `const fn` and functions that return `impl Trait` cannot be switched; each takes its own build.

Every test is run once without mutants, noting its time and the mutated functions that it enters. A mutant
is then tested by what enters its function: tests of its own folder first, of these the quickest, in
batches; the first batch that fails ends its turn. A mutant in a function that no test enters is missed.
The tests of the four folders judge first, then the library's other tests judge what is left, then the domain tests,
then those of the commands.

The order of the mutants is that of a hash of their names, so [offset, offset + size) is a random sample, and
samples that do not overlap as numbers share no mutant.
"""

import argparse
import collections
import hashlib
import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

# Name, and the files that belong to it.
GROUPS = [
    ("optimise", "crates/ventriform/src/surface/optimise/**"),
    ("retile", "crates/ventriform/src/surface/retile/**"),
    ("deform", "crates/ventriform/src/heart/deform/**"),
    ("agreement", "crates/ventriform/src/image/grid/agreement.rs"),
]
# The tests that judge, one set after the other, each what those before it miss: target and names.
STAGES = [
    (["--package", "ventriform", "--lib"], r"^(optimise|retile|deform|grid::agreement)::"),
    (["--package", "ventriform", "--lib"], r"^(?!(optimise|retile|deform|grid::agreement)::)"),
    (["--package", "ventriform", "--test", "domain"], ""),
    (["--package", "ventriform-program", "--test", "command"], ""),
]
# Building the crate takes longer than its tests: it is optimised less than usual; what it depends on is not rebuilt.
PROFILE = [
    "--config",
    "profile.dev.package.ventriform.opt-level=1",
    "--config",
    "profile.dev.package.ventriform.debug=false",
]
MEMORY = 8 << 30  # A mutant that pushes for ever must not take the machine's.
ACCEPTED = Path("scripts/check/mutants_accepted.txt")

SWITCH = """
//! The switch of mutants (scripts/check/mutants.py).
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

enum Mode { Off, On(usize), Note(std::path::PathBuf) }
static MODE: OnceLock<Mode> = OnceLock::new();
static NOTED: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];

#[inline]
pub(crate) fn on(mutant: usize) -> bool {
    let mode = MODE.get_or_init(|| {
        if let Some(path) = std::env::var_os("MUTANT_NOTE") { return Mode::Note(path.into()); }
        match std::env::var("MUTANT").ok().and_then(|m| m.parse().ok()) {
            Some(m) => Mode::On(m),
            None => Mode::Off,
        }
    });
    match mode { Mode::Off => false, Mode::On(m) => *m == mutant, Mode::Note(path) => note(mutant, path) }
}

#[cold]
fn note(mutant: usize, path: &std::path::Path) -> bool {
    if !NOTED[mutant].load(Ordering::Relaxed) && !NOTED[mutant].swap(true, Ordering::Relaxed) {
        if let Ok(mut file) = std::fs::OpenOptions::new().create(true).append(true).open(path) {
            let _ = file.write_all(format!("{mutant}\\n").as_bytes());
        }
    }
    false
}
"""


def line_starts(text):
    return [0, *(i + 1 for i, c in enumerate(text) if c == "\n")]


class Mutant:
    def __init__(self, group, raw, text, starts):
        self.group, self.file, self.name = group, raw["file"], raw["name"]

        def offsets(span):
            return [starts[span[end]["line"] - 1] + span[end]["column"] - 1 for end in ("start", "end")]

        self.span, self.replacement = offsets(raw["span"]), raw["replacement"]
        function = raw["function"]
        self.function = offsets(function["span"]) if function else None
        change = re.sub(r"^[^ ]+:\d+:\d+: ", "", self.name)
        before = text[text.rfind("\n", 0, self.span[0]) + 1 : self.span[0]]
        after = text[self.span[1] : text.find("\n", self.span[1])]
        line = (before + self.replacement + after).strip()
        # What the mutant is wherever its line has moved to: the change, and the line as changed.
        self.place = f"{self.file}: {change}: {line}"
        signature = text[self.function[0] : self.span[0]] if function else ""
        self.switchable = bool(function) and "impl " not in function["return_type"] and "const fn" not in signature
        self.outcome, self.by, self.seconds, self.id = None, "", 0.0, None


def listed(clean):
    found = []
    for group, files in GROUPS:
        out = subprocess.run(
            ["cargo", "mutants", "--dir", clean, "--file", files, "--list", "--json"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        texts = {}
        for raw in json.loads(out):
            if raw["file"] not in texts:
                text = (clean / raw["file"]).read_text()
                texts[raw["file"]] = text, line_starts(text)
            found.append(Mutant(group, raw, *texts[raw["file"]]))
    # Equal changes of one line get a number each.
    seen = collections.Counter()
    keys = {}
    for m in found:
        keys[m] = hashlib.sha256(f"{m.place}#{seen[m.place]}".encode()).hexdigest()
        seen[m.place] += 1
    return sorted(found, key=keys.get)


def masked(text):
    """The text with comments and literals blanked out, of the same length."""
    token = re.compile(r'//[^\n]*|/\*.*?\*/|r(#*)".*?"\1|"(?:\\.|[^"\\])*"|\'(?:\\[^\n]{1,8}?|[^\'\\\n])\'', re.S)
    return token.sub(lambda m: " " * len(m.group()), text)


def body_start(text, function):
    """The place after the brace that opens the function's body."""
    start, end = function
    code = masked(text[start:end])
    depth = 0
    for i in range(re.search(r"\bfn\b", code).end(), len(code)):
        depth += (code[i] in "([") - (code[i] in ")]")
        if code[i] == "{" and depth == 0:
            return start + i + 1
    raise ValueError(text[start:end])


def switched(text, mutants):
    """The source with these mutants behind their switches."""
    inserted = collections.defaultdict(str)
    for m in mutants:
        start, end = body_start(text, m.function), m.function[1] - 1
        body = text[start : m.span[0]] + m.replacement + " " + text[m.span[1] : end]
        inserted[start] += (
            f"\n/*mutant {m.id}*/ if crate::mutant_switch::on({m.id}) {{ return {{\n{body}\n}}; }} /*end {m.id}*/\n"
        )
    for start in sorted(inserted, reverse=True):
        text = text[:start] + inserted[start] + text[start:]
    return text


class Tree:
    def __init__(self, path, clean):
        self.path, self.clean = path, clean

    def reset(self, but):
        """Restores the sources, except for these files, which are about to be written."""
        changed = subprocess.run(
            ["git", "-C", self.path, "diff", "--name-only", "HEAD"], check=True, capture_output=True, text=True
        ).stdout.split()
        self.write({file: self.original(file) for file in set(changed) - set(but)})

    def write(self, files):
        """Writes what differs, so that cargo builds no more than needed."""
        for file, text in files.items():
            path = self.path / file
            if not path.exists() or path.read_text() != text:
                path.write_text(text)

    def original(self, file):
        return (self.clean / file).read_text()

    def cargo(self, *arguments):
        """The messages of cargo, as it builds."""
        run = subprocess.run(
            ["cargo", *arguments, *PROFILE, "--message-format=json"],
            cwd=self.path,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "CARGO_INCREMENTAL": "1"},
        )
        messages = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
        return run.returncode == 0, messages

    def build(self, stage):
        """The test program, nothing if the tree does not compile; and the errors."""
        fine, messages = self.cargo("test", *stage[0], "--no-run")
        programs = [
            m["executable"]
            for m in messages
            if m["reason"] == "compiler-artifact" and m.get("executable") and m["profile"]["test"]
        ]
        return programs[0] if fine else None, errors(messages)


def errors(messages):
    return [
        m["message"]
        for m in messages
        if m["reason"] == "compiler-message" and m["message"]["level"] == "error" and m["message"]["spans"]
    ]


def instrument(tree, mutants):
    """Puts all switchable mutants into the tree and builds the first tests; mutants that do not compile get their
    outcome. Returns the test program."""
    tree.reset({m.file for m in mutants} | {"crates/ventriform/src/lib.rs"})
    by_file = collections.defaultdict(list)
    for m in mutants:
        by_file[m.file].append(m)
    originals = {file: tree.original(file) for file in by_file}
    library = tree.original("crates/ventriform/src/lib.rs")
    first = re.search(r"^(pub )?mod ", library, re.M).start()
    tree.write(
        {
            "crates/ventriform/src/lib.rs": "#![allow(warnings, unconditional_panic, arithmetic_overflow)]\n"
            + library[:first]
            + "mod mutant_switch;\n"
            + library[first:],
            "crates/ventriform/src/mutant_switch.rs": SWITCH.replace(
                "COUNT", str(max([m.id for m in mutants], default=0) + 1)
            ),
        }
    )
    while True:
        files = {file: switched(originals[file], [m for m in ms if m.outcome is None]) for file, ms in by_file.items()}
        tree.write(files)
        program, failures = tree.build(STAGES[0])
        if program:
            return program
        blocks = {}
        for file, text in files.items():
            for block in re.finditer(r"/\*mutant (\d+)\*/.*?/\*end \1\*/", text, re.S):
                lines = text.count("\n", 0, block.start()) + 1, text.count("\n", 0, block.end()) + 1
                blocks[file, int(block.group(1))] = lines
        guilty = set()
        for error in failures:
            for span in error["spans"]:
                for (file, number), (start, end) in blocks.items():
                    if span["file_name"] == file and start <= span["line_start"] <= end and span["is_primary"]:
                        guilty.add(number)
        if not guilty:
            sys.exit("does not compile:\n" + "\n".join(e["rendered"] for e in failures))
        for m in mutants:
            if m.id in guilty:
                m.outcome = "unviable"


class Test:
    def __init__(self, program, name):
        self.program, self.name = program, name
        self.seconds, self.enters = 0.0, set()


def run(tree, tests, seconds, **environment):
    """Whether tests of one program pass, and which failed; raises TimeoutExpired."""
    process = subprocess.Popen(
        [tests[0].program, "--exact", *(t.name for t in tests)],
        cwd=tree.path,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "CARGO_MANIFEST_DIR": str(tree.path), "RUST_BACKTRACE": "0", **environment},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )
    try:
        output, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    return process.returncode == 0, re.findall(r"^test (\S+) .*FAILED$", output, re.M)


def survey(tree, program, names):
    """All tests of these names that pass without a mutant, with their times and what they enter."""
    out = subprocess.run(
        [program, "--list", "--format", "terse"], cwd=tree.path, check=True, capture_output=True, text=True
    ).stdout
    notes = tree.path / "target-notes"
    good = []
    for name in re.findall(r"^(\S+): test$", out, re.M):
        if not re.search(names, name):
            continue
        test = Test(program, name)
        notes.unlink(missing_ok=True)
        start = time.monotonic()
        passes, _ = run(tree, [test], 1200, MUTANT_NOTE=str(notes))
        test.seconds = time.monotonic() - start
        if notes.exists():
            test.enters = {int(n) for n in notes.read_text().split()}
        if passes:
            good.append(test)
        else:
            print(f"fails without a mutant, left out: {name}", flush=True)
    notes.unlink(missing_ok=True)
    return good


def folder(mutant):
    return "::".join(Path(mutant.file).with_suffix("").parts[1:-1])


def batches(mutant, tests, fast):
    """The tests that may notice the mutant, quickest first, in batches of growing length."""
    own = folder(mutant)
    stage = mutant.file.split("/")[1]

    def rank(test):
        if test.name.startswith(f"{own}::"):
            return test.seconds
        return test.seconds * (2 if stage in test.name or "quality" in test.name else 4)

    batch, length, limit, total = [], 0.0, 1.0, 0.0
    for test in sorted(tests, key=rank):
        total += test.seconds
        if total > fast:
            break
        if batch and length + test.seconds > limit:
            yield batch
            batch, length, limit = [], 0.0, limit * 1.5
        batch.append(test)
        length += test.seconds
    if batch:
        yield batch


def judge(tree, mutant, tests, fast, **environment):
    start = time.monotonic()
    mutant.outcome = "missed"
    for batch in batches(mutant, tests, fast):
        try:
            passes, failed = run(tree, batch, 20 + 6 * sum(t.seconds for t in batch), **environment)
        except subprocess.TimeoutExpired:
            mutant.outcome, mutant.by = "timeout", batch[0].name
            break
        if not passes:
            mutant.outcome, mutant.by = "caught", failed[0] if failed else "ended early"
            break
    mutant.seconds += time.monotonic() - start


def accepted():
    lines = ACCEPTED.read_text().splitlines() if ACCEPTED.exists() else []
    return {line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("clean", type=Path)
    parser.add_argument("tree", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--size", type=int, default=100)
    parser.add_argument("--offset", type=int, default=0)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--fast", type=float, default=float("inf"))
    options = parser.parse_args()
    begin = time.monotonic()
    tree = Tree(options.tree.resolve(), options.clean.resolve())
    everything = listed(tree.clean)
    excused = accepted()
    for place in sorted(excused - {m.place for m in everything}):
        print(f"accepted, but no longer a mutant: {place}")
    if options.only:
        sample = [m for m in everything if re.search(options.only, m.name)]
    elif options.all:
        sample = everything
    else:
        sample = everything[options.offset : options.offset + options.size]
    for number, m in enumerate(sample):
        m.id = number
    print(f"{len(sample)} mutants of {len(everything)}", flush=True)

    options.results.parent.mkdir(parents=True, exist_ok=True)
    with options.results.open("w") as results:

        def record(m):
            if m.outcome == "missed" and m.place in excused:
                m.outcome = "accepted"
            results.write(
                json.dumps(
                    {
                        "group": m.group,
                        "outcome": m.outcome,
                        "name": m.name,
                        "place": m.place,
                        "by": m.by,
                        "seconds": round(m.seconds, 1),
                    }
                )
                + "\n"
            )
            results.flush()
            print(f"{m.outcome:9} {m.seconds:6.1f} s  {m.name}  {m.by}", flush=True)

        # What did not compile is known for the commit.
        commit = subprocess.run(
            ["git", "-C", tree.clean, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
        ).stdout.strip()
        unviable = options.results.with_name(f"unviable-{commit}")
        known = set(unviable.read_text().splitlines()) if unviable.exists() else set()
        for m in sample:
            if m.switchable and m.name in known:
                m.outcome = "unviable"
        program = instrument(tree, [m for m in sample if m.switchable])
        known |= {m.name for m in sample if m.outcome == "unviable"}
        unviable.write_text("".join(f"{name}\n" for name in sorted(known)))
        tests = []
        left = [m for m in sample if m.switchable and m.outcome is None]
        for m in sample:
            if m.outcome == "unviable":
                record(m)
        for stage in STAGES:
            last = stage is STAGES[-1]
            if not left:
                break
            if stage is not STAGES[0]:
                program, _ = tree.build(stage)
            if program is None:
                sys.exit("the tests do not compile with the mutants")
            print(f"built {' '.join(stage[0])} after {time.monotonic() - begin:.0f} s", flush=True)
            tests.append(survey(tree, program, stage[1]))
            print(f"ran {len(tests[-1])} tests after {time.monotonic() - begin:.0f} s", flush=True)
            for m in left:
                judge(tree, m, [t for t in tests[-1] if m.id in t.enters], options.fast, MUTANT=str(m.id))
                if last or m.outcome != "missed":
                    record(m)
            left = [m for m in left if m.outcome == "missed"]
            print(f"{len(left)} left after {time.monotonic() - begin:.0f} s", flush=True)

        for m in sample:
            if not m.switchable:
                alone(tree, m, sample, tests, options.fast)
                record(m)
    report(sample, time.monotonic() - begin)


def alone(tree, mutant, sample, tests, fast):
    """Builds the tree with this mutant only, and judges it by the tests that enter other mutants of its file;
    if there are none, by all."""
    start = time.monotonic()
    tree.reset({mutant.file})
    text = tree.original(mutant.file)
    tree.write({mutant.file: text[: mutant.span[0]] + mutant.replacement + " " + text[mutant.span[1] :]})
    beside = {m.id for m in sample if m.file == mutant.file and m.switchable}
    for number, stage in enumerate(STAGES):
        program, _ = tree.build(stage)
        if program is None:
            mutant.outcome = "unviable"
            break
        known = tests[number] if number < len(tests) else survey(tree, program, stage[1])
        near = [t for t in known if t.enters & beside] or known
        mutant.seconds = time.monotonic() - start
        for test in near:
            test.program = program
        judge(tree, mutant, near, fast)
        if mutant.outcome != "missed":
            break


def report(sample, seconds):
    columns = ["caught", "timeout", "missed", "accepted", "unviable"]
    print("\n" + "".join(f"{c:>11}" for c in ["", *columns, "share"]))
    for group in [*(g for g, _ in GROUPS), "all"]:
        count = collections.Counter(m.outcome for m in sample if group in (m.group, "all"))
        noticed = count["caught"] + count["timeout"]
        counted = noticed + count["missed"] + count["accepted"]
        share = f"{100 * noticed / counted:.0f} %" if counted else "-"
        print(f"{group:>11}" + "".join(f"{count[c]:>11}" for c in columns) + f"{share:>11}")
    print(f"{seconds:.0f} s in all, {seconds / max(len(sample), 1):.1f} s for one")
    missed = [m for m in sample if m.outcome == "missed"]
    if missed:
        print("\nmissed and not accepted:")
        for m in missed:
            print(f"  {m.name}\n    {m.place}")
        sys.exit(1)


if __name__ == "__main__":
    main()
