//! The build: every object at its place, without what is no part of the solid.

use super::super::{Mesh, one_line};
use super::model::{Model, Object, Placed};
use super::roles::{Piece, Role, Roles};
use super::{Found, REMEDY};

/// When every object is placed as often as the build says, there may be this many times the triangles
/// and vertices of the file, and some more.
const MAX_COPIES: usize = 4;
const FEW: usize = 1 << 18;
/// Most objects placed, and how deep they may be nested.
const MAX_PLACED: usize = 1 << 16;
const MAX_DEPTH: usize = 32;
/// Most pieces left out that are named.
const MAX_NAMED: usize = 20;

/// What is wrong with a build.
pub(super) struct Fault {
    pub place: String,
    pub found: String,
    pub remedy: &'static str,
}

impl From<String> for Fault {
    fn from(found: String) -> Self {
        Fault { place: "build".into(), found, remedy: REMEDY }
    }
}

/// The first model is the main one.
pub(super) struct Build<'a> {
    models: &'a [(String, Model)],
    roles: &'a Roles,
    mesh: Mesh,
    left_out: Vec<String>,
    /// Objects that may still be placed.
    objects_left: usize,
    /// Triangles, and vertices, of the whole.
    most: usize,
}

impl<'a> Build<'a> {
    pub(super) fn new(models: &'a [(String, Model)], roles: &'a Roles) -> Self {
        let size = |o: &Object| o.mesh.triangles.len().max(o.mesh.vertices.len());
        let objects = models.iter().flat_map(|(_, model)| model.objects.values());
        let most = FEW + MAX_COPIES * objects.map(size).sum::<usize>();
        let (mesh, left_out, objects_left) = (Mesh::default(), Vec::new(), MAX_PLACED);
        Build { models, roles, mesh, left_out, objects_left, most }
    }

    /// All of it, and what was left out.
    pub(super) fn mesh(mut self) -> Result<(Mesh, Vec<String>), Fault> {
        let items = &self.models[0].1.items;
        if items.is_empty() {
            return Err("it places no object".to_string().into());
        }
        for item in items {
            if item.printable {
                self.place(item, 0, None, 0)?;
            } else {
                let words = self.words(self.file(item, 0)?, item.object, None);
                self.leave_out(format!("{words} is not to be printed"));
            }
        }
        match (self.mesh.triangles.is_empty(), self.left_out.first()) {
            (true, Some(first)) => Err(format!("nothing is left of it: {first}").into()),
            _ => Ok((self.mesh, self.left_out)),
        }
    }

    /// In which model an object is that `from` places.
    fn file(&self, at: &Placed, from: usize) -> Found<usize> {
        let Some(name) = &at.file else { return Ok(from) };
        let known = self.models.iter().position(|(known, _)| known == name);
        known.ok_or_else(|| format!("there is no model {}", one_line(name)))
    }

    fn leave_out(&mut self, what: String) {
        if self.left_out.len() < MAX_NAMED && !self.left_out.contains(&what) {
            self.left_out.push(what);
        }
    }

    /// `object 2 "lid"`, or of a piece of it `part "cutter" of object 2 "lid"`.
    fn words(&self, file: usize, id: u32, piece: Option<&str>) -> String {
        let object = self.models[file].1.objects.get(&id);
        let name = object.and_then(|object| object.name.as_ref());
        let name = name.map_or(String::new(), |name| format!(" {:?}", one_line(name)));
        let file = if file == 0 {
            String::new()
        } else {
            format!(" of {}", one_line(&self.models[file].0))
        };
        piece.map_or(String::new(), |piece| format!("{piece} of "))
            + &format!("object {id}{name}{file}")
    }

    /// Whether a piece is material; what is none is left out by name.
    fn is_solid(&mut self, role: Role, words: String) -> Result<bool, Fault> {
        match role {
            Role::Solid => Ok(true),
            Role::Other(what) => {
                self.leave_out(format!("{words} is {what}"));
                Ok(false)
            }
            Role::Negative => Err(Fault {
                place: words,
                found: "it is a negative part, to be cut out of the others".into(),
                remedy: "subtract it in the program that wrote the file, and export the result",
            }),
        }
    }

