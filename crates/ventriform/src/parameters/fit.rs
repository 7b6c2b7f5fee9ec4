//! The parameters of a fit.

use super::ParameterError;
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::heart::deform::{DeformParameters, Orbit};
use crate::heart::model::{MYOCARDIAL_DENSITY_G_PER_ML, Organ};
use crate::heart::normals::ScanKind;
use crate::heart::polar::PolarParameters;
use crate::image::locate::Hints;
use crate::image::locate::patient_orientation::Superior;
use crate::image::reconstruct::Reconstruction;
use crate::image::volume::given_mask::MaskChoice;
use crate::image::volume::{AffineSource, Provenance, Volume};
use std::ops::RangeInclusive;

/// Masses that a left ventricle's muscle can have, g.
pub const MASS_G: RangeInclusive<f64> = 20.0..=600.0;

/// Everything that determines a segmentation, apart from the files.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParameters {
    /// Frame of a 4-D volume, from 0; `None` for a 3-D volume.
    pub frame: Option<usize>,
    /// Id of the model to fit, or `auto` for the best of the built-in hearts and the library; ids of
    /// further models may follow `auto`, separated by commas.
    pub model: String,
    /// Name of the fitted model that is kept; `None` for that with the greatest confidence.
    pub kept_model: Option<String>,
    /// Direction from the long axis to the wall that is called anterior once the fit is done, LPS, any length; `None`
    /// for the orientation that the fit starts from.
    pub segments_from: Option<Vec3>,
    /// Id of an expert's mask, if there is one.
    pub expert: Option<String>,
    /// Which structure of a mask's file is meant, and whether a mask on another grid is resampled.
    pub mask: MaskChoice,
    /// Id of the reader's profile to draw the wall by, if there is one.
    pub reader: Option<String>,
    /// Id of the normal limits to compare the wall's uptake with, if there are some.
    pub normals: Option<String>,
    /// The scan's kind as the caller states it, by which the group of the normal limits is chosen.
    pub scan: ScanKind,
    /// The organ that the model shows.
    pub organ: Organ,
    /// Known position of the organ.
    pub position: KnownPosition,
    /// Mass of the left ventricle's muscle, g, where it is known; within [`MASS_G`]. `None`: by the wall's width, as far
    /// as that tells its thickness.
    pub mass_g: Option<f64>,
    /// Parameters of the deformation. [`FitParameters::on`] sets its hints and the volume of the muscle.
    pub deform: DeformParameters,
    /// Parameters of the polar map.
    pub polar: PolarParameters,
    /// The grid on which masks and labels are written.
    pub mask_grid: MaskGrid,
    /// How slices are made of projections.
    pub reconstruction: Reconstruction,
    /// Whether views of projections in which the heart lies elsewhere are shifted back.
    pub correct_motion: bool,
}

/// The grid on which masks and labels are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MaskGrid {
    /// The scan's.
    #[default]
    Scan,
    /// The scan's if its axes are at right angles, otherwise a grid at right angles that covers it
    /// ([`VoxelToPatient::orthogonal_cover`](crate::base::geometry::frame::VoxelToPatient::orthogonal_cover)).
    Orthogonal,
}

impl Default for FitParameters {
    fn default() -> Self {
        Self {
            frame: None,
            model: FitParameters::AUTO_MODEL.into(),
            kept_model: None,
            segments_from: None,
            expert: None,
            mask: MaskChoice::default(),
            reader: None,
            normals: None,
            scan: ScanKind::default(),
            organ: Organ::LeftVentricle,
            position: KnownPosition::default(),
            mass_g: None,
            deform: DeformParameters::default(),
            polar: PolarParameters::default(),
            mask_grid: MaskGrid::default(),
            reconstruction: Reconstruction::default(),
            correct_motion: false,
        }
    }
}

/// The user's hints about the organ's position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KnownPosition {
    /// A point in the cavity (or in the organ), LPS mm.
    pub centre: Option<Vec3>,
    /// A voxel in the cavity (or in the organ).
    pub seed_point: Option<[usize; 3]>,
    /// Base to apex, LPS, any length.
    pub axis: Option<Vec3>,
    /// First and last voxel of the box that holds the organ's centre.
    pub region: Option<[[usize; 3]; 2]>,
}

impl FitParameters {
    /// The value of [`FitParameters::model`] that selects the best of the available models.
    pub const AUTO_MODEL: &str = "auto";
    /// Most models that [`FitParameters::model`] names after [`FitParameters::AUTO_MODEL`].
    pub const MOST_NAMED: usize = 8;

