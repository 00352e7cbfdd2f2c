//! Claims about files of labels.

use super::*;
use glam::Vec3;

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
    few.labels.answers.inaccessible.pop();
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
