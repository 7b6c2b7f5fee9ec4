//! Masks by code in every storage, against the mask itself.

use super::*;
use crate::base::geometry::Vec3;
use crate::base::progress::{CancelToken, Cancelled, Silent};
use crate::image::volume::nifti::{self, StoredType};
use nalgebra::Matrix3;
use std::collections::BTreeSet;

const GRID_SHAPE: [usize; 3] = [12, 9, 7];

fn frame() -> VoxelToPatient {
    let turn = nalgebra::Rotation3::from_euler_angles(0.2, -0.4, 1.1);
    let steps = Matrix3::from_diagonal(&Vec3::new(3.0, 3.5, 4.0));
    VoxelToPatient::new(turn.matrix() * steps, Vec3::new(7.1, -3.3, 9.9)).unwrap()
}

fn volume(value: impl Fn([usize; 3]) -> f32) -> Volume {
    let [nx, ny, nz] = GRID_SHAPE;
    let at = |v: usize| [v % nx, v / nx % ny, v / nx / ny];
    let voxels: Vec<f32> = (0..nx * ny * nz).map(|v| value(at(v))).collect();
    Volume {
        shape: GRID_SHAPE,
        integral: voxels.iter().all(|v| v.is_nan() || v.fract() == 0.0),
        voxels,
        frame: frame(),
    }
}

/// The wall, without symmetry; and what it encloses.
fn wall([i, j, k]: [usize; 3]) -> bool {
    (2..8).contains(&i) && (2..7).contains(&j) && (1..6).contains(&k) && !cavity([i, j, k])
        || i == 8 && j == 3 && k == 2
}

fn cavity([i, j, k]: [usize; 3]) -> bool {
    (4..6).contains(&i) && (3..6).contains(&j) && (2..6).contains(&k)
}

fn named(label: &str) -> MaskChoice {
    MaskChoice {
        label: Some(label.parse().unwrap()),
        ..MaskChoice::default()
    }
}

fn read(volume: &Volume, choice: &MaskChoice) -> Result<GivenMask, GivenMaskError> {
    GivenMask::of_volume(volume, choice, &Monitor::silent())
}

#[test]
fn a_mask_that_is_cancelled_is_refused_as_that() {
    let token = CancelToken::new();
    token.cancel();
    let monitor = Monitor::new(&Silent, token);
    for inside in [1.0, 0.25, 255.0] {
        let scan = volume(|p| if wall(p) { inside } else { 0.0 });
        let made = GivenMask::of_volume(&scan, &MaskChoice::default(), &monitor);
        assert_eq!(made, Err(GivenMaskError::Cancelled(Cancelled)));
    }
}

#[test]
fn the_same_mask_in_any_numbers_is_the_same() {
    let any = MaskChoice::default();
    let one = read(&volume(|p| f32::from(u8::from(wall(p)))), &any).unwrap();
    assert_eq!(one.structure, None);
    type Values = (f32, f32);
    let pairs: [Values; 12] = [
        (255.0, 0.0),
        (-1.0, 0.0),
        (1.0, f32::NAN),
        (1.0, -1.0),
        (0.0, -1.0),
        (1.0, -1024.0),
        (0.0, 255.0),
        (7.0, 3.0),
        (0.9, 0.2),
        (0.4, 0.0),
        (1.000_000_1, 0.0),
        (-2.5, 1.5),
    ];
    for (inside, outside) in pairs {
        let stored = volume(|p| if wall(p) { inside } else { outside });
        let mask = read(&stored, &any).unwrap();
        assert_eq!(mask.mask, one.mask, "{inside} in {outside}");
    }
    let soft = volume(|p| match (wall(p), cavity(p)) {
        (true, _) => 0.9,
        (_, true) => 0.45,
        _ => 0.02,
    });
    assert_eq!(read(&soft, &any).unwrap().mask, one.mask);
}

