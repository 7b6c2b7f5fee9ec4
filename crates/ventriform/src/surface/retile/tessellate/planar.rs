//! Constrained Delaunay triangulation of a simple polygon with points inside, by `spade`.
//!
//! In: the polygon's corners, counter-clockwise, followed by points inside it. Out: triangles over
//! all of them that cover exactly the polygon, or an error. Not guaranteed: that a point outside is
//! noticed. One beyond a corner that sees both sides there makes as many triangles as one inside.

use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::base::geometry::Vec2;

/// Why a polygon could not be triangulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlanarError {
    /// Two of the points have the same position.
    Coincident([u32; 2]),
    /// The polygon touches or crosses itself or is clockwise, or a point that is not inside made the wrong number
    /// of triangles.
    NotSimple,
}

/// A point with its number, by which results are read.
struct NumberedPoint {
    position: Point2<f64>,
    number: u32,
}

impl HasPosition for NumberedPoint {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Triangulates the polygon of the first `corners` points (counter-clockwise) with the other
/// points inside it. Returns counter-clockwise triples of indices into `points`.
///
/// The predicates are exact, so if the points are inside, the result covers exactly the polygon, with
/// `corners - 2 + 2 * inner` triangles, or is an error.
pub(super) fn constrained_delaunay(
    points: &[Vec2],
    corners: usize,
) -> Result<Vec<[u32; 3]>, PlanarError> {
    let mut delaunay = ConstrainedDelaunayTriangulation::<NumberedPoint>::new();
    let mut handles = Vec::with_capacity(points.len());
    for (number, p) in (0..).zip(points) {
        // Spade accepts no coordinates other than zero that are closer to zero than this.
        let [x, y] = [p.x, p.y].map(|x| if x.abs() < 1e-40 { 0.0 } else { x });
        let position = Point2::new(x, y);
        let handle = delaunay
            .insert(NumberedPoint { position, number })
            .map_err(|_| PlanarError::NotSimple)?;
        if handle.index() < handles.len() {
            let earlier = handles.iter().position(|h| *h == handle).unwrap_or(0);
            return Err(PlanarError::Coincident([earlier as u32, number]));
        }
        handles.push(handle);
    }
    for k in 0..corners {
        let side = delaunay.try_add_constraint(handles[k], handles[(k + 1) % corners]);
        if side.len() != 1 {
            return Err(PlanarError::NotSimple);
        }
    }
    let triangles: Vec<[u32; 3]> = delaunay
        .inner_faces()
        .map(|face| face.vertices().map(|v| v.data().number))
        .filter(|t| is_inside(t, corners))
        .collect();
    if triangles.len() + 2 == corners + 2 * (points.len() - corners) {
        Ok(triangles)
    } else {
        Err(PlanarError::NotSimple)
    }
}

/// Whether a triangle lies inside the polygon. Those outside, between the polygon and its convex
/// hull, have corners of the polygon only, and in the opposite order.
fn is_inside(&[a, b, c]: &[u32; 3], corners: usize) -> bool {
    let ascents = [a < b, b < c, c < a];
    let in_order = ascents.iter().filter(|up| **up).count() == 2;
    in_order || [a, b, c].iter().any(|v| *v as usize >= corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use rand::RngExt;

    fn doubled_area([a, b, c]: [Vec2; 3]) -> f64 {
        (b - a).perp(&(c - a))
    }

    #[test]
    fn covers_star_shaped_polygons_exactly_once() {
        let mut rng = stream(1, Purpose::Measure);
        for corners in 3..40 {
            let mut points: Vec<Vec2> = (0..corners)
                .map(|k| {
                    let angle = std::f64::consts::TAU * k as f64 / corners as f64;
                    Vec2::new(angle.cos(), angle.sin()) * rng.random_range(0.3..1.0)
                })
                .collect();
            for _ in 0..corners {
                points.push(Vec2::new(rng.random(), rng.random()) * 0.05);
            }
            let triangles = constrained_delaunay(&points, corners).unwrap();
            let areas: Vec<f64> = triangles
                .iter()
                .map(|t| doubled_area(t.map(|v| points[v as usize])))
                .collect();
            assert!(areas.iter().all(|a| *a > 0.0));
            let polygon: f64 = (0..corners)
                .map(|k| points[k].perp(&points[(k + 1) % corners]))
                .sum();
            assert!((areas.iter().sum::<f64>() - polygon).abs() < 1e-12);
        }
    }

    /// Polygons with nothing inside, of which parts of the convex hull are to be left out.
    #[test]
    fn what_lies_between_a_polygon_and_its_hull_is_left_out() {
        let comb = [
            [0.0, 0.0],
            [9.0, 0.0],
            [9.0, 5.0],
            [7.0, 1.0],
            [6.0, 6.0],
            [4.0, 1.0],
            [3.0, 5.0],
            [1.0, 1.0],
            [0.0, 6.0],
        ];
        for turn in 0..comb.len() {
            let mut corners = comb.map(Vec2::from);
            corners.rotate_left(turn);
            let triangles = constrained_delaunay(&corners, corners.len()).unwrap();
            assert_eq!(triangles.len(), corners.len() - 2);
            let at = |v: u32| corners[v as usize];
            assert!(triangles.iter().all(|t| doubled_area(t.map(at)) > 0.0));
            let sum: f64 = triangles.iter().map(|t| doubled_area(t.map(at))).sum();
            let n = corners.len();
            let polygon: f64 = (0..n).map(|k| corners[k].perp(&corners[(k + 1) % n])).sum();
            assert!((sum - polygon).abs() < 1e-12);
        }
    }

    #[test]
    fn coordinates_next_to_zero_count_as_zero() {
        let tiny = 1e-60;
        let points = [[tiny, -tiny], [1.0, tiny], [0.0, 1.0], [0.3, 0.3]].map(Vec2::from);
        let exact = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.3]].map(Vec2::from);
        assert_eq!(
            constrained_delaunay(&points, 3),
            constrained_delaunay(&exact, 3)
        );
        assert_eq!(constrained_delaunay(&points, 3).unwrap().len(), 3);
        // What is small but not next to zero keeps its place.
        let apart = [
            [0.0, 0.0],
            [1.0, 0.0],
            [0.0, 1.0],
            [1e-30, 1e-30],
            [1e-30, 2e-30],
        ];
        assert_eq!(
            constrained_delaunay(&apart.map(Vec2::from), 3)
                .unwrap()
                .len(),
            5
        );
    }

    #[test]
    fn errors_name_the_reason() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
        let twisted = [square[0], square[2], square[1], square[3]];
        assert_eq!(
            constrained_delaunay(&twisted, 4),
            Err(PlanarError::NotSimple)
        );
        let clockwise = [square[3], square[2], square[1], square[0]];
        assert_eq!(
            constrained_delaunay(&clockwise, 4),
            Err(PlanarError::NotSimple)
        );
        let touching = [
            square[0],
            square[1],
            square[2],
            Vec2::new(0.5, 0.0),
            square[3],
        ];
        assert_eq!(
            constrained_delaunay(&touching, 5),
            Err(PlanarError::NotSimple)
        );
        let twice = [square[0], square[1], square[2], square[3], square[1]];
        assert_eq!(
            constrained_delaunay(&twice, 4),
            Err(PlanarError::Coincident([1, 4]))
        );
    }
}
