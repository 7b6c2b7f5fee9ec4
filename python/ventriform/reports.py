"""The reports as classes, one for each document of the service's OpenAPI description.

Written by scripts/release/python_types.py from openapi/ventriform.json: change that, not this. Lengths are millimetres,
volumes millilitres, angles degrees, as the names' endings say. Positions are LPS.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ._documents import Document, register


@dataclass(frozen=True, kw_only=True, repr=False)
class Agreement(Document):
    """A mask against an expert's."""

    _built: ClassVar[dict[str, str]] = {}

    contour_distance_mm: float | None = None
    """The same in mm."""
    contour_distance_voxels: float | None = None
    """Mean contour distance, voxels."""
    dice: float
    """Dice index."""
    expert_volume_ml: float
    """Volume of the expert's mask."""
    hausdorff95_mm: float | None = None
    """Its 95th percentile."""
    hausdorff_mm: float | None = None
    """Hausdorff distance."""
    jaccard: float
    """Jaccard index."""
    volume_difference_ml: float
    """How much larger the mask is, ml."""
    volume_difference_percent: float | None = None
    """How much larger the mask is, percent."""
    volume_ml: float
    """Volume of the mask."""


@dataclass(frozen=True, kw_only=True, repr=False)
class AppliedReader(Document):
    """The reader's profile that a wall was drawn by."""

    _built: ClassVar[dict[str, str]] = {"offsets_mm": "ReaderOffsets"}

    edge: str
    """The wall that was drawn from."""
    kind: str
    """`edge`: by distances from the edge that the image shows. `level`: where the image has a share of the polar map's
    reference."""
    level: float | None = None
    """The level, a share of the polar map's reference; `null` for a reader of kind `edge`."""
    masks: int
    """Number of masks that it was learnt on."""
    name: str
    """Its name."""
    offsets_mm: ReaderOffsets | None = None
    """The distances, mm; `null` for a reader of kind `level`."""
    sha256: str
    """SHA-256 of the profile, hexadecimal."""
    share_applied: float
    """Share of the movement that was applied: 1 unless the surface would intersect itself."""


@dataclass(frozen=True, kw_only=True, repr=False)
class BeatChange(Document):
    """What changed of the beat from rest to stress."""

    _built: ClassVar[dict[str, str]] = {}

    edv_change_interval_ml: list[float] | None = None
    """Its interval."""
    edv_change_ml: float | None = None
    """Change of the end-diastolic volume from rest to stress."""
    edv_change_verdict: str | None = None
    """Whether it changed."""
    ef_change_interval_points: list[float] | None = None
    """Its interval."""
    ef_change_points: float | None = None
    """Change from rest to stress, points."""
    ef_change_verdict: str | None = None
    """Whether it changed."""
    esv_change_interval_ml: list[float] | None = None
    """Its interval."""
    esv_change_ml: float | None = None
    """Change of the end-systolic volume."""
    esv_change_verdict: str | None = None
    """Whether it changed."""
    rest_edv_ml: float
    """End-diastolic volume at rest."""
    rest_ef_percent: float | None = None
    """Ejection fraction at rest."""
    rest_esv_ml: float
    """End-systolic volume at rest."""
    stress_edv_ml: float
    """End-diastolic volume at stress, ml."""
    stress_ef_percent: float | None = None
    """Ejection fraction at stress, per cent; `null` if the gates are no beat."""
    stress_esv_ml: float
    """End-systolic volume at stress."""


@dataclass(frozen=True, kw_only=True, repr=False)
class BeatReport(Document):
    """The report of a beat. Volumes are millilitres, lengths millimetres, angles degrees of the cycle."""

    _built: ClassVar[dict[str, str]] = {"curve": "CurvePoint[]", "flags": "Flag[]", "gates": "GateReport[]", "input": "FileFacts", "long_axis": "LongAxis", "perfusion": "Perfusion", "phase": "PhaseReport", "posture": "Posture", "rates": "RatesReport", "resolution_mm": "Resolution", "segments": "SegmentMotionReport[]", "timing": "TimingReport"}

    confidence: float
    """Confidence of the fit to the gates' sum, 0..=1."""
    curve: list[CurvePoint]
    """The volume curve, gates' width taken off, at equal steps from the beginning of the first gate."""
    edv_interval_ml: list[float] | None = None
    """Interval about EDV that holds the true volume of nine of ten hearts; `null` if the gates are no beat."""
    edv_ml: float
    """End-diastolic volume: the largest of the curve."""
    ef_interval_percent: list[float] | None = None
    """The same about EF; `null` if there is none."""
    ef_of_gates_percent: float | None = None
    """Ejection fraction of the largest and the smallest gate, per cent: a gate is a mean over its width."""
    ef_percent: float | None = None
    """Ejection fraction, per cent; `null` if the gates are no beat (flag `no_contraction`)."""
    end_diastole_degrees: float
    """When the curve is largest, degrees."""
    end_diastole_gate: int
    """The gate with the largest cavity."""
    end_systole_degrees: float
    """When the curve is smallest, degrees."""
    end_systole_gate: int
    """The gate with the smallest cavity."""
    esv_interval_ml: list[float] | None = None
    """The same about ESV."""
    esv_ml: float
    """End-systolic volume: the smallest of the curve."""
    flags: list[Flag]
    """Reasons to look closer: of the fit to the gates' sum, of what the file and the caller say, then of the beat."""
    gates: list[GateReport]
    """Each gate, in the mean over its width."""
    impression: list[str] | None = None
    """Sentences that a reader may take over into the impression; `null` where the report was made before they existed."""
    input: FileFacts
    """The file of the gates."""
    long_axis: LongAxis | None = None
    """The long axis of the summed image's wall."""
    mass_g: float
    """Its mass, grams, at the density of muscle, 1.05 g/ml."""
    no_rates: str | None = None
    """Why there are no rates."""
    parameters: dict[str, Any]
    """Every parameter, defaults written out."""
    perfusion: Perfusion | None = None
    """Uptake and beat beside normal limits, if some were given."""
    phase: PhaseReport
    """Phases of the wall."""
    posture: Posture | None = None
    """Which way is up in the patient, by which the sides of the wall are named."""
    rates: RatesReport | None = None
    """How fast the ventricle empties and fills; `null` with `no_rates` as the reason."""
    resolution_mm: Resolution | None = None
    """Full width at half maximum of a point in the gates."""
    rr_ms: float | None = None
    """The R-R interval, ms, as given or stated by the file."""
    segments: list[SegmentMotionReport]
    """The wall's segments (AHA)."""
    steps: int
    """Steps of the joint fit."""
    sv_ml: float | None = None
    """Stroke volume; `null` if the gates are no beat."""
    template: str
    """The model that was fitted to the gates' sum."""
    timing: TimingReport
    """What the file says of the beats."""
    wall_ml: float
    """Muscle of the wall in the mean of the beat."""
    wall_swing_percent: float
    """Its greatest change over the beat, per cent."""
    warnings: list[str]
    """Warnings about the files."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Candidate(Document):
    """One model's fit."""

    _built: ClassVar[dict[str, str]] = {}

    active: float
    """Share of the surface along which an edge is seen."""
    confidence: float
    """Its confidence by its own figures, by which templates are ranked."""
    merit: float
    """Figure that decides between equals."""
    residual_mm: float
    """Distance to the edges, weighted root mean square."""
    strain: float
    """Root of the mean squared strain."""
    template: str
    """The model's name."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparedScan(Document):
    """One of both scans."""

    _built: ClassVar[dict[str, str]] = {"input": "FileFacts", "long_axis": "LongAxis", "perfusion": "Perfusion", "polar": "PolarSummary", "posture": "Posture", "resolution_mm": "Resolution"}

    attenuation_corrected: bool | None = None
    """Whether attenuation was corrected; `null` where the header does not say."""
    cavity_ml: float
    """Volume of the cavity of the anatomical wall."""
    confidence: float
    """Confidence of the fit, 0..=1."""
    deficit_interval_percent: list[float] | None = None
    """The interval of the deficit score."""
    deficit_verdict: str | None = None
    """Whether it is 5 per cent or more."""
    extent_interval_percent: list[float] | None = None
    """The interval of the share below the limit by noise, 5th and 95th percentile; `null` unless both scans have
    limits, as for the others."""
    extent_verdict: str | None = None
    """Whether a twentieth of the wall or more is below the limit."""
    injected_dose: str | None = None
    """Total dose by the header, MBq."""
    input: FileFacts
    """The file."""
    long_axis: LongAxis | None = None
    """The ventricle's long axis."""
    muscle_ml: float
    """Volume of the anatomical wall's muscle."""
    perfusion: Perfusion | None = None
    """The wall's uptake beside normal limits, if some were given."""
    polar: PolarSummary | None = None
    """Uptake of the wall, by its own reference."""
    posture: Posture | None = None
    """Which way is up in the patient."""
    radiopharmaceutical: str | None = None
    """The tracer, if the header names one."""
    resolution_mm: Resolution | None = None
    """Full width at half maximum of the image's point response."""
    series_description: str | None = None
    """Series Description, if the header has one."""
    template: str
    """The model that was fitted."""
    warnings: list[str]
    """Warnings about the file."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparedSegment(Document):
    """A segment at stress and at rest."""

    _built: ClassVar[dict[str, str]] = {}

    difference_points: float | None = None
    """Rest less stress, points: positive where stress lacks uptake."""
    fixed_percent: float
    """Share of its compared area that is fixed."""
    rest_percent: float | None = None
    """At rest."""
    reversible_percent: float
    """Share of its compared area that is reversible."""
    stress_percent: float | None = None
    """At stress, scaled to rest; `null` where nothing can be compared, as for the others."""
    motion_change_interval_mm: list[float] | None = None
    """Interval of that change: in nine of ten pairs such intervals hold all 17 changes together."""
    motion_change_mm: float | None = None
    """Change of motion from rest to stress, mm; `null` unless both scans are gated."""
    motion_change_verdict: str | None = None
    """Whether the motion changed."""
    name: str
    """Its name."""
    rest_score: int | None = None
    """Score at rest."""
    segment: int
    """Its number, 1 to 17."""
    stress_score: int | None = None
    """Score at stress, 0 to 4."""
    thickening_change_interval_points: list[float] | None = None
    """Its interval, likewise."""
    thickening_change_points: float | None = None
    """Change of thickening from rest to stress, points."""
    thickening_change_verdict: str | None = None
    """Whether the thickening changed."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparedTerritory(Document):
    """The wall of an artery at stress and at rest."""

    _built: ClassVar[dict[str, str]] = {}

    difference_points: float | None = None
    """Rest less stress, points: positive where stress lacks uptake."""
    fixed_percent: float
    """Share of its compared area that is fixed."""
    rest_percent: float | None = None
    """At rest."""
    reversible_percent: float
    """Share of its compared area that is reversible."""
    stress_percent: float | None = None
    """At stress, scaled to rest; `null` where nothing can be compared, as for the others."""
    name: str
    """LAD, LCX or RCA."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparisonReport(Document):
    """The report of a comparison of rest and stress. Intervals, verdicts and what is known of the noise are `null`
    where it was made before they existed."""

    _built: ClassVar[dict[str, str]] = {"beat": "BeatChange", "flags": "Flag[]", "no_beat": "NoBeat[]", "rest": "ComparedScan", "segments": "ComparedSegment[]", "stress": "ComparedScan", "territories": "ComparedTerritory[]"}

    beat: BeatChange | None = None
    """What changed of the beat; `null` unless both scans are gated."""
    compared_percent: float
    """Share of the wall with muscle in both scans."""
    correlation: float
    """Correlation of both maps."""
    detectable_percent: float | None = None
    """The least loss, per cent of the uptake at rest, that is found in nine of ten such pairs if it takes up a
    territory."""
    fixed_interval_percent: list[float] | None = None
    """Its interval."""
    fixed_percent: float
    """Share of the wall below the threshold in both scans."""
    fixed_verdict: str | None = None
    """Whether there is such wall."""
    flags: list[Flag]
    """Reasons to look closer."""
    impression: list[str] | None = None
    """Sentences that a reader may take over into the impression; `null` where the report was made before they existed."""
    lost_percent: float | None = None
    """What stress lacks in the regions that lose uptake, per cent of the whole wall's uptake at rest."""
    matched_percent: float
    """Share of the wall by which stress was scaled."""
    no_beat: list[NoBeat]
    """Why no beats were compared (`beat` is `null`), or no ejection fractions (`beat.ef_change_points` is `null`): one
    entry for each scan that is a reason. Empty where they were."""
    noise_points: float | None = None
    """Standard deviation of the smoothed difference by the noise of this pair, points."""
    parameters: dict[str, Any]
    """Every parameter, defaults written out."""
    rest: ComparedScan
    """The scan at rest."""
    reverse_interval_percent: list[float] | None = None
    """Its interval."""
    reverse_percent: float | None = None
    """Share of the wall that lacks uptake at rest beside stress (reverse redistribution)."""
    reverse_verdict: str | None = None
    """Whether there is such wall."""
    reversible_interval_percent: list[float] | None = None
    """Its interval by noise: 5th and 95th percentile, as for the others."""
    reversible_percent: float
    """Share of the wall that loses uptake at stress, each region as far as half of the depth of its loss."""
    reversible_points: float
    """Loss of uptake that noise does not explain, points: a region has to lose more somewhere to count."""
    reversible_verdict: str | None = None
    """Whether wall loses uptake at stress."""
    scale: float
    """Counts of the stress scan that are one count of the rest scan where nothing changed."""
    sds: int | None = None
    """Summed difference score: what the segments' scores at stress exceed those at rest by."""
    sds_interval: list[float] | None = None
    """Its interval by noise, 5th and 95th percentile."""
    sds_verdict: str | None = None
    """Whether it is abnormal."""
    segments: list[ComparedSegment]
    """The 17 segments."""
    srs: int | None = None
    """Summed rest score."""
    srs_interval: list[float] | None = None
    """Its interval by noise, 5th and 95th percentile."""
    srs_verdict: str | None = None
    """Whether it is abnormal."""
    sss: int | None = None
    """Summed stress score, 0 to 68; `null` without normal limits, as for all scores."""
    sss_interval: list[float] | None = None
    """Its interval by noise, 5th and 95th percentile."""
    sss_verdict: str | None = None
    """Whether it is abnormal."""
    stress: ComparedScan
    """The scan at stress."""
    summed_percent: list[float] | None = None
    """The summed scores in per cent of 68, in that order."""
    territories: list[ComparedTerritory]
    """The walls of the three arteries; none if the orientation is unknown."""
    tid: float
    """Ratio of the cavities of the anatomical walls, stress to rest (transient ischaemic dilation), in the images of
    all gates."""
    tid_interval: list[float] | None = None
    """The interval of TID: that of an unchanged heart holds 1 in nine of ten pairs."""
    tid_verdict: str | None = None
    """Whether the cavity is larger at stress."""
    turn_degrees: float
    """How far the stress map is turned against the rest map, degrees."""


