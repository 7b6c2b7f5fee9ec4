//! One heart before the camera: anatomy on a grid, counts of gates, images, and where the truth lies.

use super::anatomy::heart::{HeartImages, PlacedHeart};
use super::anatomy::torso::{HeartSite, SOFT_PER_MM, Torso};
use super::anatomy::ventricle::Ventricle;
use super::anatomy::{Directions, Place, Vec3};
use super::camera::{Camera, Counts, Exposure, POINTS_PER_BIN, Rays, count};
use super::grid::{FWHM_PER_SD, Grid};
use super::parameters::{Acquisition, Parameters, Reconstruction};
use super::reconstruct::{Knowledge, reconstruct};
use std::ops::Range;

/// Half of the cube about a heart that is sampled, mm.
const HALF_CUBE_MM: f64 = 95.0;
/// How far nothing but soft tissue lies about a heart: the blur of its outline, mm, and the level.
const SAC_BLUR_MM: f64 = 2.5;
const SAC_LEVEL: f32 = 0.10;
/// Blur of a map of attenuation, full width at half maximum, mm.
const ATTENUATION_MAP_FWHM_MM: f64 = 5.0;

/// A patient before a camera.
pub struct Scene<'a> {
    /// What it was made of.
    pub parameters: &'a Parameters,
    /// The heart.
    pub heart: PlacedHeart,
    /// The camera.
    pub camera: Camera,
    /// Where the voxels of its images lie, without the table.
    pub voxels: Place,
    place: Place,
    corner: [usize; 3],
    /// Images of the heart in each gate.
    gates: Vec<HeartImages>,
    torso: Torso,
}

/// An image and its counts.
pub struct Exposed {
    /// Counts.
    pub counts: Counts,
    /// The image.
    pub image: Grid,
}

impl<'a> Scene<'a> {
    /// The scene of a case, the beat in gates of as many phases each.
    pub fn new(parameters: &'a Parameters, gates: usize, phases_per_gate: usize) -> Self {
        let camera = Camera::new(
            &parameters.acquisition,
            &parameters.body,
            parameters.spacing_mm,
        );
        let place = camera.place();
        let [dx, dy] = parameters.body.offset_mm;
        let trunk = Vec3::new(dx, dy, 0.0);
        let centre = Vec3::from(parameters.lv_centre_body_mm) + trunk;
        let directions = Directions::new(&parameters.orientation);
        let ventricle = Ventricle::new(&parameters.heart, gates * phases_per_gate);
        let breath = parameters.breathing.heart_mm;
        let heart = PlacedHeart::new(ventricle, directions, &centre, breath);

        let (corner, shape) = place.part_about(&centre, HALF_CUBE_MM);
        let part = place.part(corner, shape);
        let phases = |gate: usize| gate * phases_per_gate..(gate + 1) * phases_per_gate;
        let gates: Vec<HeartImages> = (0..gates)
            .map(|gate| heart.images(&part, phases(gate)))
            .collect();
        let whole = mean_of(&gates);
        let ends = heart.ventricle.axis_points();
        let [base, apex] = [ends.base, ends.outer_apex].map(|z| heart.on_axis(z) - trunk);
        let site = HeartSite {
            base,
            middle: (base + apex) / 2.0,
            apex: directions.apex,
            lateral: directions.lateral,
            lowest: lowest(&whole.wall, &part) - trunk,
        };
        let mut torso = Torso::new(parameters, &site, &place);
        clear_sac(
            &mut torso,
            &whole,
            corner,
            place.step_mm,
            parameters.organs.soft as f32,
        );
        let bins = parameters.acquisition.matrix;
        let voxels = Place::cube(bins, parameters.spacing_mm);
        Self {
            parameters,
            heart,
            camera,
            voxels,
            place,
            corner,
            gates,
            torso,
        }
    }

    /// Shares of wall and cavity of the voxels in a gate.
    pub fn truth(&self, gate: usize) -> [Grid; 2] {
        let images = &self.gates[gate];
        [&images.wall, &images.cavity].map(|part| self.on_voxels(part))
    }

    /// A part about the heart, as means of voxels of the image.
    fn on_voxels(&self, part: &Grid) -> Grid {
        let empty = Grid::zeros(self.place.shape);
        empty.with_part(self.corner, part).binned(POINTS_PER_BIN)
    }

    /// Uptake everywhere in a gate.
    fn uptake(&self, gate: usize) -> Grid {
        let images = &self.gates[gate];
        let around = self.torso.uptake.part(self.corner, images.wall.shape);
        let mut inside = around;
        for (at, value) in inside.values.iter_mut().enumerate() {
            *value = *value * (1.0 - cover(images, at)) + images.uptake.values[at];
        }
        self.torso.uptake.with_part(self.corner, &inside)
    }

    /// The rays of a gate.
    pub fn rays(&self, gate: usize) -> Rays {
        self.camera
            .project(&self.uptake(gate), Some(&self.torso.attenuation))
    }

    /// The counts of a gate, which has a share of the acquisition's.
    pub fn counts(&self, gate: usize, share: f64) -> Counts {
        self.counts_of(&self.rays(gate), &self.parameters.acquisition, gate, share)
    }

