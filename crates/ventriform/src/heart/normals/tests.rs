//! Properties of limits and of scans beside them, on walls made of numbers.

use super::build::{GroupError, GroupKind, HealthyScan, group_of, limits_of};
use super::document::{NormalCase, NormalGroup, NormalLimits};
use super::error::NormalsError;
use super::kind::{GroupSex, ScanKind, Sex};
use super::perfusion::{DEFICIT_OF_FULL_SCORE, HeartFigure, Z_LIMIT, figures, score_of};
use super::place_limits::{PlaceLimits, ScanPlaces};
use crate::base::geometry::random::{Purpose, stream, uniform};
use crate::base::progress::Monitor;
use crate::heart::polar::{Level, RAY_COLUMNS, RAY_ROWS, segment_at};
use std::sync::LazyLock;

const PLACE_COUNT: usize = RAY_ROWS * RAY_COLUMNS;

/// A wall whose apex takes the first 5 rows and whose last 3 rows are masked.
fn wall(uptake: impl Fn(usize, usize) -> f64) -> ScanPlaces {
    let at = |index: usize| (index / RAY_COLUMNS, index % RAY_COLUMNS);
    ScanPlaces {
        uptake: (0..PLACE_COUNT)
            .map(|index| {
                let (row, column) = at(index);
                (row < RAY_ROWS - 3).then(|| uptake(row, column))
            })
            .collect(),
        area: (0..PLACE_COUNT)
            .map(|index| 1.0 + at(index).0 as f64)
            .collect(),
        segment: (0..PLACE_COUNT)
            .map(|index| {
                let (row, column) = at(index);
                let level = Level::ALL
                    [(row.saturating_sub(5).div_euclid(9) + usize::from(row >= 5)).min(3)];
                segment_at(level, 360.0 * (column as f64 + 0.5) / RAY_COLUMNS as f64)
            })
            .collect(),
    }
}

/// Uptake that falls towards the base.
fn even(row: usize, _: usize) -> f64 {
    1000.0 - 8.0 * row as f64
}

/// A person: the even wall with a scale, a tilt and noise of its own.
fn person(seed: u64) -> HealthyScan {
    let mut random = stream(seed, Purpose::Measure);
    let scale = 0.5 + uniform(&mut random);
    let tilt = 0.1 * (uniform(&mut random) - 0.5);
    let noise: Vec<f64> = (0..PLACE_COUNT)
        .map(|_| 1.0 + 0.1 * (uniform(&mut random) - 0.5))
        .collect();
    let places = wall(|row, column| {
        let along = 2.0 * (row as f64 + 0.5) / RAY_ROWS as f64 - 1.0;
        even(row, column) * scale * (1.0 + tilt * along) * noise[row * RAY_COLUMNS + column]
    });
    HealthyScan {
        case: NormalCase {
            case: format!("n{seed}"),
            sex: GroupSex::M,
            sha256: String::new(),
        },
        places,
        figures: vec![HeartFigure {
            figure: "cavity_ml",
            segment: None,
            value: 80.0 + seed as f64,
        }],
    }
}

fn kind() -> GroupKind {
    GroupKind {
        sex: GroupSex::M,
        protocol: "rest".to_owned(),
        tracer: "none (simulated)".to_owned(),
        attenuation_corrected: false,
    }
}

fn people(number: u64) -> Vec<HealthyScan> {
    (0..number).map(person).collect()
}

fn group() -> NormalGroup {
    static HEALTHY_GROUP: LazyLock<NormalGroup> = LazyLock::new(|| {
        group_of(&kind(), &people(14), &Monitor::silent())
            .unwrap()
            .0
    });
    HEALTHY_GROUP.clone()
}

fn file() -> NormalLimits {
    NormalLimits::new(
        "0.0.0",
        true,
        vec![group()],
        Vec::new(),
        serde_json::Map::new(),
    )
}

/// The group's limits without patterns, so that a place's figures follow from that place alone.
fn still_limits() -> PlaceLimits {
    PlaceLimits {
        covariance: super::TermMatrix::zeros(),
        ..PlaceLimits::from(&group().map)
    }
}