@dataclass(frozen=True, kw_only=True, repr=False)
class CurvePoint(Document):
    """A point of the volume curve."""

    _built: ClassVar[dict[str, str]] = {}

    cavity_ml: float
    """Volume of the cavity."""
    degrees: float
    """When."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Distance(Document):
    """Distances between a model and its surface, and what they enclose."""

    _built: ClassVar[dict[str, str]] = {"model_to_surface": "DistanceDirection", "surface_to_model": "DistanceDirection"}

    area_error_percent: float
    """Area of the model beyond that of the surface, percent of it."""
    hausdorff_at_most_mm: float | None = None
    """Upper bound of the largest distance, mm; absent for very large meshes."""
    hausdorff_mm: float
    """The largest distance of either direction (Hausdorff) that was found, mm: a lower bound."""
    hausdorff_voxels: float
    """The Hausdorff distance in the same unit."""
    hd95_mm: float
    """The larger of the two directions' 95th percentiles, mm."""
    mean_mm: float
    """Mean of the two directions' means, mm."""
    mean_voxels: float
    """The mean in units of the smallest voxel spacing."""
    model_to_surface: DistanceDirection
    """From points of the model to the surface."""
    rms_mm: float
    """Root mean square over both directions, mm."""
    surface_to_model: DistanceDirection
    """From points of the surface to the model."""
    surface_volume_ml: float
    """Volume enclosed by the surface, millilitres."""
    volume_error_percent: float
    """Volume that the model encloses beyond that of the surface, percent of it."""
    volume_ml: float
    """Volume enclosed by the model, millilitres."""
    voxel_mm: float
    """The smallest voxel spacing, mm."""


