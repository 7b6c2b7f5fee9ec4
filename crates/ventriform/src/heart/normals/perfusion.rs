//! A scan's map against the limits of its group.

use super::document::{NormalGroup, NormalLimits};
use super::error::NormalsError;
use super::flags::NormalsFlag;
use super::kind::{GroupSex, ScanKind};
use super::matching::matched_places;
use super::pattern::Coefficients;
use super::place_limits::{PlaceLimits, ScanPlaces};
use super::sizes::FEW_CASES;
use crate::base::numeric::decimals::round;
use crate::heart::polar::{ARTERY_NAMES, PolarMap, segments_of};
use serde::{Deserialize, Serialize};

/// Standard deviations below the mean at which the limit lies.
pub const Z_LIMIT: f64 = 2.5;
/// Share below the normal mean at which a place has the full score.
pub const DEFICIT_OF_FULL_SCORE: f64 = 0.7;
/// Greatest score of a place and of a segment.
const FULL_SCORE: f64 = 4.0;
/// Greatest sum of the segments' scores.
const FULL_SUMMED_SCORE: f64 = 68.0;
/// Share of the wall that must be comparable, per cent.
const LEAST_COMPARED_PERCENT: f64 = 50.0;
/// Share of the basal segments without comparison above which a scan is flagged, per cent.
const FLAGGED_BASE_PERCENT: f64 = 60.0;
/// Share of the wall that sets the scale below which a scan is flagged.
const FLAGGED_MATCHED_SHARE: f64 = 0.4;

/// A scan beside the limits of its group.
#[derive(Debug, Clone, PartialEq)]
pub struct Perfusion {
    /// The group that the scan was compared with.
    pub group: NormalsUsed,
    /// The counts that a normal mean of 1 has in this scan.
    pub scale: f64,
    /// Standard deviations from the normal mean at every place, row by row from apex to base; `None` where nothing
    /// can be compared.
    pub z: Vec<Option<f64>>,
    /// Score of every place, 0 to 4.
    pub scores: Vec<Option<f64>>,
    /// Share of the compared wall below the limit, per cent.
    pub extent_percent: f64,
    /// Mean of |z| below the limit; `None` where nothing is.
    pub severity: Option<f64>,
    /// Mean score of the compared wall, per cent of the full score.
    pub deficit_percent: f64,
    /// Sum of the segments' scores.
    pub summed_score: u32,
    /// The same in per cent of the greatest.
    pub summed_percent: f64,
    /// The segments 1 to 17.
    pub segments: [SegmentPerfusion; 17],
    /// The territories LAD, LCX and RCA.
    pub territories: [TerritoryPerfusion; 3],
    /// The heart's figures that have limits.
    pub figures: Vec<FigureBeside>,
    /// Reasons to look closer.
    pub flags: Vec<NormalsFlag>,
    /// The compared places.
    wall: ScoredWall,
}

/// The group of normal limits that a scan was compared with.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalsUsed {
    /// SHA-256 of the limits, hexadecimal.
    pub sha256: String,
    /// Version of the program that built them.
    pub program_version: String,
    /// Whether the people are simulated.
    pub simulated: bool,
    /// What the people are.
    pub people: String,
    /// `M`, `F` or `mixed`.
    pub sex: GroupSex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// Number of people.
    pub cases: usize,
}

/// A segment against the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentPerfusion {
    /// 1 to 17.
    pub segment: usize,
    /// Area-weighted mean of z; `None` where nothing can be compared.
    pub z: Option<f64>,
    /// Score, 0 to 4.
    pub score: Option<u8>,
    /// Share of the compared wall below the limit, per cent.
    pub extent_percent: f64,
    /// Mean score of the compared wall, per cent of the full score.
    pub deficit_percent: f64,
    /// Share of its area that can be compared, per cent.
    pub compared_percent: f64,
}

/// The wall of an artery against the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TerritoryPerfusion {
    /// LAD, LCX or RCA.
    pub name: &'static str,
    /// Share of the compared wall below the limit, per cent.
    pub extent_percent: f64,
    /// Mean score of the compared wall, per cent of the full score.
    pub deficit_percent: f64,
    /// Sum of its segments' scores.
    pub summed_score: u32,
}

/// A figure of the whole heart or of a segment, which may have limits.
#[derive(Debug, Clone, PartialEq)]
pub struct HeartFigure {
    /// Its name, with its unit.
    pub figure: &'static str,
    /// The segment, 1 to 17; `None` for the whole heart.
    pub segment: Option<usize>,
    /// Its value.
    pub value: f64,
}