    /// Whether the built-in hearts and the library are fitted, beside the models that are named.
    pub fn is_auto(&self) -> bool {
        self.model.split(',').next() == Some(Self::AUTO_MODEL)
    }

    /// The fields under which the models that `model` names are looked up, with their ids: `model`,
    /// and after [`FitParameters::AUTO_MODEL`] `model[0]`, `model[1]`, ...
    pub fn named_models(model: &str) -> Vec<(String, String)> {
        let mut parts = model.split(',');
        match parts.next() {
            Some(Self::AUTO_MODEL) => parts
                .enumerate()
                .map(|(n, id)| (format!("model[{n}]"), id.to_owned()))
                .collect(),
            _ => vec![("model".to_owned(), model.to_owned())],
        }
    }

    /// Checks that parameters do not contradict each other.
    ///
    /// # Errors
    /// A [`ParameterError`] if both a point and a voxel state the organ's position.
    pub(super) fn settle(parameters: Self) -> Result<Self, ParameterError> {
        if parameters.position.centre.is_some() && parameters.position.seed_point.is_some() {
            return Err(ParameterError {
                field: "seed_point".into(),
                message: "`center` and `seed_point` both state the organ's position".into(),
                fix: "Give `center` or `seed_point`, not both.".into(),
            });
        }
        Ok(parameters)
    }

    /// The parameters of the deformation for `volume`, whose axes lie in the patient as `source` says, with hints in
    /// millimetres. If nothing says how they lie, and neither do the parameters, no side of the heart is known.
    ///
    /// # Errors
    /// A [`ParameterError`] for a hint outside the volume, and a mass that no heart has.
    pub fn on(
        &self,
        volume: &Volume,
        source: AffineSource,
        scan: Option<&Provenance>,
    ) -> Result<DeformParameters, ParameterError> {
        let deform = self.deform.clone();
        let untold = !source.states_orientation() && deform.superior == Superior::Body;
        if let Some(mass_g) = self.mass_g.filter(|mass_g| !MASS_G.contains(mass_g)) {
            let [least, most] = [MASS_G.start(), MASS_G.end()];
            return Err(ParameterError {
                field: "mass_g".into(),
                message: format!("{mass_g} is no mass of a left ventricle"),
                fix: format!("Give `mass_g` a number from {least} to {most}, in grams."),
            });
        }
        Ok(DeformParameters {
            muscle_ml: self
                .mass_g
                .map(|mass_g| mass_g / MYOCARDIAL_DENSITY_G_PER_ML),
            hints: self.position.hints(volume)?,
            orbit: (deform.orbit)
                .or_stated(scan.and_then(|scan| Orbit::of_arc(scan.scan_arc_deg()?))),
            superior: if untold && deform.anterior.is_none() {
                Superior::Untold
            } else {
                deform.superior
            },
            ..deform
        })
    }
}

impl KnownPosition {
    fn hints(&self, volume: &Volume) -> Result<Hints, ParameterError> {
        let position = |voxel: [usize; 3]| {
            let index = Vec3::from(voxel.map(|x| x as f64));
            volume.frame.to_patient(&index)
        };
        let inside = |voxel: &[usize; 3]| (0..3).all(|a| voxel[a] < volume.shape[a]);
        if let Some(centre) = &self.centre {
            let index = volume.frame.to_voxel(centre);
            if !(0..3).all(|a| (-0.5..=volume.shape[a] as f64 - 0.5).contains(&index[a])) {
                return Err(outside("center", volume));
            }
        }
        if self.seed_point.is_some_and(|voxel| !inside(&voxel)) {
            return Err(outside("seed_point", volume));
        }
        if self.region.is_some_and(|[_, last]| !inside(&last)) {
            return Err(outside("box", volume));
        }
        let corners = self.region.map(|ends| {
            let corner = |c: usize| position([0, 1, 2].map(|a| ends[c >> a & 1][a]));
            Aabb::around(&[0, 1, 2, 3, 4, 5, 6, 7].map(corner))
        });
        Ok(Hints {
            centre: self.centre.or(self.seed_point.map(position)),
            axis: self.axis,
            region: corners,
            infarcted: false,
        })
    }
}