@dataclass(frozen=True, kw_only=True, repr=False)
class DistanceDirection(Document):
    """Distances of one side's points to the other side."""

    _built: ClassVar[dict[str, str]] = {}

    max_at_most_mm: float | None = None
    """Upper bound of the largest distance, mm; absent for very large meshes."""
    max_mm: float
    """Largest distance found at any point, mm."""
    mean_mm: float
    """Mean over the even samples, mm."""
    p95_mm: float
    """95th percentile over the even samples, mm."""
    rms_mm: float
    """Root mean square over the even samples, mm."""
    samples: int
    """Number of even samples."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Evidence(Document):
    """The figures behind confidence and flags."""

    _built: ClassVar[dict[str, str]] = {}

    active_sensors: float
    """Share of sensors that see an edge."""
    agreement_of_views: float | None = None
    """Mean correlation of image and wall in their projections; null where the orientation is unknown."""
    beside: float
    """Share of the wall beside which something takes up more than that."""
    cavity_ml: float
    """Volume of the cavity."""
    chance_of_motion: float
    """Chance that the patient moved, 0 to 1."""
    dark: float
    """Share of the wall that takes up less than half as much as the bright wall does."""
    displaced_share: float | None = None
    """Share of the projections that show the second place; null likewise."""
    displacement_mm: float | None = None
    """Distance of the two places along the bed; null likewise."""
    gain_of_two_places: float | None = None
    """How much better two places of the wall in two runs of projections explain the image than one, as a share of what
    one leaves unexplained; null likewise."""
    hollowness: float
    """Share of the wall's brightness that the cavity lacks, 0 to 1."""
    offset: float
    """How far the middle of the wall lies off the axis, as a share of that mean."""
    residual_mm: float
    """Distance to the edges, weighted root mean square."""
    septal_bulge: float
    """Distance of the septum from the axis over that of the free wall."""
    slenderness: float
    """Length from rim to apex over the outer radius."""
    strain: float
    """Root of the mean squared strain."""
    template_spread_mm: float | None = None
    """Mean distance of the nodes from the fits of the other built-in hearts; null without them."""
    thickness_spread_mm: float
    """Standard deviation of the wall's thickness."""
    unroundness: float
    """Standard deviation of the distance from the axis to the middle of the wall, as a share of its mean."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ExcludedCase(Document):
    """A case that is in no group."""

    _built: ClassVar[dict[str, str]] = {}

    case: str
    """The name in the table."""
    reason: str
    """Why."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FigureBeside(Document):
    """A figure beside its limits."""

    _built: ClassVar[dict[str, str]] = {}

    figure: str
    """Its name in the limits, with its unit."""
    high: float
    """Quantile of 97.5 per cent."""
    low: float
    """Quantile of 2.5 per cent."""
    mean: float
    """Normal mean."""
    n: int
    """Number of people."""
    sd: float
    """Normal standard deviation."""
    segment: int | None = None
    """The segment, 1 to 17; null for the whole heart."""
    value: float
    """This scan's."""
    within: bool
    """Whether it lies between `low` and `high`."""
    z: float | None = None
    """Standard deviations from the normal mean; null where people do not differ."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FigureChange(Document):
    """The change of a figure from an earlier to a later scan."""

    _built: ClassVar[dict[str, str]] = {}

    change: float
    """The later figure less the earlier one."""
    earlier: int
    """The earlier scan."""
    figure: str
    """The figure: its name in `scans`."""
    interval: list[float]
    """The 95 % interval of the change."""
    later: int
    """The later one."""
    least_change: float
    """The least change that nine of ten such pairs of scans would show."""
    verdict: str
    """Whether it changed."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FileFacts(Document):
    """The statements of a volume's file."""

    _built: ClassVar[dict[str, str]] = {"intensity": "IntensityFacts", "scaling": "Scaling"}

    affine_lps: list[list[float]]
    """Maps a voxel index to LPS millimetres; row by row."""
    affine_ras: list[list[float]]
    """Maps a voxel index to RAS millimetres; row by row."""
    affine_source: str
    """The part of the header that gave the affine."""
    byte_order: str
    """`little` or `big`."""
    compressed: bool
    """Whether it was gzipped."""
    data_type: str
    """Data type in the file."""
    file_shape: list[int]
    """Sizes of all dimensions in the file."""
    format: str
    """File format."""
    frame: int | None = None
    """The frame that was read, counted from 0."""
    frames: int
    """Frames in the file."""
    intensity: IntensityFacts
    """The voxel values after slope and intercept."""
    scaling: Scaling | None = None
    """How stored values become intensities, if they do not as they are."""
    shape: list[int]
    """Voxels along i, j, k."""
    spacing_mm: list[float]
    """Voxel spacing, millimetres."""
    unit: str
    """The file's unit of length."""
    warnings: list[str]
    """Oddities of the file that do not prevent its use."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Fit(Document):
    """Figures of a fit, and the fitted model's pose."""

    _built: ClassVar[dict[str, str]] = {"long_axis": "LongAxis"}

    active_sensors: float
    """Share of sensors that see an edge."""
    confidence: float
    """Chance that a reader who draws the visible edge agrees with the mask by a Jaccard index of 0.75 or more,
    calibrated on simulated scans, 0 to 1; of other organs, half the share of the surface that sees an edge."""
    displacement_mm: list[float]
    """How far each vertex moved, mm."""
    energy: list[float]
    """Kinetic energy after each step."""
    iterations: int
    """Steps of the motion."""
    long_axis: LongAxis | None = None
    """The ventricle's long axis."""
    reason: str
    """Why the motion ended."""
    residual_mm: float
    """Distance to the edges, weighted root mean square."""
    rim_uncertainty_mm: float | None = None
    """Standard deviation of the height of the ventricle's rim, mm; where anatomy and image together put it."""
    rotation: list[list[float]]
    """Rotation of the model; row by row."""
    runs: int
    """Runs from different starts."""
    scale: float
    """Size relative to the model."""
    self_intersections: int
    """Intersecting pairs of triangles."""
    size_confidence: float | None = None
    """Chance that the true cavity is within 20 % of the anatomical one, calibrated on simulated scans, 0 to 1: how
    sure the *size* is, where `confidence` says how sure the *place* of the visible edge is; ventricles only."""
    strain: float
    """Root of the mean squared strain."""
    turned_triangles: int
    """Triangles that turned over."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessFormStages(Document):
    """All forms of the fitness after each stage."""

    _built: ClassVar[dict[str, str]] = {"fitted": "FitnessForms", "optimised": "FitnessForms", "retiled": "FitnessForms"}

    fitted: FitnessForms
    """After the least-squares fit."""
    optimised: FitnessForms
    """After optimisation."""
    retiled: FitnessForms
    """After re-tiling."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessForms(Document):
    """Mean fitness in every form."""

    _built: ClassVar[dict[str, str]] = {}

    normalised: float
    """Every term in (0, 1]."""
    raw: float
    """The paper's reciprocal terms, capped."""
    robust: float
    """Angles in degrees floored at 1, distance in mm floored at 0.01, equal weights: comparable between tools."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessReport(Document):
    """The paper's fitness: mean over all edges."""

    _built: ClassVar[dict[str, str]] = {"forms": "FitnessFormStages", "scales": "FitnessScales{}", "terms": "FitnessTermStages"}

    fitted: float
    """After the least-squares fit, before the last flips."""
    form: str
    """The form in which `retiled`, `fitted` and `optimised` are given: the one that drove the flips."""
    forms: FitnessFormStages
    """All forms after each stage."""
    gain_percent: float
    """From re-tiled to optimised, percent."""
    optimised: float
    """After optimisation."""
    retiled: float
    """After re-tiling."""
    scales: dict[str, FitnessScales]
    """Numerators and floors of every form."""
    terms: FitnessTermStages
    """Mean terms after each stage."""
    weights: list[float]
    """Weights of the four terms."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessScales(Document):
    """Numerators and floors of the four terms."""

    _built: ClassVar[dict[str, str]] = {}

    floor: list[float]
    """Floors, in radians and millimetres."""
    numerator: list[float]
    """Numerators, in radians and millimetres."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessTermStages(Document):
    """Mean terms of the fitness after each stage."""

    _built: ClassVar[dict[str, str]] = {"fitted": "FitnessTerms", "optimised": "FitnessTerms", "retiled": "FitnessTerms"}

    fitted: FitnessTerms
    """After the least-squares fit."""
    optimised: FitnessTerms
    """After optimisation."""
    retiled: FitnessTerms
    """After re-tiling."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitnessTerms(Document):
    """Means of the four terms over all edges."""

    _built: ClassVar[dict[str, str]] = {}

    a_deg: float
    """Angle between the normals of the edge's triangles, degrees."""
    b_deg: float
    """Mean angle to the four outer neighbours, degrees."""
    c: float
    """R/(2r) of the two triangles, 1 = equilateral."""
    d_mm: float
    """Distance of the edge's midpoint to the surface, mm."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FittedVolumes(Document):
    """Volumes of a fitted model, millilitres."""

    _built: ClassVar[dict[str, str]] = {"anatomical": "WallVolumes", "anatomical_interval": "VolumeIntervals", "apparent": "WallVolumes"}

    anatomical: WallVolumes | None = None
    """Of the wall corrected for the blur; ventricles only."""
    anatomical_interval: VolumeIntervals | None = None
    """Of nine of ten hearts, the true volumes of the wall corrected for the blur lie within these; ventricles only."""
    apparent: WallVolumes | None = None
    """Of the wall as the blurred image shows it; ventricles only."""
    cavity: float | None = None
    """Of its cavity; ventricles only."""
    wall: float
    """Of the wall that `edge` asks for, or of the whole organ."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Flag(Document):
    """A reason to look closer."""

    _built: ClassVar[dict[str, str]] = {}

    code: str
    """Its stable name."""
    reason: str
    """The finding."""


@dataclass(frozen=True, kw_only=True, repr=False)
class GateReport(Document):
    """A gate."""

    _built: ClassVar[dict[str, str]] = {}

    cavity_ml: float
    """Volume of the cavity."""
    counts_factor: float
    """The factor that brought the gate to the usual counts of a gate."""
    frame: int
    """The volume of the input that it is, counted from 0 as the parameter `frame` is."""
    gate: int
    """Its number, from 1."""
    wall_ml: float
    """Volume of the muscle."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Gates(Document):
    """The gates of a study, and what its files say of the beats."""

    _built: ClassVar[dict[str, str]] = {}

    beats_accepted: float | None = None
    """Beats accepted."""
    beats_rejected: float | None = None
    """Beats rejected."""
    intervals: int
    """R-R intervals into which the beats were sorted by their length."""
    number: int
    """Gates of one R-R interval."""
    rr_ms: float | None = None
    """The R-R interval, ms; `null` if the files do not say, or have several: that with the most counts is taken."""


@dataclass(frozen=True, kw_only=True, repr=False)
class GlobalLimit(Document):
    """Limits of a figure of the whole heart, or of a segment."""

    _built: ClassVar[dict[str, str]] = {}

    figure: str
    """`cavity_ml`, `wall_ml`, `tid`, `ef_percent`, `edv_ml`, `esv_ml`, `phase_sd_degrees`, `phase_bandwidth_degrees`,
    `motion_mm` or `thickening_percent`."""
    high: float
    """Quantile of 97.5 per cent."""
    low: float
    """Quantile of 2.5 per cent, linear between the people."""
    mean: float
    """Mean."""
    n: int
    """Number of people."""
    sd: float
    """Standard deviation."""
    segment: int | None = None
    """The segment of motion or thickening, 1 to 17; null for the whole heart."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Histogram(Document):
    """Counts over equal bins, before and after optimisation side by side. The bin [lower, lower + width) is the first;
    the last one includes its upper end."""

    _built: ClassVar[dict[str, str]] = {}

    lower: float
    """Lower end of the first bin."""
    optimised: list[int]
    """Counts of the optimised mesh."""
    retiled: list[int]
    """Counts of the re-tiled mesh."""
    width: float
    """Width of a bin."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Histograms(Document):
    """Distributions before and after optimisation."""

    _built: ClassVar[dict[str, str]] = {"dihedral_deg": "Histogram", "edge_length_mm": "Histogram", "min_angle_deg": "Histogram", "radius_ratio": "Histogram", "valence": "Histogram"}

    dihedral_deg: Histogram
    """Angles between neighbouring triangles' normals, degrees."""
    edge_length_mm: Histogram
    """Lengths of edges, mm."""
    min_angle_deg: Histogram
    """Smallest angle of each triangle, degrees."""
    radius_ratio: Histogram
    """Radius ratios 2r/R."""
    valence: Histogram
    """Edges at each vertex."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Intensity(Document):
    """A summary of voxel values."""

    _built: ClassVar[dict[str, str]] = {}

    max: float
    """Largest finite value."""
    mean: float
    """Mean of the finite values."""
    min: float
    """Smallest finite value."""
    not_finite: int
    """Number of voxels that are NaN or infinite."""


@dataclass(frozen=True, kw_only=True, repr=False)
class IntensityFacts(Document):
    """A summary of voxel values."""

    _built: ClassVar[dict[str, str]] = {"labels": "LabelCount[]"}

    finite_voxels: int
    """Voxels with a finite value."""
    integral: bool
    """Whether all values are whole numbers."""
    labels: list[LabelCount] | None = None
    """The labels, if the volume looks like a label map."""
    maximum: float
    """Largest finite value."""
    mean: float
    """Mean of the finite values."""
    minimum: float
    """Smallest finite value."""
    missing_voxels: int
    """Voxels that are NaN or infinite."""
    sum: float
    """Sum of the finite values."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Job(Document):
    """An accepted job."""

    _built: ClassVar[dict[str, str]] = {"deliveries": "ObjectDelivery[]", "error": "Problem", "links": "JobLinks", "source": "JobSource"}

    attempts: int
    """How often a worker has started it."""
    beat: str | None = None
    """The beat it made; only for kind `beat`."""
    cancel_requested: bool
    """Whether a client has asked to cancel it."""
    comparison: str | None = None
    """The comparison it made; only for kind `comparison`."""
    created_at: str
    """When it was accepted (RFC 3339)."""
    deliveries: list[ObjectDelivery] | None = None
    """The DICOM objects of its result that are sent to an archive."""
    error: Problem | None = None
    """Why it failed."""
    estimated_start: str | None = None
    """When it will probably start (RFC 3339), estimated from past jobs. Only while it waits."""
    external_id: str | None = None
    """The caller's own id for it; not shown to the scope `read`."""
    finished_at: str | None = None
    """When it ended (RFC 3339)."""
    id: str
    """The job's id."""
    kind: str
    """The kind of work."""
    labels: dict[str, str]
    """The caller's own names and values for it; none are shown to the scope `read`."""
    links: JobLinks
    """Related paths."""
    model: str | None = None
    """The model it made; only for kind `model`."""
    normals: str | None = None
    """The normal limits it built; only for kind `normals`."""
    parameters: dict[str, Any]
    """The parameters, including every default."""
    priority: str
    """How urgent it is."""
    progress: float
    """The share of the work that is done."""
    queue_position: int | None = None
    """Place in the queue; the next job to start has 1. Only while it waits."""
    reading: str | None = None
    """The reading it wrote; only for kind `reading`."""
    revision: int
    """Grows with every change; also the id of the events."""
    segmentation: str | None = None
    """The segmentation it made; only for kind `segmentation`."""
    serial: str | None = None
    """The serial comparison it made; only for kind `serial`."""
    source: JobSource | None = None
    """The series in an archive that the volume comes from."""
    stage: str | None = None
    """The stage of the work, after the first one has begun."""
    started_at: str | None = None
    """When a worker last started it (RFC 3339)."""
    state: str
    """Its state."""
    volume: str | None = None
    """The volume it works on; `null` until it has been fetched from `source`."""


