//! Whether scans are of one patient and of one kind, in which order they were made, and what makes changes doubtful.

use super::error::SerialError;
use super::fits::ScanFit;
use super::hearts::{SerialHearts, SerialScan};
use super::order::SerialOrder;
use crate::base::progress::Monitor;
use crate::heart::comparison::{FEW_COUNTS_LOSS_PERCENT, FigureChange, Verdict};
use crate::heart::serial::{SERIAL_FIGURES, SerialFlag};
use crate::image::volume::{Provenance, ReadLimits, ReadOptions, VolumeFile, provenance};
use crate::runs::rest_stress::{FEW_MATCHED_PERCENT, RESOLUTION_MM};

/// Share by which doses, and rates of the heart, have to differ to be told.
const OTHER_DOSE_SHARE: f64 = 0.3;
const OTHER_RATE_SHARE: f64 = 0.15;
/// Correlation about the wall below which hearts are not taken for one and the same.
const LEAST_CORRELATION: f64 = 0.7;

/// What the headers of the scans say, in the order in which they were given.
pub(super) type Headers = Vec<Option<Provenance>>;

/// The headers of all scans. Of gates that of the first.
pub(super) fn headers(
    order: &SerialOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Headers, SerialError> {
    let options = ReadOptions { frame: Some(0) };
    let header = |(place, files): (usize, &Vec<VolumeFile>)| {
        provenance(files, &options, limits, monitor)
            .map_err(|error| SerialError::of_volume(place + 1, error))
    };
    order.scans.iter().enumerate().map(header).collect()
}

/// Refuses one scan given twice, scans of two patients unless it is stated that they are one, and scans of two kinds.
pub(super) fn refuse(headers: &Headers, same_patient: bool) -> Result<(), SerialError> {
    let stated = headers.iter().enumerate();
    let stated: Vec<(usize, &Provenance)> = stated
        .filter_map(|(place, own)| Some((place + 1, own.as_ref()?)))
        .collect();
    for (index, (scan, own)) in stated.iter().enumerate() {
        for (other, its) in &stated[index + 1..] {
            let scans = [*scan, *other];
            if own.sop_instance_uid.is_some() && own.sop_instance_uid == its.sop_instance_uid {
                let reason = "they have one SOP Instance UID";
                return Err(SerialError::SameScan { scans, reason });
            }
            let fields = own.other_patient(its);
            if !fields.is_empty() && !same_patient {
                return Err(SerialError::OtherPatient { scans, fields });
            }
            if let Some((field, stated)) = other_kind(own, its) {
                return Err(SerialError::MixedKinds {
                    scans,
                    field,
                    stated: Some(stated),
                });
            }
        }
    }
    Ok(())
}

/// What makes two scans of other kinds, where both headers state it: rest or stress, tracer, correction.
fn other_kind(a: &Provenance, b: &Provenance) -> Option<(&'static str, [String; 2])> {
    let roles = a.rest_or_stress.clone().zip(b.rest_or_stress.clone());
    if let Some((a, b)) = roles.filter(|(a, b)| a != b) {
        return Some(("rest or stress", [a, b]));
    }
    if let Some(tracers) = a.other_tracer(b) {
        return Some(("the tracer", tracers));
    }
    let corrected = a.attenuation_corrected().zip(b.attenuation_corrected());
    let word = |is: bool| if is { "corrected" } else { "not corrected" }.to_owned();
    corrected
        .filter(|(a, b)| a != b)
        .map(|(a, b)| ("attenuation", [word(a), word(b)]))
}

/// The places of the scans in the order of their dates, and whether all headers state one; otherwise as they were given.
pub(super) fn sequence(headers: &Headers) -> (Vec<usize>, bool) {
    let moments: Option<Vec<_>> = (headers.iter())
        .map(|header| header.as_ref()?.moment())
        .collect();
    let mut places: Vec<usize> = (0..headers.len()).collect();
    if let Some(moments) = &moments {
        places.sort_by_key(|place| moments[*place]);
    }
    (places, moments.is_some())
}

/// Refuses fits to the same voxels.
pub(super) fn refuse_same_voxels(
    scans: &[(usize, &[VolumeFile])],
    fits: &[ScanFit],
) -> Result<(), SerialError> {
    for (index, fit) in fits.iter().enumerate() {
        for (place, other) in fits.iter().enumerate().skip(index + 1) {
            if fit.image().voxels == other.image().voxels {
                return Err(SerialError::SameScan {
                    scans: [scans[index].0, scans[place].0],
                    reason: "they have the same voxels",
                });
            }
        }
    }
    Ok(())
}

/// Reasons to look closer.
pub(super) fn flags(hearts: &SerialHearts, dated: bool) -> Vec<SerialFlag> {
    let scans = &hearts.scans;
    let mut flags = Vec::new();
    flags.extend((!dated).then_some(SerialFlag::DatesNotStated));
    flags.extend(of_headers(scans));
    for (place, scan) in scans.iter().enumerate().skip(1) {
        flags.extend(against_first(&scans[0], scan, place + 1));
    }
    flags.extend(odd_scans(hearts));
    for pair in &hearts.pairs {
        let numbers = [pair.earlier + 1, pair.later + 1];
        let detectable_percent = pair.change.answers.detectable_percent;
        if detectable_percent > FEW_COUNTS_LOSS_PERCENT {
            flags.push(SerialFlag::FewCounts {
                pair: numbers,
                detectable_percent,
            });
        }
        let percent = pair.change.matched_percent;
        if percent < FEW_MATCHED_PERCENT {
            flags.push(SerialFlag::ScaleUncertain {
                pair: numbers,
                percent,
            });
        }
    }
    for (place, scan) in scans.iter().enumerate() {
        flags.extend(of_fit(scan, place + 1));
    }
    flags
}

/// A field, and whether a header states it.
type StatedField<'a> = (&'static str, &'a dyn Fn(&Provenance) -> bool);

/// What headers leave out, and what they contradict each other in.
fn of_headers(scans: &[SerialScan]) -> Vec<SerialFlag> {
    let mut flags = Vec::new();
    let silent = |says: &dyn Fn(&SerialScan) -> bool| -> Vec<usize> {
        let all = scans.iter().enumerate();
        all.filter(|(_, scan)| !says(scan))
            .map(|(place, _)| place + 1)
            .collect()
    };
    let unknown = silent(&|scan| scan.provenance().is_some());
    let stated =
        |scan: &SerialScan, of: &dyn Fn(&Provenance) -> bool| scan.provenance().is_none_or(of);
    if !unknown.is_empty() {
        flags.push(SerialFlag::PatientNotStated { scans: unknown });
    }
    let first = scans.iter().find_map(SerialScan::provenance);
    let fields = (scans.iter().filter_map(SerialScan::provenance))
        .map(|own| first.map_or_else(Vec::new, |first| first.other_patient(own)))
        .find(|fields| !fields.is_empty());
    flags.extend(fields.map(|fields| SerialFlag::OtherPatient { fields }));
    let rows: [StatedField<'_>; 2] = [
        ("rest or stress", &|own| own.rest_or_stress.is_some()),
        ("the tracer", &|own| own.tracer().is_some()),
    ];
    for (field, of) in rows {
        let scans = silent(&|scan| stated(scan, of));
        if !scans.is_empty() {
            flags.push(SerialFlag::NotStated { scans, field });
        }
    }
    flags
}

/// What differs of the scan with that number from the first one.
fn against_first(first: &SerialScan, own: &SerialScan, scan: usize) -> Vec<SerialFlag> {
    let mut flags = Vec::new();
    if let (Some(a), Some(b)) = (first.provenance(), own.provenance()) {
        let otherwise = a.made_otherwise(b).into_iter();
        flags.extend(
            otherwise.map(|(field, [first, own])| SerialFlag::MadeOtherwise {
                scan,
                field,
                first,
                own,
            }),
        );
        flags.extend(other_dose(a, b, scan));
    }
    if let (Some(first_mm), Some(own_mm)) = (first.heart.resolution_mm(), own.heart.resolution_mm())
        && (first_mm - own_mm).abs() > RESOLUTION_MM
    {
        flags.push(SerialFlag::OtherResolution {
            scan,
            first_mm,
            own_mm,
        });
    }
    if let (Some(a), Some(b)) = (first.beats_per_minute(), own.beats_per_minute())
        && (a / b).ln().abs() > OTHER_RATE_SHARE
    {
        flags.push(SerialFlag::OtherHeartRate {
            scan,
            first_per_minute: a,
            own_per_minute: b,
        });
    }
    let correlation = own.registration.correlation;
    if correlation < LEAST_CORRELATION {
        flags.push(SerialFlag::NotRegistered { scan, correlation });
    }
    flags
}

fn other_dose(a: &Provenance, b: &Provenance, scan: usize) -> Option<SerialFlag> {
    let (first, own) = (a.injected_dose_mbq()?, b.injected_dose_mbq()?);
    let ratio = first.parse::<f64>().ok()? / own.parse::<f64>().ok()?;
    (ratio.is_finite() && ratio.ln().abs() > OTHER_DOSE_SHARE).then(|| SerialFlag::MadeOtherwise {
        scan,
        field: "the total dose",
        first: format!("{first} MBq"),
        own: format!("{own} MBq"),
    })
}

/// Scans that differ in a figure from both of their neighbours, to the same side, while the neighbours agree.
fn odd_scans(hearts: &SerialHearts) -> Vec<SerialFlag> {
    let noise_points = |earlier: usize, later: usize| {
        let pair =
            (hearts.pairs.iter()).find(|pair| (pair.earlier, pair.later) == (earlier, later));
        pair.map(|pair| pair.change.noise.points)
    };
    let mut flags = Vec::new();
    for (place, three) in hearts.scans.windows(3).enumerate() {
        let both = noise_points(place, place + 1).zip(noise_points(place + 1, place + 2));
        let Some(noise) = both.map(|(a, b)| a.max(b)) else {
            continue;
        };
        let odd = SERIAL_FIGURES.iter().find(|figure| {
            let values: Option<Vec<f64>> =
                three.iter().map(|scan| scan.figure(figure.place)).collect();
            values.is_some_and(|v| {
                let [to, back, over] =
                    [(0, 1), (1, 2), (0, 2)].map(|(a, b)| figure.change(v[a], v[b], noise));
                let yes = |change: &FigureChange| change.verdict == Verdict::Yes;
                yes(&to) && yes(&back) && !yes(&over) && to.change * back.change < 0.0
            })
        });
        flags.extend(odd.map(|figure| SerialFlag::OddScan {
            scan: place + 2,
            figure: figure.place,
        }));
    }
    flags
}

/// Flags of the fit of the scan with that number, and of its beat.
fn of_fit(scan: &SerialScan, number: usize) -> Vec<SerialFlag> {
    let told = scan.heart.flags().into_iter();
    let mut flags: Vec<SerialFlag> = told
        .map(|(code, reason)| SerialFlag::OfScan {
            scan: number,
            code,
            reason,
        })
        .collect();
    if !scan.fitted_again {
        flags.push(SerialFlag::OfScan {
            scan: number,
            code: "fitted_alone",
            reason: "no wall was found from the common heart: the scan was fitted by itself, and differs by more than \
                     the heart"
                .to_owned(),
        });
    }
    flags
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(date: &str, change: impl Fn(&mut Provenance)) -> Option<Provenance> {
        let text = |text: &str| Some(text.to_owned());
        let mut scan = Provenance {
            patient_id: text("17"),
            acquisition_date: text(date),
            sop_instance_uid: text(&format!("1.2.{date}")),
            rest_or_stress: text("rest"),
            radiopharmaceutical: text("Tc-99m tetrofosmin"),
            ..Provenance::default()
        };
        change(&mut scan);
        Some(scan)
    }

    #[test]
    fn scans_stand_in_the_order_of_their_dates_where_all_have_one() {
        let usual = |date: &str| scan(date, |_| {});
        let headers = vec![usual("20240301"), usual("20220105"), usual("20230507")];
        assert_eq!(sequence(&headers), (vec![1, 2, 0], true));
        let with_none = vec![usual("20240301"), None, usual("20230507")];
        assert_eq!(sequence(&with_none), (vec![0, 1, 2], false));
        let by_study = scan("20230101", |own| {
            own.study_date = own.acquisition_date.take();
        });
        let headers = vec![usual("20240301"), by_study];
        assert_eq!(sequence(&headers), (vec![1, 0], true));
    }

    #[test]
    fn scans_of_two_kinds_and_two_patients_are_refused() {
        let text = |text: &str| Some(text.to_owned());
        let first = || scan("20240301", |_| {});
        let later = |change: &dyn Fn(&mut Provenance)| vec![first(), scan("20250301", change)];
        assert_eq!(refuse(&later(&|_| {}), false), Ok(()));
        let kinds: [&dyn Fn(&mut Provenance); 2] =
            [&|own| own.rest_or_stress = text("stress"), &|own| {
                own.radiopharmaceutical = text("Tl-201 chloride")
            }];
        for change in kinds {
            let refused = refuse(&later(change), true);
            assert!(matches!(
                refused,
                Err(SerialError::MixedKinds { scans: [1, 2], .. })
            ));
        }
        let patient: &dyn Fn(&mut Provenance) = &|own| own.patient_id = text("18");
        assert!(matches!(
            refuse(&later(patient), false),
            Err(SerialError::OtherPatient { .. })
        ));
        assert_eq!(refuse(&later(patient), true), Ok(()));
        let same: &dyn Fn(&mut Provenance) = &|own| own.sop_instance_uid = text("1.2.20240301");
        assert!(matches!(
            refuse(&later(same), false),
            Err(SerialError::SameScan { .. })
        ));
        let corrected = vec![
            scan("20240301", |own| own.corrected_image = text("UNIF")),
            scan("20250301", |own| own.corrected_image = text("UNIF\\ATTN")),
        ];
        assert!(matches!(
            refuse(&corrected, false),
            Err(SerialError::MixedKinds {
                field: "attenuation",
                ..
            })
        ));
    }
}
