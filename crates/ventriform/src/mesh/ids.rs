//! Types for the indices of vertices, faces and half-edges.
//!
//! A vertex, a face and a half-edge are all numbers; as types of their own they cannot be
//! mistaken for each other. Each is four bytes, like the `u32` inside; `index()` is the place
//! in a list that has one entry per element.
//!
//! Half-edge 3t + k runs along triangle t from its corner k to corner k + 1 (mod 3), so that
//! faces, corners and neighbours within a triangle follow from the number alone.

use std::fmt;

macro_rules! id_type {
    ($(#[$attribute:meta])* $name:ident) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The element at place `index` of a list; at most `u32::MAX`.
            pub const fn from_index(index: usize) -> Self {
                Self(index as u32)
            }

            /// The element's place in a list with one entry per element.
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// The first `count` elements, ascending.
            pub fn first(count: usize) -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator + Clone {
                (0..count as u32).map(Self)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

id_type! {
    /// A vertex of a mesh.
    VertexId
}

id_type! {
    /// A triangle of a mesh.
    FaceId
}

id_type! {
    /// One side of an edge: the directed edge that belongs to one of its two triangles.
    HalfEdgeId
}

impl FaceId {
    /// The triangle's three half-edges: number k leaves corner k.
    pub const fn half_edges(self) -> [HalfEdgeId; 3] {
        [
            HalfEdgeId(3 * self.0),
            HalfEdgeId(3 * self.0 + 1),
            HalfEdgeId(3 * self.0 + 2),
        ]
    }

    /// The half-edge that leaves corner `k` (0, 1 or 2).
    pub const fn half_edge(self, k: usize) -> HalfEdgeId {
        HalfEdgeId(3 * self.0 + k as u32)
    }
}

impl HalfEdgeId {
    /// The triangle on whose boundary the half-edge runs.
    pub const fn face(self) -> FaceId {
        FaceId(self.0 / 3)
    }

    /// The corner of that triangle, 0..3, from which the half-edge runs.
    pub const fn corner(self) -> usize {
        self.0 as usize % 3
    }

    /// The following half-edge of the same triangle.
    pub const fn next(self) -> Self {
        if self.0 % 3 == 2 {
            Self(self.0 - 2)
        } else {
            Self(self.0 + 1)
        }
    }

    /// The preceding half-edge of the same triangle.
    pub const fn previous(self) -> Self {
        if self.0.is_multiple_of(3) {
            Self(self.0 + 2)
        } else {
            Self(self.0 - 1)
        }
    }
}

/// The typed corners of an index triple as [`TriMesh`](super::TriMesh) stores it.
pub const fn typed([a, b, c]: [u32; 3]) -> [VertexId; 3] {
    [VertexId(a), VertexId(b), VertexId(c)]
}

/// The index triple that stores these corners.
pub const fn stored([a, b, c]: [VertexId; 3]) -> [u32; 3] {
    [a.0, b.0, c.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_steps_lead_round_a_triangle() {
        for h in HalfEdgeId::first(9) {
            assert_eq!(h.next().next().next(), h);
            assert_eq!(h.next().previous(), h);
            assert_eq!(h.face().half_edge(h.corner()), h);
            assert_eq!(h.next().face(), h.face());
        }
    }
}