impl HeartFigure {
    /// Of the whole heart.
    pub fn whole(figure: &'static str, value: f64) -> Self {
        Self {
            figure,
            segment: None,
            value,
        }
    }

    /// Of a segment, 1 to 17.
    pub fn of_segment(figure: &'static str, segment: usize, value: f64) -> Self {
        Self {
            figure,
            segment: Some(segment),
            value,
        }
    }
}

/// A figure beside its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FigureBeside {
    /// Its name in the limits, with its unit.
    pub figure: String,
    /// The segment, 1 to 17; null for the whole heart.
    pub segment: Option<usize>,
    /// This scan's.
    pub value: f64,
    /// Standard deviations from the normal mean; null where people do not differ.
    pub z: Option<f64>,
    /// Whether it lies between `low` and `high`.
    pub within: bool,
    /// Number of people.
    pub n: usize,
    /// Normal mean.
    pub mean: f64,
    /// Normal standard deviation.
    pub sd: f64,
    /// Quantile of 2.5 per cent.
    pub low: f64,
    /// Quantile of 97.5 per cent.
    pub high: f64,
}

impl FigureBeside {
    /// The same with its numbers rounded, as reports have them.
    #[must_use]
    pub fn rounded(&self) -> Self {
        Self {
            value: round(self.value),
            z: self.z.map(round),
            mean: round(self.mean),
            sd: round(self.sd),
            low: round(self.low),
            high: round(self.high),
            ..self.clone()
        }
    }
}

/// Sums over places.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    area: f64,
    z: f64,
    score: f64,
    low: f64,
    severity: f64,
}

impl Sums {
    fn extent_percent(&self) -> f64 {
        percent(self.low, self.area)
    }

    fn deficit_percent(&self) -> f64 {
        percent(self.score, FULL_SCORE * self.area)
    }

    fn add(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            z: self.z + other.z,
            score: self.score + other.score,
            low: self.low + other.low,
            severity: self.severity + other.severity,
        }
    }
}

fn percent(part: f64, whole: f64) -> f64 {
    if whole > 0.0 {
        100.0 * part / whole
    } else {
        0.0
    }
}

/// Figures of a scan against limits, without the group's facts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Figures {
    pub scale: f64,
    pub pattern: Coefficients,
    pub matched_share: f64,
    pub compared_percent: f64,
    pub z: Vec<Option<f64>>,
    pub scores: Vec<Option<f64>>,
    pub extent_percent: f64,
    pub severity: Option<f64>,
    pub deficit_percent: f64,
    pub segments: [SegmentPerfusion; 17],
    pub territories: [TerritoryPerfusion; 3],
    pub wall: ScoredWall,
}

impl Figures {
    pub fn summed_score(&self) -> u32 {
        self.segments
            .iter()
            .filter_map(|segment| segment.score)
            .map(u32::from)
            .sum()
    }
}

/// A sum of the segments' scores in per cent of the greatest.
pub fn summed_percent(score: u32) -> f64 {
    100.0 * f64::from(score) / FULL_SUMMED_SCORE
}

/// The score of a place: 0 at the limit, 4 at [`DEFICIT_OF_FULL_SCORE`] below the mean. `relative_sd` is the standard
/// deviation as a share of the mean.
pub fn score_of(deficit: f64, relative_sd: f64) -> f64 {
    let limit = Z_LIMIT * relative_sd;
    if deficit <= limit {
        return 0.0;
    }
    let way = DEFICIT_OF_FULL_SCORE - limit;
    if way > 0.0 {
        FULL_SCORE * ((deficit - limit) / way).clamp(0.0, 1.0)
    } else {
        FULL_SCORE
    }
}

/// The figures of a scan; `None` if nothing can be compared.
pub(super) fn figures(scan: &ScanPlaces, limits: &PlaceLimits) -> Option<Figures> {
    let places = limits.compared(scan);
    let scale = matched_places(&places, &limits.precision())?;
    let scored = places.iter().map(|place| ScoredPlace {
        index: place.index,
        segment: scan.segment[place.index],
        area: place.area,
        uptake: place.uptake / scale.counts,
        expected: scale.expected(place),
        sd: place.sd,
    });
    let mut areas = [0.0; 17];
    for (segment, area) in scan.segment.iter().zip(&scan.area) {
        areas[segment - 1] += area;
    }
    let wall = ScoredWall {
        places: scored.collect(),
        areas,
    };
    let tally = wall.tally(|_| 0.0);
    let mut z = vec![None; scan.uptake.len()];
    let mut scores = z.clone();
    for place in &wall.places {
        z[place.index] = Some(place.z(0.0));
        scores[place.index] = Some(place.score(0.0));
    }
    let all = tally.all();
    Some(Figures {
        scale: scale.counts,
        pattern: scale.pattern,
        matched_share: scale.share,
        compared_percent: percent(all.area, areas.iter().sum()),
        z,
        scores,
        extent_percent: all.extent_percent(),
        severity: (all.low > 0.0).then(|| all.severity / all.low),
        deficit_percent: all.deficit_percent(),
        segments: tally.segments(&areas),
        territories: tally.territories(),
        wall,
    })
}

