//! Who may use whom: the imports of the sources against the order of ARCHITECTURE.md. Between crates the compiler
//! watches; here are the folders of a crate, and what may not be named by whom.

mod ages;
mod changes;
mod imports;
mod page;
mod tables;

use imports::{ModulePath, Sources, circles, rust_files};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The crates of the workspace: the folder, and those of ours that each depends on.
const CRATE_USES: &[(&str, &[&str])] = &[
    ("crates/dicom", &[]),
    ("crates/ventriform", &["ventriform-dicom"]),
    ("crates/service", &["ventriform"]),
    ("crates/store", &["ventriform-service"]),
    ("crates/http_client", &["ventriform-service"]),
    ("crates/http", &["ventriform", "ventriform-service"]),
    ("crates/python", &["ventriform"]),
    ("crates/evaluation", &["ventriform"]),
    (
        ".",
        &[
            "ventriform",
            "ventriform-http",
            "ventriform-http-client",
            "ventriform-service",
            "ventriform-store",
        ],
    ),
];

/// The crates that one crate may not depend on, whatever it uses today, unless by a feature.
const FORBIDDEN_CRATES: &[(&str, &[&str])] = &[
    ("crates/dicom", SERVICE_CRATES),
    ("crates/ventriform", SERVICE_CRATES),
    ("crates/service", INTERFACE_CRATES),
    ("crates/store", &["axum", "hyper", "utoipa"]),
    (
        "crates/http_client",
        &["axum", "utoipa", "sqlx", "object_store"],
    ),
    ("crates/http", &["reqwest", "sqlx", "object_store"]),
];

/// Crates that serve, send or store, each behind a trait of the service or above it: the service has none of them, by
/// any of its dependencies either.
const INTERFACE_CRATES: &[&str] = &["axum", "hyper", "reqwest", "utoipa", "sqlx", "object_store"];

/// The rooms of the crate for DICOM.
const DICOM_ROOMS: &[&str] = &[
    "text",
    "values",
    "characters",
    "codec",
    "write",
    "read",
    "report",
];

/// The rooms of the library, in reading order: a file uses its own room, and those that stand above it. A wing is
/// the folder of some rooms; a wing's name alone is the room of its other files.
const LIBRARY_ROOMS: &[&str] = &[
    "base/text",
    "base/geometry",
    "base/progress",
    "base/numeric",
    "mesh",
    "mesh/files",
    "mesh/decimate",
    "image/grid",
    "image/draw",
    "image/reconstruct",
    "image/volume",
    "image/locate",
    "surface",
    "surface/retile",
    "surface/optimise",
    "heart/model",
    "heart/deform",
    "heart/judge",
    "heart/fit",
    "heart/polar",
    "heart/views",
    "heart/beat",
    "heart/normals",
    "heart/comparison",
    "heart/serial",
    "heart/reader",
    "parameters",
    "results/figures",
    "results/report",
    "results/export",
    "runs/pipeline",
    "runs/segmentation",
    "runs/gated",
    "runs/rest_stress",
    "runs/serial",
    "runs/reading",
    "runs/evaluate",
    "runs/objects",
    "runs/examples",
    "runs/advice",
    "front",
];

/// The same for the service.
const SERVICE_ROOMS: &[&str] = &[
    "base/records",
    "base/error",
    "base/dicom_tags",
    "base/client",
    "base/pem",
    "base/http_client",
    "base/memory",
    "callers",
    "items",
    "jobs",
    "network/listen",
    "network/hooks",
    "network/archive",
    "network/intake",
    "network/worklist",
    "config/stores",
    "config",
    "limits/reservations",
    "limits/quotas",
    "limits/places",
    "limits/decoding",
    "telemetry",
    "work",
    "use_cases/service",
    "use_cases/keys",
    "use_cases/webhooks",
    "use_cases/workitems",
    "use_cases/operation",
    "use_cases/reading",
    "use_cases/volumes",
    "use_cases/results",
    "use_cases/erasures",
    "use_cases/scans",
    "use_cases/series",
    "use_cases/filing",
    "use_cases/uploads",
    "use_cases/library",
    "use_cases/readings",
    "use_cases/pairs",
    "use_cases/rules",
    "use_cases/procedures",
    "run/background",
    "run/start",
];

