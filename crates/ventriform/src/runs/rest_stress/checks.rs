//! Whether two scans can be compared: one patient, one at stress and one at rest, made alike.

use super::error::ComparisonError;
use super::hearts::ComparedHeart;
use super::order::ComparisonOrder;
use crate::base::progress::Monitor;
use crate::heart::comparison::{
    Change, ComparisonFlag, FEW_COUNTS_LOSS_PERCENT, Reason, WhichScan,
};
use crate::heart::normals::Perfusion;
use crate::image::volume::{
    Provenance, ReadLimits, ReadOptions, VolumeFile, hold_same_voxels, provenance,
};

/// Difference of resolution from which scans are not comparable, mm: a cavity looks smaller by some
/// per cent for every millimetre of blur.
pub(crate) const RESOLUTION_MM: f64 = 1.5;
/// Share of the wall that is reversible from which TID is uncertain, per cent.
const LARGE_REVERSIBLE_PERCENT: f64 = 10.0;
/// Share of the wall that sets the scale below which it is uncertain, per cent.
pub(crate) const FEW_MATCHED_PERCENT: f64 = 40.0;

/// Refuses, before anything is fitted, one scan given twice, and scans of two patients unless the caller says that they
/// are one.
pub(super) fn refuse(
    order: &ComparisonOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<(), ComparisonError> {
    let scans = [
        (WhichScan::Stress, order.stress),
        (WhichScan::Rest, order.rest),
    ];
    // Of gates the headers of the first.
    let options = ReadOptions { frame: Some(0) };
    let header = |(scan, files): (WhichScan, &[VolumeFile])| {
        provenance(files, &options, limits, monitor)
            .map_err(|error| ComparisonError::of_gated(scan, error.into()))
    };
    if let (Some(a), Some(b)) = (header(scans[0])?, header(scans[1])?) {
        if a.sop_instance_uid.is_some() && a.sop_instance_uid == b.sop_instance_uid {
            return Err(ComparisonError::SameScan("they have one SOP Instance UID"));
        }
        let differ = a.other_patient(&b);
        if !differ.is_empty() && !order.parameters.choice.same_patient {
            return Err(ComparisonError::OtherPatient(differ));
        }
    }
    let quiet = monitor.without_observer();
    match hold_same_voxels([order.stress, order.rest], limits, &quiet) {
        Ok(true) => Err(same_voxels()),
        // The fit that reads a file with an error says whose it is.
        Ok(false) | Err(_) => Ok(monitor.check()?),
    }
}

/// Refuses fits to the same voxels: the sum of one scan's gates beside those gates.
pub(super) fn refuse_fits(
    stress: &ComparedHeart,
    rest: &ComparedHeart,
) -> Result<(), ComparisonError> {
    match stress.has_voxels_of(rest) {
        true => Err(same_voxels()),
        false => Ok(()),
    }
}

fn same_voxels() -> ComparisonError {
    ComparisonError::SameScan("they have the same voxels")
}

/// Reasons to look closer.
pub(super) fn flags(
    stress: &ComparedHeart,
    rest: &ComparedHeart,
    change: &Change,
) -> Vec<ComparisonFlag> {
    let mut flags = Vec::new();
    let both = [(WhichScan::Stress, stress), (WhichScan::Rest, rest)];
    let unstated: Vec<WhichScan> = (both.iter())
        .filter(|(_, heart)| heart.provenance().is_none())
        .map(|(scan, _)| *scan)
        .collect();
    match unstated[..] {
        [] => {}
        [scan] => flags.push(ComparisonFlag::OriginNotStated { scan: Some(scan) }),
        _ => flags.push(ComparisonFlag::OriginNotStated { scan: None }),
    }
    for (scan, heart) in both {
        if heart.provenance().is_none() {
            continue;
        }
        match heart.stated_role() {
            Some(stated) if stated != scan => {
                flags.push(ComparisonFlag::NotComparable(Reason::Role { scan, stated }));
            }
            Some(_) => {}
            None => flags.push(ComparisonFlag::RoleNotStated { scan }),
        }
    }
    if let (Some(a), Some(b)) = (stress.provenance(), rest.provenance()) {
        flags.extend(of_headers(a, b));
    }
    if let (Some(stress_mm), Some(rest_mm)) = (stress.resolution_mm(), rest.resolution_mm())
        && (stress_mm - rest_mm).abs() > RESOLUTION_MM
    {
        flags.push(ComparisonFlag::NotComparable(Reason::Resolution {
            stress_mm,
            rest_mm,
        }));
    }
    let [stress_ml, rest_ml] = [stress, rest].map(ComparedHeart::muscle_ml);
    if !change.noise.explains_muscle(stress_ml / rest_ml) {
        flags.push(ComparisonFlag::NotComparable(Reason::Muscle {
            stress_ml,
            rest_ml,
        }));
    }
    let reversible_percent = change.answers.reversible.value;
    if reversible_percent > LARGE_REVERSIBLE_PERCENT {
        flags.push(ComparisonFlag::TidUncertain { reversible_percent });
    }
    let detectable_percent = change.answers.detectable_percent;
    if detectable_percent > FEW_COUNTS_LOSS_PERCENT {
        flags.push(ComparisonFlag::FewCounts { detectable_percent });
    }
    if change.matched_percent < FEW_MATCHED_PERCENT {
        flags.push(ComparisonFlag::ScaleUncertain {
            percent: change.matched_percent,
        });
    }
    if change.turn.degrees != 0.0 {
        flags.push(ComparisonFlag::Turned {
            degrees: change.turn.degrees,
        });
    }
    for (scan, heart) in both {
        let told = heart.flags().into_iter();
        flags.extend(told.map(|(code, reason)| ComparisonFlag::OfScan { scan, code, reason }));
    }
    flags.extend(of_limits(stress.perfusion(), rest.perfusion()));
    flags
}

/// Flags of each scan's comparison with normal limits; one that both share stands once.
fn of_limits(stress: Option<&Perfusion>, rest: Option<&Perfusion>) -> Vec<ComparisonFlag> {
    let told = |perfusion: Option<&Perfusion>| -> Vec<(&'static str, String)> {
        let flags = perfusion.map(|perfusion| perfusion.flags.as_slice());
        let flags = flags.unwrap_or_default().iter();
        flags.map(|flag| (flag.code(), flag.to_string())).collect()
    };
    let [of_stress, of_rest] = [stress, rest].map(told);
    let at_stress = (of_stress.iter()).map(|own| {
        let alone = !of_rest.contains(own);
        (alone.then_some(WhichScan::Stress), own)
    });
    let at_rest = (of_rest.iter())
        .filter(|own| !of_stress.contains(own))
        .map(|own| (Some(WhichScan::Rest), own));
    let flag = |(scan, (code, reason)): (_, &(&'static str, String))| ComparisonFlag::OfLimits {
        scan,
        code,
        reason: reason.clone(),
    };
    at_stress.chain(at_rest).map(flag).collect()
}

/// The flag of a field that one header states and the other one leaves out, as they have it at stress and at rest.
fn of_one(field: &'static str, stated: [Option<String>; 2]) -> Option<ComparisonFlag> {
    let (scan, other) = match stated {
        [None, Some(other)] => (WhichScan::Stress, other),
        [Some(other), None] => (WhichScan::Rest, other),
        _ => return None,
    };
    Some(ComparisonFlag::NotStated { scan, field, other })
}

/// Differences between the headers in patient, times and acquisition.
fn of_headers(stress: &Provenance, rest: &Provenance) -> Vec<ComparisonFlag> {
    let mut flags = Vec::new();
    let patient = stress.other_patient(rest);
    if !patient.is_empty() {
        flags.push(ComparisonFlag::NotComparable(Reason::Patient(patient)));
    }
    let corrections = [stress, rest].map(Provenance::attenuation_corrected);
    if let [Some(at_stress), Some(at_rest)] = corrections
        && at_stress != at_rest
    {
        let corrected = if at_stress {
            WhichScan::Stress
        } else {
            WhichScan::Rest
        };
        flags.push(ComparisonFlag::NotComparable(
            Reason::AttenuationCorrection { corrected },
        ));
    }
    // Most cameras correct none: where a header says so, silence of the other one is no difference.
    if !corrections.contains(&Some(false)) {
        let corrected = corrections.map(|is| is.map(|_| "corrected".to_owned()));
        flags.extend(of_one("attenuation correction", corrected));
    }
    if let Some([stress, rest]) = stress.other_tracer(rest) {
        flags.push(ComparisonFlag::NotComparable(Reason::Tracer {
            stress,
            rest,
        }));
    }
    flags.extend(of_one("tracer", [stress, rest].map(Provenance::tracer)));
    let otherwise = stress.made_otherwise(rest).into_iter();
    flags.extend(
        otherwise.map(|(field, [stress, rest])| ComparisonFlag::MadeOtherwise {
            field,
            stress,
            rest,
        }),
    );
    flags
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(change: impl Fn(&mut Provenance)) -> Provenance {
        let text = |text: &str| Some(text.to_owned());
        let mut scan = Provenance {
            patient_id: text("17"),
            patient_name: text("DOE^ANN^"),
            patient_birth_date: text("19500102"),
            patient_sex: text("F"),
            radiopharmaceutical: text("Tc-99m tetrofosmin"),
            corrected_image: text("UNIF\\COR"),
            model_name: text("Camera 1"),
            ..Provenance::default()
        };
        change(&mut scan);
        scan
    }

    #[test]
    fn scans_made_otherwise_are_named() {
        let text = |text: &str| Some(text.to_owned());
        let one = scan(|_| {});
        let codes = |other: &Provenance| -> Vec<&'static str> {
            let flags = of_headers(&one, other);
            flags.iter().map(ComparisonFlag::code).collect()
        };
        assert_eq!(codes(&one), Vec::<&str>::new());
        for other in [
            scan(|s| s.corrected_image = text("UNIF\\COR\\ATTN")),
            scan(|s| s.radiopharmaceutical = text("Tl-201 chloride")),
            scan(|s| s.patient_id = text("18")),
        ] {
            assert_eq!(codes(&other), ["not_comparable"]);
        }
        for other in [
            scan(|s| s.model_name = text("Camera 2")),
            scan(|s| s.model_name = text("camera 1 ")),
        ] {
            let expected: &[&str] = match other.model_name.as_deref() {
                Some("Camera 2") => &["made_otherwise"],
                _ => &[],
            };
            assert_eq!(codes(&other), expected);
        }
        // What a header does not say is a difference only where the other one says what is unusual.
        assert_eq!(
            codes(&scan(|s| s.corrected_image = None)),
            Vec::<&str>::new()
        );
        assert_eq!(
            codes(&scan(|s| s.radiopharmaceutical = None)),
            ["not_stated"]
        );
        let corrected = scan(|s| s.corrected_image = text("UNIF\\ATTN"));
        let silent = scan(|s| s.corrected_image = None);
        for (stress, rest) in [(&corrected, &silent), (&silent, &corrected)] {
            let flags = of_headers(stress, rest);
            let codes: Vec<&str> = flags.iter().map(ComparisonFlag::code).collect();
            assert_eq!(codes, ["not_stated"]);
        }
    }
}