#[test]
fn of_several_labels_one_must_be_named_and_only_it_counts() {
    let map = volume(|p| match (wall(p), cavity(p)) {
        (true, _) => 2.0,
        (_, true) => 3.0,
        _ if p[0] == 11 => 1.0,
        _ => 0.0,
    });
    let wanted: Vec<bool> = volume(|p| f32::from(u8::from(wall(p))))
        .voxels
        .iter()
        .map(|v| *v > 0.0)
        .collect();
    let mask = read(&map, &named("2")).unwrap();
    assert_eq!(mask.mask.voxels, wanted);
    assert_eq!(mask.structure.as_deref(), Some("label 2"));
    let refused = read(&map, &MaskChoice::default()).unwrap_err();
    let GivenMaskError::SeveralStructures { present } = &refused else {
        panic!("{refused}");
    };
    let numbers: Vec<i64> = present.iter().map(|s| s.number).collect();
    assert_eq!(numbers, [1, 2, 3]);
    for text in ["1 (", "2 (", "3 ("] {
        assert!(refused.to_string().contains(text), "{refused}");
    }
    for absent in ["4", "-1", "wall"] {
        let refused = read(&map, &named(absent)).unwrap_err();
        assert!(
            matches!(refused, GivenMaskError::NoSuchStructure { .. }),
            "{refused}"
        );
    }
    // The background is a label like any other if it is named.
    let rest = read(&map, &named("0")).unwrap();
    let both = rest
        .mask
        .voxels
        .iter()
        .zip(&wanted)
        .filter(|(a, b)| **a && **b);
    assert_eq!(both.count(), 0);
}

#[test]
fn what_is_no_mask_is_refused() {
    let any = MaskChoice::default();
    let scan = volume(|p| p.iter().sum::<usize>() as f32 * 1.7 - 3.0);
    assert!(matches!(
        read(&scan, &any),
        Err(GivenMaskError::NotMask { .. })
    ));
    assert_eq!(read(&volume(|_| 0.0), &any), Err(GivenMaskError::Empty));
    assert!(
        read(&volume(|_| 1.0), &any)
            .unwrap()
            .mask
            .voxels
            .iter()
            .all(|v| *v)
    );
    let faint = volume(|p| p[0] as f32 * 0.01);
    assert_eq!(read(&faint, &any), Err(GivenMaskError::Empty));
}

/// The voxel centres of a mask in the patient, in hundredths of a millimetre.
fn centres(given: &GivenMask) -> BTreeSet<[i64; 3]> {
    let [nx, ny, _] = given.mask.shape;
    let set = given
        .mask
        .voxels
        .iter()
        .enumerate()
        .filter(|(_, set)| **set);
    set.map(|(v, _)| {
        let index = [v % nx, v / nx % ny, v / nx / ny].map(|x| x as f64);
        let p = given.frame.to_patient(&Vec3::from(index));
        [p.x, p.y, p.z].map(|x| (x * 100.0).round() as i64)
    })
    .collect()
}