fn outside(field: &str, volume: &Volume) -> ParameterError {
    let [nx, ny, nz] = volume.shape;
    let last = Vec3::from(volume.shape.map(|n| n as f64 - 1.0));
    let ends = [Vec3::zeros(), last].map(|index| {
        let p = volume.frame.to_patient(&index);
        format!("{:.0}, {:.0}, {:.0}", p.x, p.y, p.z)
    });
    ParameterError {
        field: field.into(),
        message: "the position lies outside the volume".into(),
        fix: format!(
            "The volume has {nx} x {ny} x {nz} voxels, from ({}) to ({}) mm, LPS.",
            ends[0], ends[1]
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FIT_SPECS, Kind, Parameters, checks};
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::volume::given_mask::MaskLabel;
    use serde_json::{Value, json};

    fn pairs(list: &[(&str, &str)]) -> Result<FitParameters, ParameterError> {
        FitParameters::from_pairs(list.iter().copied())
    }

    fn refusal(list: &[(&str, &str)]) -> ParameterError {
        pairs(list).unwrap_err()
    }

    fn volume() -> Volume {
        Volume {
            shape: [10, 20, 30],
            voxels: vec![0.0; 6000],
            frame: VoxelToPatient::centred([10, 20, 30], [2.0; 3], Vec3::zeros()).unwrap(),
            integral: true,
        }
    }

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<FitParameters>(&[
            &[],
            &[
                ("center", "1.5,-2,3e1"),
                ("axis", "0,0,-1"),
                ("margin", "-1.25"),
            ],
            &[("box", "1,2,3,4,5,6"), ("organ", "kidney"), ("frame", "3")],
            &[
                ("model", "tpl_0123"),
                ("expert", "vol_ab"),
                ("sensor", "level"),
            ],
            &[
                ("seed_point", "3,4,5"),
                ("max_iterations", "7"),
                ("roll", "90"),
            ],
            &[("superior", "0,-2,1e-1"), ("anterior", "0,-1,0")],
            &[("superior", "frame")],
            &[("segments_from", "0.5,-2,1e-1")],
            &[("model", "auto,tpl_0123,mdl_4")],
            &[("label", "-2"), ("resample", "true")],
            &[("label", "Left Ventricle Myocardium")],
            &[
                ("normals", "nrm_0123"),
                ("sex", "F"),
                ("protocol", "rest, 1 day"),
                ("tracer", "Tc-99m tetrofosmin"),
                ("attenuation_corrected", "no"),
            ],
        ]);
    }

    #[test]
    fn the_table_states_the_defaults_of_the_code() {
        checks::table_states_defaults::<FitParameters>();
    }

    #[test]
    fn the_table_allows_what_the_fit_allows() {
        for spec in FIT_SPECS {
            let Kind::Number { min, max } = spec.kind else {
                continue;
            };
            for (value, fits) in [(min, true), (max, true), (min - 1e-7, false)] {
                let read = pairs(&[(spec.name, &value.to_string())]);
                let sound = read.map(|p| p.deform.validate().is_ok());
                assert_eq!(sound.unwrap_or(false), fits, "{} = {value}", spec.name);
            }
        }
    }

    #[test]
    fn numbers_that_are_none_are_refused_by_name() {
        for bad in ["nan", "inf", "1e999", "1", "1,2", "1,2,3,4", "1,2,nan", ""] {
            assert_eq!(refusal(&[("center", bad)]).field, "center", "{bad}");
            assert!(refusal(&[("center", bad)]).fix.contains("3 finite numbers"));
        }
        for name in ["margin", "blur", "roll", "spring_stiffness"] {
            assert_eq!(refusal(&[(name, "NaN")]).field, name);
            assert_eq!(refusal(&[(name, "-inf")]).field, name);
        }
        for name in ["axis", "superior", "anterior", "segments_from"] {
            assert!(refusal(&[(name, "0,0,0")]).message.contains("length"));
        }
        for bad in ["up", "1,2", "1,2,inf", ""] {
            assert!(
                refusal(&[("superior", bad)])
                    .fix
                    .contains("body, frame, or")
            );
        }
        let strings = json!({"center": ["1", "2", "3"]});
        assert!(FitParameters::from_json(strings.as_object().unwrap()).is_err());
    }

    #[test]
    fn other_names_are_understood_once() {
        assert_eq!(pairs(&[("template", "auto")]).unwrap().model, "auto");
        let twice = refusal(&[("template", "auto"), ("model", "auto")]);
        assert!(twice.message.contains("once"));
        assert!(refusal(&[("modell", "auto")]).fix.contains("`model`"));
        assert!(refusal(&[("model", "lv.json")]).fix.contains("mdl_"));
        assert!(refusal(&[("expert", "auto")]).fix.contains("vol_"));
        let both = refusal(&[("center", "1,2,3"), ("seed_point", "1,2,3")]);
        assert_eq!(both.field, "seed_point");
        // `seed` is the random seed of a model; a fit has none.
        let seed = refusal(&[("seed", "1,2,3")]);
        assert!(seed.fix.contains("`seed_point`"), "{}", seed.fix);
    }

    #[test]
    fn a_structure_has_a_number_or_a_name_and_a_switch_is_true_or_false() {
        let label = |text: &str| pairs(&[("label", text)]).map(|p| p.mask.label);
        assert_eq!(label("-3").unwrap(), Some(MaskLabel::Number(-3)));
        assert_eq!(
            label(" wall ").unwrap(),
            Some(MaskLabel::Name("wall".into()))
        );
        assert_eq!(label(" ").unwrap_err().field, "label");
        let json = |value: Value| {
            let object = json!({ "label": value });
            FitParameters::from_json(object.as_object().unwrap()).map(|p| p.mask.label)
        };
        assert_eq!(json(json!(2)).unwrap(), Some(MaskLabel::Number(2)));
        assert_eq!(json(json!("2")).unwrap(), Some(MaskLabel::Number(2)));
        assert!(json(json!(2.5)).is_err());
        assert!(pairs(&[("resample", "true")]).unwrap().mask.resample);
        assert!(!pairs(&[("resample", "false")]).unwrap().mask.resample);
        for bad in ["", "1", "yes", "TRUE"] {
            assert!(refusal(&[("resample", bad)]).fix.contains("true or false"));
        }
        let text = json!({"resample": "true"});
        assert!(FitParameters::from_json(text.as_object().unwrap()).is_err());
    }

    #[test]
    fn models_are_named_alone_or_after_auto() {
        let named = |text: &str| FitParameters::named_models(text);
        let pair = |field: &str, id: &str| (field.to_owned(), id.to_owned());
        assert_eq!(named("auto"), []);
        assert_eq!(named("mdl_1"), [pair("model", "mdl_1")]);
        let both = [pair("model[0]", "tpl_1"), pair("model[1]", "mdl_2")];
        assert_eq!(named("auto,tpl_1,mdl_2"), both);
        for text in ["auto", "auto,tpl_1"] {
            assert!(pairs(&[("model", text)]).unwrap().is_auto());
        }
        assert!(!pairs(&[("model", "tpl_1")]).unwrap().is_auto());
        let ids: Vec<String> = (0..9).map(|n| format!("mdl_{n}")).collect();
        let most = format!("auto,{}", ids[..FitParameters::MOST_NAMED].join(","));
        assert!(pairs(&[("model", &most)]).is_ok());
        let many = format!("auto,{}", ids.join(","));
        for bad in [
            many.as_str(),
            "auto,",
            "auto,auto",
            "mdl_1,mdl_2",
            "auto,mdl_1,mdl_1",
        ] {
            assert!(
                refusal(&[("model", bad)])
                    .fix
                    .contains("separated by commas")
            );
        }
    }

    #[test]
    fn hints_are_millimetres_within_the_volume() {
        let hinted = |list: &[(&str, &str)]| {
            pairs(list)
                .unwrap()
                .on(&volume(), AffineSource::Caller, None)
        };
        let seeded = hinted(&[("seed_point", "0,0,0")]).unwrap();
        assert_eq!(seeded.hints.centre, Some(Vec3::new(-9.0, -19.0, -29.0)));
        assert_eq!(seeded.margin, 0.0);
        let boxed = hinted(&[("box", "0,1,2,3,4,5"), ("margin", "1.5")]).unwrap();
        let region = boxed.hints.region.unwrap();
        assert_eq!(region.min, Vec3::new(-9.0, -17.0, -25.0));
        assert_eq!(region.max, Vec3::new(-3.0, -11.0, -19.0));
        assert_eq!(boxed.margin, 1.5);
        for (name, value) in [
            ("center", "11,0,0"),
            ("seed_point", "10,0,0"),
            ("box", "0,0,0,1,20,1"),
        ] {
            let refused = hinted(&[(name, value)]).unwrap_err();
            assert_eq!(refused.field, name);
            assert!(refused.fix.contains("10 x 20 x 30"), "{refused:?}");
        }
    }
}
