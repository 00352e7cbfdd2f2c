//! Mistakes that the kit of gradient checks catches, one wrong function for each, and right ones that pass. Wrong
//! layers are in `gradcheck_state.rs`.

use deepmill::gradcheck::{
    Case, GradcheckSettings, adjoint, function, layer, matrix_shapes, negative_control,
    negative_control_of_layer, octree_shapes, probe, sweep,
};
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::linear::Linear;
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use std::cell::RefCell;

const LIMIT: f64 = 1e-7;

fn settings() -> GradcheckSettings {
    GradcheckSettings::default()
}

#[test]
fn state_of_closures_is_found() {
    // backward computes from what the last forward pass left.
    let x = probe(5, 1);
    let last = RefCell::new(Vec::new());
    let forward = |v: &[Vec<f64>]| {
        *last.borrow_mut() = v[0].clone();
        v[0].iter().map(|x| x * x * x).collect()
    };
    let backward = |_: &[Vec<f64>], dy: &[f64]| {
        vec![last.borrow().iter().zip(dy).map(|(x, dy)| 3.0 * x * x * dy).collect()]
    };
    let report = function(&[("x", &x)], forward, backward, &settings()).unwrap();
    assert!(report.require(LIMIT).is_err(), "{report}");
    // backward adds to what it returned before.
    let sum = RefCell::new(vec![0.0; 5]);
    let forward = |v: &[Vec<f64>]| v[0].clone();
    let backward = |_: &[Vec<f64>], dy: &[f64]| {
        sum.borrow_mut().iter_mut().zip(dy).for_each(|(sum, dy)| *sum += dy);
        vec![sum.borrow().clone()]
    };
    let message = function(&[("x", &x)], forward, backward, &settings()).unwrap_err().to_string();
    assert!(message.contains("the second time"), "{message}");
}

#[test]
fn tiny_gradients_are_held_to_their_own_size() {
    let forward = |v: &[Vec<f64>]| {
        let (x, w) = (&v[0], &v[1]);
        vec![x[0] * x[0], 1e-12 * x[1] * x[1], w[0], 1e-12 * w[0] * w[0] * w[0]]
    };
    let wrong = |at: [f64; 2]| {
        move |v: &[Vec<f64>], dy: &[f64]| {
            let (x, w) = (&v[0], &v[1]);
            let dx = vec![2.0 * x[0] * dy[0], at[0] * 2e-12 * x[1] * dy[1]];
            vec![dx, vec![dy[2] + at[1] * 3e-12 * w[0] * w[0] * dy[3]]]
        }
    };
    let inputs: [(&str, &[f64]); 2] = [("x", &[0.9, 1.3]), ("w", &[0.4])];
    let check = |at| function(&inputs, forward, wrong(at), &settings()).unwrap();
    check([1.0, 1.0]).require(LIMIT).unwrap();
    let report = check([3.0, 1.0]);
    assert!(report.require(LIMIT).is_err());
    assert_eq!((&*report.worst().name, report.worst().index), ("x", 1));
    // A whole vector of them.
    let tiny = |factor: f64| {
        let forward = |v: &[Vec<f64>]| vec![v[0][0] * v[0][0], 1e-12 * v[1][0] * v[1][0]];
        let backward = move |v: &[Vec<f64>], dy: &[f64]| {
            vec![vec![2.0 * v[0][0] * dy[0]], vec![factor * 2e-12 * v[1][0] * dy[1]]]
        };
        let inputs: [(&str, &[f64]); 2] = [("a", &[0.9]), ("b", &[1.3])];
        function(&inputs, forward, backward, &settings()).unwrap()
    };
    tiny(1.0).require(LIMIT).unwrap();
    assert!(tiny(3.0).require(LIMIT).is_err());
}

#[test]
fn a_gradient_of_zero_is_no_error_whatever_rounding_says() {
    // The mean of the rows is taken away: a shift changes nothing but roundings.
    let forward = |v: &[Vec<f64>]| {
        let shifted: Vec<f64> = v[0].iter().map(|x| x + v[1][0]).collect();
        let mean = shifted.iter().sum::<f64>() / shifted.len() as f64;
        shifted.iter().map(|x| x - mean).collect()
    };
    let backward = |v: &[Vec<f64>], dy: &[f64]| {
        let mean = dy.iter().sum::<f64>() / dy.len() as f64;
        vec![dy.iter().map(|dy| dy - mean).collect(), vec![0.0; v[1].len()]]
    };
    let x = probe(40, 3);
    let inputs: [(&str, &[f64]); 2] = [("x", &x), ("shift", &[0.3])];
    function(&inputs, forward, backward, &settings()).unwrap().require(LIMIT).unwrap();
}