/// Every signed permutation of the axes, with the grid padded or cropped to the object.
#[test]
fn one_lattice_in_any_storage_gives_the_same_voxels() {
    let any = MaskChoice::default();
    let original = read(&volume(|p| f32::from(u8::from(wall(p)))), &any).unwrap();
    let silent = Monitor::silent();
    let grid = (GRID_SHAPE, &original.frame);
    let mut stored = 0;
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        for signs in 0..8_u8 {
            // Low and high end of the new grid in indices of the old one.
            for (low, high) in [
                ([0; 3], [11, 8, 6]),
                ([-3, -1, -2], [14, 8, 9]),
                ([2, 2, 1], [8, 6, 5]),
            ] {
                let extent = [0, 1, 2].map(|a| (high[a] - low[a] + 1) as usize);
                let shape = order.map(|a| extent[a]);
                let old = |new: [usize; 3]| {
                    let mut p = [0_i64; 3];
                    for (n, a) in order.into_iter().enumerate() {
                        p[a] = match signs >> n & 1 {
                            0 => low[a] + new[n] as i64,
                            _ => high[a] - new[n] as i64,
                        };
                    }
                    p
                };
                let at = |p: [i64; 3]| original.frame.to_patient(&Vec3::from(p.map(|x| x as f64)));
                let origin = at(old([0; 3]));
                let steps = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|step| at(old(step)) - origin);
                let mut mask = Mask::empty(shape);
                for v in 0..mask.voxels.len() {
                    let p = old([
                        v % shape[0],
                        v / shape[0] % shape[1],
                        v / shape[0] / shape[1],
                    ]);
                    let inside = p.map(|x| usize::try_from(x).unwrap_or(usize::MAX));
                    mask.voxels[v] = (0..3).all(|a| inside[a] < GRID_SHAPE[a]) && wall(inside);
                }
                let turned = GivenMask {
                    mask,
                    frame: VoxelToPatient::new(Matrix3::from_columns(&steps), origin).unwrap(),
                    structure: None,
                    surface: None,
                };
                assert_eq!(centres(&turned), centres(&original));
                let placed = turned.on(grid, false, &silent).unwrap();
                assert_eq!(placed.mask, original.mask, "{order:?} {signs} {low:?}");
                assert_eq!((placed.resampled, placed.outside), (false, 0));
                stored += 1;
            }
        }
    }
    assert_eq!(stored, 144);
}

#[test]
fn other_lattices_are_refused_with_both_geometries_or_resampled() {
    let any = MaskChoice::default();
    let original = read(&volume(|p| f32::from(u8::from(wall(p)))), &any).unwrap();
    let silent = Monitor::silent();
    let with = |linear: Matrix3<f64>, origin: Vec3| GivenMask {
        frame: VoxelToPatient::new(linear, origin).unwrap(),
        ..original.clone()
    };
    let (linear, origin) = (
        *original.frame.linear(),
        original.frame.to_patient(&Vec3::zeros()),
    );
    let step: Vec3 = linear.column(0).into_owned();
    let turned = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 0.01);
    let others = [
        with(linear, origin + step * 0.3),
        with(linear, origin + step * 2e-3),
        with(linear * 1.001, origin),
        with(turned.matrix() * linear, origin),
    ];
    for other in &others {
        let grid = (GRID_SHAPE, &original.frame);
        let refused = other.on(grid, false, &silent).unwrap_err();
        let GivenMaskError::OtherGrid { mask, grid } = &refused else {
            panic!("{refused}");
        };
        assert_eq!((mask.shape, grid.shape), (GRID_SHAPE, GRID_SHAPE));
        assert!(
            refused
                .to_string()
                .contains("12 x 9 x 7 voxels of 3 x 3.5 x 4 mm"),
            "{refused}"
        );
    }
    for near in [
        with(linear, origin + step * 5e-4),
        with(linear * (1.0 + 3e-7), origin),
        with(linear, origin.add_scalar(1e-5)),
    ] {
        let placed = near
            .on((GRID_SHAPE, &original.frame), false, &silent)
            .unwrap();
        assert_eq!(
            (placed.mask, placed.resampled),
            (original.mask.clone(), false)
        );
    }
    // Half a voxel and less away, the nearest voxel is the same; each voxel in eight parts, too.
    let placed = others[0]
        .on((GRID_SHAPE, &original.frame), true, &silent)
        .unwrap();
    assert_eq!((&placed.mask, placed.resampled), (&original.mask, true));
    let fine_shape = GRID_SHAPE.map(|n| 2 * n);
    let mut fine = Mask::empty(fine_shape);
    for v in 0..fine.voxels.len() {
        let p = [v % 24, v / 24 % 18, v / (24 * 18)].map(|x| x / 2);
        fine.voxels[v] = wall(p);
    }
    let fine = GivenMask {
        mask: fine,
        frame: VoxelToPatient::new(
            linear / 2.0,
            original.frame.to_patient(&Vec3::new(-0.25, -0.25, -0.25)),
        )
        .unwrap(),
        structure: None,
        surface: None,
    };
    assert!(
        fine.on((GRID_SHAPE, &original.frame), false, &silent)
            .is_err()
    );
    let placed = fine
        .on((GRID_SHAPE, &original.frame), true, &silent)
        .unwrap();
    assert_eq!(placed.mask, original.mask);
}

