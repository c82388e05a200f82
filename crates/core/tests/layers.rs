//! Modules may use only those above them in the list of `lib.rs`; on every level, and in the other crates, modules of
//! one folder do not use each other in a circle; the crate reads no file, clock or environment and knows no Python.

#![allow(clippy::disallowed_methods, reason = "this test reads the sources of the core; the core itself reads no file")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Names from the crate down to a module.
type ModulePath = Vec<String>;

/// The modules of a crate without their tests.
struct Modules {
    texts: BTreeMap<ModulePath, String>,
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Code before the tests at the end of a file, without comments.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

impl Modules {
    fn of(crate_folder: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(crate_folder).join("src");
        let mut files = Vec::new();
        sources(&root, &mut files);
        let mut texts = BTreeMap::new();
        for file in files {
            let inside = file.strip_prefix(&root).expect("below src").with_extension("");
            let mut path: ModulePath =
                inside.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
            if matches!(path.last().map(String::as_str), Some("mod" | "lib")) {
                path.pop();
            }
            let of_tests = |name: &String| name.split('_').any(|word| matches!(word, "tests" | "testing"));
            if !path.iter().any(of_tests) {
                texts.insert(path, code(&fs::read_to_string(&file).expect("source")));
            }
        }
        Self { texts }
    }

    /// Whole paths of everything that a module names, through re-exports.
    fn used(&self, module: &ModulePath) -> BTreeSet<ModulePath> {
        let paths = paths_in(&self.texts[module]);
        paths.iter().filter_map(|path| self.absolute(module, path)).map(|path| self.definition(path, 0)).collect()
    }

    /// From the crate's root; `None` for what belongs to another crate or to no module.
    fn absolute(&self, module: &ModulePath, path: &[String]) -> Option<ModulePath> {
        let mut base = module.clone();
        match path[0].as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "self" => {}
            "super" => _ = base.pop(),
            first => {
                let child = [&module[..], &[first.to_string()]].concat();
                return self.texts.contains_key(&child).then(|| [&module[..], path].concat());
            }
        }
        let n_up = path[1..].iter().take_while(|name| *name == "super").count();
        base.truncate(base.len() - n_up);
        Some(base.into_iter().chain(path[1 + n_up..].iter().cloned()).collect())
    }

    /// Follows re-exports to the module in which something is defined.
    fn definition(&self, path: ModulePath, depth: usize) -> ModulePath {
        let module = self.module_of(&path);
        let Some(name) = path.get(module.len()).filter(|_| depth < 5) else { return path };
        let exports = self.texts[&module].split(';').filter_map(|item| {
            item.split_once("pub use ")
                .or_else(|| item.split_once("pub(super) use ").or_else(|| item.split_once("pub(crate) use ")))
        });
        for path in exports.flat_map(|(_, tree)| paths_in(tree)) {
            if path.last() == Some(name)
                && let Some(target) = self.absolute(&module, &path)
                && target.len() > module.len() + 1
            {
                return self.definition(target, depth + 1);
            }
        }
        path
    }

    /// The longest part of a path that is a module.
    fn module_of(&self, path: &[String]) -> ModulePath {
        let longest = (0..=path.len()).rev().find(|n| self.texts.contains_key(&path[..*n]));
        path[..longest.unwrap_or(0)].to_vec()
    }

    /// Which modules of a folder use which others of it, anywhere below.
    fn uses_between_siblings(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let mut uses: BTreeMap<ModulePath, BTreeSet<ModulePath>> = BTreeMap::new();
        for module in self.texts.keys() {
            for used in self.used(module) {
                let used = self.module_of(&used);
                let n_shared = module.iter().zip(&used).take_while(|(a, b)| a == b).count();
                if n_shared < module.len() && n_shared < used.len() {
                    uses.entry(module[..=n_shared].to_vec()).or_default().insert(used[..=n_shared].to_vec());
                }
            }
        }
        uses
    }
}

