//! Options of the published definition beside its directions and obstacles.

use crate::args::{called, millimeters};
use deepmill::access::LabelOptions;
use deepmill::{Error, Result};

/// The parts of the published definition that may be otherwise.
#[derive(Clone, clap::Args)]
pub struct PublishedArgs {
    /// Published definition: sites lower than the lowest plus this (1 by default) are labeled accessible and are no
    /// occlusion points; `none`: no such rule.
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    bottom: Option<String>,
    /// Published definition: how the tenth of the sites that are occlusion points is rounded, `floor` (default) or
    /// `ceil`.
    #[arg(long, value_name = "HOW")]
    occlusion_rounding: Option<String>,
}

impl PublishedArgs {
    /// The options of the published definition with what was given; refused where it is not about that.
    pub fn options(&self, is_published: bool) -> Result<LabelOptions> {
        if !is_published {
            let given = match (&self.bottom, &self.occlusion_rounding) {
                (None, None) => return Ok(LabelOptions::default()),
                (Some(_), _) => "--bottom",
                (None, Some(_)) => "--occlusion-rounding",
            };
            let remedy = "leave it out, or give --obstacles published";
            return Err(Error::argument(given, "given", "the published definition", remedy));
        }
        let mut options = LabelOptions::published();
        match self.bottom.as_deref() {
            None => {}
            Some("none") => options.bottom_mm = None,
            Some(text) => options.bottom_mm = Some(bottom(text)?),
        }
        if let Some(rounding) = &self.occlusion_rounding {
            options.rounding =
                rounding.parse().map_err(|error| called(error, "--occlusion-rounding"))?;
        }
        Ok(options)
    }
}

fn bottom(text: &str) -> Result<f64> {
    let length = millimeters(text).ok().filter(|mm| (0.0..=1e6).contains(mm));
    length.ok_or_else(|| {
        let expected = "a length of 0 mm or more, or none";
        Error::argument("--bottom", format!("`{text}`"), expected, "the published data have 1")
    })
}
