//! The mesh's outlines in the planes of the slices as RT Structure Set Storage (PS3.3 A.19).
//!
//! Each slice's plane cuts the closed mesh in closed polygons. A polygon inside another one is a
//! hole: it is joined with the outer one by a channel of no width, the form that PS3.3 C.8.8.6.3
//! asks for with CLOSED_PLANAR; readers that fill by parity see the same area.

use super::segmentation::SlicePlanes;
use super::{DicomError, DicomResults, STRUCTURE_RGB};
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;
use std::collections::BTreeMap;
use ventriform_dicom::tags;
use ventriform_dicom::write::data_set::{DataSet, reference};

/// The retired SOP class that PS3.3 C.8.8.5 keeps for references to a study.
const STUDY_CLASS: &str = "1.2.840.10008.3.1.2.3.1";

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) -> Result<(), DicomError> {
    let scan = results.scan;
    let frame_of_reference = scan.frame_of_reference();
    let made = scan.made();
    set.text(tags::STRUCTURE_SET_LABEL, "VENTRIFORM");
    set.text(tags::STRUCTURE_SET_NAME, results.structure.label);
    set.text(tags::STRUCTURE_SET_DATE, made.date.as_str());
    set.text(tags::STRUCTURE_SET_TIME, made.time.as_str());
    set.empty(tags::OPERATORS_NAME);
    set.text(tags::APPROVAL_STATUS, "UNAPPROVED");
    scan.put_frame_of_reference(set);
    let mut referenced = DataSet::new();
    referenced.text(tags::FRAME_OF_REFERENCE_UID, frame_of_reference.as_str());
    if let Some(images) = scan.images() {
        let mut series = DataSet::new();
        series.text(tags::SERIES_INSTANCE_UID, images.series);
        series.items(tags::CONTOUR_IMAGE_SEQUENCE, images.references());
        let mut study = reference(STUDY_CLASS, scan.study());
        study.item(tags::RT_REFERENCED_SERIES_SEQUENCE, series);
        referenced.item(tags::RT_REFERENCED_STUDY_SEQUENCE, study);
    }
    set.item(tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE, referenced);

    let mut region = DataSet::new();
    region.text(tags::ROI_NUMBER, "1");
    region.text(
        tags::REFERENCED_FRAME_OF_REFERENCE_UID,
        frame_of_reference.as_str(),
    );
    region.text(tags::ROI_NAME, results.structure.label);
    region.text(tags::ROI_GENERATION_ALGORITHM, "AUTOMATIC");
    set.item(tags::STRUCTURE_SET_ROI_SEQUENCE, region);

    let mut outlines = DataSet::new();
    outlines.text(tags::REFERENCED_ROI_NUMBER, "1");
    outlines.text(
        tags::ROI_DISPLAY_COLOR,
        STRUCTURE_RGB.map(|c| c.to_string()).join("\\"),
    );
    outlines.items(tags::CONTOUR_SEQUENCE, contours(results)?);
    set.item(tags::ROI_CONTOUR_SEQUENCE, outlines);

    let mut observation = DataSet::new();
    observation.text(tags::OBSERVATION_NUMBER, "1");
    observation.text(tags::REFERENCED_ROI_NUMBER, "1");
    observation.code(
        tags::RTROI_IDENTIFICATION_CODE_SEQUENCE,
        results.structure.kind,
    );
    observation.text(tags::RTROI_INTERPRETED_TYPE, "ORGAN");
    observation.empty(tags::ROI_INTERPRETER);
    set.item(tags::RTROI_OBSERVATIONS_SEQUENCE, observation);
    Ok(())
}

/// One item for every polygon of every slice.
fn contours(results: &DicomResults<'_>) -> Result<Vec<DataSet>, DicomError> {
    /// Longest value of an element with a 16-bit length.
    const MAX_SHORT_VALUE_BYTES: usize = 65_534;
    let scan = results.scan;
    let planes = SlicePlanes::new(&scan.frame, scan.shape[2])?;
    let mut items = Vec::new();
    for &slice in &planes.order {
        let origin = scan.frame.to_patient(&Vec3::new(0.0, 0.0, slice as f64));
        let plane = CuttingPlane {
            origin,
            directions: planes.directions,
        };
        for points in plane.outlines(results.mesh) {
            let numbers = points.iter().flat_map(|p| [p.x, p.y, p.z]);
            let numbers: Vec<String> = numbers.map(micrometres).collect();
            let text = numbers.join("\\");
            if text.len() > MAX_SHORT_VALUE_BYTES {
                return Err(DicomError::LongContour { slice });
            }
            let mut item = DataSet::new();
            if let Some(image) = scan.slice_reference(slice) {
                item.item(tags::CONTOUR_IMAGE_SEQUENCE, image);
            }
            item.text(tags::CONTOUR_GEOMETRIC_TYPE, "CLOSED_PLANAR");
            item.text(tags::NUMBER_OF_CONTOUR_POINTS, points.len().to_string());
            item.text(tags::CONTOUR_DATA, text);
            items.push(item);
        }
    }
    Ok(items)
}

/// A coordinate in mm, to the thousandth.
fn micrometres(x: f64) -> String {
    format!("{}", (1000.0 * x).round() / 1000.0 + 0.0)
}

