//! Settings as TOML files, complete or partial over a preset.

use super::Settings;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use std::path::Path;
use toml::{Table, Value};

const REMEDY: &str = "compare with the settings.toml that every run writes";

/// Reads settings. A file that leaves out nothing but what is optional, such as every file that [`write()`]
/// has written, is taken as it is; of any other, what it does not say is as in `base`.
///
/// Tables are joined key by key; one whose `kind` differs from that in `base` replaces it.
///
/// # Errors
/// If the file cannot be read, is no TOML, or holds a key or a value that settings do not have.
pub fn read(path: &Path, base: &Settings) -> Result<Settings> {
    let text = input_file::read_text(path, input_file::SETTINGS)?;
    let alone = match toml::from_str::<Settings>(&text) {
        Ok(settings) => return Ok(settings),
        Err(error) => error,
    };
    let bad = |place: String, e: &toml::de::Error| {
        Error::file(path, place, e.message().trim().replace('\n', ", "), REMEDY)
    };
    let in_text = |e: &toml::de::Error| {
        let line = e.span().map(|s| input_file::line_of(text.as_bytes(), s.start));
        bad(line.map_or_else(|| "settings".into(), |line| format!("line {line}")), e)
    };
    let changes: Table = toml::from_str(&text).map_err(|e| in_text(&e))?;
    // Joined as text: one reader and one writer of settings are compiled.
    let unwritten = |e: toml::ser::Error| Error::file(path, "preset", e.to_string(), REMEDY);
    let base = toml::to_string(base).map_err(unwritten)?;
    let base: Table = toml::from_str(&base).map_err(|e| bad("preset".into(), &e))?;
    let joined = overlaid(Value::Table(base), Value::Table(changes));
    let joined = toml::to_string(&joined).map_err(unwritten)?;
    toml::from_str::<Settings>(&joined).map_err(|e| {
        // Only errors of the file's own text have a line, unless they are about missing keys.
        if alone.message() == e.message() { in_text(&alone) } else { bad("settings".into(), &e) }
    })
}

fn overlaid(base: Value, changes: Value) -> Value {
    let (Value::Table(mut base), Value::Table(changes)) = (base, changes.clone()) else {
        return changes;
    };
    if changes.get("kind").is_some_and(|kind| base.get("kind") != Some(kind)) {
        return Value::Table(changes);
    }
    for (key, change) in changes {
        let value = match base.remove(&key) {
            Some(old) => overlaid(old, change),
            None => change,
        };
        base.insert(key, value);
    }
    Value::Table(base)
}

/// Writes all settings, readable by [`read`].
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, settings: &Settings) -> Result<()> {
    let text =
        toml::to_string(settings).map_err(|e| Error::write(path, std::io::Error::other(e)))?;
    atomic_file::write_atomic(path, |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::optim::Schedule;
    use crate::model::graph_sage::GraphSageConfig;

    fn overlay(base: &Settings, text: &str) -> Result<Settings> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, text).unwrap();
        read(&path, base)
    }

    #[test]
    fn a_file_changes_what_it_says_and_nothing_else() {
        let base = Settings::small();
        assert_eq!(overlay(&base, "").unwrap(), base);
        let mut expected = base.clone();
        expected.lr = 0.02;
        expected.network.octree_mut().unwrap().input.depth = 4;
        expected.augment.mirror = true;
        let text = "lr = 0.02\naugment.mirror = true\n[network.input]\ndepth = 4\n";
        assert_eq!(overlay(&base, text).unwrap(), expected);
    }

    #[test]
    fn schedules_of_another_kind_are_replaced_and_of_the_same_kind_changed() {
        let base = Settings::small();
        let schedule = |text| overlay(&base, text).unwrap().schedule;
        let other = "[schedule]\nkind = \"cosine\"\nmin_lr = 0.01\n";
        assert_eq!(schedule(other), Schedule::Cosine { min_lr: 0.01 });
        let expected = Schedule::CosineWarmup { warmup_epochs: 3, start: 0.1, min_ratio: 0.001 };
        assert_eq!(schedule("schedule.warmup_epochs = 3"), expected);
    }

    #[test]
    fn a_graph_network_replaces_the_octree_network_of_the_preset() {
        let text = "[network]\nkind = \"graph_sage\"\nwidths = [8, 8]\n";
        let graph = GraphSageConfig { widths: vec![8; 2], ..GraphSageConfig::default() };
        let expected = Settings { network: graph.into(), ..Settings::tiny() };
        assert_eq!(overlay(&Settings::tiny(), text).unwrap(), expected);
        let message = overlay(&Settings::tiny(), "[network]\nkind = \"tree\"\n").unwrap_err();
        assert!(message.to_string().contains("`octree` or `graph_sage`"), "{message}");
    }

    #[test]
    fn whole_files_read_back_over_any_preset() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        let mut presets =
            ["paper", "reference", "small", "tiny"].map(|p| Settings::preset(p).unwrap()).to_vec();
        let graph = GraphSageConfig::default();
        presets.push(Settings { network: graph.into(), ..Settings::small() });
        for settings in &presets {
            write(&path, settings).unwrap();
            assert!(presets.iter().all(|base| read(&path, base).unwrap() == *settings));
        }
    }

    #[test]
    fn unknown_keys_and_wrong_values_are_named() {
        for (text, expected) in [
            ("seed = 1\nlrr = 5.0\n", "line 2: unknown field `lrr`"),
            ("lr = \"fast\"\n", "line 1: invalid type: string \"fast\""),
            ("lr = = 1\n", "line 1"),
            ("[network.input]\ndeep = 4\n", "deep"),
        ] {
            let message = overlay(&Settings::tiny(), text).unwrap_err().to_string();
            assert!(message.contains("a.toml") && message.contains(expected), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