/// A place of a scan beside its normal mean. Uptake is in units of a normal mean of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ScoredPlace {
    index: usize,
    /// 1 to 17.
    segment: usize,
    area: f64,
    uptake: f64,
    expected: f64,
    sd: f64,
}

impl ScoredPlace {
    /// Standard deviations from the normal mean, with `more` uptake.
    fn z(&self, more: f64) -> f64 {
        (self.uptake + more - self.expected) / self.sd
    }

    fn score(&self, more: f64) -> f64 {
        let deficit = 1.0 - (self.uptake + more) / self.expected;
        score_of(deficit, self.sd / self.expected)
    }
}

/// The compared places of a scan, and the areas of its segments.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ScoredWall {
    places: Vec<ScoredPlace>,
    areas: [f64; 17],
}

impl ScoredWall {
    /// The sums over the segments with `more` uptake at each place.
    fn tally(&self, more: impl Fn(usize) -> f64) -> Tally {
        let mut of_segment = [Sums::default(); 17];
        for place in &self.places {
            let more = more(place.index);
            let z = place.z(more);
            let low = if z < -Z_LIMIT { place.area } else { 0.0 };
            let sums = &mut of_segment[place.segment - 1];
            *sums = sums.add(Sums {
                area: place.area,
                z: place.area * z,
                score: place.area * place.score(more),
                low,
                severity: low * z.abs(),
            });
        }
        Tally(of_segment)
    }
}

/// Sums over the places of each segment.
struct Tally([Sums; 17]);

impl Tally {
    fn all(&self) -> Sums {
        self.0.into_iter().fold(Sums::default(), Sums::add)
    }

    fn score(&self, segment: usize) -> Option<u8> {
        let sums = self.0[segment - 1];
        let mean = sums.score / sums.area;
        (sums.area > 0.0).then(|| mean.round().clamp(0.0, FULL_SCORE) as u8)
    }

    fn segments(&self, areas: &[f64; 17]) -> [SegmentPerfusion; 17] {
        std::array::from_fn(|index| {
            let sums = self.0[index];
            SegmentPerfusion {
                segment: index + 1,
                z: (sums.area > 0.0).then(|| sums.z / sums.area),
                score: self.score(index + 1),
                extent_percent: sums.extent_percent(),
                deficit_percent: sums.deficit_percent(),
                compared_percent: percent(sums.area, areas[index]),
            }
        })
    }

    fn territories(&self) -> [TerritoryPerfusion; 3] {
        ARTERY_NAMES.map(|name| {
            let own = segments_of(name).map(|segment| self.0[segment - 1]);
            let sums = own.fold(Sums::default(), Sums::add);
            let scores = segments_of(name).filter_map(|segment| self.score(segment));
            TerritoryPerfusion {
                name,
                extent_percent: sums.extent_percent(),
                deficit_percent: sums.deficit_percent(),
                summed_score: scores.map(u32::from).sum(),
            }
        })
    }
}

/// Scores of a scan whose uptake was changed by noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoisyScores {
    /// Share of the compared wall below the limit, per cent.
    pub extent_percent: f64,
    /// Mean score of the compared wall, per cent of the full score.
    pub deficit_percent: f64,
    /// The segments' scores, 0 to 4.
    pub segments: [Option<u8>; 17],
}

impl NoisyScores {
    /// Sum of the segments' scores.
    pub fn summed_score(&self) -> u32 {
        self.segments.iter().flatten().copied().map(u32::from).sum()
    }

    /// What the segments' scores exceed those of `rest` by, summed.
    pub fn more_than(&self, rest: &Self) -> u32 {
        let pairs = self.segments.iter().zip(rest.segments);
        let more = pairs.filter_map(|(own, rest)| Some((*own)?.saturating_sub(rest?)));
        more.map(u32::from).sum()
    }
}

