//! Configuration of a network of either kind, and its form in files.

use super::config::{CutterConfig, UNetConfig};
use super::graph_sage::GraphSageConfig;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{DeserializeSeed, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Which network, and its numbers.
///
/// In files the entry `kind` names it; without one it is an octree network, which is written without:
///
/// ```
/// # #[cfg(feature = "formats")]
/// # fn main() -> Result<(), serde_json::Error> {
/// use deepmill::model::{NetworkConfig, UNetConfig};
/// let octree: NetworkConfig = UNetConfig::tiny().into();
/// let text = serde_json::to_string(&octree)?;
/// assert!(!text.contains("kind") && serde_json::from_str::<NetworkConfig>(&text)? == octree);
/// let graph: NetworkConfig = serde_json::from_str(r#"{ "kind": "graph_sage", "widths": [32, 32] }"#)?;
/// assert!(matches!(graph, NetworkConfig::GraphSage(_)));
/// # Ok(())
/// # }
/// # #[cfg(not(feature = "formats"))]
/// # fn main() {}
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NetworkConfig {
    /// The octree network.
    Octree(UNetConfig),
    /// GraphSAGE on the graph of the sites.
    #[doc(hidden)] // of the program
    GraphSage(GraphSageConfig),
}

impl NetworkConfig {
    /// The cutter modules.
    pub fn cutter(&self) -> &CutterConfig {
        match self {
            NetworkConfig::Octree(config) => &config.cutter,
            NetworkConfig::GraphSage(config) => &config.cutter,
        }
    }

    /// The cutter modules, to be changed.
    pub fn cutter_mut(&mut self) -> &mut CutterConfig {
        match self {
            NetworkConfig::Octree(config) => &mut config.cutter,
            NetworkConfig::GraphSage(config) => &mut config.cutter,
        }
    }

    /// The octree network; `None` if it is another.
    pub fn octree(&self) -> Option<&UNetConfig> {
        match self {
            NetworkConfig::Octree(config) => Some(config),
            NetworkConfig::GraphSage(_) => None,
        }
    }

    /// Whether a network of this configuration may begin with the parameters of the other: both are the same but for
    /// the number of coarse directions, if both read any.
    pub fn has_parameters_of(&self, other: &NetworkConfig) -> bool {
        let mut own = self.clone();
        if let (Some(own), Some(other)) = (own.octree_mut(), other.octree()) {
            let n_other = other.input.coarse_directions;
            if own.input.coarse_directions > 0 && n_other > 0 {
                own.input.coarse_directions = n_other;
            }
        }
        own == *other
    }

    /// The octree network, to be changed; `None` if it is another.
    pub fn octree_mut(&mut self) -> Option<&mut UNetConfig> {
        match self {
            NetworkConfig::Octree(config) => Some(config),
            NetworkConfig::GraphSage(_) => None,
        }
    }
}

impl From<UNetConfig> for NetworkConfig {
    fn from(config: UNetConfig) -> Self {
        NetworkConfig::Octree(config)
    }
}

impl From<GraphSageConfig> for NetworkConfig {
    fn from(config: GraphSageConfig) -> Self {
        NetworkConfig::GraphSage(config)
    }
}

/// The form in which each network names its kind.
#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Tagged {
    Octree(UNetConfig),
    GraphSage(GraphSageConfig),
}

const KIND: &str = "kind";
const DEFAULT_KIND: &str = "octree";

impl Serialize for NetworkConfig {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            NetworkConfig::Octree(config) => config.serialize(serializer),
            NetworkConfig::GraphSage(config) => {
                Tagged::GraphSage(config.clone()).serialize(serializer)
            }
        }
    }
}

impl<'de> Deserialize<'de> for NetworkConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(WithDefaultKind)
    }
}

struct WithDefaultKind;

impl<'de> Visitor<'de> for WithDefaultKind {
    type Value = NetworkConfig;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("the configuration of a network")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<NetworkConfig, A::Error> {
        let map = DefaultKind { map, state: Kind::NotSeen };
        Ok(match Tagged::deserialize(MapAccessDeserializer::new(map))? {
            Tagged::Octree(config) => NetworkConfig::Octree(config),
            Tagged::GraphSage(config) => NetworkConfig::GraphSage(config),
        })
    }
}

/// A map, and after its entries the default kind, if none of them was the kind.
struct DefaultKind<A> {
    map: A,
    state: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    NotSeen,
    /// Its key was given in the place of a missing entry, and the value is to follow.
    Added,
    Seen,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for DefaultKind<A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        let key = self.map.next_key::<String>()?;
        match (&key, self.state) {
            (Some(key), _) if key == KIND => self.state = Kind::Seen,
            (None, Kind::NotSeen) => {
                self.state = Kind::Added;
                let key: StrDeserializer<A::Error> = KIND.into_deserializer();
                return seed.deserialize(key).map(Some);
            }
            _ => {}
        }
        key.map(|key| seed.deserialize(key.into_deserializer())).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        match self.state {
            Kind::Added => {
                let kind: StrDeserializer<A::Error> = DEFAULT_KIND.into_deserializer();
                seed.deserialize(kind)
            }
            _ => self.map.next_value_seed(seed),
        }
    }
}

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<NetworkConfig, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn octree_networks_are_written_as_ever_and_graph_networks_by_their_kind() {
        let config = UNetConfig::reference();
        let plain = serde_json::to_string(&config).unwrap();
        let octree = NetworkConfig::from(config);
        assert_eq!(serde_json::to_string(&octree).unwrap(), plain);
        assert_eq!(read(&plain).unwrap(), octree);
        assert_eq!(read(&plain.replacen('{', "{\"kind\":\"octree\",", 1)).unwrap(), octree);
        let graph = NetworkConfig::from(GraphSageConfig { widths: vec![3], ..Default::default() });
        let text = serde_json::to_string(&graph).unwrap();
        assert!(text.starts_with("{\"kind\":\"graph_sage\""), "{text}");
        assert_eq!(read(&text).unwrap(), graph);
        let toml = toml::to_string(&graph).unwrap();
        assert_eq!(toml::from_str::<NetworkConfig>(&toml).unwrap(), graph);
    }

    #[test]
    fn wrong_entries_are_named() {
        let kind = read(r#"{ "kind": "transformer" }"#).unwrap_err();
        assert!(kind.contains("transformer") && kind.contains("graph_sage"), "{kind}");
        let field = read(r#"{ "kind": "graph_sage", "depth": 3 }"#).unwrap_err();
        assert!(field.contains("unknown field `depth`"), "{field}");
        let missing = read("{}").unwrap_err();
        assert!(missing.contains("missing field `stem_width`"), "{missing}");
        assert!(read("7").unwrap_err().contains("configuration of a network"));
    }
}
