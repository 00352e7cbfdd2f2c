//! Queries and obstacles in a spatial order, so that neighbors in the list are neighbors in space.

use super::problem::{NOT_AN_OBSTACLE, Scene};
use crate::access::labels::Labels;
use crate::answers::SiteAnswers;
use crate::spatial::{Coordinates, order};
use glam::Vec3;

/// Which query and obstacle, as given, comes at each place of the spatial order.
pub(super) struct Order {
    queries: Vec<u32>,
    obstacles: Vec<u32>,
}

impl Order {
    /// In the order of a k-d tree: every aligned run of 8, 64, 512, … is compact.
    pub fn compact(scene: &Scene) -> Self {
        Order::by(scene, order::k_d_runs)
    }

    /// Along a Z-order curve: found sooner, and runs are less compact.
    pub fn quick(scene: &Scene) -> Self {
        Order::by(scene, order::z_order)
    }

    fn by(scene: &Scene, order: impl Fn(&[Vec3]) -> Vec<u32>) -> Self {
        let queries = order(&scene.points);
        let all = &scene.obstacles;
        if !scene.own.is_empty() && scene.own.len() == all.n {
            return Order { obstacles: queries.clone(), queries };
        }
        let obstacles: Vec<Vec3> = (0..all.n).map(|j| Vec3::from(all.get(j))).collect();
        Order { queries, obstacles: order(&obstacles) }
    }

    /// The same scene in this order.
    pub fn apply(&self, scene: Scene) -> Scene {
        let pick = |from: &[Vec3]| self.queries.iter().map(|&i| from[i as usize]).collect();
        let mut moved = Coordinates::zeros(scene.obstacles.n);
        let mut places = vec![0; scene.obstacles.n];
        for (p, &j) in self.obstacles.iter().enumerate() {
            moved.set(p, scene.obstacles.get(j as usize));
            places[j as usize] = p as u32;
        }
        let place = |&j: &u32| places.get(j as usize).copied().unwrap_or(NOT_AN_OBSTACLE);
        let own = |&i: &u32| scene.own.get(i as usize).map(place);
        Scene {
            points: pick(&scene.points),
            normals: if scene.normals.is_empty() { vec![] } else { pick(&scene.normals) },
            obstacles: moved,
            own: self.queries.iter().filter_map(own).collect(),
            n_ranked: scene.n_ranked,
            bottom: match scene.bottom.is_empty() {
                true => Vec::new(),
                false => self.of_queries(&scene.bottom),
            },
        }
    }

    /// One value per query in this order, from those as given.
    pub fn of_queries<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.queries.iter().map(|&i| values[i as usize]).collect()
    }

    /// One value per query in the order as given.
    pub fn restore_queries<T: Copy>(&self, values: Vec<T>) -> Vec<T> {
        scatter(&self.queries, values)
    }

    /// Labels in the order as given.
    pub fn restore(&self, labels: Labels) -> Labels {
        Labels {
            answers: SiteAnswers {
                of_sites: scatter(&self.queries, labels.answers.of_sites),
                accessible_directions: scatter(&self.queries, labels.answers.accessible_directions),
                accessible_share: scatter(&self.queries, labels.answers.accessible_share),
                ..labels.answers
            },
            witness: scatter(&self.queries, labels.witness),
            beta: scatter(&self.obstacles, labels.beta),
            collision_matrix: labels.collision_matrix.map(|matrix| matrix.reordered(&self.queries)),
            ..labels
        }
    }
}

fn scatter<T: Copy>(order: &[u32], values: Vec<T>) -> Vec<T> {
    let Some(&any) = values.first() else { return values };
    let mut restored = vec![any; values.len()];
    values.into_iter().zip(order).for_each(|(value, &i)| restored[i as usize] = value);
    restored
}
