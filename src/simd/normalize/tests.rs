use super::*;

fn numbers(n: usize, seed: usize) -> Vec<f32> {
    (0..n).map(|i| (((i + seed) * 7919 + 13) % 97) as f32 * 0.037 - 1.7).collect()
}

fn bits(x: &[f32]) -> Vec<u32> {
    x.iter().map(|x| x.to_bits()).collect()
}

/// Rows of some width around the edges of vectors and strips.
struct Case {
    c: usize,
    mean: Vec<f32>,
    factor: Vec<f32>,
    bias: Vec<f32>,
    x: Vec<f32>,
    other: Vec<f32>,
    y: Vec<f32>,
}

impl Case {
    fn new(c: usize, n_rows: usize) -> Self {
        let [mean, factor, bias] = [1, 2, 3].map(|seed| numbers(c, seed));
        let [x, other, y] = [4, 5, 6].map(|seed| numbers(n_rows * c, seed));
        Case { c, mean, factor, bias, x, other, y }
    }

    fn columns(&self) -> Columns<'_, f32> {
        Columns { mean: &self.mean, factor: &self.factor, bias: &self.bias }
    }

    fn normalized(&self, i: usize) -> f32 {
        let j = i % self.c;
        (self.x[i] - self.mean[j]) * self.factor[j] + self.bias[j]
    }
}

fn cases() -> impl Iterator<Item = (Isa, Case)> {
    let widths = [1, 2, 4, 7, 8, 9, 16, 17, 24, 33, 48];
    // Every tail of a row, and rows around the edges of strips; few of them under Miri.
    let sizes = (1..=35)
        .map(|c| (c, 2))
        .chain(widths.into_iter().flat_map(|c| [0, 1, 5, STRIP, 2 * STRIP + 3].map(|n| (c, n))))
        .step_by(if cfg!(miri) { 5 } else { 1 })
        .filter(|(_, n)| !cfg!(miri) || *n < STRIP);
    let at = |&isa| sizes.clone().map(move |(c, n)| (isa, Case::new(c, n)));
    Isa::available().iter().flat_map(at).collect::<Vec<_>>().into_iter()
}

#[test]
fn rows_are_normalized_as_in_the_plain_loop_at_every_isa() {
    for (isa, case) in cases() {
        let relu = |x: f32| if 0.0 > x { 0.0 } else { x };
        let expected = |activation: &Activation<f32>, i: usize| {
            let n = case.normalized(i);
            match activation {
                Activation::Identity => n,
                Activation::Relu => relu(n),
                Activation::ReluOfSum(other) => relu(n + other[i]),
                Activation::ReluOfSumWithOutput => relu(n + case.y[i]),
                Activation::PassReluOfSum(other) if n + other[i] > 0.0 => case.y[i],
                Activation::PassReluOfSum(_) => 0.0,
            }
        };
        for activation in [
            Activation::Identity,
            Activation::Relu,
            Activation::ReluOfSum(&case.other),
            Activation::ReluOfSumWithOutput,
            Activation::PassReluOfSum(&case.other),
        ] {
            let expected: Vec<f32> = (0..case.x.len()).map(|i| expected(&activation, i)).collect();
            let (columns, mut y) = (case.columns(), case.y.clone());
            normalize(isa, NormalizeRows { columns, x: Some(&case.x), activation, y: &mut y });
            assert_eq!(bits(&y), bits(&expected), "{} {activation:?}", isa.name());
            let alone = matches!(
                activation,
                Activation::Identity | Activation::Relu | Activation::ReluOfSum(_)
            );
            if alone {
                let mut y = case.x.clone();
                normalize(isa, NormalizeRows { columns, x: None, activation, y: &mut y });
                assert_eq!(bits(&y), bits(&expected), "{} in place {activation:?}", isa.name());
            }
        }
    }
}

#[test]
fn the_way_back_is_that_of_the_plain_loop_at_every_isa() {
    for (isa, case) in cases() {
        let (c, inv_std) = (case.c, numbers(case.c, 9));
        let means = [numbers(c, 10), numbers(c, 11)];
        for relu in [false, true] {
            let rows = BackwardRows { columns: case.columns(), inv_std: &inv_std, relu };
            let at = |i: usize| {
                let passes = !relu || case.normalized(i) > 0.0;
                let dy = if passes { case.y[i] } else { 0.0 };
                ((case.x[i] - case.mean[i % c]) * inv_std[i % c], dy)
            };
            let (mut expected, mut dx) = ([vec![0.5; c], vec![0.25; c]], Vec::new());
            for i in 0..case.x.len() {
                let (j, (x_hat, dy)) = (i % c, at(i));
                expected[0][j] += f64::from(x_hat * dy);
                expected[1][j] += f64::from(dy);
                dx.push(case.factor[j] * (dy - means[1][j] - x_hat * means[0][j]));
            }
            let mut sums = [vec![0.5; c], vec![0.25; c]];
            let [dweight, dbias] = &mut sums;
            let (x, dy, sums_of) = (&case.x[..], &case.y[..], [&mut dweight[..], &mut dbias[..]]);
            backward_sums(isa, BackwardSums { rows, x, dy, sums: sums_of });
            assert_eq!(sums, expected, "{}", isa.name());
            for over_dy in [false, true] {
                let (read, over) = if over_dy { (x, dy) } else { (dy, x) };
                let (mut over, means) = (over.to_vec(), [&means[0][..], &means[1][..]]);
                backward_apply(isa, BackwardApply { rows, means, over_dy, read, over: &mut over });
                assert_eq!(bits(&over), bits(&dx), "{}", isa.name());
            }
        }
    }
}

#[test]
fn sums_over_rows_take_them_in_order_at_every_isa() {
    for (isa, case) in cases() {
        let mean: Vec<f64> = case.mean.iter().map(|&m| f64::from(m) / 3.0).collect();
        for mean in [None, Some(&mean[..])] {
            let mut expected = vec![0.125; case.c];
            for (i, &x) in case.x.iter().enumerate() {
                let j = i % case.c;
                let centered = f64::from(x) - mean.map_or(0.0, |mean| mean[j]);
                expected[j] += mean.map_or(f64::from(x), |_| centered * centered);
            }
            let mut sums = vec![0.125; case.c];
            column_sums(isa, &case.x, mean, &mut sums);
            assert_eq!(sums, expected, "{}", isa.name());
        }
    }
}

#[test]
#[should_panic(expected = "rows of equal number")]
fn another_number_of_rows_panics() {
    let (one, mut y) = ([1.0f32; 2], [0.0; 4]);
    let columns = Columns { mean: &one, factor: &one, bias: &one };
    let activation = Activation::ReluOfSum(&one);
    normalize(Isa::active(), NormalizeRows { columns, x: None, activation, y: &mut y });
}
