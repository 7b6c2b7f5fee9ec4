//! The gates of a phantom whose heart beats.
//!
//! In: [`PhantomParameters`], the heart at end diastole, and a [`PhantomBeat`]. Out: a [`GatedPhantom`] with one phantom
//! for each gate, which shows the heart at the middle of its gate.
//!
//! The cavity's volume follows a raised cosine down to end systole at [`SYSTOLE_SHARE`] of the cycle, and another one
//! back. The heart shortens with it; the apex stays in place, the base moves towards it. Wall and width of each gate are
//! those with which the cavity has its volume and the muscle keeps its own. Each gate has its share of the counts, so
//! the noise of the sum of all gates is that of the parameters.

use super::anatomy::Anatomy;
use super::parameters::{PhantomError, PhantomParameters, within};
use super::{Phantom, imaged};
use crate::base::progress::Monitor;
use serde::Serialize;
use std::f64::consts::PI;

/// How the heart of a phantom beats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PhantomBeat {
    /// Gates of a beat, 4..=32. Default 8.
    pub gates: u32,
    /// Ejection fraction, 5..=80 per cent. Default 60.
    pub ejection_fraction_percent: f64,
    /// Length of a beat, 300..=2000. Default 900.
    pub rr_ms: f64,
}

impl Default for PhantomBeat {
    fn default() -> Self {
        Self {
            gates: 8,
            ejection_fraction_percent: 60.0,
            rr_ms: 900.0,
        }
    }
}

impl PhantomBeat {
    /// Length of a gate, ms.
    pub fn gate_ms(&self) -> f64 {
        self.rr_ms / f64::from(self.gates)
    }

    fn check(&self) -> Result<(), PhantomError> {
        within("gates", f64::from(self.gates), 4.0, 32.0)?;
        let ef = self.ejection_fraction_percent;
        within("ejection_fraction_percent", ef, 5.0, 80.0)?;
        within("rr_ms", self.rr_ms, 300.0, 2000.0)
    }

    /// Share of the stroke volume that has been ejected at the middle of each gate: 0 at end diastole, 1 at end systole.
    fn ejected(&self) -> impl Iterator<Item = f64> {
        let gates = self.gates;
        (0..gates).map(move |gate| {
            let turns = (f64::from(gate) + 0.5) / f64::from(gates);
            let way = if turns < SYSTOLE_SHARE {
                turns / SYSTOLE_SHARE
            } else {
                (1.0 - turns) / (1.0 - SYSTOLE_SHARE)
            };
            (1.0 - (PI * way).cos()) / 2.0
        })
    }
}

/// A phantom in gates and its ground truth.
#[derive(Debug, Clone)]
pub struct GatedPhantom {
    /// The gates in their order, the first after the R wave.
    pub gates: Vec<Phantom>,
    /// Volume of the cavity at the middle of each gate, ml.
    pub volumes_ml: Vec<f64>,
}

impl GatedPhantom {
    /// The gate with the largest cavity, and the one with the smallest.
    pub fn ends(&self) -> [usize; 2] {
        let order = |a: &usize, b: &usize| self.volumes_ml[*a].total_cmp(&self.volumes_ml[*b]);
        let of = |found: Option<usize>| found.unwrap_or(0);
        let gates = || 0..self.volumes_ml.len();
        [of(gates().max_by(order)), of(gates().min_by(order))]
    }
}

/// Share of the cycle after which the cavity is smallest.
const SYSTOLE_SHARE: f64 = 0.375;

/// Share of its length that a heart loses for one of its cavity's volume: 12 % at an ejection fraction of 60 %.
const SHORTENING_PER_EJECTION: f64 = 0.2;

/// Makes the gates of `parameters`, whose heart beats as `beat` says.
///
/// # Errors
/// As [`phantom`](super::phantom), also if a figure of `beat` is out of range.
pub fn phantom_gates(
    parameters: &PhantomParameters,
    beat: &PhantomBeat,
    monitor: &Monitor,
) -> Result<GatedPhantom, PhantomError> {
    beat.check()?;
    parameters.check()?;
    let relaxed = Chamber::of(parameters);
    let stroke = beat.ejection_fraction_percent / 100.0;
    let mut gates = Vec::new();
    let mut volumes_ml = Vec::new();
    for (gate, ejected) in beat.ejected().enumerate() {
        let chamber = relaxed.contracted(stroke * ejected);
        let gated = PhantomParameters {
            length_mm: chamber.long + chamber.above,
            width_mm: 2.0 * chamber.wide,
            wall_mm: chamber.wall,
            base_mm: chamber.above,
            noise: parameters.noise * f64::from(beat.gates).sqrt(),
            scan: (parameters.scan * beat.gates).wrapping_add(gate as u32),
            ..parameters.clone()
        };
        let anatomy = Anatomy::contracted(&gated, parameters.length_mm);
        gates.push(imaged(&gated, &anatomy, monitor)?);
        volumes_ml.push(chamber.cavity_ml());
    }
    Ok(GatedPhantom { gates, volumes_ml })
}

/// The shape of the wall, mm: a half ellipsoid, and `above` its equator as much of the other half.
#[derive(Debug, Clone, Copy)]
struct Chamber {
    wide: f64,
    long: f64,
    above: f64,
    wall: f64,
}

impl Chamber {
    fn of(p: &PhantomParameters) -> Self {
        Self {
            wide: p.width_mm / 2.0,
            long: p.length_mm - p.base_mm,
            above: p.base_mm,
            wall: p.wall_mm,
        }
    }

