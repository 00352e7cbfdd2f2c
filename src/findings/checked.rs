//! Findings that are read, checked.

use super::Findings;
use crate::{Error, Result};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

impl Serialize for Findings {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        Findings::serialize(self, to)
    }
}

impl<'de> Deserialize<'de> for Findings {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let read = Findings::deserialize(from)?;
        read.check().map_err(D::Error::custom)?;
        Ok(read)
    }
}

impl Findings {
    /// Numbers of sites are those of findings, as often as these have sites; scattered sites have none.
    fn check(&self) -> Result<()> {
        let remedy = "give the findings as they were written";
        let mut n_sites = vec![0; self.list.len()];
        for number in self.of_site.iter().filter(|number| **number > 0) {
            let Some(n) = n_sites.get_mut(*number as usize - 1) else {
                let expected = format!("numbers of {} findings", self.list.len());
                return Err(Error::argument("of_site", number, expected, remedy));
            };
            *n += 1;
        }
        for ((finding, n), number) in self.list.iter().zip(n_sites).zip(1..) {
            if finding.n_sites != n {
                let found = format!("{n} sites of finding {number}");
                let expected = format!("{}, as it has", finding.n_sites);
                return Err(Error::argument("of_site", found, expected, remedy));
            }
        }
        let is_scattered = |i: &u32| self.of_site.get(*i as usize) == Some(&0);
        let is_ascending = self.scattered_sites.is_sorted_by(|a, b| a < b);
        if !(is_ascending && self.scattered_sites.iter().all(is_scattered)) {
            let expected = "sites of no finding, ascending";
            return Err(Error::argument("scattered_sites", "others", expected, remedy));
        }
        Ok(())
    }
}