@dataclass(frozen=True, kw_only=True, repr=False)
class JobLinks(Document):
    """Paths of one job and of its results."""

    _built: ClassVar[dict[str, str]] = {}

    beat: str | None = None
    """The beat it made."""
    comparison: str | None = None
    """The comparison it made."""
    events: str
    """Its changes as server-sent events."""
    mask: str | None = None
    """The segmentation's mask."""
    mesh: str | None = None
    """The mesh of what it made."""
    model: str | None = None
    """The model it made."""
    normals: str | None = None
    """The normal limits it built."""
    reading: str | None = None
    """The reading it wrote."""
    report: str | None = None
    """The report on what it made."""
    segmentation: str | None = None
    """The segmentation it made."""
    self_: str
    """This job."""
    serial: str | None = None
    """The serial comparison it made."""
    volume: str | None = None
    """Its volume, once it is stored."""


@dataclass(frozen=True, kw_only=True, repr=False)
class JobSource(Document):
    """A series in an archive."""

    _built: ClassVar[dict[str, str]] = {}

    archive: str | None = None
    """The archive's name."""
    attempts: int
    """Number of attempts to fetch it."""
    dicomweb: str | None = None
    """Base URL of its DICOMweb service, if no archive is configured for it."""
    last_error: str | None = None
    """Why the last attempt failed."""
    next_attempt_at: str | None = None
    """When it is tried next (RFC 3339)."""
    series: str | None = None
    """Series Instance UID; `null` likewise."""
    state: str
    """`pending`, `fetched`, or `failed`."""
    study: str | None = None
    """Study Instance UID; `null` after the volume, or whose scan it is, was erased."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LabelCount(Document):
    """One label of a label map."""

    _built: ClassVar[dict[str, str]] = {}

    label: int
    """Value of the voxels."""
    voxels: int
    """Number of voxels with that value."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LeftOut(Document):
    """A person judged by the limits of the others."""

    _built: ClassVar[dict[str, str]] = {}

    case: str
    """The name in the table."""
    deficit_percent: float
    """Deficit score, per cent."""
    extent_percent: float
    """Share of the wall beyond the limit, per cent."""
    summed_score: int
    """Sum of the segments' scores."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LegalHold(Document):
    """A legal hold."""

    _built: ClassVar[dict[str, str]] = {}

    by: str
    """The name of the key that set it."""
    reason: str | None = None
    """The reason that was given; not shown to the scope `read`."""
    since: str
    """Since when (RFC 3339)."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LimitMap(Document):
    """Normal uptake at every place of the polar map: 32 rows from apex to base, 60 columns from lateral over anterior,
    septal and inferior. The area-weighted mean of `mean` over the places that have one is 1."""

    _built: ClassVar[dict[str, str]] = {}

    mean: list[list[float | None]]
    """Mean; null where too few of the people have muscle."""
    pattern_covariance: list[list[float]]
    """Covariance of the coefficients by which healthy people differ from the mean as a whole: of 2 r - 1, r cos a, r
    sin a, (2 r - 1)² - 1/3, r cos 2a, r sin 2a, with the way r from apex (0) to base (1) and the angle a from
    lateral over anterior. `sd` is what is left beside these."""
    sd: list[list[float | None]]
    """Standard deviation, the uncertainty of so small a sample's mean and deviation included."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Localisation(Document):
    """Where the organ was found."""

    _built: ClassVar[dict[str, str]] = {}

    axis: list[float]
    """Direction from base to apex."""
    centre: list[float]
    """Its centre."""
    confidence: float
    """Confidence of the search, 0 to 1."""
    correlation: float
    """Correlation with the shape sought."""
    hollowness: float
    """Hollowness, 0 to 1."""
    length_mm: float
    """Its length, mm."""
    runner_up: float | None = None
    """Correlation of the next best place."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LongAxis(Document):
    """The ends of a ventricle's long axis."""

    _built: ClassVar[dict[str, str]] = {}

    apex: list[float]
    """The apex."""
    base: list[float]
    """Centre of the base."""


@dataclass(frozen=True, kw_only=True, repr=False)
class MeshFacts(Document):
    """Counts, topology and size of a mesh."""

    _built: ClassVar[dict[str, str]] = {}

    closed: bool
    """No edge has a single triangle."""
    defect: str | None = None
    """The first defect found, in words."""
    edge_manifold: bool
    """No edge has more than two triangles."""
    oriented: bool
    """Neighbouring triangles traverse their common edge in opposite directions, so that their normals point to the
    same side."""
    outward: bool
    """The triangles face outward (the enclosed volume is positive)."""
    outward_components: int
    """Components with a positive enclosed volume. The others bound cavities of the wall, or face the wrong way."""
    vertex_manifold: bool
    """The triangles about every vertex form one cycle, and every edge has two of them."""
    area_mm2: float
    """Area, mm²."""
    components: int
    """Connected components."""
    edges: int
    """Number of edges."""
    euler_characteristic: int
    """Euler characteristic V - E + F: 2 for each component without handles. Only vertices in use count."""
    genus: int | None = None
    """Handles over all components, of a closed manifold."""
    max_mm: list[float]
    """Largest coordinates, LPS mm."""
    min_mm: list[float]
    """Smallest coordinates, LPS mm."""
    self_intersections: int
    """Pairs of triangles that meet in more than shared vertices and edges, found exactly."""
    triangles: int
    """Number of triangles."""
    vertices: int
    """Number of vertices."""
    volume_ml: float
    """Enclosed volume, millilitres."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ModelReport(Document):
    """The report of a model. Lengths are millimetres in the patient frame LPS."""

    _built: ClassVar[dict[str, str]] = {"distance": "Distance", "fitness": "FitnessReport", "histograms": "Histograms", "input": "FileFacts", "mesh": "MeshFacts", "optimise": "OptimiseReport", "retile": "RetileReport", "shape": "Shape", "smoothness": "Smoothness", "software": "Software", "surface": "SurfaceReport"}

    distance: Distance
    """The model beside the iso-surface."""
    fitness: FitnessReport
    """The paper's fitness after each stage."""
    histograms: Histograms
    """Distributions before and after optimisation."""
    input: FileFacts
    """The volume's file."""
    mesh: MeshFacts
    """The model: counts and topology."""
    optimise: OptimiseReport
    """Figures of optimisation."""
    parameters: dict[str, Any]
    """Every parameter, defaults written out."""
    retile: RetileReport
    """The mesh before optimisation."""
    shape: Shape
    """The model: shape of its triangles."""
    smoothness: Smoothness
    """The model: angles between neighbouring triangles."""
    software: Software
    """The program that made the model."""
    surface: SurfaceReport
    """The iso-surface."""
    timings_ms: dict[str, float]
    """Milliseconds of each stage and their `total`."""
    warnings: list[str]
    """Sentences about the input and the model that a user should know."""


@dataclass(frozen=True, kw_only=True, repr=False)
class MoveReport(Document):
    """One movement of the heart."""

    _built: ClassVar[dict[str, str]] = {}

    back_mm: float
    """To the back of the patient, mm."""
    from_time: int | None = None
    """Number in time of the first view after a step, from 1."""
    head_mm: float
    """Towards the head, mm."""
    kind: str
    """`step`, or `drift` over the whole scan."""
    left_mm: float
    """To the left of the patient, mm."""


@dataclass(frozen=True, kw_only=True, repr=False)
class NoBeat(Document):
    """A scan of which no beat could be compared."""

    _built: ClassVar[dict[str, str]] = {}

    code: str
    """Why."""
    reason: str
    """The same in words."""
    scan: str
    """The scan."""


@dataclass(frozen=True, kw_only=True, repr=False)
class NormalCase(Document):
    """A healthy person of a group."""

    _built: ClassVar[dict[str, str]] = {}

    case: str
    """The name in the table."""
    sex: str
    """`M` or `F`."""
    sha256: str
    """SHA-256 of the scan's file, hexadecimal."""


@dataclass(frozen=True, kw_only=True, repr=False)
class NormalGroup(Document):
    """The limits of one kind of scan."""

    _built: ClassVar[dict[str, str]] = {"cases": "NormalCase[]", "figures": "GlobalLimit[]", "leave_one_out": "Specificity", "map": "LimitMap"}

    attenuation_corrected: bool
    """Whether attenuation was corrected."""
    cases: list[NormalCase]
    """The people, in the order of the table."""
    figures: list[GlobalLimit]
    """Limits of figures of the whole heart."""
    leave_one_out: Specificity
    """The people, each judged by the limits of the others."""
    map: LimitMap
    """Mean and standard deviation of the uptake."""
    protocol: str
    """The protocol."""
    sex: str
    """`M`, `F` or `mixed`."""
    tracer: str
    """The tracer."""