    /// The counts of the rays of a gate in an acquisition, which has the scene's views.
    pub fn counts_of(
        &self,
        rays: &Rays,
        acquisition: &Acquisition,
        gate: usize,
        share: f64,
    ) -> Counts {
        let exposure = Exposure {
            seed: self.parameters.noise_seed,
            gate,
            share,
            side_window: self.parameters.reconstruction.scatter_corrected,
        };
        let bin_mm = self.parameters.spacing_mm;
        count(rays, &self.camera.views, acquisition, bin_mm, &exposure)
    }

    /// The image of counts.
    pub fn image(&self, counts: &Grid, scatter: Option<&Grid>, how: &Reconstruction) -> Grid {
        let map = how
            .attenuation_corrected
            .then(|| self.attenuation_map(how.mu_map_shift_mm));
        let known = Knowledge {
            attenuation: map.as_ref(),
            scatter,
        };
        reconstruct(
            counts,
            &self.camera.views,
            self.parameters.spacing_mm,
            how,
            &known,
        )
    }

    /// The image of the wall alone, of even uptake, without noise and attenuation.
    pub fn image_of_wall(&self) -> Grid {
        let wall = &mean_of(&self.gates).wall;
        let alone = Grid::zeros(self.place.shape).with_part(self.corner, wall);
        let rays = self.camera.project(&alone, None);
        let how = Reconstruction {
            attenuation_corrected: false,
            scatter_corrected: false,
            ..self.parameters.reconstruction.clone()
        };
        let views = &self.camera.views;
        let nothing = Knowledge::default();
        reconstruct(
            &rays.primary,
            views,
            self.parameters.spacing_mm,
            &how,
            &nothing,
        )
    }

    fn attenuation_map(&self, shift_mm: [f64; 3]) -> Grid {
        let voxel = self.parameters.spacing_mm;
        let mut map = self.torso.attenuation.binned(POINTS_PER_BIN);
        map.blur([ATTENUATION_MAP_FWHM_MM / FWHM_PER_SD / voxel; 3]);
        if shift_mm == [0.0; 3] {
            return map;
        }
        Grid::from_fn(map.shape, |at| {
            map.between([0, 1, 2].map(|i| at[i] as f64 - shift_mm[i] / voxel))
        })
    }
}

/// The share of a voxel that the heart takes.
fn cover(images: &HeartImages, at: usize) -> f32 {
    let sum = images.wall.values[at] + images.cavity.values[at] + images.right.values[at];
    sum.clamp(0.0, 1.0)
}

/// The mean of gates of as many phases each.
pub fn mean_of(gates: &[HeartImages]) -> HeartImages {
    let mean = |part: fn(&HeartImages) -> &Grid| {
        let mut sum = part(&gates[0]).clone();
        for gate in &gates[1..] {
            let more = &part(gate).values;
            sum.values.iter_mut().zip(more).for_each(|(s, m)| *s += m);
        }
        let share = 1.0 / gates.len() as f32;
        sum.values.iter_mut().for_each(|v| *v *= share);
        sum
    };
    HeartImages {
        wall: mean(|g| &g.wall),
        cavity: mean(|g| &g.cavity),
        uptake: mean(|g| &g.uptake),
        right: mean(|g| &g.right),
    }
}

/// The lowest point that is wall for at least half as much as the fullest.
fn lowest(wall: &Grid, place: &Place) -> Vec3 {
    let level = 0.5 * wall.max();
    let [nx, ny, nz] = wall.shape;
    let mut found = ([0; 3], 0.0);
    for z in 0..nz {
        for x in 0..nx {
            for y in 0..ny {
                let value = wall.at([x, y, z]);
                if value > level && value > found.1 {
                    found = ([x, y, z], value);
                }
            }
        }
        if found.1 > 0.0 {
            break;
        }
    }
    place.at(found.0)
}

/// Nothing but soft tissue lies in the pericardial sac.
fn clear_sac(torso: &mut Torso, heart: &HeartImages, corner: [usize; 3], step_mm: f64, soft: f32) {
    let covers = (0..heart.wall.values.len())
        .map(|at| cover(heart, at))
        .collect();
    let mut sac = Grid {
        shape: heart.wall.shape,
        values: covers,
    };
    sac.blur([SAC_BLUR_MM / step_mm; 3]);
    let clear = |grid: &mut Grid, change: &dyn Fn(f32) -> f32| {
        let mut part = grid.part(corner, sac.shape);
        for (value, sac) in part.values.iter_mut().zip(&sac.values) {
            if *sac > SAC_LEVEL {
                *value = change(*value);
            }
        }
        grid.put(corner, &part);
    };
    clear(&mut torso.uptake, &|value| value.min(soft));
    clear(&mut torso.attenuation, &|_| SOFT_PER_MM);
}

/// The slices along z that hold `height_mm` about a heart; all of them without a height.
pub fn slices_about(wall: &Grid, height_mm: Option<f64>, voxel_mm: f64) -> Range<usize> {
    let [nx, ny, nz] = wall.shape;
    let Some(height) = height_mm else {
        return 0..nz;
    };
    let level = 0.5 * wall.max();
    let filled = |z: &usize| (0..nx * ny).any(|c| wall.column(c / ny, c % ny)[*z] >= level);
    let held: Vec<usize> = (0..nz).filter(filled).collect();
    let [first, last] = [held.first(), held.last()].map(|z| z.copied().unwrap_or(nz / 2));
    let count = ((height / voxel_mm).round() as usize).min(nz);
    let start = first
        .midpoint(last)
        .saturating_sub(count / 2)
        .min(nz - count);
    start..start + count
}