#[test]
fn what_a_check_cannot_take_is_refused() {
    let x = probe(4, 1);
    let identity = |v: &[Vec<f64>]| v[0].clone();
    let back = |v: &[Vec<f64>], dy: &[f64]| {
        v.iter()
            .enumerate()
            .map(|(k, v)| if k == 0 { dy.to_vec() } else { vec![0.0; v.len()] })
            .collect()
    };
    let message = |settings: GradcheckSettings| {
        function(&[("x", &x)], identity, back, &settings).unwrap_err().to_string()
    };
    for floor in [f64::INFINITY, f64::NAN, -1.0] {
        let message = message(settings().with_floor(floor));
        assert!(message.starts_with("floor is "), "{message}");
    }
    for step in [0.0, -1e-5, f64::NAN, f64::INFINITY] {
        let message = message(settings().with_step(step));
        assert!(message.starts_with("step is "), "{message}");
    }
    let twice: [(&str, &[f64]); 2] = [("x", &x), ("x", &x)];
    let message = function(&twice, identity, back, &settings()).unwrap_err().to_string();
    assert!(message.contains("`x` twice"), "{message}");
    // An output that grows when it is called again.
    let n_calls = RefCell::new(0);
    let growing = |v: &[Vec<f64>]| {
        *n_calls.borrow_mut() += 1;
        let mut y = v[0].clone();
        y.extend((*n_calls.borrow() > 3).then_some(1.0));
        y
    };
    let message = function(&[("x", &x)], growing, back, &settings()).unwrap_err().to_string();
    assert!(message.contains("length of the output is 5, expected 4, as before"), "{message}");
}

#[test]
fn zero_maps_and_maps_of_other_lengths_have_no_adjoint_test() {
    let zero = |n: usize| move |_: &[f64]| vec![0.0; n];
    let message = adjoint(3, 2, zero(2), zero(3)).unwrap_err().to_string();
    assert!(message.contains("a check of nothing proves nothing"), "{message}");
    assert!(adjoint(3, 2, zero(2), |y| vec![y[0]; 3]).unwrap() > 0.1);
    assert!(adjoint(3, 2, |x| vec![x[0]; 2], zero(3)).unwrap() > 0.1);
    assert!(adjoint(3, 2, |x| vec![x[0]; 3], zero(3)).is_err());
    assert!(adjoint(3, 2, |x| vec![x[0]; 2], zero(2)).is_err());
    assert_eq!(adjoint(1, 1, |_| vec![f64::NAN], |y| y.to_vec()).unwrap(), f64::INFINITY);
}

#[test]
fn a_subgradient_at_a_kink_is_no_error_and_one_beyond_it_is() {
    let forward = |v: &[Vec<f64>]| v[0].iter().map(|x| x.max(0.0) + 0.1 * x).collect();
    let with = |at_kink: f64| {
        move |v: &[Vec<f64>], dy: &[f64]| {
            let slope = |x: &f64| match x.total_cmp(&0.0) {
                std::cmp::Ordering::Less => 0.1,
                std::cmp::Ordering::Equal => at_kink,
                std::cmp::Ordering::Greater => 1.1,
            };
            vec![v[0].iter().zip(dy).map(|(x, dy)| slope(x) * dy).collect::<Vec<f64>>()]
        }
    };
    let x = [0.5, 0.0, -0.5];
    for (at_kink, passes) in [(0.1, true), (1.1, true), (0.6, true), (0.0, false), (1.3, false)] {
        let report = function(&[("x", &x)], forward, with(at_kink), &settings()).unwrap();
        assert_eq!(report.require(LIMIT).is_ok(), passes, "{at_kink}: {report}");
        // In the middle central differences agree.
        assert_eq!(report.kinks.len(), usize::from(passes && at_kink != 0.6), "{at_kink}");
    }
    // A wrong slope of a smooth function is no kink.
    let forward = |v: &[Vec<f64>]| v[0].iter().map(|x| x * x).collect();
    let backward = |v: &[Vec<f64>], dy: &[f64]| {
        vec![v[0].iter().zip(dy).map(|(x, dy)| 2.0 * (x + 1e-6) * dy).collect()]
    };
    let report = function(&[("x", &x)], forward, backward, &settings()).unwrap();
    assert!(report.require(LIMIT).is_err() && report.kinks.is_empty(), "{report}");
}