@dataclass(frozen=True, kw_only=True, repr=False)
class LimitsDocument(Document):
    """Normal limits, as `ventriform normals build` writes them."""

    _built: ClassVar[dict[str, str]] = {"excluded": "ExcludedCase[]", "groups": "NormalGroup[]"}

    excluded: list[ExcludedCase]
    """Cases that are in no group."""
    format: str
    """`ventriform-normal-limits`."""
    groups: list[NormalGroup]
    """One group for each kind of scan."""
    parameters: dict[str, Any]
    """Every parameter of the fits, defaults written out."""
    people: str
    """What the people are, in words."""
    program_version: str
    """The version of the program that built the limits."""
    schema_version: int
    """1."""
    sha256: str
    """SHA-256 of everything else in this file, hexadecimal."""
    simulated: bool
    """Whether the people are simulated. Such limits are for tests, not for patients."""


@dataclass(frozen=True, kw_only=True, repr=False)
class NormalsUsed(Document):
    """The group of normal limits that a scan was compared with."""

    _built: ClassVar[dict[str, str]] = {}

    attenuation_corrected: bool
    """Whether attenuation was corrected."""
    cases: int
    """Number of people."""
    people: str
    """What the people are."""
    program_version: str
    """Version of the program that built them."""
    protocol: str
    """The protocol."""
    sex: str
    """`M`, `F` or `mixed`."""
    sha256: str
    """SHA-256 of the limits, hexadecimal."""
    simulated: bool
    """Whether the people are simulated."""
    tracer: str
    """The tracer."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ObjectDelivery(Document):
    """The delivery of a DICOM object to an archive."""

    _built: ClassVar[dict[str, str]] = {}

    attempts: int
    """Number of attempts."""
    id: str | None = None
    """Its id; absent until the job has succeeded."""
    last_attempt_at: str | None = None
    """When it was tried last (RFC 3339)."""
    last_error: str | None = None
    """Why the last attempt failed."""
    last_outcome: str | None = None
    """How it last ended: `stored`, `present` (the archive had it already), `failed`, `refused`, `erased` (here, before
    it was sent)."""
    name: str
    """The object."""
    next_attempt_at: str | None = None
    """When it is tried next (RFC 3339)."""
    state: str
    """`pending`, `delivered`, or `dead` if it was given up."""
    to: str
    """The archive."""


@dataclass(frozen=True, kw_only=True, repr=False)
class OptimiseReport(Document):
    """Figures of optimisation."""

    _built: ClassVar[dict[str, str]] = {}

    ended: str
    """Why it ended: `no_flip_gains`, `cycle` or `sweep_limit`."""
    fit_flips: int
    """Edges flipped during the fit."""
    fit_rounds: int
    """Rounds of the least-squares fit."""
    fit_shortened: int
    """Steps of the fit that were shortened."""
    flips: int
    """Edges flipped."""
    self_intersections_before: int
    """Intersecting pairs of triangles before optimisation."""
    sweeps: int
    """Sweeps over all edges."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Perfusion(Document):
    """The wall's uptake beside normal limits."""

    _built: ClassVar[dict[str, str]] = {"figures": "FigureBeside[]", "flags": "Flag[]", "normals": "NormalsUsed", "segments": "SegmentScore[]", "territories": "TerritoryScore[]"}

    deficit_percent: float
    """Deficit score: mean score of the wall, per cent of the greatest."""
    extent_percent: float
    """Share of the wall below the limit."""
    figures: list[FigureBeside]
    """Figures of the heart beside their limits; empty where the file has none."""
    flags: list[Flag]
    """Reasons to look closer."""
    normals: NormalsUsed
    """The limits."""
    note: str
    """What the figures are."""
    segments: list[SegmentScore]
    """The 17 segments."""
    severity: float | None = None
    """Mean of |z| there; null where nothing is below it."""
    summed_percent: float
    """The same in per cent of 68."""
    summed_score: int
    """Sum of the segments' scores, 0 to 68."""
    territories: list[TerritoryScore]
    """The walls of the three arteries."""
    z_limit: float
    """Standard deviations below the normal mean at which the limit lies."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PhaseReport(Document):
    """Phases of the wall: of the first harmonic of the thickness, weighted by area and amplitude."""

    _built: ClassVar[dict[str, str]] = {}

    bandwidth_degrees: float
    """The smallest arc that holds 95 per cent of the weight."""
    bin_degrees: float
    """Width of a bin."""
    entropy_percent: float
    """Entropy of the histogram as a share of that of an even one, per cent."""
    histogram: list[float]
    """Share of the weight in equal bins from 0 to 360 degrees."""
    mean_degrees: float
    """Circular mean."""
    noise_degrees: float
    """How far the noise of the gates alone scatters the phases: of the standard deviation, the part that says nothing
    of the heart."""
    reliable: bool
    """Whether enough of the wall moves, more than noise does, and the gates are a beat."""
    sd_degrees: float
    """Standard deviation."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PolarAttenuation(Document):
    """What attenuation may have to do with the extent of a map."""

    _built: ClassVar[dict[str, str]] = {}

    corrected: bool | None = None
    """False if the header or the caller says that attenuation was not corrected; null if nothing says it."""
    inferior_extent_percent: float
    """The part of `extent_percent` that lies in inferior, inferoseptal and inferolateral segments."""
    note: str
    """Both in words, and what is usual without correction."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PolarMap(Document):
    """A polar map, as in `polar.json`."""

    _built: ClassVar[dict[str, str]] = {"attenuation": "PolarAttenuation", "segments": "PolarSegment[]", "territories": "Territory[]"}

    attenuation: PolarAttenuation | None = None
    """What attenuation may have to do with the extent; in reports only, where nothing says that it was corrected, no
    normal limits were used, and inferior wall lies below the threshold."""
    columns: int
    """Columns of pixels, around the axis."""
    direction: str | None = None
    """The order of the columns; null if the orientation is unknown."""
    extent_percent: float
    """Share of the wall below it."""
    first_column: str | None = None
    """Where the first column looks; null if the orientation is unknown."""
    note: str
    """The reference of the percentages."""
    orientation: str
    """Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`."""
    reference: float
    """The intensity that counts as 100 per cent."""
    rows: int
    """Rows of pixels, from apex to base."""
    segments: list[PolarSegment]
    """The 17 segments."""
    territories: list[Territory]
    """The walls of the three arteries; none if the orientation is unknown."""
    threshold_percent: float
    """Share of it below which wall counts as a defect."""
    level_ends: list[list[float]]
    """For every column, the distances from the apex in rows at which apex, apical, mid and basal level end; row n
    reaches from n to n + 1."""
    rings: list[float]
    """The radii at which these levels end on the drawn map, as shares of its own."""
    segment_of: list[list[int]]
    """The number of the segment to which each pixel belongs."""
    states: list[list[str]]
    """What lies at each pixel: `muscle`, `valve_plane` (hatched, and in no figure) or `no_wall`."""
    values_percent: list[list[float | None]]
    """The pixels in per cent of the reference; null where there is no muscle."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PolarSegment(Document):
    """One segment of a polar map."""

    _built: ClassVar[dict[str, str]] = {}

    area_mm2: float
    """Area of its muscle, mm²."""
    extent_percent: float
    """Share of its area below the threshold."""
    mean_percent: float | None = None
    """Mean uptake in per cent of the reference."""
    name: str
    """Its name."""
    number: int
    """1 to 17."""
    territory: str | None = None
    """The coronary artery that usually feeds it; null if the orientation is unknown."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PolarSummary(Document):
    """A polar map without its pixels."""

    _built: ClassVar[dict[str, str]] = {"attenuation": "PolarAttenuation", "segments": "PolarSegment[]", "territories": "Territory[]"}

    attenuation: PolarAttenuation | None = None
    """What attenuation may have to do with the extent; in reports only, where nothing says that it was corrected, no
    normal limits were used, and inferior wall lies below the threshold."""
    columns: int
    """Columns of pixels, around the axis."""
    direction: str | None = None
    """The order of the columns; null if the orientation is unknown."""
    extent_percent: float
    """Share of the wall below it."""
    first_column: str | None = None
    """Where the first column looks; null if the orientation is unknown."""
    note: str
    """The reference of the percentages."""
    orientation: str
    """Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`."""
    reference: float
    """The intensity that counts as 100 per cent."""
    rows: int
    """Rows of pixels, from apex to base."""
    segments: list[PolarSegment]
    """The 17 segments."""
    territories: list[Territory]
    """The walls of the three arteries; none if the orientation is unknown."""
    threshold_percent: float
    """Share of it below which wall counts as a defect."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Posture(Document):
    """Which way is up in the patient."""

    _built: ClassVar[dict[str, str]] = {}

    confidence: float
    """Confidence of that, 0 to 1."""
    source: str
    """Its source: `superior`, `anterior`, `body`, `frame` or `unknown`."""
    superior: list[float]
    """The direction to the head."""
    tilt_degrees: float
    """Its angle to the scanner's axis."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Problem(Document):
    """Why a request was not fulfilled (RFC 9457)."""

    _built: ClassVar[dict[str, str]] = {}

    detail: str
    """What happened this time."""
    field: str | None = None
    """The parameter, JSON field or header concerned."""
    fix: str | None = None
    """What to do about it."""
    job: str | None = None
    """The job that failed, if there was one."""
    status: int
    """The HTTP status."""
    title: str
    """The kind of problem in words."""
    type: str
    """Stable identifier of the kind of problem."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ProjectionsReport(Document):
    """The projections that slices were reconstructed of, and the heart's motion in them."""

    _built: ClassVar[dict[str, str]] = {"moves": "MoveReport[]", "uncorrected": "UncorrectedReport", "views": "ViewReport[]"}

    counts: float
    """Counts of all views."""
    moved: bool | None = None
    """Whether the heart moved; `null` if that was not measured."""
    moves: list[MoveReport]
    """How it moved."""
    pixel_mm: float
    """Edge of a pixel, mm."""
    range_mm: list[float] | None = None
    """The greatest distance between its places in two views, mm: along the table, and across it on the detector."""
    uncorrected: UncorrectedReport | None = None
    """What the fit gave before the views were shifted back; `null` if they were not."""
    views: list[ViewReport]
    """The views, in the order in which the camera turned."""