/// A plane through `origin`, spanned by two unit vectors at right angles.
struct CuttingPlane {
    origin: Vec3,
    directions: [Vec3; 2],
}

type Point = [f64; 2];

impl CuttingPlane {
    /// The polygons in which the plane cuts a closed, oriented mesh, holes joined with the
    /// polygons around them.
    fn outlines(&self, mesh: &TriMesh) -> Vec<Vec<Vec3>> {
        let loops = self.loops(mesh);
        let depths: Vec<usize> = (0..loops.len())
            .map(|own| {
                let around = (0..loops.len()).filter(|o| *o != own);
                around
                    .filter(|o| contains(&loops[*o], loops[own][0]))
                    .count()
            })
            .collect();
        let outer = (0..loops.len()).filter(|l| depths[*l].is_multiple_of(2));
        outer
            .map(|own| {
                let hole = |l: &usize| {
                    depths[*l] == depths[own] + 1 && contains(&loops[own], loops[*l][0])
                };
                let holes = (0..loops.len()).filter(hole);
                let joined = holes.fold(loops[own].clone(), |polygon, l| join(polygon, &loops[l]));
                let [u, v] = self.directions;
                let place = |p: &Point| self.origin + u * p[0] + v * p[1];
                joined.iter().map(place).collect()
            })
            .collect()
    }

    /// The closed polygons, in coordinates of the plane. A vertex on the plane counts as above it,
    /// so that every cut runs through edges.
    fn loops(&self, mesh: &TriMesh) -> Vec<Vec<Point>> {
        let [u, v] = self.directions;
        let normal = u.cross(&v);
        let heights: Vec<f64> = mesh
            .vertices
            .iter()
            .map(|p| (p - self.origin).dot(&normal))
            .collect();
        let above = |vertex: u32| heights[vertex as usize] >= 0.0;
        // From the edge at which a triangle goes up to the one at which it goes down.
        let mut next = BTreeMap::new();
        for triangle in &mesh.triangles {
            let (mut up, mut down) = (None, None);
            for corner in 0..3 {
                let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
                match (above(a), above(b)) {
                    (false, true) => up = Some((a.min(b), a.max(b))),
                    (true, false) => down = Some((a.min(b), a.max(b))),
                    _ => {}
                }
            }
            if let (Some(up), Some(down)) = (up, down) {
                next.insert(up, down);
            }
        }
        let point = |(a, b): (u32, u32)| {
            let (ha, hb) = (heights[a as usize], heights[b as usize]);
            let (a, b) = (mesh.vertices[a as usize], mesh.vertices[b as usize]);
            let at = a + (b - a) * (ha / (ha - hb)) - self.origin;
            [at.dot(&u), at.dot(&v)]
        };
        let mut loops = Vec::new();
        while let Some((first, mut edge)) = next.pop_first() {
            let mut polygon = vec![point(first)];
            while edge != first {
                polygon.push(point(edge));
                match next.remove(&edge) {
                    Some(further) => edge = further,
                    None => break,
                }
            }
            let near = |a: &Point, b: &Point| (0..2).all(|c| (a[c] - b[c]).abs() < 5e-4);
            polygon.dedup_by(|a, b| near(a, b));
            if polygon.len() > 1 && near(&polygon[0], &polygon[polygon.len() - 1]) {
                polygon.pop();
            }
            if polygon.len() >= 3 {
                loops.push(polygon);
            }
        }
        loops
    }
}

/// Whether `p` lies inside `polygon`, by parity.
fn contains(polygon: &[Point], p: Point) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) {
            let x = a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1]);
            inside ^= p[0] < x;
        }
    }
    inside
}

/// `polygon` with `hole` inserted at the nearest pair of their points, there and back.
fn join(polygon: Vec<Point>, hole: &[Point]) -> Vec<Point> {
    let distance = |(a, b): (usize, usize)| {
        let (p, q) = (polygon[a], hole[b]);
        (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)
    };
    let pairs = (0..polygon.len()).flat_map(|a| (0..hole.len()).map(move |b| (a, b)));
    let nearest = pairs.min_by(|x, y| distance(*x).total_cmp(&distance(*y)));
    let Some((at, from)) = nearest else {
        return polygon;
    };
    let mut joined = polygon[..=at].to_vec();
    joined.extend(&hole[from..]);
    joined.extend(&hole[..=from]);
    joined.extend(&polygon[at..]);
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_cup_is_cut_in_a_ring() {
        let mesh = shapes::cup(60.0, 30.0, 10.0, 32);
        let heights = mesh.vertices.iter().map(|p| p.z);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        let plane = CuttingPlane {
            origin: Vec3::new(0.0, 0.0, high - 0.3 * (high - low)),
            directions: [Vec3::x(), Vec3::y()],
        };
        assert_eq!(plane.loops(&mesh).len(), 2);
        let outlines = plane.outlines(&mesh);
        assert_eq!(outlines.len(), 1, "the hole is part of the ring's polygon");
        let polygon: Vec<Point> = outlines[0].iter().map(|p| [p.x, p.y]).collect();
        assert!(!contains(&polygon, [0.1, 0.2]), "the cavity is outside");
        assert!(contains(&polygon, [25.0, 0.2]) || contains(&polygon, [22.0, 0.2]));
    }
}
