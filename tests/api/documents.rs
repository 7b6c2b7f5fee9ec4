//! Pages of `docs/` that are written from the code.

use crate::helpers::generated;
use std::fmt::Write as _;
use std::path::Path;
use ventriform_service::config::Settings;

const SETTINGS_BEGIN: &str = "<!-- settings: written by scripts/generate.sh -->\n";
const SETTINGS_END: &str = "<!-- end of settings -->\n";

/// Every setting as tables, one for each group.
fn tables() -> String {
    let mut text = String::new();
    let mut group = "";
    for row in Settings::ROWS {
        if row.group != group {
            group = row.group;
            writeln!(
                text,
                "\n**{group}**\n\n| setting | default | what |\n|---|---|---|"
            )
            .unwrap();
        }
        let default = match row.default {
            "" => String::new(),
            value => format!("`{value}`"),
        };
        let what = row.summary().replace('|', "\\|");
        writeln!(text, "| `{}` | {default} | {what} |", row.name).unwrap();
    }
    text.push('\n');
    text
}

#[test]
fn the_page_for_operators_lists_every_setting() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/operations.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (before, rest) = page.split_once(SETTINGS_BEGIN).unwrap();
    let (_, after) = rest.split_once(SETTINGS_END).unwrap();
    let expected = format!("{before}{SETTINGS_BEGIN}{}{SETTINGS_END}{after}", tables());
    generated("docs/operations.md", &expected);
}

/// Every flag that the code can raise has a line on the page of flags.
#[test]
fn the_page_of_flags_has_every_flag() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/flags.md")).unwrap();
    let mut codes = 0;
    for file in [
        "heart/judge/flags.rs",
        "heart/beat/flags.rs",
        "heart/comparison/flags.rs",
        "heart/normals/flags.rs",
    ] {
        let path = root.join("crates/ventriform/src").join(file);
        let source = std::fs::read_to_string(path).unwrap();
        let (_, after) = source.split_once("fn code(&self)").unwrap();
        let (body, _) = after.split_once("\n    }\n").unwrap();
        let own = body.split('"').skip(1).step_by(2);
        for code in own {
            assert!(page.contains(&format!("| `{code}` |")), "{file}: {code}");
            codes += 1;
        }
    }
    assert!(codes > 30, "{codes}");
}