/// Equal steps: the corners of a cube with two axes swapped are the same, its voxels are not.
#[test]
fn a_swapped_cube_is_compared_by_its_voxels() {
    let cube = VoxelToPatient::centred([9; 3], [2.0; 3], Vec3::zeros()).unwrap();
    let half = |axis: usize| {
        let mut mask = Mask::empty([9; 3]);
        for v in 0..729 {
            mask.voxels[v] = [v % 9, v / 9 % 9, v / 81][axis] < 3;
        }
        mask
    };
    let linear = *cube.linear();
    let swapped = Matrix3::from_columns(&[linear.column(1), linear.column(0), linear.column(2)]);
    let given = GivenMask {
        mask: half(0),
        frame: VoxelToPatient::new(swapped, cube.to_patient(&Vec3::zeros())).unwrap(),
        structure: None,
        surface: None,
    };
    let placed = given
        .on(([9; 3], &cube), false, &Monitor::silent())
        .unwrap();
    assert_eq!(placed.mask, half(1));
}

#[test]
fn voxels_beyond_the_border_are_lost_only_if_few_and_held_otherwise() {
    let any = MaskChoice::default();
    let mask = read(&volume(|p| f32::from(u8::from(wall(p)))), &any).unwrap();
    let silent = Monitor::silent();
    let moved = |steps: f64| {
        let origin = mask.frame.to_patient(&Vec3::new(0.0, steps, 0.0));
        GivenMask {
            frame: VoxelToPatient::new(*mask.frame.linear(), origin).unwrap(),
            ..mask.clone()
        }
    };
    let refused = moved(5.0)
        .on((GRID_SHAPE, &mask.frame), true, &silent)
        .unwrap_err();
    assert!(
        matches!(refused, GivenMaskError::Elsewhere { .. }),
        "{refused}"
    );
    let (own, other) = (mask.holding(&moved(5.0), &silent).unwrap(), moved(5.0));
    assert_eq!(centres(&own), centres(&mask));
    let placed = other
        .on((own.mask.shape, &own.frame), false, &silent)
        .unwrap();
    assert_eq!(placed.mask.count(), mask.mask.count());
    let far = moved(1e8);
    assert!(matches!(
        mask.holding(&far, &silent),
        Err(GivenMaskError::TooFarApart { .. })
    ));
}

/// Labels that 32-bit floats do not tell apart, from a NIfTI file of 32-bit integers.
#[test]
fn labels_beyond_24_bits_are_told_apart() {
    let labels = [576_073_729_i32, 576_073_732, 0];
    let map = volume(|p| match (wall(p), cavity(p)) {
        (true, _) => 0.0,
        (_, true) => 1.0,
        _ => 2.0,
    });
    let mut bytes = nifti::write(&map, StoredType::Float32, false).unwrap();
    bytes[70..74].copy_from_slice(&[8, 0, 32, 0]);
    bytes.truncate(352);
    for v in &map.voxels {
        bytes.extend(labels[*v as usize].to_le_bytes());
    }
    let files = [VolumeFile::in_memory("atlas.nii", bytes)];
    let (limits, silent) = (ReadLimits::default(), Monitor::silent());
    for (kind, label) in labels.into_iter().enumerate().take(2) {
        let mask = read_mask(&files, &named(&label.to_string()), &limits, &silent).unwrap();
        let wanted: Vec<bool> = map.voxels.iter().map(|v| *v as usize == kind).collect();
        assert_eq!(mask.mask.voxels, wanted);
    }
    let refused = read_mask(&files, &MaskChoice::default(), &limits, &silent).unwrap_err();
    assert!(refused.to_string().contains("576073729"), "{refused}");
    assert!(refused.to_string().contains("576073732"), "{refused}");
    assert!(read_mask(&files, &named("576073728"), &limits, &silent).is_err());
}

