//! Setters.

use super::{AttentionConfig, CutterConfig, CutterInput, CutterPlacement, InputConfig, UNetConfig};

setters!(InputConfig {
    with_depth(depth: usize),
    with_full_depth(full_depth: usize),
    with_features(features: String),
    with_cutter(cutter: CutterInput),
    with_point_normals(point_normals: bool),
    with_coarse_directions(coarse_directions: usize),
});

setters!(CutterConfig {
    with_placement(placement: CutterPlacement),
    with_shared(shared: bool),
    with_hidden_width(hidden_width: usize),
    with_width(width: usize),
    with_batch_norm(batch_norm: bool),
    with_dropout(dropout: f64),
});

setters!(AttentionConfig {
    with_depths(depths: Vec<usize>),
    with_n_heads(n_heads: usize),
});

setters!(UNetConfig {
    with_input(input: InputConfig),
    with_stem_width(stem_width: usize),
    with_encoder_widths(encoder_widths: Vec<usize>),
    with_encoder_blocks(encoder_blocks: Vec<usize>),
    with_decoder_widths(decoder_widths: Vec<usize>),
    with_decoder_blocks(decoder_blocks: Vec<usize>),
    with_head_width(head_width: usize),
    #[doc(hidden)]
    with_normalize_empty_parents(normalize_empty_parents: bool),
    with_cutter(cutter: CutterConfig),
    with_attention(attention: AttentionConfig),
    with_share_head(share_head: bool),
});
