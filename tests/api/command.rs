//! The program as a person runs it: what it prints, into which pipes, and how it ends.

use crate::dicom::{JANE, nm};
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

fn program(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ventriform"));
    command.args(arguments).current_dir(folder);
    command
}

/// A folder with a scan in a folder, and one whose texts have control characters.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scan = nm(&JANE, 1);
    let mut hostile = scan.clone();
    for (text, by) in [
        (&b"Maker"[..], &b"\x1b[2Ja"[..]),
        (b"RECON TOMO", b"\x1b[2J\x9bTOMO"),
    ] {
        if let Some(at) = scan.windows(text.len()).position(|w| w == text) {
            hostile[at..at + by.len()].copy_from_slice(by);
        }
    }
    fs::create_dir(folder.path().join("series")).unwrap();
    fs::write(folder.path().join("series/1"), scan).unwrap();
    fs::write(folder.path().join("series/LOCKFILE"), b"").unwrap();
    fs::write(folder.path().join("hostile.dcm"), hostile).unwrap();
    fs::write(folder.path().join("a\u{1b}[2J\u{202e}.nii"), b"no volume").unwrap();
    folder
}

/// Whatever package a part of it is compiled in.
#[test]
fn the_program_has_one_name() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, wanted) in [
        (&["--version"][..], "ventriform 0."),
        (&["completions", "bash"], "_ventriform()"),
    ] {
        let output = program(folder.path(), arguments).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.starts_with(wanted), "{text}");
    }
}

#[test]
fn a_reader_that_is_gone_is_no_failure_and_a_full_disk_is_one() {
    let folder = folder();
    for arguments in [
        &["completions", "bash"][..],
        &["inspect", "series"],
        &["--help"],
        &["serve", "--print-config"],
    ] {
        let mut child = program(folder.path(), arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // The pipe is closed before anything, or after its first bytes.
        let mut first = [0; 4];
        let mut out = child.stdout.take().unwrap();
        if arguments[0] == "completions" {
            out.read_exact(&mut first).unwrap();
        }
        drop(out);
        let mut words = String::new();
        let mut err = child.stderr.take().unwrap();
        err.read_to_string(&mut words).unwrap();
        let status = child.wait().unwrap();
        assert!(!words.contains("panicked"), "{arguments:?}: {words}");
        assert_eq!(status.code(), Some(0), "{arguments:?}: {words}");
    }
    // Standard error that nobody reads is no failure either.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let status = program(folder.path(), &["inspect", "missing"])
        .stdout(Stdio::null())
        .stderr(writer)
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(1));
    #[cfg(target_os = "linux")]
    for arguments in [&["completions", "bash"][..], &["inspect", "series"]] {
        let full = fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let ended = program(folder.path(), arguments)
            .stdout(full)
            .output()
            .unwrap();
        assert_eq!(ended.status.code(), Some(1), "{arguments:?}");
    }
}

#[test]
fn what_files_say_is_printed_without_control_characters() {
    let folder = folder();
    for (arguments, code) in [
        (&["inspect", "hostile.dcm"][..], 1),
        (&["inspect", "a\u{1b}[2J\u{202e}.nii"], 1),
        // What is no volume is left out with a warning that names it.
        (&["inspect", "."], 0),
        (&["inspect", "series"], 0),
        (&["inspect"], 2),
        (&["inspect", "--unknown"], 2),
        (&["inspect", "--un\u{1b}[2Jknown\u{202e}"], 2),
        (&["in\u{9b}spect"], 2),
        (
            &["generate", "series", "-o", "a.stl", "--points", "\u{1b}[5"],
            2,
        ),
        (
            &["generate", "series", "-o", "a.stl", "--method", "\u{1b}[5"],
            2,
        ),
    ] {
        let ended = program(folder.path(), arguments).output().unwrap();
        let printed = [ended.stdout, ended.stderr].concat();
        let printed = String::from_utf8(printed).unwrap();
        let hidden =
            |c: char| (c.is_control() && c != '\n') || ('\u{2028}'..='\u{202e}').contains(&c);
        assert_eq!(ended.status.code(), Some(code), "{arguments:?}: {printed}");
        assert!(!printed.contains(hidden), "{arguments:?}: {printed:?}");
    }
}

#[test]
fn a_folder_stands_for_its_files() {
    let folder = folder();
    let ended = program(folder.path(), &["inspect", "series"])
        .output()
        .unwrap();
    let facts: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(facts["dicom"]["patient_name"], JANE.name);
    assert!(
        facts["warnings"].to_string().contains("LOCKFILE"),
        "{facts}"
    );
    let report = [
        "generate", "series", "-o", "lv.stl", "--points", "67", "--report", "r.html",
    ];
    for (more, named) in [(&[][..], true), (&["--deidentify"], false)] {
        let arguments = [&report[..], more].concat();
        let ended = program(folder.path(), &arguments).output().unwrap();
        let words = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.success(), "{words}");
        let page = fs::read_to_string(folder.path().join("r.html")).unwrap();
        assert_eq!(page.contains("Doe, Jane"), named);
        assert_eq!(page.contains(JANE.study), named);
    }
}
