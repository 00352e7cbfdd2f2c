//! Which sites a cutter cannot reach, and which sites are in its way: the exact collision labeler.