/// Paths in a text, with use groups taken apart: `a::{b, c::d}` is a::b and a::c::d.
fn paths_in(text: &str) -> Vec<Vec<String>> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let (mut paths, mut rest) = (Vec::new(), text);
    while let Some(at) = rest.find("::") {
        let head = rest[..at].rsplit(|c| !is_name(c)).next().unwrap_or_default();
        rest = &rest[at + 2..];
        if !head.is_empty() {
            rest = tree(&[head.to_string()], rest, &mut paths);
        }
    }
    paths
}

/// What follows `prefix::`; returns the text behind it.
fn tree<'a>(prefix: &[String], text: &'a str, paths: &mut Vec<Vec<String>>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut inside) = text.strip_prefix('{') {
        loop {
            inside = inside.trim_start_matches([',', ' ', '\n']);
            if inside.is_empty() || inside.starts_with('}') {
                return inside.strip_prefix('}').unwrap_or_default();
            }
            let before = inside.len();
            inside = tree(prefix, inside, paths);
            if inside.len() == before {
                return inside;
            }
        }
    }
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let path = [prefix, &[text[..end].to_string()]].concat();
    let rest = &text[end..];
    match rest.strip_prefix("::") {
        Some(rest) => tree(&path, rest, paths),
        None => {
            paths.push(path);
            // A new name does not matter.
            rest.strip_prefix(" as ")
                .map_or(rest, |rest| rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_'))
        }
    }
}

/// A circle through a module, if there is one.
fn circle(
    uses: &BTreeMap<ModulePath, BTreeSet<ModulePath>>,
    way: &mut Vec<ModulePath>,
    done: &mut BTreeSet<ModulePath>,
) -> Option<String> {
    let last = way.last().expect("a module").clone();
    for next in uses.get(&last).into_iter().flatten() {
        if let Some(first) = way.iter().position(|module| module == next) {
            let names: Vec<String> = way[first..].iter().chain([next]).map(|module| module.join("::")).collect();
            done.extend(way.iter().cloned());
            return Some(names.join(" -> "));
        }
        if !done.contains(next) {
            way.push(next.clone());
            if let Some(found) = circle(uses, way, done) {
                return Some(found);
            }
            way.pop();
        }
    }
    done.insert(last);
    None
}

#[test]
fn modules_of_one_folder_use_each_other_in_no_circle() {
    let mut found = Vec::new();
    for crate_folder in [".", "../commonroad", "../python"] {
        let uses = Modules::of(crate_folder).uses_between_siblings();
        let mut done = BTreeSet::new();
        for module in uses.keys() {
            if !done.contains(module) {
                found.extend(circle(&uses, &mut vec![module.clone()], &mut done));
            }
        }
    }
    assert!(found.is_empty(), "circles:\n{}", found.join("\n"));
}

#[test]
fn a_module_uses_only_modules_of_lower_layers() {
    let modules = Modules::of(".");
    let lib = &modules.texts[&Vec::new()];
    let layers: Vec<&str> = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert!(layers.len() > 8, "lib.rs lists the modules in layer order");
    let position = |module: &str| layers.iter().position(|layer| *layer == module);
    for module in modules.texts.keys().filter(|module| !module.is_empty()) {
        let own = position(&module[0]).unwrap_or_else(|| panic!("{} is not listed in lib.rs", module[0]));
        for used in modules.used(module) {
            let used = used.first().unwrap_or_else(|| panic!("{module:?} names the crate itself"));
            let other = position(used).unwrap_or_else(|| panic!("{module:?}: crate::{used} is no module"));
            assert!(other <= own, "{} must not use {used}, which is in a higher layer", module.join("::"));
        }
    }
}

#[test]
fn the_core_reads_no_file_clock_or_environment_and_knows_no_python() {
    for (module, text) in Modules::of(".").texts {
        for forbidden in ["std::fs", "std::env", "std::net", "std::time", "pyo3", "HashMap", "HashSet", "thread_rng"] {
            assert!(!text.contains(forbidden), "{}: {forbidden}", module.join("::"));
        }
    }
}
