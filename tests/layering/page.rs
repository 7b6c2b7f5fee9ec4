//! Which source file of the page uses which: the relative paths after `from` and `import`.

use crate::imports::ModulePath;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path};

/// The endings of sources that import others.
const SOURCE_ENDINGS: [&str; 2] = ["ts", "tsx"];

/// For each source below `folder` those that it imports, at once or when they are needed.
pub fn arrows(folder: &Path) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
    let mut arrows = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder_inside) = open.pop() {
        for entry in fs::read_dir(folder_inside).expect("a folder of sources") {
            let path = entry.expect("an entry of a folder").path();
            let ending = path.extension().and_then(|ending| ending.to_str());
            if path.is_dir() {
                open.push(path);
            } else if ending.is_some_and(|ending| SOURCE_ENDINGS.contains(&ending)) {
                let text = fs::read_to_string(&path).expect("a source file");
                let inside = path.strip_prefix(folder).expect("a path inside the folder");
                let used = imported(&text).map(|path| resolve(inside, path));
                arrows.insert(module(inside), used.collect());
            }
        }
    }
    arrows
}

/// The relative paths that a source imports.
fn imported(text: &str) -> impl Iterator<Item = &str> {
    let parts = text.split('"');
    let pairs = parts.clone().zip(parts.skip(1));
    let imports = |before: &str| {
        let words = before.trim_end();
        ["from", "import", "import("]
            .iter()
            .any(|word| words.ends_with(word))
    };
    let named = pairs.filter(move |(before, part)| part.starts_with('.') && imports(before));
    named.map(|(_, part)| part)
}

/// The module to which `path` leads from the file `from`.
fn resolve(from: &Path, path: &str) -> ModulePath {
    let mut module: ModulePath = module(from);
    module.pop();
    for part in Path::new(path).components() {
        match part {
            Component::ParentDir => {
                module.pop();
            }
            Component::Normal(name) => module.push(name.to_string_lossy().into_owned()),
            _ => {}
        }
    }
    module
}

/// `viewer/sheet.tsx` as `["viewer", "sheet"]`.
fn module(path: &Path) -> ModulePath {
    let parts = path.with_extension("");
    let parts = parts.components();
    parts
        .map(|part| part.as_os_str().to_string_lossy().into_owned())
        .collect()
}

#[test]
fn imports_are_found_and_resolved() {
    let source = r#"
        import { a } from "./a";
        import "../style.css";
        const late = () => import("../viewer/late");
        const text = "./no/import";
    "#;
    let found: Vec<ModulePath> = imported(source)
        .map(|path| resolve(Path::new("list/one.tsx"), path))
        .collect();
    assert_eq!(
        found,
        [vec!["list", "a"], vec!["style.css"], vec!["viewer", "late"]]
    );
}
