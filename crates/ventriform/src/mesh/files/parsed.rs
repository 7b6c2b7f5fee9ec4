//! The content of a file as the reader of a format takes it.

use super::MeshFormat;
use super::error::MeshFileError;
use super::said::Said;
use super::statement::{MeshFrame, MeshUnit};
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;

/// Points and triangles as the file states them.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    pub vertices: Vec<Vec3>,
    /// Each index is below the number of vertices.
    pub triangles: Vec<[u32; 3]>,
    pub unit: Option<MeshUnit>,
    pub frame: Option<MeshFrame>,
    /// Whether the format has no shared vertices: each triangle brings its corners.
    pub corners_only: bool,
    pub notes: Vec<String>,
}

impl Parsed {
    /// Sets what the file said.
    pub fn said(mut self, said: Said) -> Self {
        (self.unit, self.frame) = (said.unit, said.frame);
        self
    }
}

/// Triangles of polygons and strips, whose corners are checked.
pub(super) struct Faces {
    pub triangles: Vec<[u32; 3]>,
    monitor: Monitor<'static>,
    /// Polygons so far.
    faces: usize,
    /// Polygons of more than three corners.
    split: usize,
    /// Polygons of fewer than three corners.
    thin: usize,
}

impl Faces {
    /// None yet; every corner checks the cancel token.
    pub fn new(monitor: &Monitor<'_>) -> Self {
        Self {
            triangles: Vec::new(),
            monitor: monitor.without_observer(),
            faces: 0,
            split: 0,
            thin: 0,
        }
    }

    /// Adds a polygon over `count` vertices: the triangles from its first corner.
    ///
    /// # Errors
    /// [`MeshFileError::NoSuchVertex`] or [`MeshFileError::Cancelled`].
    pub fn polygon(
        &mut self,
        corners: impl IntoIterator<Item = f64>,
        count: usize,
    ) -> Result<(), MeshFileError> {
        let face = self.faces;
        self.faces += 1;
        let mut first = None;
        let mut last = None;
        let mut number = 0;
        for corner in corners {
            let corner = self.index(corner, face, count)?;
            match (first, last) {
                (Some(first), Some(last)) => self.triangles.push([first, last, corner]),
                (Some(_), None) => {}
                (None, _) => first = Some(corner),
            }
            if number > 0 {
                last = Some(corner);
            }
            number += 1;
        }
        self.split += usize::from(number > 3);
        self.thin += usize::from(number < 3);
        Ok(())
    }

    /// Adds a strip: every corner from the third on makes a triangle with the two before it.
    ///
    /// # Errors
    /// [`MeshFileError::NoSuchVertex`] or [`MeshFileError::Cancelled`].
    pub fn strip(
        &mut self,
        corners: impl IntoIterator<Item = f64>,
        count: usize,
    ) -> Result<(), MeshFileError> {
        let face = self.faces;
        self.faces += 1;
        let mut before: [Option<u32>; 2] = [None; 2];
        for (number, corner) in corners.into_iter().enumerate() {
            let corner = self.index(corner, face, count)?;
            if let [Some(a), Some(b)] = before {
                self.triangles.push(match number % 2 {
                    0 => [a, b, corner],
                    _ => [b, a, corner],
                });
            }
            before = [before[1], Some(corner)];
        }
        Ok(())
    }

    fn index(&self, corner: f64, face: usize, count: usize) -> Result<u32, MeshFileError> {
        self.monitor.check()?;
        let whole = corner.fract() == 0.0 && corner >= 0.0 && corner < count as f64;
        if whole && corner < f64::from(u32::MAX) {
            Ok(corner as u32)
        } else {
            Err(MeshFileError::NoSuchVertex {
                face,
                vertex: corner.to_string(),
                count,
            })
        }
    }

    /// The notes about them.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.split > 0 {
            notes.push(format!(
                "{} polygons of more than three corners were split into triangles.",
                self.split
            ));
        }
        if self.thin > 0 {
            notes.push(format!(
                "{} polygons of fewer than three corners were left out.",
                self.thin
            ));
        }
        notes
    }

    /// The surface of these triangles.
    pub fn over(self, vertices: Vec<Vec3>) -> Parsed {
        Parsed {
            notes: self.notes(),
            triangles: self.triangles,
            vertices,
            ..Parsed::default()
        }
    }
}

/// An error at byte `at` of a file.
pub(super) fn damaged(format: MeshFormat, at: usize, reason: impl Into<String>) -> MeshFileError {
    MeshFileError::Damaged {
        format,
        place: format!("byte {at}"),
        reason: reason.into(),
    }
}