impl Perfusion {
    /// The scores with `noise` at every place of the map, image units, on the same scale.
    pub fn with_noise(&self, noise: impl Fn(usize) -> f64) -> NoisyScores {
        let tally = self.wall.tally(|index| noise(index) / self.scale);
        let all = tally.all();
        NoisyScores {
            extent_percent: all.extent_percent(),
            deficit_percent: all.deficit_percent(),
            segments: std::array::from_fn(|index| tally.score(index + 1)),
        }
    }
}

/// `map` and the `heart`'s figures against the group of `limits` for a scan of this kind.
///
/// # Errors
/// [`NormalsError`]: there is no such group, or too little wall can be compared.
pub fn apply(
    map: &PolarMap,
    heart: &[HeartFigure],
    kind: &ScanKind,
    limits: &NormalLimits,
) -> Result<Perfusion, NormalsError> {
    let group = limits.group(kind)?;
    if !map.is_oriented() {
        return Err(NormalsError::Unoriented);
    }
    let found = figures(&ScanPlaces::from_map(map), &PlaceLimits::from(&group.map))
        .ok_or(NormalsError::TooLittleWall { percent: 0.0 })?;
    let percent = found.compared_percent;
    if percent < LEAST_COMPARED_PERCENT {
        return Err(NormalsError::TooLittleWall { percent });
    }
    let summed_score = found.summed_score();
    Ok(Perfusion {
        flags: flags(&found, kind, limits, group),
        group: NormalsUsed {
            sha256: limits.sha256.clone(),
            program_version: limits.program_version.clone(),
            simulated: limits.simulated,
            people: limits.people.clone(),
            sex: group.sex,
            protocol: group.protocol.clone(),
            tracer: group.tracer.clone(),
            attenuation_corrected: group.attenuation_corrected,
            cases: group.cases.len(),
        },
        scale: found.scale,
        extent_percent: found.extent_percent,
        severity: found.severity,
        deficit_percent: found.deficit_percent,
        summed_score,
        summed_percent: summed_percent(summed_score),
        segments: found.segments,
        territories: found.territories,
        figures: heart
            .iter()
            .filter_map(|figure| group.beside(figure))
            .collect(),
        z: found.z,
        scores: found.scores,
        wall: found.wall,
    })
}

fn flags(
    found: &Figures,
    kind: &ScanKind,
    limits: &NormalLimits,
    group: &NormalGroup,
) -> Vec<NormalsFlag> {
    let cases = group.cases.len();
    let unknown = [
        ("sex", kind.sex.is_none()),
        ("protocol", kind.protocol.is_none()),
        ("tracer", kind.tracer.is_none()),
        (
            "attenuation_corrected",
            kind.attenuation_corrected.is_none(),
        ),
    ];
    let fields: Vec<&'static str> = (unknown.iter())
        .filter(|(_, is)| *is)
        .map(|(name, _)| *name)
        .collect();
    let basal = found.segments[..6]
        .iter()
        .map(|segment| segment.compared_percent);
    let missing = 100.0 - basal.sum::<f64>() / 6.0;
    let raised = [
        limits.simulated.then_some(NormalsFlag::Simulated),
        (cases < FEW_CASES).then_some(NormalsFlag::FewCases { cases }),
        (group.sex == GroupSex::Mixed).then_some(NormalsFlag::MixedSex),
        (!fields.is_empty()).then_some(NormalsFlag::KindNotStated { fields }),
        (limits.program_version != env!("CARGO_PKG_VERSION")).then(|| NormalsFlag::OtherVersion {
            built: limits.program_version.clone(),
        }),
        (missing > FLAGGED_BASE_PERCENT).then_some(NormalsFlag::MaskedBase { percent: missing }),
        (found.matched_share < FLAGGED_MATCHED_SHARE).then_some(NormalsFlag::FewMatched {
            percent: 100.0 * found.matched_share,
        }),
    ];
    raised.into_iter().flatten().collect()
}

impl NormalGroup {
    /// A figure beside its limits; `None` without any.
    fn beside(&self, own: &HeartFigure) -> Option<FigureBeside> {
        let limit = (self.figures.iter())
            .find(|limit| limit.figure == own.figure && limit.segment == own.segment)?;
        Some(FigureBeside {
            figure: limit.figure.clone(),
            segment: limit.segment,
            value: own.value,
            z: (limit.sd > 0.0).then(|| (own.value - limit.mean) / limit.sd),
            within: (limit.low..=limit.high).contains(&own.value),
            n: limit.n,
            mean: limit.mean,
            sd: limit.sd,
            low: limit.low,
            high: limit.high,
        })
    }
}
