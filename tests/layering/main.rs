//! Who may use whom: the imports of the sources against the order of ARCHITECTURE.md. Between crates the compiler
//! watches; here are the folders of a crate, and what may not be named by whom.

mod ages;
mod changes;
mod imports;
mod page;

use imports::{ModulePath, Sources, circles, rust_files};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The crates of the workspace: the folder, and those of ours that each depends on.
const CRATE_USES: &[(&str, &[&str])] = &[
    ("crates/ventriform", &[]),
    ("crates/service", &["ventriform"]),
    ("crates/store", &["ventriform-service"]),
    ("crates/http_client", &["ventriform-service"]),
    ("crates/http", &["ventriform", "ventriform-service"]),
    ("crates/python", &["ventriform"]),
    ("tools", &["ventriform"]),
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

/// Each module of the library and the modules it uses, in reading order: a module uses only what
/// stands above it.
const LIBRARY_USES: &[(&str, &[&str])] = &[
    ("text", &[]),
    ("geometry", &[]),
    ("progress", &[]),
    ("numeric", &["geometry", "progress"]),
    ("mesh", &["geometry", "numeric"]),
    ("mesh_files", &["geometry", "numeric", "mesh", "progress"]),
    ("grid", &["geometry", "numeric", "mesh", "progress"]),
    ("draw", &["geometry", "numeric", "mesh"]),
    (
        "volume",
        &[
            "text",
            "geometry",
            "mesh",
            "mesh_files",
            "progress",
            "grid",
            "draw",
        ],
    ),
    (
        "locate",
        &["geometry", "numeric", "mesh", "progress", "grid"],
    ),
    (
        "surface",
        &["geometry", "numeric", "mesh", "progress", "grid", "locate"],
    ),
    ("retile", &["geometry", "mesh", "progress", "surface"]),
    (
        "optimise",
        &[
            "geometry", "numeric", "mesh", "progress", "surface", "retile",
        ],
    ),
    ("decimate", &["geometry", "mesh", "progress"]),
    ("model", &["geometry", "mesh", "progress", "grid", "locate"]),
    (
        "deform",
        &[
            "geometry", "numeric", "mesh", "progress", "grid", "locate", "model",
        ],
    ),
    (
        "judge",
        &[
            "geometry", "numeric", "mesh", "progress", "grid", "locate", "model", "deform",
        ],
    ),
    ("fit", &["progress", "grid", "model", "deform", "judge"]),
    ("polar", &["geometry", "grid", "draw", "locate", "model"]),
    (
        "beat",
        &[
            "geometry", "numeric", "mesh", "progress", "grid", "model", "polar",
        ],
    ),
    (
        "normals",
        &["text", "numeric", "progress", "model", "polar"],
    ),
    ("comparison", &["model", "polar", "normals"]),
    (
        "reader",
        &[
            "text", "geometry", "numeric", "mesh", "progress", "grid", "model", "deform",
        ],
    ),
    (
        "parameters",
        &[
            "geometry",
            "mesh_files",
            "grid",
            "volume",
            "locate",
            "surface",
            "retile",
            "optimise",
            "model",
            "deform",
            "polar",
            "normals",
            "comparison",
        ],
    ),
    (
        "report",
        &[
            "geometry",
            "numeric",
            "mesh",
            "progress",
            "grid",
            "draw",
            "volume",
            "locate",
            "surface",
            "retile",
            "optimise",
            "model",
            "deform",
            "judge",
            "polar",
            "beat",
            "normals",
            "comparison",
            "reader",
            "parameters",
        ],
    ),
    (
        "export",
        &[
            "text",
            "geometry",
            "numeric",
            "mesh",
            "progress",
            "grid",
            "draw",
            "volume",
            "polar",
            "normals",
            "comparison",
            "report",
        ],
    ),
    (
        "pipeline",
        &[
            "mesh",
            "progress",
            "grid",
            "volume",
            "surface",
            "retile",
            "optimise",
            "export",
            "model",
            "report",
            "parameters",
        ],
    ),
    (
        "segmentation",
        &[
            "geometry",
            "mesh",
            "progress",
            "grid",
            "draw",
            "volume",
            "locate",
            "export",
            "model",
            "deform",
            "judge",
            "fit",
            "polar",
            "normals",
            "reader",
            "report",
            "parameters",
            "pipeline",
        ],
    ),
    (
        "gated",
        &[
            "numeric",
            "mesh",
            "progress",
            "grid",
            "volume",
            "locate",
            "export",
            "model",
            "deform",
            "polar",
            "beat",
            "normals",
            "report",
            "parameters",
            "segmentation",
        ],
    ),
    (
        "rest_stress",
        &[
            "geometry",
            "numeric",
            "mesh",
            "progress",
            "grid",
            "draw",
            "volume",
            "locate",
            "export",
            "model",
            "polar",
            "normals",
            "comparison",
            "report",
            "parameters",
            "segmentation",
            "gated",
        ],
    ),
    (
        "evaluate",
        &[
            "text",
            "geometry",
            "mesh",
            "mesh_files",
            "progress",
            "grid",
            "draw",
            "volume",
            "locate",
            "surface",
            "optimise",
            "decimate",
            "export",
            "model",
            "deform",
            "judge",
            "normals",
            "reader",
            "parameters",
            "pipeline",
            "segmentation",
            "gated",
        ],
    ),
    (
        "objects",
        &[
            "progress",
            "volume",
            "export",
            "segmentation",
            "gated",
            "rest_stress",
        ],
    ),
    (
        "advice",
        &[
            "mesh_files",
            "grid",
            "volume",
            "locate",
            "surface",
            "retile",
            "model",
            "deform",
            "beat",
            "normals",
            "comparison",
            "reader",
            "parameters",
            "export",
            "pipeline",
            "segmentation",
            "gated",
            "rest_stress",
            "evaluate",
            "objects",
        ],
    ),
    (
        "front",
        &[
            "progress",
            "grid",
            "volume",
            "parameters",
            "pipeline",
            "segmentation",
        ],
    ),
];

/// The same for the service.
const SERVICE_USES: &[(&str, &[&str])] = &[
    ("records", &[]),
    ("error", &["records"]),
    ("dicom_tags", &[]),
    ("client", &[]),
    ("pem", &[]),
    ("http_client", &[]),
    ("memory", &["records", "error", "client"]),
    ("access", &["records", "http_client", "memory"]),
    ("items", &["records", "error", "memory", "access"]),
    ("jobs", &["records", "items"]),
    ("reservations", &["records", "access"]),
    ("quotas", &["records", "error", "access", "reservations"]),
    ("hooks", &["records", "http_client"]),
    (
        "archive",
        &[
            "records",
            "error",
            "dicom_tags",
            "pem",
            "http_client",
            "items",
            "jobs",
            "access",
            "hooks",
        ],
    ),
    (
        "intake",
        &["records", "error", "client", "memory", "jobs", "access"],
    ),
    ("worklist", &["records", "dicom_tags"]),
    (
        "stores",
        &[
            "records", "access", "hooks", "archive", "intake", "worklist",
        ],
    ),
    (
        "config",
        &["records", "hooks", "archive", "intake", "worklist"],
    ),
    ("places", &["memory"]),
    (
        "decoding",
        &["records", "error", "memory", "config", "places"],
    ),
    (
        "telemetry",
        &[
            "records",
            "http_client",
            "jobs",
            "access",
            "hooks",
            "archive",
            "intake",
            "config",
        ],
    ),
    ("work", &["records", "items", "jobs"]),
    (
        "service",
        &[
            "records",
            "http_client",
            "items",
            "jobs",
            "access",
            "quotas",
            "memory",
            "hooks",
            "archive",
            "intake",
            "worklist",
            "config",
            "decoding",
            "telemetry",
            "work",
        ],
    ),
    ("series", &["records", "error", "work", "service"]),
    (
        "filing",
        &["records", "error", "jobs", "access", "quotas", "service"],
    ),
    ("erasures", &["records", "error", "access", "service"]),
    ("scans", &["records", "error", "work", "service"]),
    (
        "uploads",
        &[
            "records", "error", "items", "access", "quotas", "memory", "work", "service",
        ],
    ),
    (
        "library",
        &[
            "records", "error", "items", "access", "quotas", "decoding", "service",
        ],
    ),
    ("pairs", &["records", "intake", "work"]),
    (
        "rules",
        &[
            "records", "error", "client", "intake", "service", "filing", "uploads", "pairs",
        ],
    ),
    (
        "procedures",
        &[
            "records", "error", "access", "hooks", "archive", "worklist", "service", "series",
            "filing",
        ],
    ),
    (
        "background",
        &[
            "records",
            "error",
            "items",
            "jobs",
            "access",
            "quotas",
            "hooks",
            "archive",
            "intake",
            "work",
            "service",
            "uploads",
            "procedures",
        ],
    ),
    (
        "start",
        &[
            "records",
            "http_client",
            "items",
            "jobs",
            "access",
            "quotas",
            "memory",
            "hooks",
            "archive",
            "intake",
            "stores",
            "config",
            "decoding",
            "telemetry",
            "work",
            "service",
            "background",
        ],
    ),
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

/// The modules of a crate that use each other, by the first word of their paths.
fn used_modules(folder: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut used: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (file, others) in Sources::read(&src(folder)).arrows() {
        let Some(module) = file.first() else {
            continue;
        };
        let entry = used.entry(module.clone()).or_default();
        entry.extend(
            others
                .iter()
                .filter_map(|o| o.first())
                .filter(|o| *o != module)
                .cloned(),
        );
    }
    used
}

#[test]
fn modules_use_exactly_what_the_tables_say() {
    let mut wrong = Vec::new();
    for (folder, uses) in [
        ("crates/ventriform", LIBRARY_USES),
        ("crates/service", SERVICE_USES),
    ] {
        let table: BTreeMap<String, BTreeSet<String>> = uses
            .iter()
            .map(|(module, uses)| {
                let uses = uses.iter().map(|u| u.to_string()).collect();
                (module.to_string(), uses)
            })
            .collect();
        assert_eq!(
            table.len(),
            uses.len(),
            "a module stands in a table twice: {folder}"
        );
        let used = used_modules(folder);
        for module in table.keys().chain(used.keys()).collect::<BTreeSet<_>>() {
            let empty = BTreeSet::new();
            let (said, found) = (
                table.get(module).unwrap_or(&empty),
                used.get(module).unwrap_or(&empty),
            );
            for extra in found.difference(said) {
                wrong.push(format!(
                    "`{module}` uses `{extra}`, which the table does not allow"
                ));
            }
            for unused in said.difference(found) {
                wrong.push(format!(
                    "the table lets `{module}` use `{unused}`; it does not"
                ));
            }
            if !table.contains_key(module) {
                wrong.push(format!("`{module}` is not in the table"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_module_uses_one_that_stands_below_it() {
    for table in [LIBRARY_USES, SERVICE_USES] {
        for (at, (module, uses)) in table.iter().enumerate() {
            for used in *uses {
                assert!(
                    table[..at].iter().any(|(above, _)| above == used),
                    "`{module}` uses `{used}`, which does not stand above it"
                );
            }
        }
    }
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
    let src = src("crates/ventriform");
    for path in rust_files(&src) {
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
