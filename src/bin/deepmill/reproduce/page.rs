//! The page of an experiment: what it is, its table, its pictures.

use super::study::Study;
use deepmill::tables::Table;
use deepmill::{Result, atomic_file};
use serde_json::{Value, json};

/// What `NAME.md` says.
pub struct Page<'a> {
    /// Name of the experiment and of its files.
    pub name: &'a str,
    pub title: &'a str,
    /// Paragraphs before the table.
    pub text: Vec<String>,
    pub table: Table,
    /// File names in the folder, and what they show.
    pub pictures: Vec<(String, String)>,
}

impl Page<'_> {
    /// Writes the page and its numbers; as JSON for the result.
    pub fn write(&self, study: &Study) -> Result<Value> {
        let mut page = format!("# {}\n\n", self.title);
        self.text.iter().for_each(|paragraph| page += &format!("{paragraph}\n\n"));
        page += &self.table.markdown();
        for (file, words) in &self.pictures {
            page += &format!("\n![{words}]({file})\n\n{words}.\n");
        }
        let [md, csv] = ["md", "csv"].map(|e| study.file(&format!("{}.{e}", self.name)));
        atomic_file::write_atomic(&csv, |file| file.write_all(&self.table.csv()))?;
        atomic_file::write_atomic(&md, |file| file.write_all(page.as_bytes()))?;
        study.output.say(self.table.text());
        let pictures = self.pictures.iter().map(|(file, _)| study.file(file));
        let files: Vec<_> = [md, csv].into_iter().chain(pictures).collect();
        study.output.files(&files);
        Ok(json!({ "table": self.table.json(), "files": files }))
    }
}
