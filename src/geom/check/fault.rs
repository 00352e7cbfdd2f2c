//! Kinds of fault of a mesh, with a name, a description and a remedy for each.

/// Kinds of fault, the most fundamental first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Fault {
    /// Triangles with a corner that names no vertex; nothing else is looked at then.
    MissingVertex,
    /// Vertices whose place is not finite.
    NotFinite,
    /// There is no triangle with three different corners.
    Empty,
    /// Vertices within an edge with one triangle: neighbors touch there, but share no edge.
    TJunction,
    /// Edges with one triangle: the surface has a hole there.
    OpenEdge,
    /// Edges with more than two triangles.
    NonManifoldEdge,
    /// Edges whose two triangles pass them in the same direction: one of them is turned over.
    InconsistentEdge,
    /// Vertices where the triangles form more than one fan: solids touching in a point.
    NonManifoldVertex,
    /// More pieces than one that share no edge.
    ManyComponents,
    /// The triangles face inward.
    Inward,
    /// Triangles without area: a corner used twice, or three in line.
    Degenerate,
    /// Triangles so low that their normal is uncertain.
    Sliver,
    /// Triangles that pierce others; found by [`crate::geom::intersect`] only.
    SelfIntersection,
}

impl Fault {
    /// Whether labels of a mesh with this fault would be meaningless.
    pub fn blocks_labeling(self) -> bool {
        self < Fault::Degenerate
    }

    /// As [`Fault::blocks_labeling`], where several bodies may be: each is labeled against all.
    pub fn blocks_bodies(self) -> bool {
        self.blocks_labeling() && self != Fault::ManyComponents
    }

    /// Its name for programs.
    pub fn name(self) -> &'static str {
        match self {
            Fault::MissingVertex => "missing_vertex",
            Fault::NotFinite => "not_finite",
            Fault::Empty => "empty",
            Fault::OpenEdge => "open_edge",
            Fault::TJunction => "t_junction",
            Fault::NonManifoldEdge => "non_manifold_edge",
            Fault::InconsistentEdge => "inconsistent_edge",
            Fault::NonManifoldVertex => "non_manifold_vertex",
            Fault::ManyComponents => "many_components",
            Fault::Inward => "inward",
            Fault::Degenerate => "degenerate",
            Fault::Sliver => "sliver",
            Fault::SelfIntersection => "self_intersection",
        }
    }

    /// What was found `count` times, in words.
    pub(super) fn words(self, count: usize) -> &'static str {
        let [one, many] = match self {
            Fault::MissingVertex => {
                ["triangle that names a missing vertex", "triangles that name a missing vertex"]
            }
            Fault::NotFinite => {
                ["vertex whose place is not finite", "vertices whose place is not finite"]
            }
            Fault::Empty => ["mesh without a triangle"; 2],
            Fault::OpenEdge => {
                ["open edge (used by one triangle)", "open edges (used by one triangle)"]
            }
            Fault::TJunction => [
                "T-junction (a vertex within an open edge of another triangle)",
                "T-junctions (vertices within open edges of other triangles)",
            ],
            Fault::NonManifoldEdge => {
                ["edge used by more than two triangles", "edges used by more than two triangles"]
            }
            Fault::InconsistentEdge => [
                "edge between triangles that face opposite sides",
                "edges between triangles that face opposite sides",
            ],
            Fault::NonManifoldVertex => [
                "vertex where several sheets touch in a point",
                "vertices where several sheets touch in a point",
            ],
            Fault::ManyComponents => ["separate component", "separate components"],
            Fault::Inward => ["component that faces inward", "components that face inward"],
            Fault::Degenerate => ["triangle without area", "triangles without area"],
            Fault::Sliver => [
                "sliver (lower than 1e-5 of the diagonal)",
                "slivers (lower than 1e-5 of the diagonal)",
            ],
            Fault::SelfIntersection => [
                "pair of triangles that pierce or cover each other",
                "pairs of triangles that pierce or cover each other",
            ],
        };
        if count == 1 { one } else { many }
    }

    /// What the user can do about it.
    pub fn remedy(self) -> &'static str {
        match self {
            Fault::MissingVertex | Fault::NotFinite | Fault::Empty => "export the part again",
            Fault::OpenEdge => {
                "try `deepmill check --repair` (in a program `geom::repair::repair`), which closes gaps \
                 of up to 1e-5 of the diagonal; else close the solid in the program that wrote it"
            }
            Fault::TJunction => {
                "split the longer edge at the vertex in the program that wrote it: mesh the faces so \
                 that neighbors share their corners"
            }
            Fault::NonManifoldEdge => {
                "try `deepmill check --repair` (in a program `geom::repair::repair`), else separate \
                 or join the touching bodies in the CAD program"
            }
            Fault::InconsistentEdge | Fault::Inward => {
                "try `deepmill check --repair` (in a program `geom::repair::repair`)"
            }
            Fault::NonManifoldVertex => "separate or join the touching bodies in the CAD program",
            Fault::ManyComponents => {
                "each body is labeled against all; fill voids that no cutter can enter, lest they count as out of reach"
            }
            Fault::Degenerate => {
                "harmless: they are no obstacles and hold no sites; a repair drops collapsed ones"
            }
            Fault::Sliver => "harmless for labels unless sites land on them",
            Fault::SelfIntersection => "unite the overlapping bodies in the CAD program",
        }
    }

    /// What to do if [`repair`](crate::geom::repair) has been tried already.
    pub fn remedy_beyond_repair(self) -> &'static str {
        match self {
            Fault::OpenEdge => {
                "repair could not close it: close the solid in the program that wrote it"
            }
            Fault::NonManifoldEdge => "separate or join the touching bodies in the CAD program",
            Fault::InconsistentEdge | Fault::Inward => {
                "repair could not orient it: check the faces in the program that wrote it"
            }
            Fault::Degenerate => "harmless for labels",
            _ => self.remedy(),
        }
    }
}
