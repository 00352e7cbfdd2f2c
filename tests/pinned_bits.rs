//! Bits that a rewrite must not change: SHA-256 of labels, logits and trained weights.
//!
//! A hash here changes only with a documented change of an order of summation or of a definition; the
//! commit that changes it says which, and parity and gradient checks prove the new bits right.

use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::generated::{demo_part, mixed_part};
use deepmill::directions::Directions;
use deepmill::geom::Mesh;
use deepmill::geom::sites::{SiteOptions, Sites, sample};
use deepmill::loss::CrossEntropy;
use deepmill::model::{Batch, Model, Shape, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::optim::Sgd;
use deepmill::par;
use deepmill::rng::{Purpose, Stream};
use deepmill::simd::Isa;
use hmac_sha256::Hash;
use std::sync::Mutex;

/// The instruction set in force belongs to the whole process.
static LEVEL: Mutex<()> = Mutex::new(());

const CUTTERS: [[f64; 4]; 4] =
    [[1.5, 6.0, 40.0, 5.0], [1.0, 20.0, 5.0, 20.0], [2.0, 0.1, 90.0, 0.2], [3.0, 12.0, 8.0, 10.0]];

fn parts() -> Vec<Sites> {
    let options = SiteOptions::default().with_n_sites(900);
    let parts: [Mesh; 3] = [demo_part(), mixed_part(5, 3), mixed_part(5, 11)];
    parts.iter().map(|mesh| sample(mesh, &options).unwrap()).collect()
}

fn hex(hash: Hash) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn add<const N: usize>(hash: &mut Hash, numbers: impl Iterator<Item = [u8; N]>) {
    numbers.for_each(|bytes| hash.update(bytes));
}

fn add_floats(hash: &mut Hash, x: &[f32]) {
    add(hash, x.iter().map(|x| x.to_bits().to_le_bytes()));
}

/// Runs `work` on 1 and on 3 threads, with every instruction set of this processor, and demands one hash of all.
fn assert_pinned(name: &str, expected: &str, work: impl Fn() -> Hash + Sync) {
    let _alone = LEVEL.lock().unwrap_or_else(|e| e.into_inner());
    let chosen = Isa::requested().unwrap();
    for &isa in Isa::available() {
        isa.activate();
        // Both at once: a single thread leaves a core idle for as long as emulated arithmetic takes.
        let run = |n_threads| hex(par::with_threads(n_threads, &work).unwrap());
        let found = std::thread::scope(|scope| {
            let three = scope.spawn(|| run(3));
            [(1, run(1)), (3, three.join().unwrap())]
        });
        for (n_threads, found) in found {
            if found != expected {
                chosen.activate();
            }
            assert_eq!(found, expected, "{name}: {}, {n_threads} threads", isa.name());
        }
    }
    chosen.activate();
}

#[test]
fn sites_of_generated_parts_are_pinned() {
    let mut hash = Hash::new();
    for sites in parts() {
        for points in [&sites.points, &sites.normals] {
            points.iter().for_each(|p| add_floats(&mut hash, &p.to_array()));
        }
    }
    assert_eq!(hex(hash), "a260cc3a53b91936104e059cdbb5ce8ccf40671569ca275482c5aaec7deb4440");
}

#[test]
fn labels_of_three_parts_and_four_cutters_are_pinned() {
    let (parts, directions) = (parts(), Directions::fibonacci_hemisphere(150).unwrap());
    assert_pinned(
        "labels",
        "ce46754953093d3a5743787e3c004f45801745d9188e3de4b51b39a5f6e35703",
        || {
            let mut hash = Hash::new();
            for sites in &parts {
                for lengths in CUTTERS {
                    let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).unwrap();
                    let options = LabelOptions::default();
                    let labels =
                        label(sites, Obstacles::Queries, &cutter, &directions, &options).unwrap();
                    add(&mut hash, labels.answers.inaccessible().iter().map(|&l| [u8::from(l)]));
                    let witness = labels.witness.iter().map(|w| w.unwrap_or(u32::MAX));
                    add(&mut hash, witness.map(u32::to_le_bytes));
                    add(
                        &mut hash,
                        labels.answers.accessible_directions().iter().map(|n| n.to_le_bytes()),
                    );
                    add(&mut hash, labels.beta.iter().map(|n| n.to_le_bytes()));
                    add(&mut hash, labels.answers.occlusion().iter().map(|&l| [u8::from(l)]));
                }
            }
            hash
        },
    );
}

