//! What a random sample says about the share of wrong answers among those not drawn.

/// P(X ≤ `n_found`) for the number X of wrong ones among `n_drawn` of `n`, drawn without replacement, if `n_wrong` of
/// all are wrong; 1 where `n_found` is not below the mean, where nothing can be said.
///
/// The terms are summed from the greatest downward, so none that counts is lost.
fn probability_of_so_few(n: usize, n_wrong: usize, n_drawn: usize, n_found: usize) -> f64 {
    let real = |n: usize| n as f64;
    if real(n_found) * real(n) >= real(n_drawn) * real(n_wrong) {
        return 1.0;
    }
    let n_right = n - n_wrong;
    let least = n_drawn.saturating_sub(n_right);
    if n_found < least {
        return 0.0;
    }
    let ways = ln_choices(n_wrong, n_found) + ln_choices(n_right, n_drawn - n_found);
    let mut term = libm::exp(ways - ln_choices(n, n_drawn));
    let mut sum = term;
    for k in (least + 1..=n_found).rev() {
        // From k wrong ones to k − 1.
        term *= real(k) * real(n_right + k - n_drawn);
        term /= real(n_wrong - k + 1) * real(n_drawn - k + 1);
        sum += term;
    }
    sum.min(1.0)
}

/// ln of the number of ways to choose `k` of `n`.
fn ln_choices(n: usize, k: usize) -> f64 {
    let ln_factorial = |n: usize| libm::lgamma(n as f64 + 1.0);
    ln_factorial(n) - ln_factorial(k) - ln_factorial(n - k)
}

/// Upper confidence limit of the share of wrong ones among the `n − n_drawn` that were not drawn, if `n_found` of the
/// drawn ones are wrong: with a probability of at most `risk` over the draw the true share is greater. 0 if all were
/// drawn.
///
/// The limit of Clopper and Pearson (1934) for draws without replacement (hypergeometric). Theirs for draws with
/// replacement (binomial) is about all `n`, and may be too low for those not drawn: wrong ones that were drawn by
/// chance less often than their share are more often among the others.
pub(super) fn upper_limit(n: usize, n_drawn: usize, n_found: usize, risk: f64) -> f64 {
    let n_others = n - n_drawn;
    // The greatest number of wrong ones among the others that is not ruled out.
    let (mut possible, mut refuted) = (0, n_others + 1);
    while refuted - possible > 1 {
        let middle = possible + (refuted - possible) / 2;
        match probability_of_so_few(n, n_found + middle, n_drawn, n_found) > risk {
            true => possible = middle,
            false => refuted = middle,
        }
    }
    possible as f64 / n_others.max(1) as f64
}

/// So many of `n` to draw that the [`upper_limit`] is at most `bound` even if `n_found` of them are wrong; hardly
/// more than needed, and all if no fewer suffice.
pub(super) fn sample_size(n: usize, n_found: usize, bound: f64, risk: f64) -> usize {
    let suffices = |n_drawn: usize| {
        let n_others = n - n_drawn;
        let above = (bound * n_others as f64) as usize + 1;
        above > n_others || probability_of_so_few(n, n_found + above, n_drawn, n_found) <= risk
    };
    let (mut least, mut enough) = (n_found, n);
    while least < enough {
        let middle = least + (enough - least) / 2;
        if suffices(middle) {
            enough = middle;
        } else {
            least = middle + 1;
        }
    }
    enough.min(n)
}

