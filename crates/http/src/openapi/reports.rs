//! Schemas of the JSON files and summaries that jobs write.
//!
//! The domain writes them and knows no OpenAPI, so each is described here a second time, field by
//! field. `scripts/check_contract.py` compares the description with what a running service
//! answers: a field of the answer that is missing here, or has another type, fails it.

#![expect(
    dead_code,
    reason = "the types describe JSON that other modules write; no value of them is made"
)]

use super::inputs::{ModelParametersObject, SegmentationParametersObject};
use crate::products::SoftwareBody;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Declares types that describe JSON objects: their doc comments, their name, the name of the
/// schema, and their fields.
macro_rules! schemas {
    ($($(#[doc = $doc:literal])+ $name:ident as $schema:ident { $($(#[doc = $help:literal])+ $field:ident: $kind:ty,)+ })+) => {$(
        $(#[doc = $doc])+
        #[derive(ToSchema)]
        #[schema(as = $schema)]
        pub struct $name {
            $($(#[doc = $help])+ $field: $kind,)+
        }
    )+};
}

schemas! {
    /// Whose scan a volume is: what its DICOM header says, or was stated.
    ScanSchema as Scan {
        /// Patient's Name (0010,0010), components separated by `^`.
        patient_name: Option<String>,
        /// Patient ID (0010,0020).
        patient_id: Option<String>,
        /// Patient's Birth Date (0010,0030), `YYYYMMDD`.
        patient_birth_date: Option<String>,
        /// Patient's Sex (0010,0040): `M`, `F` or `O`.
        patient_sex: Option<String>,
        /// Study Instance UID (0020,000D).
        study_uid: Option<String>,
        /// Study Date (0008,0020), `YYYYMMDD`.
        study_date: Option<String>,
        /// Study Time (0008,0030), `HHMMSS.FFFFFF`.
        study_time: Option<String>,
        /// Study ID (0020,0010).
        study_id: Option<String>,
        /// Study Description (0008,1030).
        study_description: Option<String>,
        /// Accession Number (0008,0050).
        accession_number: Option<String>,
        /// Referring Physician's Name (0008,0090).
        referring_physician: Option<String>,
        /// Series Instance UID (0020,000E).
        series_uid: Option<String>,
        /// Series Number (0020,0011).
        series_number: Option<String>,
        /// Series Description (0008,103E).
        series_description: Option<String>,
        /// Modality (0008,0060).
        modality: Option<String>,
        /// Image Type (0008,0008), values separated by backslashes.
        image_type: Option<String>,
        /// Frame of Reference UID (0020,0052).
        frame_of_reference_uid: Option<String>,
        /// Position Reference Indicator (0020,1040).
        position_reference_indicator: Option<String>,
        /// SOP Class UID (0008,0016) of the instances.
        sop_class_uid: Option<String>,
        /// SOP Instance UID (0008,0018); of a series of several instances, the first one's.
        sop_instance_uid: Option<String>,
        /// Acquisition Date (0008,0022), or the date in Acquisition `DateTime` (0008,002A), or
        /// the Series Date, `YYYYMMDD`.
        acquisition_date: Option<String>,
        /// Acquisition Time (0008,0032), or the time in Acquisition `DateTime` (0008,002A).
        acquisition_time: Option<String>,
        /// Meaning of the Radiopharmaceutical Code (0054,0304), or the Radiopharmaceutical
        /// (0018,0031).
        radiopharmaceutical: Option<String>,
        /// Meaning of the Radionuclide Code (0054,0300).
        radionuclide: Option<String>,
        /// Radionuclide Total Dose (0018,1074) as stored: MBq in NM images, Bq in PET images.
        injected_dose: Option<String>,
        /// Radiopharmaceutical Start Time (0018,1072).
        injection_time: Option<String>,
        /// Manufacturer (0008,0070) of the equipment.
        manufacturer: Option<String>,
        /// Manufacturer's Model Name (0008,1090).
        model_name: Option<String>,
        /// Software Versions (0018,1020).
        software_versions: Option<String>,
        /// Protocol Name (0018,1030).
        protocol_name: Option<String>,
        /// Reconstruction Method (0054,1103).
        reconstruction_method: Option<String>,
        /// Convolution Kernel (0018,1210).
        convolution_kernel: Option<String>,
        /// `rest` or `stress`.
        rest_or_stress: Option<String>,
        /// SOP Instance UIDs of a series of several instances; in `/identity` only.
        instance_uids: Option<Vec<String>>,
        /// Fields that the file states and that cannot be decoded; while they belong to patient or
        /// study, no DICOM object is made.
        undecoded: Option<Vec<String>>,
    }
    /// The report of a model. Lengths are millimetres in the patient frame LPS.
    ModelReportSchema as ModelReport {
        /// The program that made the model.
        software: SoftwareBody,
        /// The volume's file.
        input: FileFactsSchema,
        /// Every parameter, defaults written out.
        parameters: ModelParametersObject,
        /// The iso-surface.
        surface: SurfaceReport,
        /// The mesh before optimisation.
        retile: RetileReport,
        /// What optimisation did.
        optimise: OptimiseReport,
        /// The model: counts and topology.
        mesh: MeshReport,
        /// The model: shape of its triangles.
        shape: ShapeReport,
        /// The model: angles between neighbouring triangles.
        smoothness: SmoothnessReport,
        /// The model beside the iso-surface.
        distance: DistanceReport,
        /// The paper's fitness after each stage.
        fitness: FitnessReport,
        /// Distributions before and after optimisation.
        histograms: HistogramsReport,
        /// Milliseconds of each stage and their `total`.
        timings_ms: BTreeMap<String, f64>,
        /// Sentences about the input and the model that a user should know.
        warnings: Vec<String>,
    }

    /// What a volume's file says.
    FileFactsSchema as FileFacts {
        /// File format.
        format: String,
        /// `little` or `big`.
        byte_order: String,
        /// Whether it was gzipped.
        compressed: bool,
        /// Data type in the file.
        data_type: String,
        /// How stored values become intensities, if they do not as they are.
        scaling: Option<ScalingFacts>,
        /// Sizes of all dimensions in the file.
        file_shape: Vec<u64>,
        /// Frames in the file.
        frames: u64,
        /// The frame that was read, counted from 0.
        frame: Option<u64>,
        /// Voxels along i, j, k.
        shape: [u64; 3],
        /// Voxel spacing, millimetres.
        spacing_mm: [f64; 3],
        /// Maps a voxel index to LPS millimetres; row by row.
        affine_lps: [[f64; 4]; 4],
        /// Maps a voxel index to RAS millimetres; row by row.
        affine_ras: [[f64; 4]; 4],
        /// The part of the header that gave the affine.
        affine_source: String,
        /// The file's unit of length.
        unit: String,
        /// The voxel values after slope and intercept.
        intensity: IntensityFactsSchema,
        /// Oddities of the file that do not prevent its use.
        warnings: Vec<String>,
    }

    /// intensity = slope × stored value + intercept.
    ScalingFacts as Scaling {
        /// The slope.
        slope: f64,
        /// The intercept.
        intercept: f64,
    }

    /// A summary of voxel values.
    IntensityFactsSchema as IntensityFacts {
        /// Smallest finite value.
        minimum: f64,
        /// Largest finite value.
        maximum: f64,
        /// Mean of the finite values.
        mean: f64,
        /// Sum of the finite values.
        sum: f64,
        /// Voxels with a finite value.
        finite_voxels: u64,
        /// Voxels that are NaN or infinite.
        missing_voxels: u64,
        /// Whether all values are whole numbers.
        integral: bool,
        /// The labels, if the volume looks like a label map.
        labels: Option<Vec<LabelFacts>>,
    }

    /// One label of a label map.
    LabelFacts as LabelCount {
        /// Its value.
        label: i64,
        /// Voxels that have it.
        voxels: u64,
    }

    /// The noise of a scan where its surface lies.
    SurfaceNoiseSchema as SurfaceNoise {
        /// Standard deviation of the intensities.
        intensity: f64,
        /// Standard deviation of the surface's place, mm.
        offset_mm: f64,
        /// Full width at half maximum of the noise's correlation, mm; 0 without noise.
        correlation_mm: f64,
        /// Root mean square of the distances by which the surface's vertices were moved, mm.
        moved_mm: f64,
    }

    /// Figures of the iso-surface.
    SurfaceReport as SurfaceReport {
        /// The iso-value, in the volume's units.
        iso_value: f64,
        /// Number of vertices.
        vertices: u64,
        /// Number of triangles.
        triangles: u64,
        /// V - E + F.
        euler_characteristic: i64,
        /// Connected components.
        components: u64,
        /// Components that face outward; the others bound cavities.
        outward_components: u64,
        /// Enclosed volume, millilitres.
        volume_ml: f64,
        /// Area, mm².
        area_mm2: f64,
        /// Smallest voxel spacing, mm.
        voxel_mm: f64,
        /// Handles over all components.
        genus: i64,
        /// The iso-value as a share of the reference intensity.
        iso_fraction: f64,
        /// The object's maximum, which percentages refer to.
        reference_intensity: f64,
        /// Otsu's threshold.
        otsu: Option<f64>,
        /// Smallest and largest intensity.
        intensity_range: [f64; 2],
        /// `intensity`, `mask` or `labels`.
        kind: String,
        /// The object's label.
        label: Option<i64>,
        /// How much the object looks like a left ventricle.
        ventricle_score: Option<f64>,
        /// The noise that was measured and taken off the surface; null for masks and with denoise=off.
        noise: Option<SurfaceNoiseSchema>,
        /// Volume of the voxels that carry the label, millilitres, which the surface is made to enclose;
        /// null for intensities.
        mask_ml: Option<f64>,
        /// Volume of the object's voxels, millilitres.
        region_ml: f64,
        /// Whether the object touches the volume's border.
        touches_border: bool,
        /// Voxels that are NaN or infinite.
        not_finite_voxels: u64,
        /// Voxels of neighbouring organs that were cut off.
        neighbour_voxels_cut: u64,
        /// Area of that cut, mm².
        neighbour_cut_mm2: f64,
        /// Components before all but one were removed.
        components_before: u64,
        /// Enclosed cavities before they were filled.
        cavities_before: u64,
        /// Handles before they were removed.
        handles_before: u64,
        /// Voxels of dropped components.
        voxels_dropped: u64,
        /// Voxels cut to open handles.
        voxels_cut: u64,
        /// Voxels filled to close handles and cavities.
        voxels_filled: u64,
    }

    /// Figures of the mesh before optimisation.
    RetileReport as RetileReport {
        /// Seed of the kept model's random numbers.
        seed: u64,
        /// Rounds of repulsion.
        repulsion_rounds: u64,
        /// Repetitions of repulsion and tessellation.
        repeats: u64,
        /// Rounds of relaxation.
        relaxation_rounds: u64,
        /// Attempts until the mesh was a manifold.
        attempts: u64,
        /// The models of which the best was kept.
        starts: Vec<StartReport>,
        /// Shape of the triangles.
        shape: ShapeReport,
        /// Angles between neighbouring triangles.
        smoothness: SmoothnessReport,
    }

    /// One of the models of which the best was kept.
    StartReport as Start {
        /// Its seed.
        seed: u64,
        /// Mean 2r/R of its triangles.
        radius_ratio_mean: f64,
        /// Mean distance to the surface, mm.
        distance_mean_mm: f64,
        /// Largest distance to the surface, mm.
        hausdorff_mm: f64,
    }

    /// What optimisation did.
    OptimiseReport as OptimiseReport {
        /// Edges flipped.
        flips: u64,
        /// Sweeps over all edges.
        sweeps: u64,
        /// Why it ended: `no_flip_gains`, `cycle` or `sweep_limit`.
        ended: String,
        /// Rounds of the least-squares fit.
        fit_rounds: u64,
        /// Edges flipped during the fit.
        fit_flips: u64,
        /// Steps of the fit that were shortened.
        fit_shortened: u64,
        /// Intersecting pairs of triangles before optimisation.
        self_intersections_before: u64,
    }

    /// Counts, topology and size of a mesh.
    MeshReport as MeshFacts {
        /// Number of vertices.
        vertices: u64,
        /// Number of edges.
        edges: u64,
        /// Number of triangles.
        triangles: u64,
        /// Connected components.
        components: u64,
        /// V - E + F.
        euler_characteristic: i64,
        /// Handles over all components, of a closed manifold.
        genus: Option<i64>,
        /// No edge has a single triangle.
        closed: bool,
        /// No edge has more than two triangles.
        edge_manifold: bool,
        /// The triangles about every vertex form one cycle.
        vertex_manifold: bool,
        /// The normals of neighbouring triangles point to the same side.
        oriented: bool,
        /// The enclosed volume is positive.
        outward: bool,
        /// Components with a positive enclosed volume.
        outward_components: u64,
        /// The first defect found, in words.
        defect: Option<String>,
        /// Pairs of triangles that meet in more than shared vertices and edges.
        self_intersections: u64,
        /// Area, mm².
        area_mm2: f64,
        /// Enclosed volume, millilitres.
        volume_ml: f64,
        /// Smallest coordinates.
        min_mm: [f64; 3],
        /// Largest coordinates.
        max_mm: [f64; 3],
    }

    /// How well-shaped triangles are.
    ShapeReport as Shape {
        /// Radius ratio 2r/R, 1 = equilateral.
        radius_ratio: SummaryReport,
        /// Smallest angle of each triangle, degrees.
        min_angle_deg: SummaryReport,
        /// Largest angle of each triangle, degrees.
        max_angle_deg: SummaryReport,
        /// Lengths of edges, mm.
        edge_length_mm: SummaryReport,
        /// Areas of triangles, mm².
        area_mm2: SummaryReport,
        /// Edges at each vertex.
        valence: ValenceReport,
    }

    /// Mean, spread and percentiles of a list of numbers.
    SummaryReport as Summary {
        /// Arithmetic mean.
        mean: f64,
        /// Root of the mean square.
        rms: f64,
        /// Standard deviation over the mean.
        cv: f64,
        /// Smallest.
        min: f64,
        /// 5th percentile.
        p5: f64,
        /// 50th percentile.
        median: f64,
        /// 95th percentile.
        p95: f64,
        /// Largest.
        max: f64,
    }

    /// How many edges meet at a vertex.
    ValenceReport as Valence {
        /// Number of vertices for each valence.
        counts: BTreeMap<String, u64>,
        /// Share of vertices with six edges.
        share_6: f64,
        /// Share of vertices with five, six or seven.
        share_5_to_7: f64,
    }

    /// How smooth a mesh is.
    SmoothnessReport as Smoothness {
        /// Angle between the normals of neighbouring triangles, degrees.
        dihedral_deg: SummaryReport,
    }

    /// Distances between a model and its surface.
    DistanceReport as Distance {
        /// Mean of the two directions' means, mm.
        mean_mm: f64,
        /// Root mean square over both directions, mm.
        rms_mm: f64,
        /// The larger of the two directions' 95th percentiles, mm.
        hd95_mm: f64,
        /// The largest distance found (Hausdorff), mm.
        hausdorff_mm: f64,
        /// Upper bound of the largest distance, mm.
        hausdorff_at_most_mm: Option<f64>,
        /// The mean in units of the smallest voxel spacing.
        mean_voxels: f64,
        /// The Hausdorff distance in the same unit.
        hausdorff_voxels: f64,
        /// The smallest voxel spacing, mm.
        voxel_mm: f64,
        /// From points of the model to the surface.
        model_to_surface: DirectionReport,
        /// From points of the surface to the model.
        surface_to_model: DirectionReport,
        /// Volume enclosed by the model, millilitres.
        volume_ml: f64,
        /// Volume enclosed by the surface, millilitres.
        surface_volume_ml: f64,
        /// How much more volume the model encloses, percent.
        volume_error_percent: f64,
        /// How much more area the model has, percent.
        area_error_percent: f64,
    }

    /// Distances of one side's points to the other side.
    DirectionReport as DistanceDirection {
        /// Number of even samples.
        samples: u64,
        /// Mean, mm.
        mean_mm: f64,
        /// Root mean square, mm.
        rms_mm: f64,
        /// 95th percentile, mm.
        p95_mm: f64,
        /// Largest distance found at any point, mm.
        max_mm: f64,
        /// Upper bound of the largest distance, mm.
        max_at_most_mm: Option<f64>,
    }

    /// The paper's fitness: mean over all edges.
    FitnessReport as FitnessReport {
        /// The form in which `retiled`, `fitted` and `optimised` are given.
        form: String,
        /// After re-tiling.
        retiled: f64,
        /// After the least-squares fit.
        fitted: f64,
        /// After optimisation.
        optimised: f64,
        /// From re-tiled to optimised, percent.
        gain_percent: f64,
        /// Weights of the four terms.
        weights: [f64; 4],
        /// Numerators and floors of every form.
        scales: BTreeMap<String, FitnessScalesSchema>,
        /// All forms after each stage.
        forms: FitnessFormStages,
        /// Mean terms after each stage.
        terms: FitnessTermStages,
    }

    /// Numerators and floors of the four terms.
    FitnessScalesSchema as FitnessScales {
        /// Numerators, in radians and millimetres.
        numerator: [f64; 4],
        /// Floors, in radians and millimetres.
        floor: [f64; 4],
    }

    /// All forms of the fitness after each stage.
    FitnessFormStages as FitnessFormStages {
        /// After re-tiling.
        retiled: FitnessFormsSchema,
        /// After the least-squares fit.
        fitted: FitnessFormsSchema,
        /// After optimisation.
        optimised: FitnessFormsSchema,
    }

    /// Mean fitness in every form.
    FitnessFormsSchema as FitnessForms {
        /// The paper's reciprocal terms, capped.
        raw: f64,
        /// Every term in (0, 1].
        normalised: f64,
        /// Comparable between tools.
        robust: f64,
    }

    /// Mean terms of the fitness after each stage.
    FitnessTermStages as FitnessTermStages {
        /// After re-tiling.
        retiled: FitnessTermsSchema,
        /// After the least-squares fit.
        fitted: FitnessTermsSchema,
        /// After optimisation.
        optimised: FitnessTermsSchema,
    }

    /// Means of the four terms over all edges.
    FitnessTermsSchema as FitnessTerms {
        /// Angle between the normals of the edge's triangles, degrees.
        a_deg: f64,
        /// Mean angle to the four outer neighbours, degrees.
        b_deg: f64,
        /// R/(2r) of the two triangles, 1 = equilateral.
        c: f64,
        /// Distance of the edge's midpoint to the surface, mm.
        d_mm: f64,
    }

    /// Distributions before and after optimisation.
    HistogramsReport as Histograms {
        /// Radius ratios 2r/R.
        radius_ratio: HistogramReport,
        /// Smallest angle of each triangle, degrees.
        min_angle_deg: HistogramReport,
        /// Lengths of edges, mm.
        edge_length_mm: HistogramReport,
        /// Angles between neighbouring triangles' normals, degrees.
        dihedral_deg: HistogramReport,
        /// Edges at each vertex.
        valence: HistogramReport,
    }

    /// Counts over equal bins.
    HistogramReport as Histogram {
        /// Lower end of the first bin.
        lower: f64,
        /// Width of a bin.
        width: f64,
        /// Counts before optimisation.
        retiled: Vec<u64>,
        /// Counts after optimisation.
        optimised: Vec<u64>,
    }

    /// Signed distances from a model to its surface, as in `distance.json`.
    ClosenessSchema as Closeness {
        /// Parts that each side of a triangle is cut into.
        parts: u64,
        /// Distance of the centroid of each part, mm; positive outside. Triangle by triangle.
        distances_mm: Vec<f64>,
    }

    /// The main figures of a model; the report has all.
    ModelSummarySchema as ModelSummary {
        /// Number of vertices.
        vertices: u64,
        /// Number of triangles.
        triangles: u64,
        /// V - E + F.
        euler_characteristic: i64,
        /// Intersecting pairs of triangles.
        self_intersections: u64,
        /// Mean 2r/R of the triangles.
        radius_ratio_mean: f64,
        /// Smallest 2r/R.
        radius_ratio_min: f64,
        /// Mean angle between neighbours, degrees.
        dihedral_mean_deg: f64,
        /// Mean distance to the surface, mm.
        distance_mean_mm: f64,
        /// Largest distance to the surface, mm.
        hausdorff_mm: f64,
        /// How much more volume the model encloses than the surface, percent.
        volume_error_percent: f64,
        /// The paper's fitness.
        fitness: f64,
    }

    /// The main figures of a template.
    TemplateSummarySchema as TemplateSummary {
        /// Number of vertices.
        vertices: u64,
        /// Number of triangles.
        triangles: u64,
        /// Enclosed volume, millilitres.
        volume_ml: f64,
        /// Length of its cup, mm; ventricles only.
        length_mm: Option<f64>,
        /// What was assumed or changed of the mesh, in sentences.
        warnings: Vec<String>,
    }

    /// What a reader's profile holds.
    ReaderSummarySchema as ReaderSummary {
        /// The wall that the distances start from: `apparent` or `anatomical`.
        edge: String,
        /// Number of masks that it was learnt on.
        masks: u64,
        /// The distances that are applied, mm.
        offsets_mm: ReaderOffsetsReport,
    }

    /// How far a reader's wall lies from the fitted one, mm.
    ReaderOffsetsReport as ReaderOffsets {
        /// How far the inner surface lies farther out.
        endocardium: f64,
        /// How far the outer surface lies farther out.
        epicardium: f64,
        /// How far the rim lies farther towards the base.
        rim: f64,
    }

    /// A reader's profile, as `ventriform calibrate` writes it.
    ReaderProfileSchema as ReaderProfile {
        /// `ventriform-reader-profile`.
        format: String,
        /// 1.
        version: u64,
        /// The wall that the distances start from: `apparent` or `anatomical`.
        edge: String,
        /// Number of masks that it was learnt on: the length of `learnt_on`.
        masks: u64,
        /// The distances, mm.
        offsets_mm: LearntOffsetsSchema,
        /// What it was learnt on.
        learnt_on: Vec<LearntOnSchema>,
    }

    /// The distances of a reader's profile.
    LearntOffsetsSchema as LearntOffsets {
        /// Inner surface, outward.
        endocardium: LearntOffsetSchema,
        /// Outer surface, outward.
        epicardium: LearntOffsetSchema,
        /// Rim, towards the base.
        rim: LearntOffsetSchema,
    }

    /// One distance of a reader's profile, mm.
    LearntOffsetSchema as LearntOffset {
        /// What is applied: the mean, drawn towards zero.
        value: f64,
        /// Mean over the masks.
        mean: f64,
        /// Standard deviation over the masks.
        spread: f64,
    }

    /// A scan and its mask that a profile was learnt on.
    LearntOnSchema as LearntOn {
        /// SHA-256 of the scan's file, hexadecimal.
        scan: String,
        /// SHA-256 of the mask's file, hexadecimal.
        mask: String,
    }

    /// The reader's profile that a wall was drawn by.
    AppliedReaderReport as AppliedReader {
        /// Its name.
        name: String,
        /// SHA-256 of the profile, hexadecimal.
        sha256: String,
        /// The wall that the distances start from.
        edge: String,
        /// Number of masks that it was learnt on.
        masks: u64,
        /// The distances, mm.
        offsets_mm: ReaderOffsetsReport,
        /// Share of the distances that was applied: 1 unless the surface would intersect itself.
        share_applied: f64,
    }

    /// The main figures of a segmentation; the report has all.
    SegmentationSummarySchema as SegmentationSummary {
        /// Name of the fitted model.
        template: String,
        /// Why that one was taken.
        choice: String,
        /// Models that were fitted.
        candidates: Vec<CandidateReport>,
        /// Why the motion ended.
        reason: String,
        /// How reliable the fit is, 0 to 1.
        confidence: f64,
        /// Volumes.
        volumes_ml: FittedVolumesReport,
        /// Agreement with the expert's mask.
        measures: Option<AgreementReport>,
        /// Reasons to look closer.
        flags: Vec<FlagReport>,
        /// Number of vertices of the fitted mesh.
        vertices: u64,
    }

    /// The report of a segmentation. Lengths are millimetres in the patient frame LPS.
    SegmentationReportSchema as SegmentationReport {
        /// Name of the fitted model.
        template: String,
        /// Why that one was taken.
        choice: String,
        /// Models that were fitted.
        candidates: Vec<CandidateReport>,
        /// Models that could not be fitted.
        refused: Vec<RefusedReport>,
        /// Where the organ was found.
        localisation: Option<LocalisationReport>,
        /// Which way is up in the patient.
        posture: Option<PostureReport>,
        /// How the fit went.
        fit: FitReport,
        /// The figures behind confidence and flags; ventricles only.
        evidence: Option<EvidenceReport>,
        /// Volumes.
        volumes_ml: FittedVolumesReport,
        /// Mass of the myocardium, g, from the anatomical wall; ventricles only.
        mass_g: Option<f64>,
        /// Mean thickness of the wall that `edge` asks for; ventricles only.
        wall_thickness_mm: Option<f64>,
        /// Thickness of both walls; ventricles only.
        thickness_mm: Option<ThicknessesReport>,
        /// Standard deviation of the nodes' distance from the walls; ventricles only.
        uncertainty_mm: Option<UncertaintiesReport>,
        /// Full width at half maximum of the image's point response; ventricles only.
        resolution_mm: Option<ResolutionReport>,
        /// The reader's profile that the shown wall was drawn by.
        reader: Option<AppliedReaderReport>,
        /// Agreement with the expert's mask.
        measures: Option<AgreementReport>,
        /// Uptake of the wall; ventricles only.
        polar: Option<PolarSummary>,
        /// Reasons to look closer.
        flags: Vec<FlagReport>,
        /// Which voxels the mask holds.
        mask_rule: String,
        /// Every parameter, defaults written out.
        parameters: SegmentationParametersObject,
        /// The volume's file.
        input: FileFactsSchema,
        /// Warnings about the volume's file.
        warnings: Vec<String>,
    }

    /// One model's fit.
    CandidateReport as Candidate {
        /// The model's name.
        template: String,
        /// What it is ranked by: its confidence by its own figures.
        confidence: f64,
        /// What decides between equals.
        merit: f64,
        /// Share of the surface along which an edge is seen.
        active: f64,
        /// Root of the mean squared strain.
        strain: f64,
        /// Distance to the edges, weighted root mean square.
        residual_mm: f64,
    }

    /// Standard deviation of the nodes' distance from the walls, millimetres.
    UncertaintiesReport as Uncertainties {
        /// From the wall as it looks.
        apparent: UncertaintyReport,
        /// From the wall itself.
        anatomical: UncertaintyReport,
    }

    /// Standard deviation of the nodes' distance from a wall, millimetres.
    UncertaintyReport as Uncertainty {
        /// Median over the nodes.
        median: f64,
        /// 95th percentile over the nodes.
        percentile_95: f64,
        /// The greatest.
        greatest: f64,
    }

    /// A model that could not be fitted.
    RefusedReport as RefusedTemplate {
        /// The model's name.
        template: String,
        /// Why.
        reason: String,
    }

    /// Where the organ was found.
    LocalisationReport as Localisation {
        /// Its centre.
        centre: [f64; 3],
        /// Direction from base to apex.
        axis: [f64; 3],
        /// Its length, mm.
        length_mm: f64,
        /// Correlation with the shape sought.
        correlation: f64,
        /// Correlation of the next best place.
        runner_up: Option<f64>,
        /// How hollow it is, 0 to 1.
        hollowness: f64,
        /// How sure the search is, 0 to 1.
        confidence: f64,
    }

    /// Which way is up in the patient.
    PostureReport as Posture {
        /// The direction to the head.
        superior: [f64; 3],
        /// What told it: `superior`, `anterior`, `body` or `frame`.
        source: String,
        /// Its angle to the scanner's axis.
        tilt_degrees: f64,
        /// How sure that is, 0 to 1.
        confidence: f64,
    }

    /// How a fit went, and the fitted model's pose.
    FitReport as Fit {
        /// Why the motion ended.
        reason: String,
        /// How reliable the fit is, 0 to 1.
        confidence: f64,
        /// Steps of the motion.
        iterations: u64,
        /// Runs from different starts.
        runs: u64,
        /// Distance to the edges, weighted root mean square.
        residual_mm: f64,
        /// Share of sensors that see an edge.
        active_sensors: f64,
        /// Root of the mean squared strain.
        strain: f64,
        /// Kinetic energy after each step.
        energy: Vec<f64>,
        /// Intersecting pairs of triangles.
        self_intersections: u64,
        /// Triangles that turned over.
        turned_triangles: u64,
        /// The ventricle's long axis.
        long_axis: Option<LongAxis>,
        /// Size relative to the model.
        scale: f64,
        /// Rotation of the model; row by row.
        rotation: [[f64; 3]; 3],
        /// How far each vertex moved, mm.
        displacement_mm: Vec<f64>,
    }

    /// The ends of a ventricle's long axis.
    LongAxis as LongAxis {
        /// Centre of the base.
        base: [f64; 3],
        /// The apex.
        apex: [f64; 3],
    }

    /// Volumes of a fitted model, millilitres.
    FittedVolumesReport as FittedVolumes {
        /// Of the wall that `edge` asks for, or of the whole organ.
        wall: f64,
        /// Of its cavity; ventricles only.
        cavity: Option<f64>,
        /// Of the wall as the blurred image shows it; ventricles only.
        apparent: Option<WallVolumesReport>,
        /// Of the wall corrected for the blur; ventricles only.
        anatomical: Option<WallVolumesReport>,
    }

    /// Volumes of one wall, millilitres.
    WallVolumesReport as WallVolumes {
        /// Of the wall.
        wall: f64,
        /// Of the cavity.
        cavity: f64,
    }

    /// Thickness of both walls, mm.
    ThicknessesReport as Thicknesses {
        /// Of the wall as the blurred image shows it.
        apparent: ThicknessReport,
        /// Of the wall corrected for the blur.
        anatomical: ThicknessReport,
    }

    /// Thickness of a wall, mm.
    ThicknessReport as Thickness {
        /// Its mean.
        mean: f64,
        /// Its standard deviation over the wall.
        spread: f64,
    }

    /// Full width at half maximum of the image's point response.
    ResolutionReport as Resolution {
        /// Millimetres.
        value: f64,
        /// `given` as a parameter, or `estimated` from the image.
        source: String,
    }

    /// The figures behind confidence and flags.
    EvidenceReport as Evidence {
        /// Share of sensors that see an edge.
        active_sensors: f64,
        /// Distance to the edges, weighted root mean square.
        residual_mm: f64,
        /// Root of the mean squared strain.
        strain: f64,
        /// How much darker the cavity is than the wall, 0 to 1.
        hollowness: f64,
        /// Volume of the cavity.
        cavity_ml: f64,
        /// Standard deviation of the wall's thickness.
        thickness_spread_mm: f64,
        /// Standard deviation of the distance from the axis to the middle of the wall, as a share of its mean.
        unroundness: f64,
        /// How far the middle of the wall lies off the axis, as a share of that mean.
        offset: f64,
        /// Length from rim to apex over the outer radius.
        slenderness: f64,
        /// Distance of the septum from the axis over that of the free wall.
        septal_bulge: f64,
        /// Share of the wall that takes up less than half as much as the bright wall does.
        dark: f64,
        /// Share of the wall beside which something takes up more than that.
        beside: f64,
        /// Mean correlation of image and wall in their projections; null where the orientation is unknown.
        agreement_of_views: Option<f64>,
        /// How much better two places of the wall in two runs of projections explain the image than one, as a share of what one leaves unexplained; null likewise.
        gain_of_two_places: Option<f64>,
        /// Distance of the two places along the bed; null likewise.
        displacement_mm: Option<f64>,
        /// Share of the projections that show the second place; null likewise.
        displaced_share: Option<f64>,
        /// Chance that the patient moved, 0 to 1.
        chance_of_motion: f64,
        /// Mean distance of the nodes from the fits of the other built-in hearts; null without them.
        template_spread_mm: Option<f64>,
    }

    /// A mask against an expert's.
    AgreementReport as Agreement {
        /// Jaccard index.
        jaccard: f64,
        /// Mean contour distance, voxels.
        contour_distance_voxels: Option<f64>,
        /// The same in mm.
        contour_distance_mm: Option<f64>,
        /// Dice index.
        dice: f64,
        /// Hausdorff distance.
        hausdorff_mm: Option<f64>,
        /// Its 95th percentile.
        hausdorff95_mm: Option<f64>,
        /// Volume of the mask.
        volume_ml: f64,
        /// Volume of the expert's mask.
        expert_volume_ml: f64,
        /// How much larger the mask is, ml.
        volume_difference_ml: f64,
        /// How much larger the mask is, percent.
        volume_difference_percent: Option<f64>,
    }

    /// A reason to look closer.
    FlagReport as Flag {
        /// Its stable name.
        code: String,
        /// What was found.
        reason: String,
    }

    /// A polar map without its pixels.
    PolarSummary as PolarSummary {
        /// The intensity that counts as 100 per cent.
        reference: f64,
        /// Share of it below which wall counts as a defect.
        threshold_percent: f64,
        /// Share of the wall below it.
        extent_percent: f64,
        /// What the percentages refer to.
        note: String,
        /// The 17 segments.
        segments: Vec<PolarSegmentReport>,
        /// The walls of the three arteries; none if the orientation is unknown.
        territories: Vec<TerritoryReport>,
        /// Rows of pixels, from apex to base.
        rows: u64,
        /// Columns of pixels, around the axis.
        columns: u64,
        /// What told the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`.
        orientation: String,
        /// Where the first column looks; null if the orientation is unknown.
        first_column: Option<String>,
        /// The order of the columns; null if the orientation is unknown.
        direction: Option<String>,
    }

    /// A polar map, as in `polar.json`.
    PolarMapSchema as PolarMap {
        /// The intensity that counts as 100 per cent.
        reference: f64,
        /// Share of it below which wall counts as a defect.
        threshold_percent: f64,
        /// Share of the wall below it.
        extent_percent: f64,
        /// What the percentages refer to.
        note: String,
        /// The 17 segments.
        segments: Vec<PolarSegmentReport>,
        /// The walls of the three arteries; none if the orientation is unknown.
        territories: Vec<TerritoryReport>,
        /// Rows of pixels, from apex to base.
        rows: u64,
        /// Columns of pixels, around the axis.
        columns: u64,
        /// What told the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`.
        orientation: String,
        /// Where the first column looks; null if the orientation is unknown.
        first_column: Option<String>,
        /// The order of the columns; null if the orientation is unknown.
        direction: Option<String>,
        /// The pixels in per cent of the reference; null where there is no wall.
        values_percent: Vec<Vec<Option<f64>>>,
        /// The number of the segment to which each pixel belongs.
        segment_of: Vec<Vec<u64>>,
        /// For every column, the distances from the apex in rows at which apex, apical, mid and basal level
        /// end; row n reaches from n to n + 1. Absent from maps of older versions.
        level_ends: Option<Vec<Vec<f64>>>,
        /// The radii at which these levels end on the drawn map, as shares of its own. Absent from maps of
        /// older versions.
        rings: Option<Vec<f64>>,
    }

    /// The wall that an artery usually feeds.
    TerritoryReport as Territory {
        /// LAD, LCX or RCA.
        name: String,
        /// Mean uptake in per cent of the reference.
        mean_percent: Option<f64>,
        /// Share of its area below the threshold.
        extent_percent: f64,
        /// Its area, mm².
        area_mm2: f64,
    }

    /// One segment of a polar map.
    PolarSegmentReport as PolarSegment {
        /// 1 to 17.
        number: u64,
        /// Its name.
        name: String,
        /// The coronary artery that usually feeds it; null if the orientation is unknown.
        territory: Option<String>,
        /// Mean uptake in per cent of the reference.
        mean_percent: Option<f64>,
        /// Share of its area below the threshold.
        extent_percent: f64,
        /// Its area, mm².
        area_mm2: f64,
    }
}