#[test]
fn logits_of_the_shipped_network_are_pinned() {
    let (parts, model) = (parts(), Model::shipped().unwrap());
    assert_pinned(
        "logits",
        "a69b4636196191a7e3b898c5b6d2ae1f073541b1d3a10222b19c646f8fe8c982",
        || {
            let mut hash = Hash::new();
            for sites in &parts {
                for lengths in CUTTERS {
                    let answer = model.predict(&sites.points, &sites.normals, lengths).unwrap();
                    // Columns in the order of the network's classes, which is that of the hash.
                    let first = answer.logits_inaccessible.iter().map(|[no, yes]| [*yes, *no]);
                    for logits in [first.collect(), answer.logits_occlusion] {
                        add_floats(&mut hash, logits.as_flattened());
                    }
                }
            }
            hash
        },
    );
}

/// The reference's structure and conventions with few channels.
fn narrow_reference() -> UNetConfig {
    let mut config = UNetConfig::reference();
    config.stem_width = 8;
    config.encoder_widths = vec![8, 16, 24, 32];
    config.encoder_blocks = vec![1, 2, 1, 1];
    config.decoder_widths = vec![32, 24, 24, 64];
    config.head_width = 16;
    config.cutter.width = 24;
    config
}

/// Parameters and running statistics after three steps on three shapes with dropout.
fn trained(config: &UNetConfig, parts: &[Sites]) -> Hash {
    let shapes: Vec<Shape> = parts
        .iter()
        .zip(CUTTERS)
        .map(|(s, cutter_mm)| Shape::new(&s.points, &s.normals, cutter_mm))
        .collect();
    let batch = Batch::new(&shapes, &config.input).unwrap();
    let mut model = Model::<f32>::new(config, 3).unwrap();
    let (arena, mut dlogits) = (Arena::default(), [vec![], vec![]]);
    let n = model.params.len();
    let (mut grads, mut velocity) = (vec![0.0; n], vec![0.0; n]);
    let targets: Vec<u8> = (0..batch.n_points()).map(|i| u8::from(i % 5 == 0)).collect();
    for step in 0..3 {
        let stream = |shape| Stream::new(3, step, shape, Purpose::Dropout);
        let mut dropout: Vec<_> = (0..batch.n_shapes() as u64).map(stream).collect();
        let pass = model.forward_train(&batch, Some(&mut dropout), &arena);
        for (logits, d) in pass.logits.iter().zip(&mut dlogits) {
            assert!(CrossEntropy::binary().loss(logits, &targets, 1.0, d).is_finite());
        }
        let [first, second] = &dlogits;
        model.backward(&batch, pass, &[first, second], &mut grads, &arena);
        let sgd = Sgd::new(0.9, 5e-4);
        sgd.step(0.1, &mut grads, &mut velocity, &mut model.params);
    }
    let mut hash = Hash::new();
    add_floats(&mut hash, &model.params);
    add_floats(&mut hash, &model.buffers);
    hash
}

#[test]
fn weights_after_three_steps_of_tiny_are_pinned() {
    let (config, parts) = (UNetConfig::tiny(), parts());
    assert_pinned(
        "tiny",
        "1ec11aa3b97e5fd5edd02379f1124abac73ac9d0366135f260155f613bb2ae67",
        || trained(&config, &parts),
    );
}

#[test]
fn weights_after_three_steps_of_small_are_pinned() {
    let (config, parts) = (UNetConfig::small(), parts());
    assert_pinned(
        "small",
        "5e861dce9b7e75b2b463fcca39def62a36a63f2048e1965ccb6e671ed387f49c",
        || trained(&config, &parts),
    );
}

#[test]
fn weights_after_three_steps_of_a_narrow_reference_are_pinned() {
    let (config, parts) = (narrow_reference(), parts());
    assert_pinned(
        "narrow reference",
        "27142dad4014f9ba053e21191913e327df73138f75e8c603cca46025a5dcf97e",
        || trained(&config, &parts),
    );
}