/// The greatest mean of a Poisson distribution with P(X ≤ `most`) ≥ `power`.
pub(super) fn greatest_mean(most: usize, power: f64) -> f64 {
    let probability = |mean: f64| {
        let (mut term, mut sum) = (libm::exp(-mean), 0.0);
        for k in 0..=most {
            sum += term;
            term *= mean / (k + 1) as f64;
        }
        sum
    };
    let (mut low, mut high) = (0.0, most as f64 + 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if probability(middle) >= power {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From sums of exact fractions.
    #[test]
    fn probabilities_are_those_of_draws_without_replacement() {
        for ([n, n_wrong, n_drawn, n_found], exact) in EXACT {
            let found = probability_of_so_few(n, n_wrong, n_drawn, n_found);
            assert!((found / exact - 1.0).abs() < 1e-10, "{n} {n_drawn} {n_found}: {found}");
        }
        assert_eq!(probability_of_so_few(10, 6, 8, 3), 0.0, "four of them are right");
        assert_eq!(probability_of_so_few(10, 5, 4, 2), 1.0);
    }

    #[test]
    fn probabilities_of_many_sites_are_not_lost() {
        // The first term, of no wrong one, is e^-2565.
        let likely = probability_of_so_few(100_000, 50_000, 5_000, 2_490);
        assert!((0.3..0.45).contains(&likely), "{likely}");
    }

    /// Where few of many are drawn, the limits are the binomial ones of Clopper and Pearson.
    #[test]
    fn limits_of_small_samples_are_those_of_clopper_and_pearson() {
        for (n_drawn, n_found, risk, expected) in CLOPPER_PEARSON {
            let found = upper_limit(10_000_000, n_drawn, n_found, risk);
            assert!((found / expected - 1.0).abs() < 1e-4, "{n_found} of {n_drawn}: {found}");
        }
    }

    #[test]
    fn limits_are_about_those_not_drawn() {
        assert_eq!(upper_limit(50, 50, 7, 0.05), 0.0);
        // None wrong of five of six: the last one is wrong and was left out once in six times.
        assert_eq!(upper_limit(6, 5, 0, 0.16), 1.0);
        assert_eq!(upper_limit(6, 5, 0, 0.17), 0.0);
    }

    #[test]
    fn samples_suffice_and_are_hardly_larger_than_needed() {
        for (n, n_found, bound, risk) in
            [(7000, 0, 0.01, 0.05), (6000, 5, 0.01, 0.025), (900, 2, 0.05, 0.0125)]
        {
            let size = sample_size(n, n_found, bound, risk);
            assert!(upper_limit(n, size, n_found, risk) <= bound);
            // Not one less: whole numbers of wrong ones let the limit rise here and there as the sample grows.
            assert!(upper_limit(n, size - size / 50, n_found, risk) > bound, "{size}");
        }
        assert_eq!(sample_size(7000, 0, 1.0, 0.05), 0);
        // A single wrong one is left out with a probability of one in twenty.
        assert_eq!(sample_size(7000, 0, 1e-9, 0.05), 6650);
        assert_eq!(sample_size(15, 0, 1e-9, 0.05), 15);
        assert_eq!(sample_size(3, 7, 0.1, 0.05), 3);
    }

    #[test]
    fn means_keep_their_promise() {
        assert!((greatest_mean(0, 0.8) + libm::log(0.8)).abs() < 1e-12);
        // The table of the Poisson distribution: P(X ≤ 3) = 0.8 at a mean of 2.2968.
        assert!((greatest_mean(3, 0.8) - 2.2968).abs() < 1e-4);
    }

    const EXACT: [([usize; 4], f64); 6] = [
        ([20, 8, 10, 2], 8.490_116_694_451_06e-2),
        ([10, 6, 8, 4], 3.333333333333333e-01),
        ([7000, 71, 420, 0], 1.208281031840493e-02),
        ([6500, 97, 900, 3], 3.673204444152561e-04),
        ([6500, 90, 3000, 20], 1.889486624211287e-06),
        ([30, 25, 12, 8], 6.808_134_394_341_29e-2),
    ];

    /// Drawn, found, risk; beta quantiles, computed with 30 digits.
    const CLOPPER_PEARSON: [(usize, usize, f64, f64); 5] = [
        (300, 0, 0.05, 0.0099360819),
        (300, 1, 0.05, 0.0157145549),
        (1000, 5, 0.025, 0.0116294706),
        (50, 3, 0.05, 0.1478371764),
        (100, 10, 0.025, 0.1762225977),
    ];
}
