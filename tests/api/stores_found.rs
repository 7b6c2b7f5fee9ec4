//! Commands beside the service find its store as `serve` does, and make none where there is none.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

/// How a command is told where the data folder is.
#[derive(Debug, Clone, Copy)]
enum Told {
    Flag,
    Variable,
    FileOfAVariable,
    FileOfAFlag,
}

const WAYS: [Told; 4] = [
    Told::Flag,
    Told::Variable,
    Told::FileOfAVariable,
    Told::FileOfAFlag,
];

/// The program with those words in `here`, told of `data`.
fn run(here: &Path, words: &[&str], told: Told, data: &Path) -> Output {
    let file = here.join("ventriform.toml");
    std::fs::write(&file, format!("data_dir = {data:?}\n")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_ventriform"));
    command.current_dir(here).args(words);
    match told {
        Told::Flag => command.args([OsStr::new("--data-dir"), data.as_os_str()]),
        Told::Variable => command.env("VENTRIFORM_DATA_DIR", data),
        Told::FileOfAVariable => command.env("VENTRIFORM_CONFIG", &file),
        Told::FileOfAFlag => command.args([OsStr::new("--config"), file.as_os_str()]),
    };
    command.output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The names in a folder; none if it does not exist.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder).map_or_else(
        |_| Vec::new(),
        |entries| {
            let names = entries.map(|entry| entry.unwrap().file_name());
            names.map(|name| name.into_string().unwrap()).collect()
        },
    );
    names.sort();
    names
}

const CREATE: [&str; 6] = ["keys", "create", "--name", "a", "--scope", "read"];
const KEPT: &str = "kept.txt";

#[test]
fn a_command_that_finds_no_store_makes_none() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    std::fs::write(here.join("model.json"), "{}").unwrap();
    let commands: [&[&str]; 9] = [
        &CREATE,
        &["keys", "list"],
        &["keys", "revoke", "0123456789abcdef"],
        &["audit", "verify"],
        &["audit", "print"],
        &["doctor"],
        &["doctor", "--repair"],
        &["backup", "copied"],
        &["templates", "import", "model.json"],
    ];
    for words in commands {
        for told in WAYS {
            let what = format!("{words:?} {told:?}");
            let missing = here.join("missing");
            let other = here.join("other");
            std::fs::create_dir_all(&other).unwrap();
            std::fs::write(other.join(KEPT), "not of a service").unwrap();
            for data in [&missing, &other, &other.join(KEPT)] {
                let refused = run(here, words, told, data);
                let said = said(&refused);
                assert_eq!(refused.status.code(), Some(1), "{what}: {said}");
                assert!(refused.stdout.is_empty(), "{what}: a key, or an answer");
                assert!(said.contains(&*data.to_string_lossy()), "{what}: {said}");
                let origin = match told {
                    Told::Flag => "--data-dir",
                    Told::Variable => "VENTRIFORM_DATA_DIR",
                    _ => "file of --config",
                };
                assert!(said.contains(origin), "{what}: {said}");
                assert!(!said.contains("os error"), "{what}: {said}");
            }
            assert!(!missing.exists(), "{what}");
            assert_eq!(names(&other), [KEPT], "{what}");
            assert!(!here.join("copied").exists(), "{what}");
        }
        // The default, in a folder without one.
        let output = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .current_dir(here)
            .args(words)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{words:?}");
        assert!(said(&output).contains("ventriform-data"), "{words:?}");
        assert!(!here.join("ventriform-data").exists(), "{words:?}");
    }
    // A folder that is empty may be one before the first start, or one that has lost all: only what makes something, or
    // repairs, makes a store there.
    let empty = here.join("empty");
    std::fs::create_dir(&empty).unwrap();
    for words in commands[1..8].iter().filter(|words| words[0] != "doctor") {
        let refused = run(here, words, Told::Flag, &empty);
        assert_eq!(refused.status.code(), Some(1), "{words:?}");
        assert!(names(&empty).is_empty(), "{words:?}");
    }
}

#[test]
fn every_command_finds_the_store_as_serve_does() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let data = here.join("data");
    std::fs::create_dir(&data).unwrap();
    let made = run(here, &CREATE, Told::Variable, &data);
    assert!(made.status.success(), "{}", said(&made));
    let id = said(&made).split(' ').nth(1).unwrap().to_owned();
    for (number, told) in WAYS.into_iter().enumerate() {
        let ok = |words: &[&str]| {
            let output = run(here, words, told, &data);
            assert!(
                output.status.success(),
                "{words:?} {told:?}: {}",
                said(&output)
            );
            String::from_utf8(output.stdout).unwrap()
        };
        assert!(ok(&["keys", "list"]).contains(&id));
        assert!(ok(&["audit", "print"]).contains("AuditEvent"));
        ok(&["audit", "verify"]);
        ok(&["doctor"]);
        let target = format!("copied{number}");
        ok(&["backup", &target]);
        assert!(here.join(target).join("ventriform.db").exists());
        ok(&["keys", "revoke", &id]);
    }
    // Records on a server are copied by its own tools.
    let output = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .current_dir(here)
        .args(["backup", "elsewhere"])
        .env(
            "VENTRIFORM_DATABASE",
            "postgres://a:secret@127.0.0.1:1/none",
        )
        .env("VENTRIFORM_DATA_DIR", &data)
        .output()
        .unwrap();
    let said = said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("VENTRIFORM_DATABASE") && said.contains("pg_"),
        "{said}"
    );
    assert!(!said.contains("secret"), "{said}");
}

#[test]
fn a_value_that_cannot_be_used_is_named_with_where_it_came_from_and_an_example() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (setting, value, example) in [
        ("listen", "localhost", "127.0.0.1:8080"),
        ("queue_limit", "many", "a whole number"),
        ("voxel_limit", "1e9", "a whole number"),
        ("attempt_limit", "-1", "a whole number"),
        ("allow_anonymous", "yes", "`true` or `false`"),
        ("body_limit", "3", "256KiB"),
        ("lease", "soon", "30s"),
        ("dicom_listen", "11112", "127.0.0.1:11112"),
        ("database", "mysql://x", "postgres://user@host"),
        ("blobs", "gs://x", "s3://BUCKET/PREFIX"),
    ] {
        let flag = format!("--{}={value}", setting.replace('_', "-"));
        let variable = format!("VENTRIFORM_{}", setting.to_uppercase());
        let file = here.join("ventriform.toml");
        std::fs::write(&file, format!("{setting} = {value:?}\n")).unwrap();
        let serve = || {
            let mut command = Command::new(env!("CARGO_BIN_EXE_ventriform"));
            command.current_dir(here).args(["serve", "--print-config"]);
            command
        };
        for (mut command, origin) in [
            (serve(), flag.split('=').next().unwrap().to_owned()),
            (serve(), variable.clone()),
            (serve(), "--config".to_owned()),
        ] {
            let output = if origin.starts_with("--config") {
                command.arg("--config").arg(&file)
            } else if origin.starts_with("--") {
                command.arg(&flag)
            } else {
                command.env(&variable, value)
            };
            let output = output.output().unwrap();
            let said = said(&output);
            assert!(!output.status.success(), "{setting}: {said}");
            for part in [origin.as_str(), example] {
                assert!(said.contains(part), "{setting}, {part}: {said}");
            }
            // A URL may hold a password.
            assert!(setting == "database" || said.contains(value), "{said}");
        }
    }
}
