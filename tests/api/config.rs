//! The settings of the program; more tests are in `crates/service/src/config`.

use std::process::{Command, Output};

fn print_config(arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(["serve", "--print-config"])
        .args(arguments)
        .envs(variables.iter().copied())
        .output()
        .unwrap()
}

#[test]
fn print_config_shows_every_setting_with_its_origin() {
    let output = print_config(
        &["--listen", "127.0.0.1:0"],
        &[("VENTRIFORM_DATA_DIR", "/somewhere")],
    );
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(
        printed.contains("listen = \"127.0.0.1:0\" # flag"),
        "{printed}"
    );
    assert!(printed.contains("data_dir = \"/somewhere\" # variable"));
    assert!(printed.contains("queue_limit = \"1000\" # default"));
    assert_eq!(
        printed.lines().count(),
        ventriform_service::config::Settings::NAMES.len()
    );
}

#[test]
fn an_unknown_key_in_the_file_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ventriform.toml");
    std::fs::write(&path, "body_limits = \"1GiB\"\n").unwrap();
    let output = print_config(&["--config", path.to_str().unwrap()], &[]);
    assert!(!output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.contains("body_limits") && said.contains("`body_limit`?"),
        "{said}"
    );
}
