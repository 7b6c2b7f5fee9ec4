//! Fits for the tests of this folder.

use super::{Fit, judge};
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use crate::heart::deform::setup::FitSetup;
use crate::heart::deform::{self, DeformParameters, OrganPosition};
use crate::heart::model::{Organ, Template};
use crate::image::grid::Volume;
use crate::mesh::shapes;

/// A ball of 30 mm in a volume that reaches 68 mm to either side, and the fit of a smaller one to it.
pub(super) fn ball() -> (Volume, Fit) {
    let (shape, spacing) = ([40; 3], [3.5; 3]);
    let frame = VoxelToPatient::centred(shape, spacing, Vec3::zeros()).unwrap();
    let value = |p: &Vec3| ((30.0 - p.norm()) / 7.0 + 0.5).clamp(0.0, 1.0);
    let volume = Volume::sampled(shape, frame, value);
    let silent = Monitor::silent();
    let model = shapes::icosphere(25.0, 2);
    let template = Template::new(model, Organ::Generic, &silent).unwrap();
    let parameters = DeformParameters::default();
    let position = OrganPosition::find(&volume, &template, &parameters, &silent).unwrap();
    let setup = FitSetup::new(&position, &volume, &template, &parameters, &silent).unwrap();
    let model = deform::fit(&setup, &template, &parameters, &silent).unwrap();
    let judgement = judge(
        &model,
        &setup,
        &volume,
        Organ::Generic,
        &parameters,
        &silent,
    )
    .unwrap();
    (volume, Fit { model, judgement })
}
