//! Which source file uses which: paths of `use` declarations and expressions, resolved through
//! re-exports to the file that defines the item.
//!
//! In: the folder `src`. Out: one arrow for each pair of files of which the first names an item
//! that the second defines or hands on by a `pub use`. Test modules, comments and strings are left
//! out. Items that macros generate and glob re-exports are not followed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module's path from the crate's root: `["mesh", "topology"]`.
pub type ModulePath = Vec<String>;

/// The code of the crate's files by module: words and signs, without comments, strings and test
/// modules.
pub struct Sources(BTreeMap<ModulePath, Vec<String>>);

/// A path that a file names, resolved against the module it stands in.
struct Named {
    target: ModulePath,
    /// The name under which a `pub use` hands it on.
    reexported_as: Option<String>,
}

impl Sources {
    /// Reads every `.rs` file below `src`, except `tests.rs`.
    pub fn read(src: &Path) -> Self {
        let mut sources = BTreeMap::new();
        for path in rust_files(src) {
            let text = fs::read_to_string(&path).expect("a source file");
            let inside = path.strip_prefix(src).expect("a path inside src");
            sources.insert(module_of(inside), without_tests(tokens(&text)));
        }
        assert!(!sources.is_empty(), "no sources in {}", src.display());
        Self(sources)
    }

    /// For each module the modules of other files whose items it uses.
    pub fn arrows(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let named: BTreeMap<&ModulePath, Vec<Named>> = self
            .0
            .iter()
            .map(|(module, tokens)| (module, self.named(module, tokens)))
            .collect();
        let reexports: BTreeMap<(&ModulePath, &str), &ModulePath> = named
            .iter()
            .flat_map(|(module, named)| {
                named
                    .iter()
                    .filter_map(|n| Some(((*module, n.reexported_as.as_deref()?), &n.target)))
            })
            .collect();
        named
            .iter()
            .map(|(module, named)| {
                let used = named.iter().filter(|n| n.reexported_as.is_none());
                let files = used.flat_map(|n| self.files_to(&n.target, &reexports));
                let others = files.filter(|file| file != *module).collect();
                ((*module).clone(), others)
            })
            .collect()
    }

    /// The files that hand on what `target` names, and the file that defines it: of each path, the
    /// longest beginning that is a file.
    fn files_to(
        &self,
        target: &[String],
        reexports: &BTreeMap<(&ModulePath, &str), &ModulePath>,
    ) -> Vec<ModulePath> {
        let mut files = Vec::new();
        let mut path = target.to_vec();
        while let Some(length) = (0..=path.len())
            .rev()
            .find(|n| self.0.contains_key(&path[..*n]))
        {
            let module = path[..length].to_vec();
            let name = path.get(length);
            let onward = name.and_then(|name| reexports.get(&(&module, name.as_str())).copied());
            let again = files.contains(&module);
            files.push(module.clone());
            match onward {
                Some(onward) if !again && onward.as_slice() != &path[..=length] => {
                    path = [onward.as_slice(), &path[length + 1..]].concat();
                }
                _ => break,
            }
        }
        files
    }

    /// Every path of this crate that the tokens of `module` name.
    fn named(&self, module: &ModulePath, tokens: &[String]) -> Vec<Named> {
        let mut named = Vec::new();
        let mut at = 0;
        while at < tokens.len() {
            let starts_path = at == 0 || tokens[at - 1] != "::" && tokens[at - 1] != ".";
            if tokens[at] == "use"
                && (at == 0 || [";", "}", "{", "pub", ")", "]"].contains(&tokens[at - 1].as_str()))
            {
                let public = at > 0 && ["pub", ")"].contains(&tokens[at - 1].as_str());
                let end = at + tokens[at..].iter().position(|t| t == ";").unwrap_or(0);
                for (path, name) in use_paths(&tokens[at + 1..end]) {
                    if let Some(target) = self.absolute(module, &path) {
                        let reexported_as = public.then_some(name);
                        named.push(Named {
                            target,
                            reexported_as,
                        });
                    }
                }
                at = end + 1;
            } else if starts_path && tokens.get(at + 1).is_some_and(|t| t == "::") {
                let mut path = vec![tokens[at].clone()];
                at += 1;
                while tokens.get(at).is_some_and(|t| t == "::")
                    && tokens.get(at + 1).is_some_and(|t| is_word(t))
                {
                    path.push(tokens[at + 1].clone());
                    at += 2;
                }
                if let Some(target) = self.absolute(module, &path) {
                    named.push(Named {
                        target,
                        reexported_as: None,
                    });
                }
            } else {
                at += 1;
            }
        }
        named
    }