@dataclass(frozen=True, kw_only=True, repr=False)
class RatesReport(Document):
    """How fast the ventricle empties and fills."""

    _built: ClassVar[dict[str, str]] = {}

    peak_ejection_edv_per_s: float
    """Greatest rate of ejection, end-diastolic volumes per second."""
    peak_filling_edv_per_s: float
    """Greatest rate of filling, end-diastolic volumes per second."""
    time_to_peak_filling_ms: float
    """From end systole to the greatest rate of filling."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ReaderOffsets(Document):
    """Distances of a reader's wall from the fitted one, mm."""

    _built: ClassVar[dict[str, str]] = {}

    endocardium: float
    """Distance of the inner surface, positive outward."""
    epicardium: float
    """Distance of the outer surface, positive outward."""
    rim: float
    """Distance of the rim, positive towards the base."""


@dataclass(frozen=True, kw_only=True, repr=False)
class RefusedTemplate(Document):
    """A model that could not be fitted."""

    _built: ClassVar[dict[str, str]] = {}

    reason: str
    """Why."""
    template: str
    """The model's name."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Resolution(Document):
    """Full width at half maximum of the image's point response."""

    _built: ClassVar[dict[str, str]] = {}

    source: str
    """`given` as a parameter, or `estimated` from the image."""
    value: float
    """Millimetres."""


