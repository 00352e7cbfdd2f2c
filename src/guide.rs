//! The guides of `docs`, for reading beside the items. Links between them and their pictures are those of the
//! repository.
#![allow(rustdoc::all)] // Brackets, formulas and paths of the repository are no links, tags or code.

/// A module for each page. They hold formulas, which doctests would take for Rust.
macro_rules! guides {
    ($($name:ident $file:literal)*) => {$(
        #[cfg_attr(not(doctest), doc = include_str!(concat!("../docs/", $file)))]
        #[cfg_attr(doctest, doc = $file)]
        pub mod $name {}
    )*};
}

guides! {
    adding_a_layer "adding-a-layer.md"
    analysis "analysis.md"
    backprop "backprop.md"
    concepts "concepts.md"
    formats "formats.md"
    gradcheck "gradcheck.md"
    labeling "labeling.md"
    limits "limits.md"
    mesh_definition "mesh-definition.md"
    meshes "meshes.md"
    numerics "numerics.md"
    octree "octree.md"
    performance "performance.md"
    rest "rest.md"
    setups "setups.md"
    sites "sites.md"
    tools "tools.md"
    training "training.md"
}

/// Its examples are tests.
#[cfg(all(doctest, feature = "generate"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
