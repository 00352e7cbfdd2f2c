//! The request: everything that decided the answers of a file, as the file states it.

mod tool;

pub use tool::ToolSettings;

use crate::access::surface::Warning;
use crate::answers::{CONFIDENCE, Definition, Rounding};
use crate::geom::Mesh;
use crate::tool::directions::DirectionSet;
use crate::{Error, Result};
use serde::de::DeserializeOwned;
use serde::ser::{Error as _, Serializer};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};
use std::fmt;
use std::path::Path;

/// Everything that decided the answers of a file. What its command has no option for, or its version did not state, is
/// absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AnalysisSettings {
    /// Where the sites are from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sites: Option<SiteSettings>,
    /// The region of interest; none is all of the part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<RegionSettings>,
    /// The surfaces beside the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceSettings>,
    /// The tool beyond its four lengths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool: Option<ToolSettings>,
    /// The directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<DirectionSet>,
    /// Their number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_directions: Option<usize>,
    /// By which definition.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "definition_words")]
    pub definition: Option<Definition>,
    /// What blocks, if that was said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub obstacles: Option<Blocking>,
    /// Options of the mesh definition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_itself: Option<PartSettings>,
    /// What may make the answers misleading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warnings: Option<Vec<StatedWarning>>,
    /// Whether occlusion points were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion: Option<bool>,
    /// Share of the sites that are occlusion points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion_share: Option<f64>,
    /// How their number is rounded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion_rounding: Option<Rounding>,
    /// Tolerance of the bottom rule, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bottom_mm: Option<f64>,
    /// Greatest clearance that was looked for, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance_limit_mm: Option<f64>,
    /// Engine of the published definition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<String>,
    /// Local origin in the coordinates of the part's file, mm, of a part that is far from theirs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_mm: Option<[f64; 3]>,
    /// The network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// How predictions were verified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verify: Option<VerifySettings>,
    /// In what the part or the tool is unlike those of the training.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_domain: Option<Vec<String>>,
}

/// Where sites are from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct SiteSettings {
    /// Their number, `vertices` or `as given`.
    pub sites: String,
    /// Seed of those that are spread.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Normals are interpolated across edges folded by less, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth_deg: Option<f64>,
    /// `area` if faces weigh by it in the normals of `vertices`; without it by their angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertex_normals: Option<String>,
}

impl SiteSettings {
    /// So many sites spread over a mesh, or its `vertices`.
    pub fn spread(sites: String, seed: u64, smooth_deg: Option<f64>) -> Self {
        SiteSettings { sites, seed: Some(seed), smooth_deg, ..SiteSettings::default() }
    }

    /// The points of a cloud.
    pub fn as_given() -> Self {
        SiteSettings { sites: "as given".into(), ..SiteSettings::default() }
    }
}

/// The region of interest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct RegionSettings {
    /// Its faces, as `--only` has them.
    pub only: Vec<String>,
    /// Faces left out, as `--except` has them.
    pub except: Vec<String>,
    /// Its area, mm².
    pub area_mm2: f64,
    /// That of the part, mm².
    pub part_area_mm2: f64,
}

/// SHA-256 of the surfaces beside a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct SurfaceSettings {
    /// That of the part; none for a cloud.
    pub sha256: Option<String>,
    /// That of fixtures and table, if there are any.
    pub fixtures_sha256: Option<String>,
}

/// Options of the mesh definition.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct PartSettings {
    /// Files of the fixtures.
    pub fixtures: Vec<String>,
    /// Height of the table in the coordinates of the sites.
    pub table_z_mm: Option<f64>,
    /// How many cells of directions are searched at every level; 0: no search.
    pub search: Option<usize>,
    /// Whether proofs were searched for.
    pub prove: bool,
    /// Gouge tolerance, mm; none is by the tessellation.
    pub tolerance_mm: Option<f64>,
    /// Finish tolerance, mm.
    pub finish_mm: Option<f64>,
}

/// How predictions were verified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VerifySettings {
    /// Share of wrong answers allowed among those that are not computed; 0: all are computed.
    pub bound: f64,
    /// Probability with which the bound holds; `None` in files of before it was shown for each part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// Seed of the spot checks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The directions tested.
    pub directions: DirectionSet,
}

impl VerifySettings {
    /// Predictions verified up to a share of wrong answers by spot checks of a seed, in these directions.
    pub fn new((bound, seed): (f64, u64), directions: DirectionSet) -> Self {
        VerifySettings { bound, confidence: Some(CONFIDENCE), seed: Some(seed), directions }
    }
}