/// Headers spell tracers freely; a text that names none or several of the groups' tracers chooses no group.
#[test]
fn a_headers_tracer_names_one_of_the_groups() {
    let tracers = ["Tc-99m tetrofosmin", "Tc-99m sestamibi", "Tl-201 chloride"];
    let of = |tracer: &&str| NormalGroup {
        tracer: (*tracer).to_owned(),
        ..group()
    };
    let limits = NormalLimits {
        groups: tracers.iter().map(of).collect(),
        ..file()
    };
    for (text, named) in [
        ("Tc-99m Tetrofosmin", Some(tracers[0])),
        ("TETROFOSMIN ", Some(tracers[0])),
        ("Myoview (Tc-99m tetrofosmin)", Some(tracers[0])),
        ("tl-201", Some(tracers[2])),
        ("Tc-99m", None),
        ("FDG", None),
        (" ", None),
    ] {
        assert_eq!(limits.tracer_named(text), named, "{text}");
    }
}

#[test]
fn limits_of_equal_hearts_are_that_heart_and_the_least_deviation() {
    let scans: Vec<ScanPlaces> = (1..=20_u32)
        .map(|n| wall(|r, c| f64::from(n) * even(r, c)))
        .collect();
    let limits = limits_of(&scans.iter().collect::<Vec<_>>(), &Monitor::silent()).unwrap();
    let known: Vec<f64> = limits.mean.iter().flatten().copied().collect();
    assert_eq!(known.len(), PLACE_COUNT - 3 * RAY_COLUMNS);
    let level = known.iter().sum::<f64>() / known.len() as f64;
    assert!((level - 1.0).abs() < 1e-12);
    let expected = |index: usize| even(index / RAY_COLUMNS, 0);
    let first = limits.mean[0].unwrap() / expected(0);
    for index in 0..known.len() {
        let (mean, sd) = (limits.mean[index].unwrap(), limits.sd[index].unwrap());
        assert!((mean / expected(index) / first - 1.0).abs() < 1e-9);
        assert!((sd / mean - 0.03 * (1.0 + 1.0 / 20.0_f64).sqrt()).abs() < 1e-9);
    }
}

