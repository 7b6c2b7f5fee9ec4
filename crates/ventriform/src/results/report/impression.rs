//! Sentences that a reader may take over into the impression of a study.
//!
//! In: a report. Out: sentences by a table of wording, the perfusion first, then cavity, scores and beat, what limits the
//! study last. Figures are those of the report.
//!
//! 1. A flag that doubts the fit or the uptake takes all sentences on perfusion away, one that doubts the beat those on the
//!    beat: what is doubted is not offered.
//! 2. A defect is described where its verdict is `yes`: size by its share of the wall ([`SIZES`]), severity by the lowest
//!    uptake of its segments ([`SEVERITIES`]), type by what is reversible and what is fixed in the same segments, place by
//!    walls and levels.
//! 3. `cannot_tell` is said to be open; it is never turned into a finding or its absence.
//!
//! Sizes are those of the guidelines of the American Society of Nuclear Cardiology for reports (small below 10 % of the
//! ventricle, large from 20 % on). Severities are a convention of this program. Nothing of the headers is repeated.

use super::beat_report::BeatReport;
use super::comparison_report::{ComparedSegmentReport, ComparisonReport};
use super::perfusion_report::PerfusionReport;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::SegmentationReport;
use crate::heart::comparison::Verdict;
use crate::heart::polar::PolarSegment;
use crate::image::draw::text::{number, signed};

/// Least share of the wall, per cent, of a defect of that size.
const SIZES: [(f64, &str); 3] = [(20.0, "large"), (10.0, "medium"), (0.0, "small")];

/// Least uptake of the darkest segment, per cent of the reference, of a defect of that severity.
const SEVERITIES: [(f64, &str); 3] = [(60.0, "mild"), (45.0, "moderate"), (0.0, "severe")];

/// Share of a segment from which on a defect lies in it, per cent.
const OF_SEGMENT_PERCENT: f64 = 50.0;

/// The walls of the ventricle, by their segments.
const WALLS: [(&str, &[usize]); 5] = [
    ("anterior wall", &[1, 7, 13]),
    ("septum", &[2, 3, 8, 9, 14]),
    ("inferior wall", &[4, 10, 15]),
    ("lateral wall", &[5, 6, 11, 12, 16]),
    ("apex", &[17]),
];

/// Flags that doubt where the wall lies or what its uptake is.
const DOUBT_UPTAKE: [&str; 17] = [
    "uncertain_place",
    "uncertain_fit",
    "motion",
    "right_ventricle",
    "label_map",
    "saturated",
    "negative_background",
    "raised_background",
    "hot_voxels",
    "mirrored",
    "field_of_view",
    "valve_plane",
    "implausible_shape",
    "poor_contrast",
    "not_at_rest",
    "folded",
    "not_comparable",
];

/// Flags that doubt volumes and ejection fraction, too.
const DOUBT_BEAT: [&str; 9] = [
    "uncertain_place",
    "implausible_shape",
    "not_at_rest",
    "folded",
    "no_contraction",
    "count_gain",
    "dark_wall",
    "small_heart",
    "leaves_field",
];

/// What flags say of the limits of a study.
const LIMITS: [(&str, &str); 22] = [
    (
        "uncertain_place",
        "it is uncertain whether the left ventricle was found",
    ),
    ("uncertain_fit", "the contours are uncertain"),
    ("motion", "the patient may have moved"),
    (
        "right_ventricle",
        "the contour may follow the right ventricle",
    ),
    ("saturated", "the greatest counts were cut off"),
    ("negative_background", "the background lies below zero"),
    ("raised_background", "a constant was added to the counts"),
    ("hot_voxels", "single voxels outshine the wall"),
    ("mirrored", "the image may be mirrored"),
    ("field_of_view", "the heart leaves the field of view"),
    ("valve_plane", "the base cannot be seen"),
    ("implausible_shape", "the shape is none of a left ventricle"),
    ("poor_contrast", "the contrast is poor"),
    ("thickness_assumed", "the thickness of the wall is assumed"),
    ("not_comparable", "both scans are not comparable"),
    ("few_counts", "the counts are few"),
    ("scale_uncertain", "little of the wall is unchanged"),
    (
        "role_not_stated",
        "the headers do not say which scan is at stress",
    ),
    ("no_contraction", "the gates show no beat"),
    ("beats_rejected", "many beats were rejected"),
    ("dark_wall", "the motion of dark wall cannot be seen"),
    ("small_heart", "the heart is small"),
];

