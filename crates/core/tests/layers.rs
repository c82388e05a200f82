//! Modules may use only those above them in the list of `lib.rs`; the crate reads no file, clock or environment and
//! knows no Python.

#![allow(clippy::disallowed_methods, reason = "this test reads the sources of the core; the core itself reads no file")]

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("src").map(|entry| entry.expect("entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Source files with the module of the first level that they belong to.
fn modules() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    files
        .into_iter()
        .map(|file| {
            let inside = file.strip_prefix(&root).expect("below src");
            let first = inside.components().next().expect("a file").as_os_str().to_string_lossy().into_owned();
            (file.clone(), first.trim_end_matches(".rs").to_string())
        })
        .filter(|(_, module)| module != "lib")
        .collect()
}

fn layers() -> Vec<String> {
    let lib = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).expect("lib.rs");
    lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).map(str::to_string).collect()
}

/// Names after `crate::` in a line of code.
fn used(line: &str) -> impl Iterator<Item = String> + '_ {
    line.split("crate::").skip(1).map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
}

#[test]
fn a_module_uses_only_modules_of_lower_layers() {
    let layers = layers();
    let position = |module: &str| layers.iter().position(|layer| layer == module);
    assert!(layers.len() > 8, "lib.rs lists the modules in layer order");
    for (file, module) in modules() {
        let own = position(&module).unwrap_or_else(|| panic!("{module} is not listed in lib.rs"));
        let text = fs::read_to_string(&file).expect("source");
        for line in text.lines().take_while(|line| *line != "mod tests {") {
            for name in used(line) {
                let other = position(&name).unwrap_or_else(|| panic!("{}: crate::{name} is no module", file.display()));
                assert!(other <= own, "{}: {module} must not use {name}, which is in a higher layer", file.display());
            }
        }
    }
}

#[test]
fn the_core_reads_no_file_clock_or_environment_and_knows_no_python() {
    for (file, _) in modules() {
        let text = fs::read_to_string(&file).expect("source");
        for forbidden in ["std::fs", "std::env", "std::net", "std::time", "pyo3", "HashMap", "HashSet", "thread_rng"] {
            assert!(!text.contains(forbidden), "{}: {forbidden}", file.display());
        }
    }
}