/// What blocks the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[non_exhaustive]
pub enum Blocking {
    /// The triangles of the part.
    Part,
    /// Its sites, and this many further points of it.
    Points(Option<usize>),
    /// The centroids of its triangles.
    Centroids,
}

impl Blocking {
    /// The definition of the answers.
    pub fn definition(self) -> Definition {
        match self {
            Blocking::Part => Definition::Part,
            Blocking::Points(_) | Blocking::Centroids => Definition::Sites,
        }
    }
}

impl fmt::Display for Blocking {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Blocking::Part => f.pad("part"),
            Blocking::Points(None) => f.pad("published"),
            Blocking::Points(Some(n)) => f.pad(&n.to_string()),
            Blocking::Centroids => f.pad("centroids"),
        }
    }
}

impl From<Blocking> for String {
    fn from(blocking: Blocking) -> Self {
        blocking.to_string()
    }
}

impl TryFrom<String> for Blocking {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        match &*text {
            "part" => Ok(Blocking::Part),
            "published" | "sites" => Ok(Blocking::Points(None)),
            "centroids" => Ok(Blocking::Centroids),
            count => match count.parse() {
                Ok(n) => Ok(Blocking::Points(Some(n))),
                Err(_) => Err(format!("`{text}` is not part, published, centroids or a number")),
            },
        }
    }
}

/// A warning in words, with its numbers where this version knows them.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StatedWarning {
    /// In words.
    pub words: String,
    /// In numbers.
    pub warning: Option<Warning>,
}

impl From<&Warning> for StatedWarning {
    fn from(warning: &Warning) -> Self {
        StatedWarning { words: warning.to_string(), warning: Some(*warning) }
    }
}

impl Serialize for StatedWarning {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let numbers = self.warning.map(serde_json::to_value).transpose();
        let mut map = match numbers.map_err(S::Error::custom)? {
            Some(Value::Object(map)) => map,
            _ => Map::new(),
        };
        map.insert("words".into(), self.words.clone().into());
        map.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for StatedWarning {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let words = value["words"].as_str().unwrap_or_default().to_owned();
        Ok(StatedWarning { words, warning: serde_json::from_value(value).ok() })
    }
}

fn definition_words<S: Serializer>(
    definition: &Option<Definition>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    definition.map(|definition| definition.to_string()).serialize(serializer)
}

impl AnalysisSettings {
    /// As JSON, as files hold it.
    pub fn json(&self) -> Value {
        serde_json::to_value(self).expect("records of numbers, strings and lists")
    }

    /// Reads what [`AnalysisSettings::json`] made, of this version or an earlier one.
    ///
    /// # Errors
    /// If a key holds what it cannot; `path` is named.
    pub(super) fn read(path: &Path, stated: &Value) -> Result<Self> {
        let read = Keys { path, stated };
        if !(stated.is_object() || stated.is_null()) {
            return Err(Error::file(path, "settings", "they are no object", WRITE_AGAIN));
        }
        let definition: Option<String> = read.key("definition")?;
        Ok(AnalysisSettings {
            sites: read.key("sites")?,
            region: read.key("region")?,
            surface: read.key("surface")?,
            tool: read.key("tool")?,
            directions: read.key("directions")?,
            n_directions: read.key("n_directions")?,
            definition: definition.map(|words| read.definition(&words)).transpose()?,
            obstacles: read.key("obstacles")?,
            part_itself: read.key("part_itself")?,
            origin_mm: read.key("origin_mm")?,
            warnings: read.key("warnings")?,
            occlusion: read.key("occlusion")?,
            occlusion_share: read.key("occlusion_share")?,
            occlusion_rounding: read.key("occlusion_rounding")?,
            bottom_mm: read.key("bottom_mm")?,
            clearance_limit_mm: read.key("clearance_limit_mm")?,
            engine: read.key("engine")?,
            model: read.key("model")?,
            verify: read.key("verify")?,
            outside_domain: read.key("outside_domain")?,
        })
    }

    /// The warnings and what is outside of the training, in words.
    pub fn warnings_in_words(&self) -> Vec<String> {
        let warnings = self.warnings.iter().flatten().map(|warning| warning.words.clone());
        warnings.chain(self.outside_domain.iter().flatten().cloned()).collect()
    }

    /// What the files of a part say of the surfaces beside them.
    ///
    /// # Errors
    /// If a mesh has more triangles than an STL file can count.
    pub fn surface_of(mesh: Option<&Mesh>, fixtures: Option<&Mesh>) -> Result<SurfaceSettings> {
        let hash = |mesh: Option<&Mesh>| mesh.map(super::hash::of_mesh).transpose();
        Ok(SurfaceSettings { sha256: hash(mesh)?, fixtures_sha256: hash(fixtures)? })
    }
}

