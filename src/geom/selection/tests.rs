use super::*;
use crate::geom::solids::{cuboid, torus};
use glam::dvec3;

fn only(selector: Selector) -> Selection {
    Selection { only: vec![selector], except: vec![] }
}

fn of_box(low: [f64; 3], high: [f64; 3]) -> Selector {
    Selector::Box { low: DVec3::from_array(low), high: DVec3::from_array(high) }
}

fn up(degrees: f64) -> Selector {
    Selector::Normal { direction: DVec3::Z * 2.0, within_rad: degrees.to_radians() }
}

fn area(selection: &Selection, part: &Mesh) -> f64 {
    let region = selection.of(part).unwrap();
    assert_eq!(region.faces.len(), region.mesh.triangles.len());
    for (f, of) in region.faces.iter().enumerate() {
        let normals = [region.mesh.area_vector(f), part.area_vector(*of as usize)];
        if region.mesh.has_area(f) {
            assert!(normals[0].normalize().dot(normals[1].normalize()) > 1.0 - 1e-9);
        }
    }
    region.mesh.area()
}

#[test]
fn areas_of_boxes_and_normals_are_those_by_hand() {
    let part = cuboid(dvec3(40.0, 30.0, 20.0));
    let near = |selection: Selection, expected: f64| {
        let found = area(&selection, &part);
        assert!((found - expected).abs() < 1e-9 * expected, "{found}, not {expected}");
    };
    near(Selection::default(), 5200.0);
    // The upper quarter along x: of the top 10 × 30, of two sides 10 × 5, of one 30 × 5.
    near(only(of_box([30., -1., 15.], [50., 31., 21.])), 300.0 + 100.0 + 150.0);
    // A box that only touches the top holds the top.
    near(only(of_box([0., 0., 20.], [40., 30., 25.])), 1200.0);
    near(only(up(10.0)), 1200.0);
    near(only(up(90.0)), 1200.0 + 2800.0);
    let but = Selection { only: vec![up(1.0)], except: vec![of_box([0.; 3], [10., 30., 20.])] };
    near(but, 900.0);
    near(Selection { only: vec![], except: vec![up(1.0)] }, 4000.0);
    // Two boxes that overlap count once: of the top 20 × 30.
    let boxes = [of_box([0., 0., 20.], [15., 30., 21.]), of_box([10., 0., 20.], [20., 30., 21.])];
    near(Selection { only: boxes.to_vec(), except: vec![] }, 600.0);
}

#[test]
fn pieces_hang_together_as_their_triangles_did() {
    let part = torus(20.0, 8.0, 60, 30);
    let boxes =
        vec![of_box([-30., -30., -9.], [3., 30., 2.]), of_box([0., -5., -9.], [30., 7., 9.])];
    let region = Selection { only: boxes, except: vec![] }.of(&part).unwrap();
    let report = crate::geom::check::check(&region.mesh);
    assert_eq!(report.n_components, 2, "the second box cuts the ring beyond the first, too");
    assert_eq!(report.count(crate::geom::check::Fault::TJunction), 0);
    let whole = Selection { only: vec![of_box([-50.; 3], [50.; 3])], except: vec![] };
    assert_eq!(whole.of(&part).unwrap().mesh.triangles.len(), part.triangles.len());
}

#[test]
fn faces_of_another_mesh_and_sites_choose_what_is_near_them() {
    let part = cuboid(dvec3(40.0, 30.0, 20.0));
    let top: Vec<usize> = (0..12).filter(|f| part.area_vector(*f).z > 0.0).collect();
    let mut chosen = Mesh { vertices: part.vertices.clone(), triangles: vec![] };
    chosen.triangles = top.iter().map(|f| part.triangles[*f]).collect();
    chosen.vertices.iter_mut().for_each(|v| *v = v.as_vec3().as_dvec3() + 1e-6);
    assert!((area(&only(Selector::Faces(chosen)), &part) - 1200.0).abs() < 1e-9);
    let options = SiteOptions { n_sites: 2000, ..Default::default() };
    let sites = sites::sample(&part, &options).unwrap();
    let is_near = |p: &glam::Vec3| p.z > 19.99 && p.x < 20.0;
    let chosen: Vec<bool> = sites.points.iter().map(is_near).collect();
    let spacing_mm = (5200.0f64 / 2000.0).sqrt();
    let found = area(&only(Selector::Sites { sites, chosen, spacing_mm }), &part);
    assert!((found - 600.0).abs() < 30.0, "{found}");
}

#[test]
fn sites_of_a_region_name_triangles_of_the_part_and_are_as_dense_at_its_border() {
    let part = cuboid(dvec3(40.0, 30.0, 20.0));
    let selection = only(of_box([5., 5., 10.], [35., 25., 30.]));
    let options = SiteOptions { n_sites: 1200, ..Default::default() };
    let region = selection.of(&part).unwrap();
    let on_region = selection.sample(&part, &region, &options).unwrap();
    for (p, face) in on_region.points.iter().zip(&on_region.faces) {
        assert!(distance(p.as_dvec3(), region.mesh.corners(*face as usize)) < 1e-5);
    }
    let sites = region.on_part(&on_region);
    assert!((1150..1250).contains(&sites.len()), "{}", sites.len());
    for (i, p) in sites.points.iter().enumerate() {
        let corners = part.corners(sites.faces[i] as usize);
        assert!(distance(p.as_dvec3(), corners) < 1e-5 && p.z == 20.0, "{p}");
        assert!((4.999..35.001).contains(&p.x) && (4.999..25.001).contains(&p.y), "{p}");
    }
    // Of 600 mm², a rim 2 mm wide has 184.
    let is_rim = |p: &&glam::Vec3| p.x < 7.0 || p.x > 33.0 || p.y < 7.0 || p.y > 23.0;
    let rim = sites.points.iter().filter(is_rim).count() as f64 / sites.len() as f64;
    assert!((rim - 184.0 / 600.0).abs() < 0.015, "{rim}");
    let speck = only(of_box([5., 5., 10.], [5.1, 5.1, 30.]));
    let region = speck.of(&part).unwrap();
    assert!(speck.sample(&part, &region, &options).unwrap().len() > 1000);
}

#[test]
fn what_selects_nothing_or_is_no_selector_is_refused_with_numbers() {
    let part = cuboid(dvec3(40.0, 30.0, 20.0));
    let message = |selector| only(selector).of(&part).unwrap_err().to_string();
    let missed = message(of_box([50.; 3], [60.; 3]));
    assert!(missed.contains("no face") && missed.contains("40, 30, 20"), "{missed}");
    assert!(message(of_box([5.; 3], [1.; 3])).contains("the least corner"));
    let zero = Selector::Normal { direction: DVec3::ZERO, within_rad: 0.1 };
    assert!(message(zero).contains("a direction"));
}
