//! The ventricle's voxels at the iso-value, cut from its neighbours.
//!
//! In: the place of the ventricle ([`crate::image::locate::rays::Cavity`]) and the voxels. Out: its labels
//! at full resolution, and the reference intensity that fractions refer to.
//!
//! 1. The reference is the 98th percentile of the wall's voxels above 0.3 of its maximum (not
//!    the single hottest voxel).
//! 2. The component at the iso-value that holds most of the wall is taken.
//! 3. Where it reaches more than 24 mm beyond the middle of the wall, it has leaked into a
//!    neighbour. A watershed from two markers, the wall and everything that far out, floods
//!    from bright to dark and separates them along the valley between them (Vincent & Soille, PAMI 1991;
//!    marker flooding after Meyer 1994).

use std::collections::BinaryHeap;

use rayon::prelude::*;

use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::components::Components;
use crate::image::grid::labels::Labels;
use crate::image::locate::directions::Compass;
use crate::image::locate::rays::Cavity;

/// Greatest distance of the ventricle's voxels outward from the middle of the wall, mm.
const MAX_OUTWARD_MM: f64 = 24.0;
/// Voxels within this distance of the middle of the wall belong to its core, mm.
const CORE_DISTANCE_MM: f64 = 8.0;
/// The same for the search of the reference, mm.
const REFERENCE_DISTANCE_MM: f64 = 12.0;

/// The wall about a cavity, in a box of the volume that holds it.
#[derive(Debug, Clone)]
pub struct WallShell<'a> {
    volume: &'a Volume,
    cavity: &'a Cavity,
    compass: &'static Compass,
    spacing: [f64; 3],
    origin: [usize; 3],
    extent: [usize; 3],
    /// The intensity that fractions refer to.
    pub reference: f32,
}

/// The region at an iso-value and the parts that were cut away.
#[derive(Debug, Clone)]
pub struct Region {
    /// The ventricle's voxels.
    pub labels: Labels,
    /// Voxels cut off with a neighbour that touches at the iso-value.
    pub cut_voxels: usize,
    /// Area of the cut, mm².
    pub cut_area: f64,
    /// Voxels of the wall's core above the iso-value.
    pub core_voxels: usize,
    /// Those of them that are not connected to the rest.
    pub loose_voxels: usize,
}

impl Region {
    /// Whether the wall falls into pieces: more than 15 % of it is not connected to the rest.
    pub fn is_torn(&self) -> bool {
        100 * self.loose_voxels > 15 * self.core_voxels
    }

    /// Voxels of the cavities that the region encloses.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn enclosed_voxels(&self, monitor: &Monitor) -> Result<usize, Cancelled> {
        let outside = Components::of_outside(&self.labels, monitor)?;
        Ok(outside.sizes[1..].iter().sum())
    }
}

/// Position of a voxel with respect to the wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Zone {
    Core,
    Between,
    Beyond,
}