/// Crates of the service and the command line: the library knows no network, no database, no runtime,
/// no terminal.
const SERVICE_CRATES: &[&str] = &[
    "axum",
    "hyper",
    "hyper_util",
    "tokio",
    "tokio_util",
    "tower",
    "tower_http",
    "sqlx",
    "object_store",
    "utoipa",
    "utoipa_axum",
    "include_dir",
    "reqwest",
    "clap",
    "indicatif",
    "tracing",
    "tracing_subscriber",
    "uuid",
    "time",
    "futures",
    "bytes",
    "rustix",
    "rustls",
    "tokio_rustls",
    "socket2",
    "x509_parser",
];

/// Standard-library facilities that would make a result depend on more than its input.
const IMPURE_NAMES: &[&str] = &["std::time", "std::env", "std::net", "HashMap", "HashSet"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The sources of the crate in `folder`.
fn src(folder: &str) -> PathBuf {
    root().join(folder).join("src")
}

/// The place of a file's room in the list; `None` for a crate's root and the page of a wing that lists its rooms.
fn room_of(file: &ModulePath, rooms: &[&str]) -> Option<usize> {
    let path = file.join("/");
    let holds = |room: &str| {
        let rest = path.strip_prefix(room);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let found = rooms.iter().enumerate().filter(|(_, room)| holds(room));
    let longest = found.max_by_key(|(_, room)| room.len());
    longest.map(|(at, _)| at)
}

#[test]
fn no_room_uses_one_that_stands_below_it() {
    let mut wrong = Vec::new();
    for (folder, rooms) in [
        ("crates/dicom", DICOM_ROOMS),
        ("crates/ventriform", LIBRARY_ROOMS),
        ("crates/service", SERVICE_ROOMS),
    ] {
        let mut seen = BTreeSet::new();
        for (file, others) in Sources::read(&src(folder)).arrows() {
            let Some(room) = room_of(&file, rooms) else {
                let lists_rooms = src(folder).join(file.join("/")).is_dir();
                if !lists_rooms {
                    wrong.push(format!("{folder}: `{}` is in no room", file.join("/")));
                }
                continue;
            };
            seen.insert(room);
            for other in others {
                if room_of(&other, rooms).is_some_and(|other| other > room) {
                    let (file, other) = (file.join("/"), other.join("/"));
                    wrong.push(format!(
                        "{folder}: `{file}` uses `{other}`, which stands below it"
                    ));
                }
            }
        }
        let empty = (0..rooms.len()).filter(|room| !seen.contains(room));
        wrong.extend(empty.map(|room| format!("{folder}: no file is in `{}`", rooms[room])));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let mut told = Vec::new();
    for (folder, _) in CRATE_USES {
        for circle in circles(&Sources::read(&src(folder)).arrows()) {
            let files: Vec<String> = circle.iter().map(|m: &ModulePath| m.join("::")).collect();
            told.push(format!("{folder}: {}", files.join(", ")));
        }
    }
    assert!(told.is_empty(), "{}", told.join("\n"));
}

#[test]
fn no_sources_of_the_page_use_each_other_in_a_circle() {
    let arrows = page::arrows(&root().join("web/src"));
    assert!(arrows.values().map(BTreeSet::len).sum::<usize>() > 200);
    assert_eq!(circles(&arrows), Vec::<Vec<ModulePath>>::new());
}

/// The names under `[dependencies]` of the crate in `folder`, for every platform, without those of features.
fn dependencies(folder: &str) -> BTreeSet<String> {
    let manifest = fs::read_to_string(root().join(folder).join("Cargo.toml")).expect("a manifest");
    let mut names = BTreeSet::new();
    let mut inside = false;
    for line in manifest.lines() {
        if line.starts_with('[') {
            inside = line.ends_with("dependencies]")
                && !line.contains("dev-")
                && !line.contains("workspace");
        } else if inside
            && !line.starts_with('#')
            && !line.contains("optional = true")
            && let Some((name, _)) = line.split_once(['.', ' ', '='])
        {
            names.insert(name.to_owned());
        }
    }
    assert!(!names.is_empty(), "{folder} depends on nothing");
    names
}

#[test]
fn a_crate_depends_on_the_crates_below_it_alone() {
    for (folder, ours) in CRATE_USES {
        let found = dependencies(folder);
        let found: BTreeSet<&str> = found
            .iter()
            .map(String::as_str)
            .filter(|name| name.starts_with("ventriform"))
            .collect();
        assert_eq!(found, ours.iter().copied().collect(), "{folder}");
    }
    for (folder, forbidden) in FORBIDDEN_CRATES {
        let found = dependencies(folder);
        for name in *forbidden {
            let name = name.replace('_', "-");
            assert!(!found.contains(&name), "{folder} depends on {name}");
            assert!(
                !found.contains(&name.replace('-', "_")),
                "{folder} depends on {name}"
            );
        }
    }
}

/// The crates of a lock file by name, each with the names of those it depends on. Versions are left out: all versions of
/// a crate count as one.
fn locked_crates(lock: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut crates: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut current = String::new();
    for line in lock.lines() {
        if let Some(name) = line.strip_prefix("name = ") {
            current = name.trim_matches('"').to_owned();
            crates.entry(current.clone()).or_default();
        } else if let Some(named) = line.strip_prefix(" \"") {
            // `name`, or `name version` where there are several.
            let name = named.split([' ', '"']).next().unwrap_or_default();
            let uses = crates.entry(current.clone()).or_default();
            uses.insert(name.to_owned());
        }
    }
    crates
}

/// All crates that the crate in `folder` is built with: those of its manifest, those of the manifests of our crates among
/// these, those that the others have in the lock file, and so on. That is at least what `cargo tree --edges normal` names,
/// but for optional dependencies of ours: a lock file has the dependencies of every platform, and of the features that
/// any crate of the workspace asks for.
fn all_dependencies(folder: &str) -> BTreeSet<String> {
    let lock = fs::read_to_string(root().join("Cargo.lock")).expect("a lock file");
    let mut crates = locked_crates(&lock);
    for (folder, _) in CRATE_USES {
        crates.insert(package_name(folder), dependencies(folder));
    }
    let mut found = BTreeSet::new();
    let mut next: Vec<String> = dependencies(folder).into_iter().collect();
    while let Some(name) = next.pop() {
        let uses = crates.get(&name);
        let uses = uses.unwrap_or_else(|| panic!("{name} is not in the lock file"));
        if found.insert(name) {
            next.extend(uses.iter().cloned());
        }
    }
    found
}

/// The name of the package in `folder`.
fn package_name(folder: &str) -> String {
    let manifest = fs::read_to_string(root().join(folder).join("Cargo.toml")).expect("a manifest");
    let package = manifest.split("[package]\n").nth(1).expect("a package");
    let mut lines = package.lines();
    let name = lines.find_map(|line| line.strip_prefix("name = "));
    name.expect("a name").trim_matches('"').to_owned()
}

#[test]
fn the_service_is_built_without_what_serves_sends_and_stores() {
    let found = all_dependencies("crates/service");
    for name in INTERFACE_CRATES {
        assert!(!found.contains(*name), "the service is built with {name}");
    }
    // The lock file names what the others are built with.
    let sending = all_dependencies("crates/http_client");
    assert!(sending.contains("reqwest") && sending.contains("hyper"));
    assert!(all_dependencies("crates/store").contains("sqlx"));
}

#[test]
fn the_library_knows_no_clock_and_no_environment() {
    let mut violations = Vec::new();
    let sources = ["crates/dicom", "crates/ventriform"].map(src);
    for path in sources.iter().flat_map(|folder| rust_files(folder)) {
        let text = fs::read_to_string(&path).expect("a source file");
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or("");
        for line in code.lines().map(str::trim).filter(|l| !l.starts_with("//")) {
            for name in IMPURE_NAMES {
                let at_word = line.find(name).is_some_and(|at| {
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
                });
                if at_word {
                    violations.push(format!("{}: {line}", path.display()));
                }
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn every_module_opens_with_its_method() {
    let folders = CRATE_USES.iter().map(|(folder, _)| src(folder));
    for path in folders.flat_map(|folder| rust_files(&folder)) {
        let text = fs::read_to_string(&path).expect("a source file");
        assert!(
            text.starts_with("//!"),
            "{} has no module page",
            path.display()
        );
        assert!(!text.contains("STUB"), "{} is a stub", path.display());
    }
}
