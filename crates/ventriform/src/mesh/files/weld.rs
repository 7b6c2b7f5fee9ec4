//! Vertices that a file repeats become one.

use super::closed;
use super::error::MeshFileError;
use crate::base::geometry::Vec3;
use crate::base::numeric::order::sort_watched;
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Share of the greatest coordinate within which points may become one: eight steps of single precision.
const WELD_SHARE: f64 = 1.0 / (1 << 20) as f64;

/// Joins vertices of `mesh` as far as it takes to close it; always those of equal coordinates if the format repeats
/// them (`corners_only`).
///
/// # Errors
/// [`MeshFileError::Open`] or [`MeshFileError::Orientation`] of the surface as the file states it, or with equal
/// points joined.
pub(super) fn close(
    mesh: &mut TriMesh,
    corners_only: bool,
    notes: &mut Vec<String>,
    monitor: &Monitor<'_>,
) -> Result<(), MeshFileError> {
    let stated = mesh.vertices.len();
    tidy(mesh, notes);
    if !corners_only {
        match closed::check(mesh, monitor) {
            Err(cancelled @ MeshFileError::Cancelled(_)) => return Err(cancelled),
            Err(_) => {}
            Ok(()) => return Ok(()),
        }
    }
    apply(mesh, &equal(&mesh.vertices, monitor)?);
    monitor.check()?;
    let joined = stated - mesh.vertices.len().min(stated);
    tidy(mesh, notes);
    if !corners_only && joined > 0 {
        notes.push(format!(
            "{joined} vertices with the coordinates of others were joined with them."
        ));
    }
    let error = match closed::check(mesh, monitor) {
        Ok(()) => return Ok(()),
        Err(cancelled @ MeshFileError::Cancelled(_)) => return Err(cancelled),
        Err(error) => error,
    };
    let greatest = mesh.vertices.iter().map(|p| p.amax()).fold(0.0, f64::max);
    let mut nearer = mesh.clone();
    let first = near(&mesh.vertices, greatest * WELD_SHARE, monitor)?;
    apply(&mut nearer, &first);
    let joined = mesh.vertices.len() - nearer.vertices.len();
    let mut later = Vec::new();
    tidy(&mut nearer, &mut later);
    let still_open = closed::check(&nearer, monitor).is_err();
    monitor.check()?;
    if joined == 0 || still_open {
        return Err(error);
    }
    notes.push(format!(
        "{joined} vertices within {:.1e} of others were joined with them.",
        greatest * WELD_SHARE
    ));
    notes.append(&mut later);
    *mesh = nearer;
    Ok(())
}

/// Leaves out triangles that name a vertex twice, and vertices without triangle.
fn tidy(mesh: &mut TriMesh, notes: &mut Vec<String>) {
    let before = mesh.triangles.len();
    mesh.triangles
        .retain(|[a, b, c]| a != b && b != c && c != a);
    let thin = before - mesh.triangles.len();
    if thin > 0 {
        notes.push(format!(
            "{thin} triangles with two corners at one place were left out."
        ));
    }
    let mut used = vec![false; mesh.vertices.len()];
    for v in mesh.triangles.iter().flatten() {
        used[*v as usize] = true;
    }
    let unused = used.iter().filter(|used| !**used).count();
    if unused == 0 {
        return;
    }
    notes.push(format!("{unused} vertices without triangle were left out."));
    let mut place = vec![0; used.len()];
    let mut kept = 0_u32;
    for (v, used) in used.iter().enumerate() {
        place[v] = kept;
        kept += u32::from(*used);
    }
    let mut keep = used.iter();
    mesh.vertices.retain(|_| *keep.next().unwrap_or(&true));
    for v in mesh.triangles.iter_mut().flatten() {
        *v = place[*v as usize];
    }
}

/// Moves the triangles to the vertices that `first` names, and leaves the others out. Vertices stay in their order.
fn apply(mesh: &mut TriMesh, first: &[u32]) {
    let mut place = vec![0_u32; first.len()];
    let mut kept = 0;
    for (v, first) in first.iter().enumerate() {
        if *first as usize == v {
            mesh.vertices[kept as usize] = mesh.vertices[v];
            place[v] = kept;
            kept += 1;
        }
    }
    mesh.vertices.truncate(kept as usize);
    for v in mesh.triangles.iter_mut().flatten() {
        *v = place[first[*v as usize] as usize];
    }
}

/// For each point the first with the same coordinates.
fn equal(points: &[Vec3], monitor: &Monitor<'_>) -> Result<Vec<u32>, Cancelled> {
    // Adding zero makes both zeros one.
    let coordinates = |v: u32| points[v as usize].map(|x| x + 0.0);
    let compare = |a: &u32, b: &u32| {
        let (p, q) = (coordinates(*a), coordinates(*b));
        let places = p.iter().zip(q.iter()).map(|(x, y)| x.total_cmp(y));
        places.fold(Ordering::Equal, Ordering::then).then(a.cmp(b))
    };
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    sort_watched(&mut order, compare, monitor)?;
    let mut first: Vec<u32> = (0..points.len() as u32).collect();
    for pair in order.windows(2) {
        if coordinates(pair[0]) == coordinates(pair[1]) {
            first[pair[1] as usize] = first[pair[0] as usize];
        }
    }
    Ok(first)
}

/// For each point the first that is kept within `distance` along each axis. Those that are kept are farther apart, so
/// that a cell of that size holds few.
fn near(points: &[Vec3], distance: f64, monitor: &Monitor<'_>) -> Result<Vec<u32>, Cancelled> {
    let mut kept: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut first: Vec<u32> = (0..points.len() as u32).collect();
    if !(distance > 0.0) {
        return Ok(first);
    }
    for (v, p) in points.iter().enumerate() {
        monitor.check()?;
        let cell: [i64; 3] = (*p / distance).map(|x| x.floor() as i64).into();
        let around = (0..27).map(|n| {
            [n % 3, n / 3 % 3, n / 9]
                .iter()
                .zip(cell)
                .map(|(d, c)| c + d - 1)
                .collect::<Vec<i64>>()
        });
        let found = around
            .filter_map(|at| kept.get(&[at[0], at[1], at[2]]))
            .filter(|other| (points[**other as usize] - p).amax() <= distance)
            .min();
        match found {
            Some(other) => first[v] = *other,
            None => {
                kept.insert(cell, v as u32);
            }
        }
    }
    Ok(first)
}
