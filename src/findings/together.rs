//! Several tools together.

use crate::answers::{SiteAnswer, SiteAnswers};

/// The answers for sites that no tool of several reaches: inaccessible where all tools are.
///
/// # Panics
/// If there are no answers, or they differ in length.
pub fn for_all_tools<'a>(answers: impl Iterator<Item = &'a SiteAnswers>) -> SiteAnswers {
    let answers: Vec<&SiteAnswers> = answers.collect();
    let n = answers[0].len();
    let is_any = |i: usize, answer: SiteAnswer| answers.iter().any(|a| a.of(i) == answer);
    let best = |i: usize| {
        let better = [SiteAnswer::Accessible, SiteAnswer::TipDoesNotFit];
        better.into_iter().find(|answer| is_any(i, *answer)).unwrap_or(SiteAnswer::Inaccessible)
    };
    let mut common = SiteAnswers::by_mesh((0..n).map(best).collect());
    if n > 0 && answers.iter().all(|answers| answers.rest_mm.len() == n) {
        let least = |i: usize| answers.iter().map(|a| a.rest_mm[i]).fold(f32::INFINITY, f32::min);
        common.rest_mm = (0..n).map(least).collect();
        let volume = |i: usize| {
            let all = answers.iter().filter_map(|a| a.rest_volume_mm3.get(i).copied());
            all.fold(f32::INFINITY, f32::min)
        };
        common.rest_volume_mm3 = (0..n).map(volume).filter(|v| v.is_finite()).collect();
    }
    common
}
