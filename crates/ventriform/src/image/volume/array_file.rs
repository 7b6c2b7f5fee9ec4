//! Volumes in memory, read as a file of them would be.
//!
//! In: one volume, or the gates of a study, that a program holds as arrays. Out: what a file of them would be, so that
//! whatever takes files takes arrays too. Of several, as many as a study has gates are gates; others are volumes of
//! which the caller names one.
//!
//! Guaranteed: voxels are those of the arrays, bit for bit. The numbers of the frame are rounded to single precision,
//! as those of DICOM are, so that a scan gives the same results in every container.

use super::VolumeError;
use super::facts::AffineSource;
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement, array_header};
use super::source::VolumeFile;
use super::summary::Tally;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use crate::image::grid::Volume;
use crate::image::grid::gates::SAME_PLACE_MM;
use std::sync::Arc;

/// Voxels that are copied between two looks at the cancel token.
const VOXELS_PER_COPY: usize = 1 << 20;

/// Volumes of one grid.
pub(super) struct ArrayFile {
    name: String,
    volumes: Arc<[Volume]>,
    placement: Placement,
}

impl ArrayFile {
    /// Checks the arrays of `file`.
    ///
    /// # Errors
    /// [`VolumeError::OtherGate`] for volumes of different grids, [`VolumeError::TooLarge`] for more voxels than a
    /// volume may have, [`VolumeError::NoFile`] if there is none.
    pub(super) fn open(file: &VolumeFile, limits: &ReadLimits) -> Result<Self, VolumeError> {
        let volumes = file.arrays().ok_or(VolumeError::NoFile)?;
        let first = volumes.first().ok_or(VolumeError::NoFile)?;
        let voxels = first.voxels.len() as u64;
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: file.name().to_owned(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        for (index, other) in volumes.iter().enumerate().skip(1) {
            let apart = (first.frame).greatest_distance(&other.frame, first.shape);
            let difference = if other.shape != first.shape {
                format!(
                    "has {:?} voxels where gate 1 has {:?}",
                    other.shape, first.shape
                )
            } else if apart > SAME_PLACE_MM {
                format!("lies elsewhere: its voxels are up to {apart:.2} mm from those of gate 1")
            } else {
                continue;
            };
            let gate = index + 1;
            return Err(VolumeError::OtherGate { gate, difference });
        }
        Ok(Self {
            name: file.name().to_owned(),
            placement: Placement {
                frame: rounded(&first.frame).ok_or_else(|| VolumeError::Field {
                    file: file.name().to_owned(),
                    field: "affine",
                    value: format!("{:?}", first.frame.matrix().as_slice()),
                    reason: "it cannot be inverted in single precision".into(),
                    byte: None,
                })?,
                source: AffineSource::Caller,
                warnings: Vec::new(),
            },
            volumes,
        })
    }
}

/// The frame with numbers of single precision; `None` if it cannot be inverted.
fn rounded(frame: &VoxelToPatient) -> Option<VoxelToPatient> {
    let single = |x: f64| f64::from(x as f32);
    let origin = frame.to_patient(&Vec3::zeros());
    VoxelToPatient::new(frame.linear().map(single), origin.map(single)).ok()
}

impl OpenVolume for ArrayFile {
    fn header(&self) -> HeaderFacts<'_> {
        array_header(
            &self.name,
            &self.placement,
            self.volumes[0].shape,
            self.volumes.len(),
        )
    }

    fn assumes_gates(&self) -> bool {
        self.volumes.len() > 1
    }

    fn reads_again(&self) -> bool {
        true
    }

    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        let held = &self.volumes[frame].voxels;
        let mut voxels = Vec::with_capacity(held.len());
        for portion in held.chunks(VOXELS_PER_COPY) {
            monitor.check()?;
            voxels.extend_from_slice(portion);
        }
        let mut tally = Tally::default();
        tally.add_portion(&voxels);
        monitor.check()?;
        Ok(Decoded {
            voxels,
            tally,
            warnings: Vec::new(),
        })
    }

    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let volume = &self.volumes[frame];
        let slice = volume.shape[0] * volume.shape[1];
        for (k, voxels) in volume.voxels.chunks(slice).enumerate() {
            monitor.check()?;
            take(k * slice, voxels);
        }
        Ok(())
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let mut tally = Tally::default();
        for frame in 0..self.volumes.len() {
            let mut both = |first: usize, voxels: &[f32]| {
                tally.add_portion(voxels);
                take(first, voxels);
            };
            self.stream_frame(frame, &mut both, monitor)?;
        }
        Ok((tally, Vec::new()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ReadOptions, inspect, read, read_gates};
    use super::*;
    use crate::image::grid::Affine;

    fn volume(value: f32, shift: f64) -> Volume {
        let affine = Affine::Lps([
            [4.0, 0.0, 0.0, shift],
            [0.0, 4.0, 0.0, 0.0],
            [0.0, 0.0, 4.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]);
        let voxels = (0..60).map(|v| value + v as f32).collect();
        Volume::from_array(voxels, [3, 4, 5], affine).unwrap()
    }

    fn file(volumes: Vec<Volume>) -> [VolumeFile; 1] {
        [VolumeFile::of_arrays("the array", volumes)]
    }

    #[test]
    fn as_many_equal_arrays_as_a_study_has_gates_are_gates() {
        let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
        let gates = vec![volume(1.0, 0.0); 8];
        let read = |files: &[VolumeFile]| read(files, &ReadOptions::default(), &limits, &quiet);
        let gated = read_gates(&file(gates.clone()), false, &limits, &quiet).unwrap();
        assert!(
            gated
                .gates
                .iter()
                .zip(&gates)
                .all(|(a, b)| a.voxels == b.voxels)
        );
        let sum = read(&file(gates.clone())).unwrap().volume;
        assert_eq!(sum.at(1, 0, 0), 16.0);
        let facts = inspect(&file(gates[..2].to_vec()), &limits, &quiet).unwrap();
        assert_eq!(
            (facts.frames, &facts.file_shape[..]),
            (2, &[3, 4, 5, 2][..])
        );
        assert!(matches!(
            read(&file(gates[..2].to_vec())),
            Err(VolumeError::FrameNeeded { frames: 2, .. })
        ));
        assert!(matches!(
            read_gates(&file(gates[..1].to_vec()), false, &limits, &quiet),
            Err(VolumeError::NotGated { .. })
        ));
    }

    #[test]
    fn arrays_of_several_grids_and_none_at_all_are_refused() {
        let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
        let read = |files: &[VolumeFile]| read(files, &ReadOptions::default(), &limits, &quiet);
        let apart = (0..8).map(|gate| volume(0.0, f64::from(gate))).collect();
        assert!(matches!(
            read(&file(apart)),
            Err(VolumeError::OtherGate { gate: 2, .. })
        ));
        assert_eq!(read(&file(Vec::new())).unwrap_err(), VolumeError::NoFile);
        let two = [file(vec![volume(0.0, 0.0)]), file(vec![volume(1.0, 0.0)])].concat();
        assert!(matches!(read(&two), Err(VolumeError::NotOneVolume { .. })));
        let few = ReadLimits {
            voxels: 59,
            ..limits
        };
        assert!(matches!(
            super::super::read(&two[..1], &ReadOptions::default(), &few, &quiet),
            Err(VolumeError::TooLarge { asked: 60, .. })
        ));
    }
}