@dataclass(frozen=True, kw_only=True, repr=False)
class RetileReport(Document):
    """Figures of the mesh before optimisation."""

    _built: ClassVar[dict[str, str]] = {"shape": "Shape", "smoothness": "Smoothness", "starts": "Start[]"}

    attempts: int
    """Attempts until the mesh was a manifold."""
    relaxation_rounds: int
    """Rounds of relaxation."""
    repeats: int
    """Repetitions of repulsion and tessellation."""
    repulsion_rounds: int
    """Rounds of repulsion."""
    seed: int
    """Seed of the kept model's random numbers."""
    shape: Shape
    """Shape of the triangles."""
    smoothness: Smoothness
    """Angles between neighbouring triangles."""
    starts: list[Start]
    """The models of which the best was kept."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Scaling(Document):
    """intensity = slope × stored value + intercept."""

    _built: ClassVar[dict[str, str]] = {}

    intercept: float
    """The intercept."""
    slope: float
    """The slope."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Scan(Document):
    """Whose scan a volume is: what its DICOM header says, or was stated."""

    _built: ClassVar[dict[str, str]] = {}

    accession_number: str | None = None
    """Accession Number (0008,0050)."""
    acquisition_date: str | None = None
    """Acquisition Date (0008,0022), or the date in Acquisition `DateTime` (0008,002A), or the Series Date, `YYYYMMDD`."""
    acquisition_time: str | None = None
    """Acquisition Time (0008,0032), or the time in Acquisition `DateTime` (0008,002A)."""
    convolution_kernel: str | None = None
    """Convolution Kernel (0018,1210)."""
    corrected_image: str | None = None
    """Corrected Image (0028,0051), values separated by backslashes: with `ATTN` attenuation was corrected."""
    frame_of_reference_uid: str | None = None
    """Frame of Reference UID (0020,0052)."""
    image_type: str | None = None
    """Image Type (0008,0008), values separated by backslashes."""
    injected_dose: str | None = None
    """Radionuclide Total Dose (0018,1074) as stored: MBq in NM images, Bq in PET images
    ([`Provenance::injected_dose_mbq`])."""
    injection_time: str | None = None
    """Radiopharmaceutical Start Time (0018,1072)."""
    instance_uids: list[str] | None = None
    """SOP Instance UIDs of a series of several instances; in `/identity` only."""
    manufacturer: str | None = None
    """Manufacturer (0008,0070) of the equipment."""
    modality: str | None = None
    """Modality (0008,0060)."""
    model_name: str | None = None
    """Manufacturer's Model Name (0008,1090)."""
    patient_birth_date: str | None = None
    """Patient's Birth Date (0010,0030), `YYYYMMDD`."""
    patient_id: str | None = None
    """Patient ID (0010,0020)."""
    patient_name: str | None = None
    """Patient's Name (0010,0010), components separated by `^`."""
    patient_position: str | None = None
    """Patient Position (0018,5100), such as `HFS`, or the meaning of the Patient Orientation Modifier Code
    (0054,0412)."""
    patient_sex: str | None = None
    """Patient's Sex (0010,0040): `M`, `F` or `O`."""
    position_reference_indicator: str | None = None
    """Position Reference Indicator (0020,1040)."""
    protocol_name: str | None = None
    """Protocol Name (0018,1030)."""
    radionuclide: str | None = None
    """Meaning of the Radionuclide Code (0054,0300)."""
    radiopharmaceutical: str | None = None
    """Meaning of the Radiopharmaceutical Code (0054,0304), or the Radiopharmaceutical (0018,0031)."""
    reconstruction_method: str | None = None
    """Reconstruction Method (0054,1103)."""
    referring_physician: str | None = None
    """Referring Physician's Name (0008,0090)."""
    rest_or_stress: str | None = None
    """`rest` or `stress`."""
    scan_arc: str | None = None
    """Scan Arc (0018,1143): by how many degrees the camera turned."""
    series_description: str | None = None
    """Series Description (0008,103E)."""
    series_number: str | None = None
    """Series Number (0020,0011)."""
    series_uid: str | None = None
    """Series Instance UID (0020,000E)."""
    software_versions: str | None = None
    """Software Versions (0018,1020)."""
    sop_class_uid: str | None = None
    """SOP Class UID (0008,0016) of the instances."""
    sop_instance_uid: str | None = None
    """SOP Instance UID (0008,0018); of a series of several instances, the first one's."""
    study_date: str | None = None
    """Study Date (0008,0020), `YYYYMMDD`."""
    study_description: str | None = None
    """Study Description (0008,1030)."""
    study_id: str | None = None
    """Study ID (0020,0010)."""
    study_time: str | None = None
    """Study Time (0008,0030), `HHMMSS.FFFFFF`."""
    study_uid: str | None = None
    """Study Instance UID (0020,000D)."""
    undecoded: list[str] | None = None
    """Fields that the file states and that cannot be decoded; while they belong to patient or study, no DICOM object
    is made."""
    units: str | None = None
    """Units (0054,1001)."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SegmentMotionReport(Document):
    """A segment through the beat."""

    _built: ClassVar[dict[str, str]] = {}

    motion_mm: float
    """Motion of the inner surface inward, end diastole to end systole."""
    name: str
    """Its name."""
    phase_degrees: float | None = None
    """Phase of the greatest thickness; `null` where the segment does not move."""
    segment: int
    """Its number, 1 to 17."""
    thickening_counts_percent: float | None = None
    """The same by the counts of the wall, a second opinion: lower by what the image's filter takes; `null` where the
    wall has no counts."""
    thickening_percent: float
    """Thickening, end diastole to end systole."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SegmentScore(Document):
    """A segment beside its limits."""

    _built: ClassVar[dict[str, str]] = {}

    compared_percent: float
    """Share of its area that has limits and muscle."""
    deficit_percent: float
    """Mean score of its wall, per cent of the greatest."""
    extent_percent: float
    """Share of its wall below the limit."""
    name: str
    """Its name."""
    score: int | None = None
    """Score, 0 to 4."""
    segment: int
    """Its number, 1 to 17."""
    z: float | None = None
    """Mean of z: standard deviations from the normal mean, negative below; null where nothing can be compared."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SegmentationReport(Document):
    """The report of a segmentation. Lengths are millimetres in the patient frame LPS."""

    _built: ClassVar[dict[str, str]] = {"candidates": "Candidate[]", "evidence": "Evidence", "fit": "Fit", "flags": "Flag[]", "input": "FileFacts", "localisation": "Localisation", "measures": "Agreement", "perfusion": "Perfusion", "polar": "PolarSummary", "posture": "Posture", "projections": "ProjectionsReport", "reader": "AppliedReader", "refused": "RefusedTemplate[]", "resolution_mm": "Resolution", "thickness_mm": "Thicknesses", "uncertainty_mm": "Uncertainties", "volumes_ml": "FittedVolumes"}

    candidates: list[Candidate]
    """Models that were fitted."""
    choice: str
    """Why that one was taken."""
    evidence: Evidence | None = None
    """The figures behind confidence and flags; ventricles only."""
    fit: Fit
    """Figures of the fit."""
    flags: list[Flag]
    """Reasons to look closer."""
    impression: list[str] | None = None
    """Sentences that a reader may take over into the impression; `null` where the report was made before they existed."""
    input: FileFacts
    """The volume's file."""
    localisation: Localisation | None = None
    """Where the organ was found."""
    mask_rule: str
    """Which voxels the mask holds."""
    mass_g: float | None = None
    """Mass of the myocardium, g, from the anatomical wall; ventricles only."""
    mass_interval_g: list[float] | None = None
    """Of nine of ten hearts, the true mass lies within these, g; ventricles only."""
    measures: Agreement | None = None
    """Agreement with the expert's mask."""
    parameters: dict[str, Any]
    """Every parameter, defaults written out."""
    perfusion: Perfusion | None = None
    """The wall's uptake beside normal limits, if some were given."""
    polar: PolarSummary | None = None
    """Uptake of the wall; ventricles only."""
    posture: Posture | None = None
    """Which way is up in the patient."""
    projections: ProjectionsReport | None = None
    """The projections that slices were reconstructed of, if they were reconstructed here."""
    reader: AppliedReader | None = None
    """The reader's profile that the shown wall was drawn by."""
    refused: list[RefusedTemplate]
    """Models that could not be fitted."""
    resolution_mm: Resolution | None = None
    """Full width at half maximum of the image's point response; ventricles only."""
    template: str
    """Name of the fitted model."""
    thickness_mm: Thicknesses | None = None
    """Thickness of both walls; ventricles only."""
    uncertainty_mm: Uncertainties | None = None
    """Standard deviation of the nodes' distance from the walls; ventricles only."""
    volumes_ml: FittedVolumes
    """Volumes."""
    wall_thickness_mm: float | None = None
    """Mean thickness of the wall that `edge` asks for; ventricles only."""
    warnings: list[str]
    """Warnings about the volume's file."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SerialPair(Document):
    """The change of the wall's uptake from an earlier to a later scan. Uptake is in per cent of the earlier scan's
    reference, the later one scaled to it by the wall that did not change."""

    _built: ClassVar[dict[str, str]] = {"segments": "SerialSegment[]"}

    better_interval_percent: list[float]
    """Its interval."""
    better_percent: float
    """Share of the wall that gained uptake."""
    better_verdict: str
    """Whether wall gained uptake."""
    compared_percent: float
    """Share of the wall with muscle in both scans."""
    correlation: float
    """Correlation of both maps."""
    dark_in_both_percent: float
    """Share of the wall below the threshold in both scans."""
    detectable_percent: float
    """The least loss, per cent, that is found in nine of ten such pairs if it takes up a territory."""
    earlier: int
    """The earlier scan."""
    later: int
    """The later one."""
    lost_percent: float
    """What the later scan lacks in the regions that lost uptake, per cent of the whole wall's uptake."""
    matched_percent: float
    """Share of the wall by which the later scan was scaled."""
    noise_points: float
    """Standard deviation of the smoothed difference by the noise of this pair, points."""
    scale: float
    """Counts of the later scan that are one count of the earlier one where nothing changed."""
    segments: list[SerialSegment]
    """The 17 segments."""
    worse_interval_percent: list[float]
    """Its interval by noise: 5th and 95th percentile."""
    worse_percent: float
    """Share of the wall that lost uptake, each region as far as half of the depth of its loss."""
    worse_verdict: str
    """Whether wall lost uptake."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SerialReport(Document):
    """The report of a serial comparison: scans of one patient, and what changed from scan to scan."""

    _built: ClassVar[dict[str, str]] = {"changes": "FigureChange[]", "flags": "Flag[]", "pairs": "SerialPair[]", "scans": "SerialScan[]"}

    changes: list[FigureChange]
    """The change of every figure: of every scan against the first one, and then against the one before it."""
    flags: list[Flag]
    """Reasons to look closer."""
    gated: bool
    """Whether all scans are gated, so that there are beats."""
    pairs: list[SerialPair]
    """The change of the wall's uptake, likewise."""
    parameters: dict[str, Any]
    """Every parameter, defaults written out."""
    scans: list[SerialScan]
    """The scans, in the order of their dates."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SerialScan(Document):
    """A scan of a series. All are fitted from one common heart."""

    _built: ClassVar[dict[str, str]] = {"input": "FileFacts", "polar": "PolarSummary", "resolution_mm": "Resolution"}

    beats_per_minute: float | None = None
    """Beats a minute; `null` unless the scan is gated and its R-R interval is known."""
    cavity_ml: float | None = None
    """Volume of the cavity in the image of all gates."""
    confidence: float
    """Confidence of the fit of this scan alone, 0..=1."""
    correlation: float
    """Correlation of the image with that of the first scan about the wall."""
    dark_percent: float | None = None
    """Share of the wall below the threshold, a share of the scan's own maximum."""
    date: str | None = None
    """The date, `YYYY-MM-DD`; `null` where the header states none."""
    deficit_percent: float | None = None
    """Deficit score."""
    edv_ml: float | None = None
    """End-diastolic volume."""
    ef_percent: float | None = None
    """Ejection fraction, per cent; `null` unless all scans are gated, as for the others of the beat."""
    esv_ml: float | None = None
    """End-systolic volume."""
    extent_percent: float | None = None
    """Share of the wall below the normal limit; `null` without normal limits, as for the other two."""
    given: int
    """Its number as it was given."""
    input: FileFacts
    """The file."""
    mass_g: float | None = None
    """Mass of the muscle by the fit of this scan alone; the volumes of all scans stand on one common mass."""
    motion_mm: float | None = None
    """Inward motion, the mean of the segments."""
    moved_mm: float
    """How far the heart lies from where it was in the first scan, mm."""
    number: int
    """Its number."""
    phase_bandwidth_degrees: float | None = None
    """Bandwidth of the phases."""
    phase_sd_degrees: float | None = None
    """Standard deviation of the phases; `null` where they are not reliable."""
    polar: PolarSummary | None = None
    """Uptake of the wall, by its own reference."""
    resolution_mm: Resolution | None = None
    """Full width at half maximum of the image's point response."""
    series_description: str | None = None
    """Series Description, if the header has one."""
    summed_score: float | None = None
    """Summed score, 0 to 68."""
    template: str
    """The model that was fitted."""
    thickening_percent: float | None = None
    """Thickening, the mean of the segments."""
    turned_degrees: float
    """By how much it is turned against the first scan, degrees."""
    warnings: list[str]
    """Warnings about the file."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SerialSegment(Document):
    """The change of a segment from an earlier to a later scan."""

    _built: ClassVar[dict[str, str]] = {}

    change_interval_points: list[float] | None = None
    """Its 95 % interval."""
    change_points: float | None = None
    """The later less the earlier, points."""
    change_verdict: str | None = None
    """Whether it changed."""
    earlier_percent: float | None = None
    """Its mean uptake in the earlier scan; `null` where nothing can be compared, as for the others."""
    later_percent: float | None = None
    """In the later one."""
    motion_change_mm: float | None = None
    """Change of the inward motion, mm; `null` unless all scans are gated."""
    name: str
    """Its name."""
    segment: int
    """Its number, 1 to 17."""
    thickening_change_points: float | None = None
    """Change of the thickening, points."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Shape(Document):
    """Figures of the triangles' shapes."""

    _built: ClassVar[dict[str, str]] = {"area_mm2": "Summary", "edge_length_mm": "Summary", "max_angle_deg": "Summary", "min_angle_deg": "Summary", "radius_ratio": "Summary", "valence": "Valence"}

    area_mm2: Summary
    """Areas of triangles, mm²."""
    edge_length_mm: Summary
    """Lengths of edges, mm."""
    max_angle_deg: Summary
    """Largest angle of each triangle, degrees."""
    min_angle_deg: Summary
    """Smallest angle of each triangle, degrees, 60 = equilateral."""
    radius_ratio: Summary
    """Radius ratio 2r/R, 1 = equilateral."""
    valence: Valence
    """Edges at each vertex."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Smoothness(Document):
    """Figures of the mesh's smoothness."""

    _built: ClassVar[dict[str, str]] = {"dihedral_deg": "Summary"}

    dihedral_deg: Summary
    """Angle between the normals of neighbouring triangles, degrees, 0 = flat."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Software(Document):
    """The program that made a product."""

    _built: ClassVar[dict[str, str]] = {}

    name: str
    """The program."""
    version: str
    """Its version."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Specificity(Document):
    """The people of a group, each judged by the limits of the others."""

    _built: ClassVar[dict[str, str]] = {"cases": "LeftOut[]"}

    cases: list[LeftOut]
    """Each person's figures."""
    deficit_percent_of_95: float
    """The deficit score that 95 of 100 people stay below, per cent: quantile of 95 per cent."""
    mean_deficit_percent: float
    """Mean deficit score, per cent."""
    mean_extent_percent: float
    """Mean share of the wall beyond the limit, per cent."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Start(Document):
    """One of the models of which the best was kept."""

    _built: ClassVar[dict[str, str]] = {}

    distance_mean_mm: float
    """Mean distance to the surface, two-sided, mm."""
    hausdorff_mm: float
    """Largest distance to the surface, two-sided, mm."""
    radius_ratio_mean: float
    """Mean 2r/R of its triangles."""
    seed: int
    """Its seed."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Summary(Document):
    """Mean, spread and percentiles of a list of numbers. All zero for an empty list."""

    _built: ClassVar[dict[str, str]] = {}

    cv: float
    """Standard deviation over the mean."""
    max: float
    """Largest."""
    mean: float
    """Arithmetic mean."""
    median: float
    """50th percentile."""
    min: float
    """Smallest."""
    p5: float
    """5th percentile."""
    p95: float
    """95th percentile."""
    rms: float
    """Root of the mean square."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SurfaceNoise(Document):
    """The noise of a scan where its surface lies."""

    _built: ClassVar[dict[str, str]] = {}

    correlation_mm: float
    """Full width at half maximum of the noise's correlation between places, mm; 0 without noise."""
    intensity: float
    """Standard deviation of the intensities, in the volume's units."""
    moved_mm: float
    """Root mean square of the distances by which the vertices were moved, mm."""
    offset_mm: float
    """Standard deviation of the surface's place, mm: that of the intensities over the steepness of the image across
    the surface, the median over all vertices."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SurfaceReport(Document):
    """Figures of the iso-surface."""

    _built: ClassVar[dict[str, str]] = {"noise": "SurfaceNoise"}

    area_mm2: float
    """Area, mm²."""
    cavities_before: int
    """Enclosed cavities before they were filled."""
    components: int
    """Connected components."""
    components_before: int
    """Components before all but one were removed."""
    euler_characteristic: int
    """V - E + F."""
    genus: int
    """Handles over all components."""
    handles_before: int
    """Handles before they were removed."""
    intensity_range: list[float]
    """Smallest and largest intensity."""
    iso_fraction: float
    """The iso-value as a share of the reference intensity."""
    iso_value: float
    """The iso-value, in the volume's units."""
    kind: str
    """`intensity`, `mask` or `labels`."""
    label: int | None = None
    """The object's label."""
    mask_ml: float | None = None
    """Volume of the voxels that carry the label, millilitres, which the surface is made to enclose; null for
    intensities."""
    neighbour_cut_mm2: float
    """Area of that cut, mm²."""
    neighbour_voxels_cut: int
    """Voxels of neighbouring organs that were cut off."""
    noise: SurfaceNoise | None = None
    """The noise that was measured and taken off the surface; null for masks and with denoise=off."""
    not_finite_voxels: int
    """Voxels that are NaN or infinite."""
    otsu: float | None = None
    """Otsu's threshold."""
    outward_components: int
    """Components that face outward; the others bound cavities."""
    reference_intensity: float
    """The object's maximum, which percentages refer to."""
    region_ml: float
    """Volume of the object's voxels, millilitres."""
    touches_border: bool
    """Whether the object touches the volume's border."""
    triangles: int
    """Number of triangles."""
    ventricle_score: float | None = None
    """How much the object looks like a left ventricle."""
    vertices: int
    """Number of vertices."""
    volume_ml: float
    """Enclosed volume, millilitres."""
    voxel_mm: float
    """Smallest voxel spacing, mm."""
    voxels_cut: int
    """Voxels cut to open handles."""
    voxels_dropped: int
    """Voxels of dropped components."""
    voxels_filled: int
    """Voxels filled to close handles and cavities."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Territory(Document):
    """The wall that an artery usually feeds."""

    _built: ClassVar[dict[str, str]] = {}

    area_mm2: float
    """Area of its muscle, mm²."""
    extent_percent: float
    """Share of its area below the threshold."""
    mean_percent: float | None = None
    """Mean uptake in per cent of the reference."""
    name: str
    """LAD, LCX or RCA."""


@dataclass(frozen=True, kw_only=True, repr=False)
class TerritoryScore(Document):
    """The wall of an artery beside its limits."""

    _built: ClassVar[dict[str, str]] = {}

    deficit_percent: float
    """Mean score of its wall, per cent of the greatest."""
    extent_percent: float
    """Share of its wall below the limit."""
    name: str
    """LAD, LCX or RCA."""
    summed_score: int
    """Sum of its segments' scores."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Thickness(Document):
    """Thickness of a wall, mm."""

    _built: ClassVar[dict[str, str]] = {}

    mean: float
    """Its mean."""
    spread: float
    """Its standard deviation over the wall."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Thicknesses(Document):
    """Thickness of both walls, mm."""

    _built: ClassVar[dict[str, str]] = {"anatomical": "Thickness", "apparent": "Thickness"}

    anatomical: Thickness
    """Of the wall corrected for the blur."""
    anatomical_interval: list[float] | None = None
    """Of nine of ten hearts that look so, the true mean thickness lies within these."""
    apparent: Thickness
    """Of the wall as the blurred image shows it."""


@dataclass(frozen=True, kw_only=True, repr=False)
class TimingReport(Document):
    """What the file says of the beats."""

    _built: ClassVar[dict[str, str]] = {}

    beats_accepted: float | None = None
    """Beats accepted."""
    beats_rejected: float | None = None
    """Beats rejected."""
    frame_time_ms: float | None = None
    """Length of a gate."""
    high_rr_ms: float | None = None
    """The longest R-R interval accepted."""
    low_rr_ms: float | None = None
    """The shortest R-R interval accepted."""
    nominal_interval_ms: float | None = None
    """The R-R interval."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Uncertainties(Document):
    """Standard deviation of the nodes' distance from the walls, millimetres."""

    _built: ClassVar[dict[str, str]] = {"anatomical": "Uncertainty", "apparent": "Uncertainty"}

    anatomical: Uncertainty
    """From the wall itself."""
    apparent: Uncertainty
    """From the wall as it looks."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Uncertainty(Document):
    """Standard deviation of the nodes' distance from a wall, millimetres."""

    _built: ClassVar[dict[str, str]] = {}

    greatest: float
    """The greatest."""
    median: float
    """Median over the nodes."""
    percentile_95: float
    """95th percentile over the nodes."""