    /// Appends an object of the model `from` and all it is put together from.
    fn place(
        &mut self,
        at: &Placed,
        from: usize,
        within: Option<u32>,
        depth: usize,
    ) -> Result<(), Fault> {
        let (id, file) = (at.object, self.file(at, from)?);
        let models = self.models;
        let object = models[file].1.objects.get(&id);
        let object =
            object.ok_or_else(|| format!("{} does not exist", self.words(file, id, None)))?;
        if let Some(piece) = self.roles.parts.get(&(within.unwrap_or(id), id)).cloned() {
            let part = piece_words("part", id, &piece);
            let words = self.words(
                if within.is_some() { from } else { file },
                within.unwrap_or(id),
                Some(&part),
            );
            if !self.is_solid(piece.role, words)? {
                return Ok(());
            }
        }
        let words = self.words(file, id, None);
        if !self.is_solid(object.role, words)? {
            return Ok(());
        }
        self.check_room(object, depth)?;
        // Vertices are placed by the innermost object first, then by all around it.
        let (begin, first) = (self.mesh.vertices.len(), self.mesh.triangles.len());
        self.append(object, file, id)?;
        for component in &object.components {
            self.place(component, file, Some(id), depth + 1)?;
        }
        self.mesh.vertices[begin..].iter_mut().for_each(|v| *v = at.turn * *v + at.shift);
        if at.turn.determinant() < 0.0 {
            self.mesh.triangles[first..].iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(())
    }

    fn check_room(&mut self, object: &Object, depth: usize) -> Found<()> {
        let n_vertices = self.mesh.vertices.len() + object.mesh.vertices.len();
        let n_triangles = self.mesh.triangles.len() + object.mesh.triangles.len();
        let too_many = n_triangles.max(n_vertices) > self.most || self.objects_left == 0;
        if depth > MAX_DEPTH || too_many {
            return Err("its objects multiply without end".into());
        }
        self.objects_left -= 1;
        Ok(())
    }

    /// The object's own mesh, without volumes that are no material.
    fn append(&mut self, object: &Object, file: usize, id: u32) -> Result<(), Fault> {
        let Mesh { vertices, triangles } = &object.mesh;
        let n = vertices.len();
        if let Some(v) = triangles.iter().flatten().find(|v| **v as usize >= n) {
            return Err(format!("object {id}: vertex {v} of {n} does not exist").into());
        }
        if triangles.is_empty() && object.components.is_empty() {
            let words = self.words(file, id, None);
            self.leave_out(format!("{words} has no triangles"));
            return Ok(());
        }
        let roles = self.roles;
        let volumes = roles.volumes.get(&id).filter(|_| file == 0).map_or(&[][..], |v| v);
        let mut out = Vec::new();
        for (k, volume) in volumes.iter().enumerate() {
            let piece = piece_words("volume", k as u32 + 1, &volume.piece);
            let words = self.words(file, id, Some(&piece));
            if !self.is_solid(volume.piece.role, words)? {
                out.push(&volume.triangles);
            }
        }
        let begin = self.mesh.vertices.len() as u32;
        let kept = (0..).zip(triangles).filter(|(t, _)| !out.iter().any(|out| out.contains(t)));
        let kept: Vec<[u32; 3]> = kept.map(|(_, t)| *t).collect();
        if out.is_empty() {
            self.mesh.vertices.extend(vertices);
            self.mesh.triangles.extend(kept.iter().map(|t| t.map(|v| v + begin)));
            return Ok(());
        }
        self.append_used(vertices, &kept);
        Ok(())
    }

    /// Some triangles with no vertices but their own.
    fn append_used(&mut self, vertices: &[glam::DVec3], triangles: &[[u32; 3]]) {
        let mut place = vec![u32::MAX; vertices.len()];
        for triangle in triangles {
            let moved = triangle.map(|v| {
                if place[v as usize] == u32::MAX {
                    place[v as usize] = self.mesh.vertices.len() as u32;
                    self.mesh.vertices.push(vertices[v as usize]);
                }
                place[v as usize]
            });
            self.mesh.triangles.push(moved);
        }
    }
}

/// `part "cutter"`, or `part 2` without a name.
fn piece_words(kind: &str, number: u32, piece: &Piece) -> String {
    match piece.name.as_deref().filter(|name| !name.trim().is_empty()) {
        Some(name) => format!("{kind} {:?}", one_line(name)),
        None => format!("{kind} {number}"),
    }
}