    /// Volume within an ellipsoid with half axes `wide` and `long`, below the base; the slant of a base adds as much as
    /// it takes away.
    fn within_ml(&self, wide: f64, long: f64) -> f64 {
        wide * wide * self.height(long) / 1000.0
    }

    /// That volume for half axes of `long` and 1.
    fn height(&self, long: f64) -> f64 {
        let above = self.above.min(long);
        PI * (above - above.powi(3) / (3.0 * long * long) + 2.0 * long / 3.0)
    }

    fn cavity_ml(&self) -> f64 {
        self.within_ml(self.wide - self.wall, self.long - self.wall)
    }

    fn muscle_ml(&self) -> f64 {
        self.within_ml(self.wide, self.long) - self.cavity_ml()
    }

    /// The chamber that has ejected this share of its cavity, with the same muscle.
    fn contracted(&self, ejected: f64) -> Self {
        let shorter = 1.0 - SHORTENING_PER_EJECTION * ejected;
        let cavity = self.cavity_ml() * (1.0 - ejected);
        let with_wall = |wall: f64| {
            let long = self.long * shorter;
            let mut chamber = Self {
                wide: 0.0,
                long,
                above: self.above * shorter,
                wall,
            };
            chamber.wide = wall + (1000.0 * cavity / chamber.height(long - wall)).sqrt();
            chamber
        };
        // A thicker wall about the same cavity has more muscle.
        let (mut thin, mut thick) = (0.5 * self.wall, 0.9 * self.long * shorter);
        for _ in 0..60 {
            let wall = (thin + thick) / 2.0;
            if with_wall(wall).muscle_ml() < self.muscle_ml() {
                thin = wall;
            } else {
                thick = wall;
            }
        }
        with_wall(thin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::phantom::phantom;

    fn heart() -> PhantomParameters {
        PhantomParameters {
            shape: [64; 3],
            spacing_mm: [4.0; 3],
            noise: 0.0,
            ..PhantomParameters::default()
        }
    }

    fn voxels_ml(mask: &crate::image::volume::Volume) -> f64 {
        let inside = mask.voxels.iter().filter(|v| **v > 0.5).count();
        inside as f64 * mask.frame.voxel_volume() / 1000.0
    }

    #[test]
    fn gates_eject_what_is_asked_for_and_keep_their_muscle() {
        for percent in [5.0, 35.0, 60.0, 80.0] {
            let beat = PhantomBeat {
                gates: 8,
                ejection_fraction_percent: percent,
                ..PhantomBeat::default()
            };
            let made = phantom_gates(&heart(), &beat, &Monitor::silent()).unwrap();
            assert_eq!(made.ends(), [7, 3]);
            let whole = Chamber::of(&heart());
            for (gate, volume) in made.gates.iter().zip(&made.volumes_ml) {
                let own = Chamber::of(&gate.parameters);
                assert!((own.muscle_ml() / whole.muscle_ml() - 1.0).abs() < 1e-9);
                assert!((own.cavity_ml() / volume - 1.0).abs() < 1e-9);
                let muscle = voxels_ml(&gate.truth);
                assert!((muscle / whole.muscle_ml() - 1.0).abs() < 0.04, "{muscle}");
                assert!((gate.pose.apex - made.gates[0].pose.apex).norm() < 1e-9);
            }
            // The middle of no gate is the very end of a phase.
            let end = whole.contracted(percent / 100.0).cavity_ml();
            assert!((end / whole.cavity_ml() - (1.0 - percent / 100.0)).abs() < 1e-9);
            let [ed, es] = made.ends().map(|gate| made.volumes_ml[gate]);
            let found = 100.0 * (1.0 - es / ed);
            assert!(found < percent && found > 0.9 * percent, "{found}");
        }
    }

    #[test]
    fn a_beat_without_contraction_is_the_phantom() {
        let still = Chamber::of(&heart()).contracted(0.0);
        let alone = phantom(&heart(), &Monitor::silent()).unwrap();
        assert!((still.wall - heart().wall_mm).abs() < 1e-9);
        assert!((still.wide - heart().width_mm / 2.0).abs() < 1e-9);
        let relaxed = heart();
        let own = Anatomy::contracted(&relaxed, relaxed.length_mm);
        let again = imaged(&relaxed, &own, &Monitor::silent()).unwrap();
        assert_eq!(again.volume.voxels, alone.volume.voxels);
    }

    #[test]
    fn figures_out_of_range_are_refused_by_name() {
        let refused = |beat: PhantomBeat| {
            let error = phantom_gates(&heart(), &beat, &Monitor::silent()).unwrap_err();
            error.to_string()
        };
        let beat = PhantomBeat::default;
        assert!(refused(PhantomBeat { gates: 3, ..beat() }).starts_with("gates is 3"));
        let most = PhantomBeat {
            ejection_fraction_percent: 81.0,
            ..beat()
        };
        assert!(refused(most).starts_with("ejection_fraction_percent is 81"));
    }

    #[test]
    fn another_scan_of_a_patient_has_another_noise_and_the_same_heart() {
        let noisy = PhantomParameters {
            noise: 0.05,
            ..heart()
        };
        let again = PhantomParameters {
            scan: 1,
            ..noisy.clone()
        };
        let [first, second] = [&noisy, &again].map(|p| phantom(p, &Monitor::silent()).unwrap());
        assert_eq!(first.truth.voxels, second.truth.voxels);
        assert_ne!(first.volume.voxels, second.volume.voxels);
    }
}