    /// A path as written in `module`, from the crate's root; `None` for other crates' paths and
    /// for what an import brought into scope (the import itself is an arrow).
    fn absolute(&self, module: &[String], path: &[String]) -> Option<ModulePath> {
        let mut base = module.to_vec();
        let mut rest = path;
        match rest.first()?.as_str() {
            "crate" => {
                base.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|word| word == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
            }
            child => {
                base.push(child.to_owned());
                let is_child = self.0.contains_key(&base);
                base.pop();
                if !is_child {
                    return None;
                }
            }
        }
        base.extend(rest.iter().filter(|word| *word != "self").cloned());
        Some(base)
    }
}

/// The circles among `arrows`: sets of files each of which reaches every other (Tarjan 1972).
/// A module and those below it do not count as a circle: a stage's `mod.rs` calls its steps,
/// which use the types that it defines.
pub fn circles(arrows: &BTreeMap<ModulePath, BTreeSet<ModulePath>>) -> Vec<Vec<ModulePath>> {
    let reaches = |from: &ModulePath| {
        let mut seen = BTreeSet::new();
        let mut open = vec![from];
        while let Some(module) = open.pop() {
            for next in arrows.get(module).into_iter().flatten() {
                let family = next.starts_with(module) || module.starts_with(next);
                if !family && seen.insert(next) {
                    open.push(next);
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&ModulePath, BTreeSet<&ModulePath>> = arrows
        .keys()
        .map(|module| (module, reaches(module)))
        .collect();
    let mut circles: Vec<Vec<ModulePath>> = Vec::new();
    for (module, others) in &reached {
        if !others.contains(*module) || circles.iter().flatten().any(|m| m == *module) {
            continue;
        }
        let both_ways = others
            .iter()
            .filter(|other| reached[**other].contains(*module));
        circles.push(both_ways.map(|m| (**m).clone()).collect());
    }
    circles
}

/// The paths that a `use` declaration names, with the name each goes by afterwards.
fn use_paths(tokens: &[String]) -> Vec<(Vec<String>, String)> {
    let mut found = Vec::new();
    let mut prefixes: Vec<Vec<String>> = vec![Vec::new()];
    let mut path: Vec<String> = Vec::new();
    let mut alias = None;
    let mut words = tokens.iter().chain(std::iter::once(&*COMMA_TOKEN));
    while let Some(token) = words.next() {
        match token.as_str() {
            "::" => {}
            "{" => prefixes.push(std::mem::take(&mut path)),
            "as" => alias = words.next().cloned(),
            "," | "}" => {
                if let Some(last) = path.last().cloned() {
                    let whole: Vec<String> = prefixes
                        .concat()
                        .into_iter()
                        .chain(path.drain(..))
                        .collect();
                    found.push((whole, alias.take().unwrap_or(last)));
                }
                if token == "}" {
                    prefixes.pop();
                }
            }
            word => path.push(word.to_owned()),
        }
    }
    found
}

static COMMA_TOKEN: std::sync::LazyLock<String> = std::sync::LazyLock::new(|| ",".to_owned());

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Words, `::` and single signs; comments, strings and characters are dropped.
fn tokens(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let at = |n: usize| chars.get(n).copied().unwrap_or(' ');
    let mut tokens = Vec::new();
    let mut n = 0;
    while n < chars.len() {
        match (chars[n], at(n + 1)) {
            ('/', '/') => {
                n += chars[n..]
                    .iter()
                    .position(|c| *c == '\n')
                    .unwrap_or(chars.len() - n)
            }
            ('r', '"' | '#') if !at(n.wrapping_sub(1)).is_alphanumeric() => {
                let hashes = chars[n + 1..].iter().take_while(|c| **c == '#').count();
                let close: Vec<char> = std::iter::once('"')
                    .chain(std::iter::repeat_n('#', hashes))
                    .collect();
                let body = n + 2 + hashes;
                let end = (body..chars.len()).find(|e| chars[*e..].starts_with(&close));
                n = end.map_or(chars.len(), |end| end + close.len());
            }
            ('"', _) => {
                n += 1;
                while n < chars.len() && chars[n] != '"' {
                    n += 1 + usize::from(chars[n] == '\\');
                }
                n += 1;
            }
            ('\'', '\\') => n += 3 + chars[n + 3..].iter().position(|c| *c == '\'').unwrap_or(0),
            ('\'', _) if at(n + 2) == '\'' => n += 3,
            (':', ':') => {
                tokens.push("::".to_owned());
                n += 2;
            }
            (c, _) if c.is_alphanumeric() || c == '_' => {
                let length = chars[n..]
                    .iter()
                    .take_while(|c| c.is_alphanumeric() || **c == '_')
                    .count();
                tokens.push(chars[n..n + length].iter().collect());
                n += length;
            }
            (c, _) => {
                if !c.is_whitespace() {
                    tokens.push(c.to_string());
                }
                n += 1;
            }
        }
    }
    tokens
}

/// The tokens without what `#[cfg(test)]` marks.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    const TEST_MARK: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if tokens[at..]
            .iter()
            .zip(TEST_MARK)
            .filter(|(a, b)| a == b)
            .count()
            < TEST_MARK.len()
        {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        // The marked item ends with its block, or with a semicolon where it has none.
        let mut depth = 0;
        for token in &tokens[at + TEST_MARK.len()..] {
            at += 1;
            match token.as_str() {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            if depth == 0 && (token == "}" || token == ";") {
                break;
            }
        }
        at += TEST_MARK.len();
    }
    kept
}

fn module_of(path: &Path) -> ModulePath {
    let mut module: ModulePath = path
        .with_extension("")
        .iter()
        .map(|part| part.to_string_lossy().into_owned())
        .collect();
    if module
        .last()
        .is_some_and(|last| last == "mod" || last == "lib")
    {
        module.pop();
    }
    module
}

/// Every source file but the `tests.rs` of modules whose tests fill a file of their own.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

#[test]
fn paths_are_read_from_use_declarations() {
    let read = |text: &str| use_paths(&tokens(text));
    let path = |words: &str| words.split("::").map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(
        read("crate::{mesh::{self, TriMesh as Mesh}, volume}"),
        [
            (path("crate::mesh::self"), "self".to_owned()),
            (path("crate::mesh::TriMesh"), "Mesh".to_owned()),
            (path("crate::volume"), "volume".to_owned()),
        ]
    );
}

#[test]
fn comments_strings_and_tests_are_no_code() {
    let text = r##"
        // use crate::a;
        fn f(x: &'a str) -> char { let _ = "crate::b"; let _ = r#"crate::c "quoted" "#; '"' }
        #[cfg(test)]
        mod tests { use crate::d; fn g() { { } } }
        use crate::e;
    "##;
    let kept = without_tests(tokens(text)).concat();
    for gone in ["crate::a", "crate::b", "crate::c", "crate::d"] {
        assert!(!kept.contains(gone), "{kept}");
    }
    assert!(kept.contains("usecrate::e;"), "{kept}");
}

#[test]
fn a_circle_is_found_and_a_family_is_none() {
    let module = |text: &str| text.split("::").map(str::to_owned).collect::<ModulePath>();
    let arrows: BTreeMap<ModulePath, BTreeSet<ModulePath>> = [
        ("a", "a::b"),
        ("a::b", "a"),
        ("a::c", "a::d"),
        ("a::d", "e"),
        ("e", "a::c"),
    ]
    .map(|(from, to)| (module(from), BTreeSet::from([module(to)])))
    .into();
    let expected = ["a::c", "a::d", "e"].map(module);
    assert_eq!(circles(&arrows), [expected]);
}

#[test]
fn a_file_uses_those_that_hand_on_what_it_names() {
    let module = |text: &str| text.split("::").map(str::to_owned).collect::<ModulePath>();
    let sources = Sources(
        [
            ("a", "use crate::b::Kept;"),
            ("b", "pub use kept::Kept; use crate::a::Other;"),
            ("b::kept", "pub struct Kept;"),
        ]
        .map(|(path, code)| (module(path), tokens(code)))
        .into(),
    );
    let arrows = sources.arrows();
    assert_eq!(arrows[&module("a")], ["b", "b::kept"].map(module).into());
    assert_eq!(circles(&arrows), [["a", "b"].map(module)]);
}
