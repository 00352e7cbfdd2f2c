//! Contact sheets of views from above.

use super::trainings::Trained;
use deepmill::Result;

use deepmill::data::Sample;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::image::{Font, Image};
use deepmill::report::{Coloring, PartView, Rgb, picture};

/// Pixels of a view, and height of the legend below all.
const VIEW: [u32; 2] = [560, 460];
const FOOT: u32 = 40;
const COLUMNS: usize = 3;
const INK: Rgb = [40, 42, 46];

/// Views in rows of three, with one legend.
#[derive(Default)]
pub struct Sheet {
    cells: Vec<(Image, String)>,
    /// Names and colors.
    legend: Vec<(String, Rgb)>,
}

impl Sheet {
    /// Adds the view of a part from above; the legend names the colors of all views.
    pub fn add(&mut self, mesh: &Mesh, sites: &Sites, coloring: &Coloring, caption: String) {
        let part = PartView { name: "", mesh: Some(mesh), sites, cutter: "", outlines: &[] };
        let [width, height] = VIEW;
        self.cells.push((picture::view(&part, coloring, width, height), caption));
        for class in coloring.classes() {
            let entry = (class.name.to_string(), class.color);
            if !self.legend.contains(&entry) {
                self.legend.push(entry);
            }
        }
    }

    /// Adds views of a sample of the part `mesh`, as many as networks and one: its exact labels, and what each network
    /// predicts. Captions begin with `about`.
    pub fn add_answers(
        &mut self,
        mesh: &Mesh,
        sample: &Sample,
        networks: &[(&str, Trained)],
        about: &str,
    ) -> Result<()> {
        let sites = &*sample.sites;
        let mut answers = vec![("exact", sample.answers.clone())];
        for (name, trained) in networks {
            let (points, normals) = (&sites.points, &sites.normals);
            let prediction = trained.model.predict(points, normals, sample.cutter.to_array())?;
            answers.push((name, prediction.answers()));
        }
        for (name, answers) in &answers {
            let (inaccessible, occlusion) = (&answers.inaccessible(), answers.occlusion());
            let coloring = Coloring::Labels { inaccessible, occlusion };
            self.add(mesh, sites, &coloring, format!("{about}: {name}"));
        }
        Ok(())
    }

    /// The views of `n` series that were added by turns, one series after the other.
    pub fn by_turns(self, n: usize) -> Self {
        let of = |k: usize| self.cells.iter().skip(k).step_by(n).cloned();
        Sheet { cells: (0..n).flat_map(of).collect(), legend: self.legend }
    }

    /// All of them.
    pub fn image(&self) -> Image {
        let grid = Image::grid(&self.cells, COLUMNS);
        let mut image = Image::new(grid.width(), grid.height() + FOOT, [255; 3]);
        image.paste(&grid, 0, 0);
        let (mut x, y) = (20, grid.height() as i32 + 12);
        for (name, color) in &self.legend {
            image.rectangle(x, y, 16, 16, *color);
            image.text(x + 24, y, name, Font::Bold, INK);
            x += Font::Bold.width(name) as i32 + 56;
        }
        image
    }
}