#[test]
fn negative_controls_fail_and_a_blind_check_is_refused() {
    let x = probe(6, 1);
    let forward = |v: &[Vec<f64>]| v[0].iter().map(|x| x * x * v[1][0]).collect();
    let backward = |v: &[Vec<f64>], dy: &[f64]| {
        let dx = v[0].iter().zip(dy).map(|(x, dy)| 2.0 * x * v[1][0] * dy).collect();
        vec![dx, vec![v[0].iter().zip(dy).map(|(x, dy)| x * x * dy).sum()]]
    };
    let inputs: [(&str, &[f64]); 2] = [("x", &x), ("w", &[0.8])];
    let controls = negative_control(&inputs, forward, backward, &settings(), LIMIT).unwrap();
    let names: Vec<&str> = controls.iter().map(|control| &*control.mistake).collect();
    assert!(names.contains(&"x scaled by 1.01") && names.contains(&"w negated"), "{names:?}");
    assert!(!names.contains(&"w in reverse order"), "one number has no order: {names:?}");
    assert!(controls.iter().all(|control| control.error > LIMIT));
    // A gradient that is lost beside a large output is named.
    let forward_of_large = |v: &[Vec<f64>]| vec![1e9 + 1e-9 * v[0][0], v[1][0]];
    let backward_of_large = |_: &[Vec<f64>], dy: &[f64]| vec![vec![1e-9 * dy[0]], vec![dy[1]]];
    let two: [(&str, &[f64]); 2] = [("lost", &[0.3]), ("w", &[0.8])];
    let found =
        negative_control(&two, forward_of_large, backward_of_large, &settings(), LIMIT).unwrap();
    assert!(found[0].is_lost && found[0].mistake.starts_with("lost "), "{found:?}");
    assert!(found[1..].iter().all(|control| !control.is_lost));
    // A limit that lets a factor of 1.01 pass, and a function that nothing moves.
    let blind = negative_control(&inputs, forward, backward, &settings(), 0.1).unwrap_err();
    assert!(blind.to_string().contains("passed with the gradient by x scaled by 1.01"), "{blind}");
    let still = |_: &[Vec<f64>]| vec![1.0, 2.0];
    let none = |v: &[Vec<f64>], _: &[f64]| v.iter().map(|v| vec![0.0; v.len()]).collect();
    let nothing = negative_control(&inputs, still, none, &settings(), LIMIT).unwrap_err();
    assert!(nothing.to_string().contains("all gradients are zero"), "{nothing}");
}

#[test]
fn layers_are_swept_over_matrices_and_octrees() {
    let linear = |&[rows, columns]: &[usize; 2]| {
        let mut layout = Layout::default();
        let linear = Linear::new(&mut layout, "linear", columns, 3, true);
        let (params, x) = (layout.init_params(1), probe(rows * columns, 2));
        let x = Operand::new(&x, columns);
        let case = Case::new(&layout, &params, &(), x);
        negative_control_of_layer(&linear, &case, &settings(), LIMIT)?;
        layer(&linear, &case, &settings())
    };
    let shapes = matrix_shapes();
    assert_eq!(sweep(shapes, LIMIT, linear).unwrap().len(), 6);
    let reports = sweep(octree_shapes().unwrap(), LIMIT, |octree| {
        let (mut layout, level) = (Layout::default(), &octree.levels[3]);
        let conv = OctreeConv::new(&mut layout, "conv", 3, 2);
        let (params, x) = (layout.init_params(1), probe(3 * level.keys.len(), 2));
        let x = Operand::new(&x, 3);
        let case = Case::new(&layout, &params, &level.conv, x);
        layer(&conv, &case, &settings().with_max_elements(40))
    });
    assert_eq!(reports.unwrap().len(), 4);
    // A layer that is right for all shapes but one: the shape is named.
    let wrong = |&[rows, columns]: &[usize; 2]| {
        let x = probe(rows * columns, 1);
        let factor = if rows == 1 { 2.0 } else { 1.0 };
        let forward = |v: &[Vec<f64>]| v[0].clone();
        let backward = |_: &[Vec<f64>], dy: &[f64]| vec![dy.iter().map(|dy| factor * dy).collect()];
        function(&[("x", &x)], forward, backward, &settings())
    };
    let message = sweep(shapes, LIMIT, wrong).unwrap_err().to_string();
    assert!(message.contains("of one row: x["), "{message}");
    let none: [(&str, [usize; 2]); 0] = [];
    assert!(sweep(none, LIMIT, wrong).is_err());
}
