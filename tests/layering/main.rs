//! Who may use whom: the imports of `src/` against the order of ARCHITECTURE.md.

mod imports;

use imports::{ModulePath, Sources, circles, rust_files};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Each module of the crate and the modules it uses, in reading order: a module uses only what
/// stands above it.
const USES: &[(&str, &[&str])] = &[
    ("text", &[]),
    ("geometry", &[]),
    ("numeric", &["geometry"]),
    ("mesh", &["geometry", "numeric"]),
    ("mesh_files", &["geometry", "mesh"]),
    ("progress", &[]),
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
        &["geometry", "mesh", "progress", "grid", "locate"],
    ),
    ("retile", &["geometry", "mesh", "progress", "surface"]),
    (
        "optimise",
        &[
            "geometry", "numeric", "mesh", "progress", "surface", "retile",
        ],
    ),
    ("decimate", &["geometry", "mesh", "progress"]),
    (
        "export",
        &["text", "geometry", "mesh", "progress", "grid", "volume"],
    ),
    ("model", &["geometry", "mesh", "progress", "grid", "locate"]),
    (
        "deform",
        &[
            "geometry", "numeric", "mesh", "progress", "grid", "locate", "model",
        ],
    ),
    ("polar", &["geometry", "grid", "draw", "locate", "model"]),
    (
        "reader",
        &["geometry", "mesh", "progress", "grid", "model", "deform"],
    ),
    (
        "report",
        &[
            "geometry", "numeric", "mesh", "progress", "draw", "volume", "surface", "retile",
            "optimise",
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
            "numeric",
            "mesh",
            "progress",
            "grid",
            "draw",
            "volume",
            "locate",
            "export",
            "model",
            "deform",
            "polar",
            "reader",
            "report",
            "parameters",
            "pipeline",
        ],
    ),
    (
        "evaluate",
        &[
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
            "reader",
            "parameters",
            "pipeline",
            "segmentation",
        ],
    ),
    ("jobs", &["text", "progress"]),
    ("access", &["text", "jobs"]),
    ("pem", &[]),
    ("hooks", &["jobs"]),
    ("archive", &["jobs", "pem", "hooks"]),
    (
        "intake",
        &["progress", "volume", "export", "jobs", "access"],
    ),
    ("worklist", &["jobs"]),
    (
        "store",
        &["jobs", "access", "hooks", "archive", "intake", "worklist"],
    ),
    (
        "work",
        &[
            "geometry",
            "mesh",
            "mesh_files",
            "progress",
            "grid",
            "volume",
            "locate",
            "surface",
            "retile",
            "export",
            "model",
            "deform",
            "polar",
            "reader",
            "report",
            "parameters",
            "pipeline",
            "segmentation",
            "jobs",
        ],
    ),
    (
        "config",
        &["jobs", "hooks", "archive", "intake", "worklist", "store"],
    ),
    (
        "http",
        &[
            "text",
            "mesh",
            "mesh_files",
            "progress",
            "volume",
            "export",
            "parameters",
            "jobs",
            "access",
            "pem",
            "hooks",
            "intake",
            "worklist",
            "archive",
            "store",
            "work",
            "config",
        ],
    ),
    (
        "cli",
        &[
            "text",
            "mesh",
            "mesh_files",
            "progress",
            "grid",
            "volume",
            "export",
            "deform",
            "reader",
            "report",
            "parameters",
            "pipeline",
            "segmentation",
            "evaluate",
            "jobs",
            "access",
            "store",
            "work",
            "config",
            "http",
        ],
    ),
];

/// Crates that only the service and the command line may name: the domain knows no network,
/// no database, no runtime, no terminal.
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

/// The service: what stands here may name [`SERVICE_CRATES`].
const SERVICE: &[&str] = &[
    "jobs", "access", "pem", "hooks", "archive", "intake", "worklist", "work", "store", "config",
    "http", "cli",
];

/// Standard-library facilities that would make a result depend on more than its input.
const IMPURE: &[&str] = &["std::time", "std::env", "std::net", "HashMap", "HashSet"];

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// The modules of `src/` that use each other, by the first word of their paths.
fn used_modules() -> BTreeMap<String, BTreeSet<String>> {
    let mut used: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (file, others) in Sources::read(&src()).arrows() {
        let Some(module) = file.first().filter(|m| *m != "main") else {
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
fn modules_use_exactly_what_the_table_says() {
    let table: BTreeMap<String, BTreeSet<String>> = USES
        .iter()
        .map(|(module, uses)| {
            (
                module.to_string(),
                uses.iter().map(|u| u.to_string()).collect(),
            )
        })
        .collect();
    assert_eq!(
        table.len(),
        USES.len(),
        "a module stands in the table twice"
    );
    let used = used_modules();
    let mut wrong = Vec::new();
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
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_module_uses_one_that_stands_below_it() {
    for (at, (module, uses)) in USES.iter().enumerate() {
        for used in *uses {
            assert!(
                USES[..at].iter().any(|(above, _)| above == used),
                "`{module}` uses `{used}`, which does not stand above it"
            );
        }
    }
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let found = circles(&Sources::read(&src()).arrows());
    let told: Vec<String> = found
        .iter()
        .map(|circle| {
            circle
                .iter()
                .map(|m: &ModulePath| m.join("::"))
                .collect::<Vec<_>>()
                .join(", ")
        })
        .collect();
    assert!(told.is_empty(), "{}", told.join("\n"));
}

#[test]
fn the_domain_knows_no_service_and_no_clock() {
    let mut violations = Vec::new();
    for path in rust_files(&src()) {
        let inside = path.strip_prefix(src()).expect("a path inside src");
        let first = inside
            .iter()
            .next()
            .map(Path::new)
            .and_then(Path::file_stem);
        let module = first
            .map(|m| m.to_string_lossy().into_owned())
            .unwrap_or_default();
        if SERVICE.contains(&module.as_str()) || module == "lib" || module == "main" {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a source file");
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or("");
        for line in code.lines().map(str::trim).filter(|l| !l.starts_with("//")) {
            let named = SERVICE_CRATES
                .iter()
                .map(|name| format!("{name}::"))
                .chain(IMPURE.iter().map(|name| (*name).to_owned()));
            for name in named {
                let at_word = line.find(&name).is_some_and(|at| {
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
                });
                if at_word {
                    violations.push(format!("{}: {line}", inside.display()));
                }
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn every_module_opens_with_its_method() {
    for path in rust_files(&src()) {
        let text = fs::read_to_string(&path).expect("a source file");
        assert!(
            text.starts_with("//!"),
            "{} has no module page",
            path.display()
        );
        assert!(!text.contains("STUB"), "{} is a stub", path.display());
    }
}