const WRITE_AGAIN: &str = "write the file again with this version";

/// The keys of a file's settings.
struct Keys<'a> {
    path: &'a Path,
    stated: &'a Value,
}

impl Keys<'_> {
    fn fault(&self, key: &str, found: impl Into<String>) -> Error {
        Error::file(self.path, format!("settings.{key}"), found, WRITE_AGAIN)
    }

    fn key<T: DeserializeOwned>(&self, key: &str) -> Result<Option<T>> {
        match self.stated.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => {
                let read = serde_json::from_value(value.clone());
                read.map(Some).map_err(|e| self.fault(key, e.to_string()))
            }
        }
    }

    fn definition(&self, words: &str) -> Result<Definition> {
        let known = Definition::ALL.into_iter().find(|known| known.to_string() == words);
        known.ok_or_else(|| self.fault("definition", format!("the definition is `{words}`")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::files::tools::Tool;
    use crate::tool::cutter::CutterParams;
    use serde_json::json;

    fn read(value: &Value) -> Result<AnalysisSettings> {
        AnalysisSettings::read(Path::new("labels.npz"), value)
    }

    #[test]
    fn what_is_written_is_read_back_and_nothing_is_invented() {
        assert_eq!(AnalysisSettings::default().json(), json!({}));
        assert_eq!(read(&Value::Null).unwrap(), AnalysisSettings::default());
        let lengths = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
        let tool = Tool::new(lengths, None, 0.0).unwrap();
        let warning = Warning::Tiny { longest_mm: 3.5 };
        let all = AnalysisSettings {
            sites: Some(SiteSettings {
                sites: "70".into(),
                seed: Some(3),
                smooth_deg: Some(30.0),
                vertex_normals: Some("area".into()),
            }),
            region: Some(RegionSettings { only: vec!["a".into()], ..RegionSettings::default() }),
            surface: Some(SurfaceSettings { sha256: Some("00".into()), fixtures_sha256: None }),
            tool: Some(ToolSettings::of(&tool)),
            directions: Some(DirectionSet::Published),
            n_directions: Some(152),
            definition: Some(Definition::Sites),
            obstacles: Some(Blocking::Points(Some(200))),
            part_itself: Some(PartSettings { search: Some(4), ..PartSettings::default() }),
            origin_mm: Some([1.0, 2.0, 3.0]),
            warnings: Some(vec![StatedWarning::from(&warning)]),
            occlusion: Some(true),
            occlusion_share: Some(0.1),
            occlusion_rounding: Some(Rounding::Floor),
            bottom_mm: Some(1.0),
            clearance_limit_mm: Some(2.0),
            engine: Some("pruned".into()),
            model: Some("m".into()),
            verify: Some(VerifySettings::new((0.01, 0), DirectionSet::Published)),
            outside_domain: Some(vec!["far".into()]),
        };
        assert_eq!(read(&all.json()).unwrap(), all);
        assert_eq!(all.json()["warnings"][0]["longest_mm"], 3.5);
        assert_eq!(all.warnings_in_words(), [warning.to_string(), "far".into()]);
        for blocking in [Blocking::Part, Blocking::Points(None), Blocking::Centroids] {
            assert_eq!(Blocking::try_from(blocking.to_string()), Ok(blocking));
        }
    }

    #[test]
    fn nulls_and_keys_of_other_versions_are_no_fault_and_wrong_kinds_are_named() {
        let older = json!({
            "region": null, "bottom_mm": null, "obstacles": "sites", "of_the_future": 1,
            "warnings": [{ "warning": "of-the-future", "words": "beware" }],
        });
        let settings = read(&older).unwrap();
        assert_eq!(settings.obstacles, Some(Blocking::Points(None)));
        assert_eq!(settings.warnings_in_words(), ["beware"]);
        for (key, value) in [
            ("definition", json!("guessed")),
            ("directions", json!({ "kind": "none" })),
            ("obstacles", json!("walls")),
            ("tool", json!({ "corner_mm": "wide" })),
        ] {
            let mut wrong = json!({});
            wrong[key] = value;
            let message = read(&wrong).unwrap_err().to_string();
            assert!(message.starts_with(&format!("labels.npz: settings.{key}: ")), "{message}");
        }
        let message = read(&json!([1])).unwrap_err().to_string();
        assert!(message.starts_with("labels.npz: settings: they are no object"), "{message}");
    }
}