impl<'a> WallShell<'a> {
    /// Measures the wall's intensity.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(
        volume: &'a Volume,
        cavity: &'a Cavity,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let spacing = volume.frame.spacing();
        let reach = cavity.distances.iter().copied().fold(0.0, f64::max) + MAX_OUTWARD_MM + 6.0;
        let mut origin = [0; 3];
        let mut extent = [0; 3];
        for r in 0..3 {
            let low = ((cavity.centre[r] - reach) / spacing[r]).floor().max(0.0) as usize;
            let high = ((cavity.centre[r] + reach) / spacing[r]).ceil().max(0.0) as usize + 1;
            origin[r] = low.min(volume.shape[r] - 1);
            extent[r] = high.clamp(origin[r] + 1, volume.shape[r]) - origin[r];
        }
        let mut wall = Self {
            volume,
            cavity,
            compass: Compass::of_directions(),
            spacing,
            origin,
            extent,
            reference: 0.0,
        };
        wall.reference = wall.measure(monitor)?;
        Ok(wall)
    }

    fn value(&self, p: [usize; 3]) -> f32 {
        let [i, j, k] = [0, 1, 2].map(|r| p[r] + self.origin[r]);
        self.volume.voxels[i + self.volume.shape[0] * (j + self.volume.shape[1] * k)]
    }

    /// Distance from the wall's middle along the ray through voxel `p` of the box, mm
    /// (negative towards the cavity), and whether the wall was seen there.
    fn depth(&self, p: [usize; 3]) -> (f64, bool) {
        let offset = Vec3::from_fn(|r, _| {
            (p[r] + self.origin[r]) as f64 * self.spacing[r] - self.cavity.centre[r]
        });
        let n = self.compass.nearest(&offset);
        (
            offset.norm() - self.cavity.distances[n],
            self.cavity.seen[n],
        )
    }

    fn zone(&self, p: [usize; 3]) -> Zone {
        match self.depth(p) {
            (depth, _) if depth > MAX_OUTWARD_MM => Zone::Beyond,
            (depth, true) if depth.abs() <= CORE_DISTANCE_MM => Zone::Core,
            _ => Zone::Between,
        }
    }

    fn measure(&self, monitor: &Monitor) -> Result<f32, Cancelled> {
        let level = self.cavity.level as f32 * 0.5;
        let values = &self.volume.voxels;
        let bright = Labels::threshold(values, self.volume.shape, self.origin, self.extent, level);
        let mut wall: Vec<f32> = bright
            .par_voxels()
            .filter_map(|p| {
                if let Err(cancelled) = monitor.check() {
                    return Some(Err(cancelled));
                }
                let (depth, seen) = self.depth(p);
                let value = self.value(p);
                let of_wall = seen && depth.abs() <= REFERENCE_DISTANCE_MM && value.is_finite();
                of_wall.then_some(Ok(value))
            })
            .collect::<Result<_, Cancelled>>()?;
        let maximum = wall.iter().copied().fold(0.0, f32::max);
        wall.retain(|&v| v > 0.3 * maximum);
        if wall.is_empty() {
            return Ok(maximum);
        }
        let place = (wall.len() - 1) * 98 / 100;
        Ok(*wall.select_nth_unstable_by(place, f32::total_cmp).1)
    }

    /// The region at `iso`; `None` where no voxel of the wall reaches it.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn region(&self, iso: f32, monitor: &Monitor) -> Result<Option<Region>, Cancelled> {
        let values = &self.volume.voxels;
        let mut labels =
            Labels::threshold(values, self.volume.shape, self.origin, self.extent, iso);
        let components = Components::of_inside(&labels, monitor)?;
        let zone = |p| {
            monitor.check()?;
            Ok((p, self.zone(p)))
        };
        let zones: Vec<([usize; 3], Zone)> =
            (labels.par_voxels().map(zone)).collect::<Result<_, Cancelled>>()?;
        let mut core = vec![0usize; components.sizes.len()];
        let mut beyond = vec![0usize; components.sizes.len()];
        for (&(_, zone), c) in zones.iter().zip(components.of_voxels()) {
            match zone {
                Zone::Core => core[c] += 1,
                Zone::Beyond => beyond[c] += 1,
                Zone::Between => {}
            }
        }
        let Some(chosen) = (0..core.len()).rev().max_by_key(|&c| core[c]) else {
            return Ok(None);
        };
        if core[chosen] == 0 {
            return Ok(None);
        }
        let core_voxels = core.iter().sum::<usize>();
        components.paint(&mut labels, false, |c| c != chosen, monitor)?;
        let mut region = Region {
            labels,
            cut_voxels: 0,
            cut_area: 0.0,
            core_voxels,
            loose_voxels: core_voxels - core[chosen],
        };
        if beyond[chosen] > 0 {
            self.cut(&mut region, &zones, monitor)?;
            let parts = Components::of_inside(&region.labels, monitor)?;
            if let Some(largest) = parts.largest() {
                parts.paint(&mut region.labels, false, |c| c != largest, monitor)?;
            }
        }
        Ok(Some(region))
    }

    /// Watershed between the wall's core and everything beyond it.
    fn cut(
        &self,
        region: &mut Region,
        zones: &[([usize; 3], Zone)],
        monitor: &Monitor,
    ) -> Result<(), Cancelled> {
        const FREE_VOXEL: u8 = 0;
        const VENTRICLE_VOXEL: u8 = 1;
        const NEIGHBOUR_VOXEL: u8 = 2;
        let [nx, ny, nz] = self.extent;
        let index = |p: [usize; 3]| p[0] + nx * (p[1] + ny * p[2]);
        let mut owner = vec![FREE_VOXEL; nx * ny * nz];
        let mut heap = BinaryHeap::new();
        let neighbours = |p: [usize; 3]| {
            (0..6).filter_map(move |n| {
                let mut q = p;
                let axis = n / 2;
                q[axis] = if n % 2 == 0 {
                    p[axis].checked_sub(1)?
                } else {
                    p[axis] + 1
                };
                (q[axis] < [nx, ny, nz][axis]).then_some(q)
            })
        };
        for &(p, zone) in zones {
            monitor.check()?;
            let mark = match zone {
                Zone::Core => VENTRICLE_VOXEL,
                Zone::Beyond => NEIGHBOUR_VOXEL,
                Zone::Between => continue,
            };
            if region.labels.get(p) {
                owner[index(p)] = mark;
                heap.push((ordered(self.value(p)), std::cmp::Reverse(index(p))));
            }
        }
        while let Some((_, std::cmp::Reverse(at))) = heap.pop() {
            monitor.check()?;
            let p = [at % nx, at / nx % ny, at / (nx * ny)];
            for q in neighbours(p) {
                if region.labels.get(q) && owner[index(q)] == FREE_VOXEL {
                    owner[index(q)] = owner[at];
                    heap.push((ordered(self.value(q)), std::cmp::Reverse(index(q))));
                }
            }
        }
        let spacing = self.spacing;
        for &(p, _) in zones {
            monitor.check()?;
            if owner[index(p)] != NEIGHBOUR_VOXEL {
                continue;
            }
            region.cut_voxels += 1;
            region.labels.set(p, false);
            for q in neighbours(p) {
                if owner[index(q)] == VENTRICLE_VOXEL {
                    let axis = (0..3).find(|&r| p[r] != q[r]).unwrap_or(0);
                    region.cut_area += spacing[(axis + 1) % 3] * spacing[(axis + 2) % 3];
                }
            }
        }
        Ok(())
    }
}

/// A key that sorts like the float; NaN sorts outside the numbers.
pub fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}