#[test]
fn the_mean_heart_lies_nowhere_below_whatever_its_scale() {
    let limits = PlaceLimits::from(&group().map);
    for scale in [1e-3, 1.0, 4e5] {
        let mean =
            wall(|row, column| scale * limits.mean[row * RAY_COLUMNS + column].unwrap_or(1.0));
        let found = figures(&mean, &limits).unwrap();
        assert!(found.z.iter().flatten().all(|z| z.abs() < 1e-6));
        assert_eq!(
            (
                found.extent_percent,
                found.deficit_percent,
                found.summed_score()
            ),
            (0.0, 0.0, 0)
        );
        assert_eq!(found.severity, None);
        assert!((found.scale / scale - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_scan_multiplied_has_the_same_figures() {
    let limits = PlaceLimits::from(&group().map);
    let scan = person(77).places;
    let dark = |factor: f64| ScanPlaces {
        uptake: (scan.uptake.iter().zip(&scan.segment))
            .map(|(uptake, segment)| {
                uptake.map(|uptake| {
                    factor * uptake * if [4, 10].contains(segment) { 0.5 } else { 1.0 }
                })
            })
            .collect(),
        ..scan.clone()
    };
    let [one, other] = [1.0, 1000.0].map(|factor| figures(&dark(factor), &limits).unwrap());
    assert!(one.deficit_percent > 1.0);
    assert!((one.deficit_percent - other.deficit_percent).abs() < 1e-9);
    assert!((one.extent_percent - other.extent_percent).abs() < 1e-9);
    assert_eq!(one.summed_score(), other.summed_score());
}

/// The score, extent and severity of a defect of known depth, by the formulas written out again.
#[test]
fn a_defect_of_known_depth_has_the_score_of_the_formula() {
    let limits = still_limits();
    for depth in [0.2, 0.45, 0.69, 0.9] {
        let scan = wall(|row, column| {
            let index = row * RAY_COLUMNS + column;
            limits.mean[index].unwrap_or(1.0)
                * if wall(even).segment[index] == 10 {
                    1.0 - depth
                } else {
                    1.0
                }
        });
        let found = figures(&scan, &limits).unwrap();
        let (mut area, mut dark, mut score, mut low, mut severity) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for index in 0..PLACE_COUNT {
            let (Some(mean), Some(sd)) = (limits.mean[index], limits.sd[index]) else {
                continue;
            };
            area += scan.area[index];
            if scan.segment[index] != 10 {
                continue;
            }
            let limit = 2.5 * sd / mean;
            let own = if depth > limit {
                4.0 * ((depth - limit) / (0.7 - limit)).min(1.0)
            } else {
                0.0
            };
            dark += scan.area[index];
            score += own * scan.area[index];
            if depth > limit {
                low += scan.area[index];
                severity += scan.area[index] * depth * mean / sd;
            }
        }
        assert!(
            (found.deficit_percent - 100.0 * score / (4.0 * area)).abs() < 1e-6,
            "{depth}"
        );
        assert!((found.extent_percent - 100.0 * low / area).abs() < 1e-6);
        assert!((found.severity.unwrap() - severity / low).abs() < 1e-6);
        let segment = found.segments[9];
        assert_eq!(segment.score, Some((score / dark).round() as u8));
        assert_eq!(found.summed_score(), (score / dark).round() as u32);
        assert_eq!(
            found.territories[2].summed_score,
            found.summed_score(),
            "segment 10 is the RCA's"
        );
    }
}

#[test]
fn scores_run_from_the_limit_to_seventy_per_cent() {
    let sd = 0.06;
    assert_eq!(score_of(Z_LIMIT * sd, sd), 0.0);
    assert_eq!(score_of(-0.3, sd), 0.0);
    assert!((score_of(f64::midpoint(Z_LIMIT * sd, DEFICIT_OF_FULL_SCORE), sd) - 2.0).abs() < 1e-12);
    assert_eq!([0.7, 0.95].map(|deficit| score_of(deficit, sd)), [4.0, 4.0]);
    // A place that varies by more than the whole scale has a full score or none.
    assert_eq!(
        [0.74, 0.76].map(|deficit| score_of(deficit, 0.3)),
        [0.0, 4.0]
    );
}

/// Patterns in which all hearts vary are taken off; a defect as wide as a segment hardly is.
#[test]
fn the_pattern_of_a_healthy_heart_is_no_defect() {
    let limits = PlaceLimits::from(&group().map);
    let tilted = wall(|row, column| {
        even(row, column) * (1.0 - 0.07 * (2.0 * (row as f64 + 0.5) / RAY_ROWS as f64 - 1.0))
    });
    assert!(figures(&tilted, &limits).unwrap().extent_percent < 0.5);
    let still = figures(&tilted, &still_limits()).unwrap();
    assert!(
        still
            .z
            .iter()
            .flatten()
            .fold(0.0, |a: f64, z| a.max(z.abs()))
            > 1.5
    );
}

/// Most of the wall is dark: the scale stands on what is not.
#[test]
fn a_defect_of_sixty_per_cent_of_the_wall_is_still_below() {
    let limits = PlaceLimits::from(&group().map);
    let scan = wall(|row, column| even(row, column) * if column < 36 { 0.45 } else { 1.0 });
    let found = figures(&scan, &limits).unwrap();
    assert!(
        (50.0..65.0).contains(&found.extent_percent),
        "{}",
        found.extent_percent
    );
    assert!(found.matched_share < 0.5);
}

#[test]
fn masked_places_are_in_no_figure() {
    let limits = PlaceLimits::from(&group().map);
    let scan = wall(|row, column| even(row, column) * if row > 25 { 0.3 } else { 1.0 });
    let masked = ScanPlaces {
        uptake: (scan.uptake.iter().enumerate())
            .map(|(index, uptake)| uptake.filter(|_| index / RAY_COLUMNS <= 25))
            .collect(),
        ..scan.clone()
    };
    assert!(figures(&scan, &limits).unwrap().extent_percent > 5.0);
    let found = figures(&masked, &limits).unwrap();
    assert_eq!(found.extent_percent, 0.0);
    assert!(found.segments[0].compared_percent < 80.0);
}

#[test]
fn each_person_is_judged_by_the_limits_of_the_others() {
    let people = people(13);
    let (group, excluded) = group_of(&kind(), &people, &Monitor::silent()).unwrap();
    assert_eq!(excluded, []);
    for (index, judged) in group.leave_one_out.cases.iter().enumerate() {
        let others: Vec<&ScanPlaces> = (people.iter().enumerate())
            .filter(|(other, _)| *other != index)
            .map(|(_, person)| &person.places)
            .collect();
        let found = figures(
            &people[index].places,
            &limits_of(&others, &Monitor::silent()).unwrap(),
        )
        .unwrap();
        assert!((judged.extent_percent - found.extent_percent).abs() < 1e-4);
        assert!((judged.deficit_percent - found.deficit_percent).abs() < 1e-4);
    }
    let extents = group
        .leave_one_out
        .cases
        .iter()
        .map(|case| case.extent_percent);
    assert!((group.leave_one_out.mean_extent_percent - extents.sum::<f64>() / 13.0).abs() < 1e-4);
}

#[test]
fn a_heart_with_a_defect_is_left_out_of_the_limits() {
    let mut people = people(14);
    let places = &mut people[3].places;
    for (uptake, segment) in places.uptake.iter_mut().zip(&places.segment) {
        if [1, 2, 7, 8, 13].contains(segment) {
            *uptake = uptake.map(|uptake| 0.4 * uptake);
        }
    }
    let (group, excluded) = group_of(&kind(), &people, &Monitor::silent()).unwrap();
    assert_eq!(excluded.len(), 1);
    assert_eq!(excluded[0].case, "n3");
    assert!(
        excluded[0]
            .reason
            .contains("beyond the limits of the others")
    );
    assert_eq!(group.cases.len(), 13);
}

#[test]
fn figures_have_mean_deviation_and_quantiles() {
    let limit = &group().figures[0];
    assert_eq!((limit.figure.as_str(), limit.n), ("cavity_ml", 14));
    assert!((limit.mean - 86.5).abs() < 1e-9 && (limit.sd - 17.5_f64.sqrt()).abs() < 1e-4);
    assert!((limit.low - 80.325).abs() < 1e-9 && (limit.high - 92.675).abs() < 1e-9);
}

#[test]
fn fewer_than_twelve_people_make_no_group() {
    let error = group_of(&kind(), &people(8), &Monitor::silent()).unwrap_err();
    assert!(
        matches!(
            error,
            GroupError::Normals(NormalsError::TooFewCases { cases: 8, .. })
        ),
        "{error}"
    );
}

#[test]
fn threads_change_nothing() {
    let people = people(12);
    let made = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let (group, _) = pool
            .install(|| group_of(&kind(), &people, &Monitor::silent()))
            .unwrap();
        NormalLimits::new(
            "0.0.0",
            true,
            vec![group],
            Vec::new(),
            serde_json::Map::new(),
        )
        .to_json()
    };
    assert_eq!(made(1), made(3));
}

#[test]
fn a_file_is_read_as_it_was_written_and_not_if_it_was_edited() {
    let written = file();
    let text = written.to_json();
    assert_eq!(NormalLimits::from_json(text.as_bytes()).unwrap(), written);
    // JavaScript writes whole numbers without a point.
    let respelt = text
        .replace(".0,", ",")
        .replace(".0}", "}")
        .replace(".0]", "]");
    assert_ne!(respelt, text);
    NormalLimits::from_json(respelt.as_bytes()).unwrap();
    assert!(text.contains("simulated, not patients"));
    let edited = text.replacen("\"simulated\":true", "\"simulated\":false", 1);
    assert_ne!(edited, text);
    let error = NormalLimits::from_json(edited.as_bytes()).unwrap_err();
    assert!(matches!(error, NormalsError::Edited { .. }), "{error}");
    let later = text.replacen("\"schema_version\":1", "\"schema_version\":2", 1);
    let error = NormalLimits::from_json(later.as_bytes()).unwrap_err();
    assert_eq!(error, NormalsError::SchemaVersion(2));
    for no_limits in [&b"{}"[..], b"no json", b"[1]", b"\xff"] {
        assert!(matches!(
            NormalLimits::from_json(no_limits),
            Err(NormalsError::Syntax(_))
        ));
    }
}

/// Lists are read up to the length that they may have, and parameters have nothing in them: what they are parsed to
/// could have 50 times the bytes of the text.
#[test]
fn what_is_longer_than_any_limits_is_refused_before_it_is_all_read() {
    let text = file().to_json();
    let zeros = vec!["0"; 5001].join(",");
    let pairs: Vec<String> = (0..1025).map(|n| format!("\"p{n}\":0")).collect();
    for (from, to) in [
        (
            "\"excluded\":[]",
            format!("\"excluded\":[{}]", vec![r#"["",""]"#; 5001].join(",")),
        ),
        ("\"mean\":[[", format!("\"mean\":[[{zeros},")),
        (
            "\"parameters\":{}",
            format!("\"parameters\":{{{}}}", pairs.join(",")),
        ),
        ("\"parameters\":{}", "\"parameters\":{\"a\":[0]}".to_owned()),
        ("\"parameters\":{}", "\"parameters\":{\"a\":{}}".to_owned()),
    ] {
        let changed = text.replacen(from, &to, 1);
        assert_ne!(changed, text, "{from}");
        let error = NormalLimits::from_json(changed.as_bytes()).unwrap_err();
        assert!(matches!(error, NormalsError::Syntax(_)), "{from}: {error}");
    }
    // Parameters of every kind are read as they are written.
    let parameters = serde_json::json!({"a": null, "b": true, "c": -1, "d": 2, "e": 0.5, "f": "x"});
    let parameters = parameters.as_object().unwrap().clone();
    let written = NormalLimits::new("0.0.0", true, vec![group()], Vec::new(), parameters);
    let read = NormalLimits::from_json(written.to_json().as_bytes());
    assert_eq!(read.unwrap(), written);
}

/// The SHA-256 is right, and the content is not usable all the same.
#[test]
fn limits_that_no_cohort_can_have_are_refused() {
    let with = |change: &dyn Fn(&mut NormalGroup)| {
        let mut group = group();
        change(&mut group);
        let file = NormalLimits::new(
            "0.0.0",
            true,
            vec![group],
            Vec::new(),
            serde_json::Map::new(),
        );
        NormalLimits::from_json(file.to_json().as_bytes()).unwrap_err()
    };
    let few = with(&|group| group.cases.truncate(8));
    assert!(
        matches!(few, NormalsError::TooFewCases { cases: 8, .. }),
        "{few}"
    );
    for error in [
        with(&|group| group.map.mean.truncate(31)),
        with(&|group| group.map.sd[4][7] = Some(0.0)),
        with(&|group| group.map.mean[4][7] = Some(-1.0)),
        with(&|group| group.map.pattern_covariance[2][2] = -1.0),
    ] {
        assert!(matches!(error, NormalsError::Field { .. }), "{error}");
    }
}

#[test]
fn only_the_group_of_the_scans_kind_is_used() {
    let limits = file();
    let kind = ScanKind {
        sex: Some(Sex::M),
        protocol: Some("Rest".to_owned()),
        tracer: None,
        attenuation_corrected: Some(false),
    };
    assert!(limits.group(&kind).is_ok());
    let others = [
        ScanKind {
            sex: Some(Sex::F),
            ..kind.clone()
        },
        ScanKind {
            protocol: Some("stress".to_owned()),
            ..kind.clone()
        },
        ScanKind {
            tracer: Some("Tl-201".to_owned()),
            ..kind.clone()
        },
        ScanKind {
            attenuation_corrected: Some(true),
            ..kind.clone()
        },
    ];
    for other in others {
        let error = limits.group(&other).unwrap_err();
        assert!(matches!(error, NormalsError::OtherKind { .. }), "{error}");
        assert!(error.to_string().contains("14 cases"), "{error}");
    }
    let mut women = group();
    women.sex = GroupSex::F;
    let both = NormalLimits::new(
        "0.0.0",
        true,
        vec![group(), women],
        Vec::new(),
        serde_json::Map::new(),
    );
    let unknown = ScanKind { sex: None, ..kind };
    assert!(matches!(
        both.group(&unknown),
        Err(NormalsError::Ambiguous { .. })
    ));
}
