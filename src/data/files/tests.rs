//! Claims about files of labels.

use super::*;
use glam::{DVec3, Vec3};

pub(super) fn provenance() -> Provenance {
    let cutter = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
    let settings = AnalysisSettings { n_directions: Some(7), ..AnalysisSettings::default() };
    Provenance::ball_end("a.stl", cutter, settings)
}

pub(super) fn sites() -> Sites {
    let points = vec![Vec3::new(0.1, 0.2, 0.3), Vec3::ONE];
    Sites { points, normals: vec![Vec3::Z, Vec3::X], faces: vec![3, 9] }
}

#[test]
fn labels_come_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.npz");
    let labels = Labels {
        answers: SiteAnswers {
            accessible_directions: vec![0, 17],
            clearance_mm: vec![-0.5, 1.25],
            ..SiteAnswers::new(vec![true, false], vec![false, true])
        },
        witness: vec![None, Some(4)],
        beta: vec![3, 1 << 40],
        ..Labels::default()
    };
    let vertex_index = vec![2, 0];
    let vertices = Some(SiteVertices { vertex_index, site_of_vertex: vec![1, -1, 0, 1] });
    let file = LabelFile { provenance: provenance(), sites: sites(), labels, vertices };
    file.write(&path).unwrap();
    assert_eq!(LabelFile::read(&path).unwrap(), file);
    let cloud = crate::geom::formats::read_cloud(&path).unwrap();
    assert_eq!(cloud.points, file.sites.points);
    let mut few = file.clone();
    few.labels.answers.of_sites.pop();
    assert!(few.write(&path).unwrap_err().to_string().contains("1 entries for 2 sites"));
    let mut wrong = file.clone();
    wrong.vertices.as_mut().unwrap().site_of_vertex.pop();
    wrong.vertices.as_mut().unwrap().site_of_vertex[2] = 1;
    let message = wrong.write(&path).unwrap_err().to_string();
    assert!(message.contains("vertex_index") && message.contains("entry 0"), "{message}");
    let mut bare = file;
    (bare.labels.beta, bare.labels.answers.occlusion) = (vec![], vec![]);
    bare.vertices = None;
    bare.write(&path).unwrap();
    assert_eq!(LabelFile::read(&path).unwrap(), bare);
}

#[test]
fn poses_that_are_none_are_named() {
    use crate::access::surface::{SurfaceEvidence, WitnessPose};
    use crate::answers::SiteAnswer;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.npz");
    let read = |direction: Vec3, tip_mm: DVec3| {
        let pose = Some(WitnessPose { direction, tip_mm });
        let surface = SurfaceEvidence {
            collision_free_directions: vec![1; 2],
            witness: vec![None, pose],
            rest_pose: vec![pose, None],
            open_directions: vec![0.0; 2],
            tolerance_mm: vec![0.01; 2],
            ..SurfaceEvidence::default()
        };
        let answers = SiteAnswers {
            accessible_directions: vec![1; 2],
            occlusion: vec![false; 2],
            ..SiteAnswers::by_mesh(vec![SiteAnswer::Accessible; 2])
        };
        let labels =
            Labels { answers, beta: vec![0; 2], surface: Some(surface), ..Labels::default() };
        let (provenance, sites) = (provenance(), sites());
        LabelFile { provenance, sites, labels, vertices: None }.write(&path).unwrap();
        LabelFile::read(&path)
    };
    let file = read(Vec3::Z, DVec3::ONE).unwrap();
    assert_eq!(file.labels.surface.unwrap().witness[1].unwrap().tip_mm, DVec3::ONE);
    for direction in [2.0 * Vec3::Z, Vec3::NAN, Vec3::new(0.0, f32::INFINITY, 0.0)] {
        let message = read(direction, DVec3::ONE).unwrap_err().to_string();
        assert!(message.contains("witness_direction: row 1 is ["), "{message}");
    }
    for tip in [f64::NAN, f64::INFINITY] {
        let message = read(Vec3::Z, DVec3::new(1.0, tip, 0.0)).unwrap_err().to_string();
        assert!(message.contains("witness_tip: row 1 has "), "{message}");
    }
}