/// Whether one of the flags has one of the codes.
fn is_raised(flags: &[RaisedFlag], codes: &[&str]) -> bool {
    flags.iter().any(|flag| codes.contains(&flag.code.as_str()))
}

/// The row of the table that `value` falls into.
fn word(table: &[(f64, &'static str)], value: f64) -> &'static str {
    let row = table.iter().find(|(least, _)| value >= *least);
    row.or(table.last()).map_or("", |(_, word)| word)
}

/// A figure with its interval.
fn within(value: f64, ends: Option<[f64; 2]>, digits: usize, unit: &str) -> String {
    let own = number(value, digits);
    match ends {
        None => format!("{own}{unit}"),
        Some([low, high]) => {
            let [low, high] = [low, high].map(|end| number(end, digits));
            format!("{own}{unit} ({low} to {high}{unit})")
        }
    }
}

/// The walls in which `segments` lie, in words; `None` where the sides of the wall are not known, or there are none.
fn place(segments: &[usize], oriented: bool) -> Option<String> {
    if segments.is_empty() {
        return None;
    }
    if !oriented {
        let count = segments.len();
        return Some(format!("{count} of 17 segments"));
    }
    let walls = WALLS.iter().filter_map(|(name, of_wall)| {
        let within = of_wall.iter().filter(|number| segments.contains(number));
        let levels: Vec<&str> = within.map(|number| level(*number)).collect();
        let whole = levels.len() == of_wall.len();
        let one_level = levels.iter().all(|level| *level == levels[0]);
        match levels.first() {
            None => None,
            Some(level) if !whole && one_level && !level.is_empty() => {
                Some(format!("the {level} {name}"))
            }
            Some(_) => Some(format!("the {name}")),
        }
    });
    Some(listed(&walls.collect::<Vec<_>>()))
}

/// The level of a segment; none of the apex.
fn level(segment: usize) -> &'static str {
    match segment {
        1..=6 => "basal",
        7..=12 => "mid",
        13..=16 => "apical",
        _ => "",
    }
}

fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The sentence with a capital letter and a full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

/// What limits the study, by its flags; `None` if none of them does.
fn limits(flags: &[RaisedFlag]) -> Option<String> {
    let rows = LIMITS.iter().filter(|(code, _)| is_raised(flags, &[code]));
    let reasons: Vec<String> = rows.map(|(_, reason)| (*reason).to_owned()).collect();
    (!reasons.is_empty()).then(|| sentence(&format!("limits of the study: {}", reasons.join("; "))))
}

/// The segments of a comparison in which a part of the change lies.
fn segments_with(
    report: &ComparisonReport,
    percent: impl Fn(&ComparedSegmentReport) -> f64,
) -> Vec<usize> {
    let segments = report.segments.iter();
    let involved = segments.filter(|segment| percent(segment) >= OF_SEGMENT_PERCENT);
    involved.map(|segment| segment.segment).collect()
}

/// One defect of a comparison: what is reversible of it and what is fixed, per cent of the wall, and its segments.
struct Defect {
    kind: &'static str,
    percent: f64,
    ends: Option<[f64; 2]>,
    segments: Vec<usize>,
}

impl Defect {
    fn described(&self, report: &ComparisonReport) -> String {
        let lowest = report.segments.iter();
        let lowest = lowest.filter(|segment| self.segments.contains(&segment.segment));
        let lowest = lowest.filter_map(|segment| segment.uptake.stress_percent);
        let lowest = lowest.fold(f64::INFINITY, f64::min);
        let size = word(&SIZES, self.percent);
        let severity = match lowest.is_finite() {
            true => format!(" {}", word(&SEVERITIES, lowest)),
            false => String::new(),
        };
        let share = within(self.percent, self.ends, 0, " %");
        let oriented = !report.territories.is_empty();
        let place = match place(&self.segments, oriented) {
            Some(place) => format!(" in {place}"),
            None => String::new(),
        };
        sentence(&format!(
            "{size}{severity} {} defect{place}: {share} of the wall",
            self.kind
        ))
    }
}

/// The sentences of a comparison of rest and stress.
pub fn of_comparison(report: &ComparisonReport) -> Vec<String> {
    let mut said = Vec::new();
    let flags = &report.flags;
    if !is_raised(flags, &DOUBT_UPTAKE) {
        said.extend(perfusion_change(report));
        said.extend(dilation(report));
        if let (Some(sss), Some(srs), Some(sds)) = (report.sss, report.srs, report.sds) {
            said.push(format!(
                "Summed scores by the normal limits: stress {sss}, rest {srs}, difference {sds}."
            ));
        }
    }
    let beat = report.beat.as_ref();
    if let Some(beat) = beat.filter(|_| !is_raised(flags, &DOUBT_BEAT))
        && let (Some(stress), Some(rest)) = (beat.stress_ef_percent, beat.rest_ef_percent)
    {
        let change = beat.ef_change_points.map_or(String::new(), |change| {
            let points = signed(change, 0);
            let says = match (beat.ef_change_interval_points, beat.ef_change_verdict) {
                (Some([low, high]), Some(verdict)) => {
                    let ends = format!("{} to {}", signed(low, 0), signed(high, 0));
                    let says = match verdict {
                        Verdict::Yes if change < 0.0 => "lower at stress",
                        Verdict::Yes => "higher at stress",
                        Verdict::No => "unchanged",
                        Verdict::CannotTell => "too uncertain to call a change",
                    };
                    format!(", {ends}: {says}")
                }
                _ => String::new(),
            };
            format!(" ({points} points{says})")
        });
        said.push(format!(
            "Ejection fraction {} % at stress, {} % at rest{change}; end-diastolic volume {} ml and {} ml.",
            number(stress, 0),
            number(rest, 0),
            number(beat.stress_edv_ml, 0),
            number(beat.rest_edv_ml, 0)
        ));
    }
    let attenuation = [&report.stress, &report.rest].iter().any(|scan| {
        let polar = scan.polar.as_ref();
        polar.is_some_and(|polar| polar.attenuation.is_some())
    });
    if attenuation {
        said.push("Attenuation was not corrected, which can darken the inferior wall.".to_owned());
    }
    said.extend(limits(flags));
    said
}

fn perfusion_change(report: &ComparisonReport) -> Vec<String> {
    let reversible = segments_with(report, |segment| segment.uptake.reversible_percent);
    let fixed = segments_with(report, |segment| segment.uptake.fixed_percent);
    let verdicts = (report.reversible_verdict, report.fixed_verdict);
    let mut said = Vec::new();
    let shared = reversible.iter().any(|segment| fixed.contains(segment));
    match verdicts {
        (Some(Verdict::Yes), Some(Verdict::Yes)) if shared => {
            let mut segments = [reversible.as_slice(), fixed.as_slice()].concat();
            segments.sort_unstable();
            segments.dedup();
            let both = Defect {
                kind: "partly reversible",
                percent: report.reversible_percent + report.fixed_percent,
                ends: None,
                segments,
            };
            said.push(both.described(report));
            said.push(format!(
                "Of the wall {} are reversible, {} fixed.",
                within(
                    report.reversible_percent,
                    report.reversible_interval_percent,
                    0,
                    " %"
                ),
                within(report.fixed_percent, report.fixed_interval_percent, 0, " %")
            ));
            return said;
        }
        (Some(Verdict::No), Some(Verdict::No)) => {
            said.push("No perfusion defect.".to_owned());
            if let Some(least) = report.detectable_percent {
                said.push(format!(
                    "A territory that loses {} % of its uptake at stress would be found nine times in ten.",
                    number(least, 0)
                ));
            }
            return said;
        }
        _ => {}
    }
    let parts = [
        (
            "reversible",
            verdicts.0,
            report.reversible_percent,
            report.reversible_interval_percent,
            reversible,
        ),
        (
            "fixed",
            verdicts.1,
            report.fixed_percent,
            report.fixed_interval_percent,
            fixed,
        ),
    ];
    for (kind, verdict, percent, ends, segments) in parts {
        match verdict {
            Some(Verdict::Yes) => said.push(
                Defect {
                    kind,
                    percent,
                    ends,
                    segments,
                }
                .described(report),
            ),
            Some(Verdict::No) => said.push(format!("No {kind} defect.")),
            Some(Verdict::CannotTell) => said.push(format!(
                "Noise leaves open whether there is a {kind} defect ({} of the wall).",
                within(percent, ends, 0, " %")
            )),
            None => {}
        }
    }
    said
}

fn dilation(report: &ComparisonReport) -> Option<String> {
    if is_raised(&report.flags, &["tid_uncertain"]) {
        return None;
    }
    let tid = within(report.tid, report.tid_interval, 2, "");
    match report.tid_verdict? {
        Verdict::Yes => Some(format!(
            "Transient dilation of the left ventricle: TID {tid}."
        )),
        Verdict::No => Some(format!(
            "No transient dilation of the left ventricle: TID {tid}."
        )),
        Verdict::CannotTell => None,
    }
}

/// The sentences of a single scan.
pub fn of_segmentation(report: &SegmentationReport) -> Vec<String> {
    let mut said = Vec::new();
    let flags = &report.flags;
    let Some(polar) = &report.polar else {
        return said;
    };
    let oriented = !polar.territories.is_empty();
    if !is_raised(flags, &DOUBT_UPTAKE) {
        match &report.perfusion {
            Some(perfusion) => said.push(beside_limits(perfusion, oriented)),
            None => {
                let dark = |segment: &&PolarSegment| {
                    segment
                        .mean_percent
                        .is_some_and(|mean| mean < polar.threshold_percent)
                };
                let segments: Vec<usize> = polar
                    .segments
                    .iter()
                    .filter(dark)
                    .map(|s| s.number)
                    .collect();
                let place = place(&segments, oriented)
                    .map_or(String::new(), |place| format!(", most in {place}"));
                said.push(format!(
                    "{} % of the wall take up less than {} % of its reference{place}; no normal limits were used.",
                    number(polar.extent_percent, 0),
                    number(polar.threshold_percent, 0)
                ));
            }
        }
        if let Some(anatomical) = &report.volumes_ml.anatomical {
            let ends = report
                .volumes_ml
                .anatomical_interval
                .as_ref()
                .map(|ends| ends.cavity);
            said.push(format!(
                "Cavity of the left ventricle {}.",
                within(anatomical.cavity, ends, 0, " ml")
            ));
        }
    }
    if polar.attenuation.is_some() {
        said.push("Attenuation was not corrected, which can darken the inferior wall.".to_owned());
    }
    said.extend(limits(flags));
    said
}

/// The wall of one scan beside normal limits.
fn beside_limits(perfusion: &PerfusionReport, oriented: bool) -> String {
    let scored = perfusion
        .segments
        .iter()
        .filter(|segment| segment.score.is_some_and(|score| score > 0));
    let segments: Vec<usize> = scored.map(|segment| segment.segment).collect();
    if segments.is_empty() {
        return "No perfusion defect: no segment lies below its normal limits.".to_owned();
    }
    let place = place(&segments, oriented).map_or(String::new(), |place| format!(" in {place}"));
    sentence(&format!(
        "{} perfusion defect{place}: {} % of the wall lie below the normal limits, summed score {}, deficit score {} %",
        word(&SIZES, perfusion.extent_percent),
        number(perfusion.extent_percent, 0),
        perfusion.summed_score,
        number(perfusion.deficit_percent, 0)
    ))
}

/// The sentences of a beat.
pub fn of_beat(report: &BeatReport) -> Vec<String> {
    let mut said = Vec::new();
    let flags = &report.flags;
    if !is_raised(flags, &DOUBT_BEAT) {
        if let Some(ef) = report.ef_percent {
            said.push(format!(
                "Left ventricular ejection fraction {}; end-diastolic volume {}, end-systolic volume {}.",
                within(ef, report.ef_interval_percent, 0, " %"),
                within(report.edv_ml, report.edv_interval_ml, 0, " ml"),
                within(report.esv_ml, report.esv_interval_ml, 0, " ml")
            ));
        }
        if report.phase.reliable {
            said.push(format!(
                "Phases of contraction: standard deviation {} degrees, bandwidth {} degrees.",
                number(report.phase.sd_degrees, 0),
                number(report.phase.bandwidth_degrees, 0)
            ));
        }
    }
    let oriented = report.posture.is_some();
    let uptake = report
        .perfusion
        .as_ref()
        .filter(|_| !is_raised(flags, &DOUBT_UPTAKE));
    said.extend(uptake.map(|perfusion| beside_limits(perfusion, oriented)));
    said.extend(limits(flags));
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::report::comparison_report::tests::first_comparison;

    fn flag(code: &str) -> RaisedFlag {
        RaisedFlag {
            code: code.into(),
            reason: "the header says Müller".into(),
        }
    }

    #[test]
    fn a_reversible_defect_is_described_by_size_severity_type_and_place() {
        let mut report = first_comparison();
        report.flags.clear();
        for segment in &mut report.segments {
            let involved = [1, 7, 13].contains(&segment.segment);
            segment.uptake.reversible_percent = if involved { 90.0 } else { 5.0 };
            segment.uptake.stress_percent = Some(if segment.segment == 7 { 44.0 } else { 70.0 });
        }
        let said = of_comparison(&report);
        assert_eq!(
            said[0],
            "Medium severe reversible defect in the anterior wall: 12 % (9 to 16 %) of the wall."
        );
        assert_eq!(said[1], "No fixed defect.");
        // Whether the cavity is larger is open: nothing is said.
        assert!(
            !said.iter().any(|sentence| sentence.contains("TID")),
            "{said:?}"
        );
    }

    #[test]
    fn what_is_doubted_is_not_offered_and_headers_are_not_repeated() {
        let mut report = first_comparison();
        report.flags = vec![flag("motion")];
        assert_eq!(
            of_comparison(&report),
            ["Limits of the study: the patient may have moved."]
        );
        for code in DOUBT_UPTAKE {
            report.flags = vec![flag(code)];
            let said = of_comparison(&report).join(" ");
            assert!(
                !said.contains("defect") && !said.contains("Müller"),
                "{code}: {said}"
            );
        }
    }

    #[test]
    fn no_defect_says_what_would_have_been_found_and_an_open_question_stays_open() {
        let mut report = first_comparison();
        report.flags.clear();
        report.reversible_verdict = Some(Verdict::No);
        let said = of_comparison(&report);
        assert_eq!(said[0], "No perfusion defect.");
        assert!(said[1].contains("19 %"), "{said:?}");
        report.reversible_verdict = Some(Verdict::CannotTell);
        let said = of_comparison(&report);
        assert!(said[0].starts_with("Noise leaves open"), "{said:?}");
        assert!(
            !said
                .iter()
                .any(|sentence| sentence == "No perfusion defect.")
        );
    }

    #[test]
    fn a_place_is_named_by_walls_and_levels() {
        assert_eq!(place(&[1], true).unwrap(), "the basal anterior wall");
        assert_eq!(
            place(&[4, 10, 15, 17], true).unwrap(),
            "the inferior wall and the apex"
        );
        assert_eq!(
            place(&[1, 2, 11, 12], true).unwrap(),
            "the basal anterior wall, the basal septum and the mid lateral wall"
        );
        assert_eq!(place(&[1, 2], false).unwrap(), "2 of 17 segments");
        assert_eq!(place(&[], true), None);
    }
}