@dataclass(frozen=True, kw_only=True, repr=False)
class UncorrectedReport(Document):
    """What a fit gave before views were shifted back."""

    _built: ClassVar[dict[str, str]] = {}

    cavity_ml: float | None = None
    """Volume of the cavity, ml."""
    confidence: float
    """Confidence."""
    segments_change: list[float | None]
    """What each segment gained by the correction, points."""
    segments_percent: list[float | None]
    """Uptake of the 17 segments, % of the reference."""
    wall_ml: float
    """Volume of the wall, ml."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Valence(Document):
    """Numbers of edges that meet at a vertex."""

    _built: ClassVar[dict[str, str]] = {}

    counts: dict[str, int]
    """Number of vertices for each valence."""
    share_5_to_7: float
    """Share of vertices with five, six or seven."""
    share_6: float
    """Share of vertices with six edges, the regular case."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ViewReport(Document):
    """One view."""

    _built: ClassVar[dict[str, str]] = {}

    across_mm: float | None = None
    """How far towards higher columns of the detector, mm."""
    along_mm: float | None = None
    """How far towards the head the heart lay from its mean place, mm, as measured in this view alone."""
    angle_deg: float
    """Angle of the detector about the patient, degrees: 0 at the back, 90 at the left side."""
    counts: float
    """Counts."""
    moved_across_mm: float | None = None
    """The second by the moves that are told, mm."""
    moved_along_mm: float | None = None
    """The first by the moves that are told, mm."""
    time: int
    """Number in time, from 1; views of several detectors at one time have the same."""


@dataclass(frozen=True, kw_only=True, repr=False)
class StoredVolume(Document):
    """A stored volume: what its header says."""

    _built: ClassVar[dict[str, str]] = {"dicom": "Scan", "gates": "Gates", "intensity": "Intensity", "legal_hold": "LegalHold", "links": "VolumeLinks", "originals": "VolumeFile[]"}

    affine: list[list[float]]
    """Maps a voxel index to millimetres in the patient frame LPS; row by row."""
    affine_source: str
    """The part of the header that gave the affine."""
    bytes: int
    """Size of all its files in bytes."""
    compressed: bool
    """Whether it was gzipped."""
    created_at: str
    """When it was stored (RFC 3339)."""
    dicom: Scan | None = None
    """Whose scan it is, as far as the caller's scope allows to see it; absent if nothing is known."""
    dtype: str
    """Data type in the file."""
    expires_at: str | None = None
    """When it will be erased unless it is uploaded or used again (RFC 3339); absent if it is kept."""
    external_id: str | None = None
    """The caller's own id for it; not shown to the scope `read`."""
    files: int
    """Number of its files."""
    format: str
    """File format."""
    frame: str
    """The frame of `affine`."""
    frames: int
    """How many volumes of that shape the file holds; if several, the parameter `frame` chooses one."""
    gates: Gates | None = None
    """The gates of one heart beat, if the frames are gates: a gated DICOM series, 6 to 32 DICOM or NIfTI files of one
    gate each, or a 4-D NIfTI file whose header does not contradict and whose volumes look like gates."""
    id: str
    """Derived from the SHA-256 of the content, so it is the same on every machine."""
    intensity: Intensity
    """The voxel values after slope and intercept."""
    label_values: list[int] | None = None
    """The voxel values in rising order if the volume looks like a label map."""
    labels: dict[str, str]
    """The caller's own names and values for it; none are shown to the scope `read`."""
    legal_hold: LegalHold | None = None
    """The legal hold that forbids to erase it."""
    links: VolumeLinks
    """Related paths."""
    originals: list[VolumeFile]
    """Its files as they were uploaded."""
    shape: list[int]
    """Voxels along i, j, k of one frame."""
    spacing_mm: list[float]
    """Voxel spacing along the first three axes, millimetres."""
    warnings: list[str]
    """Oddities of the file that do not prevent its use."""


@dataclass(frozen=True, kw_only=True, repr=False)
class VolumeFile(Document):
    """An uploaded file."""

    _built: ClassVar[dict[str, str]] = {}

    bytes: int
    """Its length in bytes."""
    href: str
    """Its path."""
    media_type: str
    """Its media type."""
    name: str
    """Its name in the store; not that of the upload."""
    sha256: str
    """SHA-256 of its content, hexadecimal; also its `ETag`."""


@dataclass(frozen=True, kw_only=True, repr=False)
class VolumeIntervals(Document):
    """Least and greatest volumes of one wall, millilitres."""

    _built: ClassVar[dict[str, str]] = {}

    cavity: list[float]
    """Of the cavity."""
    wall: list[float]
    """Of the wall."""


@dataclass(frozen=True, kw_only=True, repr=False)
class VolumeLinks(Document):
    """Paths of one volume."""

    _built: ClassVar[dict[str, str]] = {}

    content: str | None = None
    """The uploaded file; absent if there are several."""
    hold: str
    """Its legal hold: PUT sets it, DELETE lifts it."""
    identity: str
    """Whose scan it is: PUT states it, DELETE erases it."""
    preview: str
    """Three middle slices as PNG."""
    self_: str
    """This volume."""


@dataclass(frozen=True, kw_only=True, repr=False)
class WallVolumes(Document):
    """Volumes of one wall, millilitres."""

    _built: ClassVar[dict[str, str]] = {}

    cavity: float
    """Of the cavity."""
    wall: float
    """Of the wall."""


register(
    Agreement, AppliedReader, BeatChange, BeatReport, Candidate, ComparedScan, ComparedSegment, ComparedTerritory,
    ComparisonReport, CurvePoint, Distance, DistanceDirection, Evidence, ExcludedCase, FigureBeside, FigureChange,
    FileFacts, Fit, FitnessFormStages, FitnessForms, FitnessReport, FitnessScales, FitnessTermStages, FitnessTerms,
    FittedVolumes, Flag, GateReport, Gates, GlobalLimit, Histogram, Histograms, Intensity, IntensityFacts, Job,
    JobLinks, JobSource, LabelCount, LeftOut, LegalHold, LimitMap, Localisation, LongAxis, MeshFacts, ModelReport,
    MoveReport, NoBeat, NormalCase, NormalGroup, LimitsDocument, NormalsUsed, ObjectDelivery, OptimiseReport,
    Perfusion, PhaseReport, PolarAttenuation, PolarMap, PolarSegment, PolarSummary, Posture, Problem,
    ProjectionsReport, RatesReport, ReaderOffsets, RefusedTemplate, Resolution, RetileReport, Scaling, Scan,
    SegmentMotionReport, SegmentScore, SegmentationReport, SerialPair, SerialReport, SerialScan, SerialSegment,
    Shape, Smoothness, Software, Specificity, Start, Summary, SurfaceNoise, SurfaceReport, Territory,
    TerritoryScore, Thickness, Thicknesses, TimingReport, Uncertainties, Uncertainty, UncorrectedReport, Valence,
    ViewReport, StoredVolume, VolumeFile, VolumeIntervals, VolumeLinks, WallVolumes,
)