/// A body as a surface is the mask of the voxels whose centres lie inside it, on any grid.
#[test]
fn a_surface_is_voxelised_on_the_grid_of_the_volume() {
    use crate::image::grid::voxelise::voxelise;
    use crate::mesh::shapes;
    let mut mesh = shapes::icosphere(14.0, 3);
    let grid = frame();
    let centre = grid.to_patient(&Vec3::new(5.3, 4.1, 2.8));
    mesh.vertices.iter_mut().for_each(|p| *p += centre);
    let wanted = voxelise(&mesh, GRID_SHAPE, &grid, &Monitor::silent()).unwrap();
    let text = |mesh: &TriMesh, head: &str| {
        let points = mesh
            .vertices
            .iter()
            .map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
        let faces = mesh
            .triangles
            .iter()
            .map(|t| t.map(|v| (v + 1).to_string()).join(" "));
        let faces = faces.map(|face| format!("f {face}\n"));
        [head.to_owned()]
            .into_iter()
            .chain(points)
            .chain(faces)
            .collect::<String>()
    };
    let (limits, silent) = (ReadLimits::default(), Monitor::silent());
    let read = |text: String, choice: &MaskChoice| {
        let files = [VolumeFile::in_memory("drawn.obj", text.into_bytes())];
        read_mask(&files, choice, &limits, &silent)
    };
    let any = MaskChoice::default();
    let given = read(text(&mesh, "# SPACE=LPS UNIT=mm\n"), &any).unwrap();
    assert_eq!(given.structure, None);
    let placed = given.on((GRID_SHAPE, &grid), false, &silent).unwrap();
    assert_eq!(placed.mask, wanted);
    assert!(!placed.resampled);
    // The voxels of its own grid tell its size.
    let own_ml = given.mask.count() as f64 * given.frame.voxel_volume();
    assert!((own_ml / mesh.volume() - 1.0).abs() < 0.01);
    // In another frame it lies elsewhere, unless that is stated.
    let mut turned = mesh.clone();
    turned
        .vertices
        .iter_mut()
        .for_each(|p| (p.x, p.y) = (-p.x, -p.y));
    let lost = read(text(&turned, ""), &any).unwrap();
    let lost = lost.on((GRID_SHAPE, &grid), false, &silent).unwrap_err();
    assert!(matches!(lost, GivenMaskError::Elsewhere { .. }), "{lost}");
    let mut ras = any.clone();
    ras.mesh.frame = Some(crate::mesh::files::MeshFrame::Ras);
    let found = read(text(&turned, ""), &ras).unwrap();
    assert_eq!(
        found.on((GRID_SHAPE, &grid), false, &silent).unwrap().mask,
        wanted
    );
    // Metres are told by the size.
    let mut small = mesh.clone();
    small.vertices.iter_mut().for_each(|p| *p /= 1000.0);
    let refused = read(text(&small, "# wavefront\n"), &any).unwrap_err();
    assert!(refused.to_string().contains("factor 1000"), "{refused}");
    let mut metres = any.clone();
    metres.mesh.unit = Some(crate::mesh::files::MeshUnit::Metre);
    let found = read(text(&small, "# wavefront\n"), &metres).unwrap();
    let found = found.on((GRID_SHAPE, &grid), false, &silent).unwrap().mask;
    let differ = found
        .voxels
        .iter()
        .zip(&wanted.voxels)
        .filter(|(a, b)| a != b);
    assert!(differ.count() <= 1);
    // An open surface, and a label that it does not have.
    let mut open = mesh.clone();
    open.triangles.pop();
    let refused = read(text(&open, "# SPACE=LPS UNIT=mm\n"), &any).unwrap_err();
    assert!(refused.to_string().contains("3 edges"), "{refused}");
    assert!(read(text(&mesh, "# SPACE=LPS UNIT=mm\n"), &named("7")).is_err());
}
