//! The objects, read back with `dicom-object`.

use super::*;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use crate::heart::normals::{GroupSex, NormalsFlag, NormalsUsed};
use crate::heart::polar::{PolarSegment, PolarSummary};
use crate::image::draw::Image;
use crate::image::grid::voxelise::voxelise;
use crate::image::volume::Provenance;
use crate::image::volume::is_uid;
use crate::mesh::shapes;
use crate::results::report::comparison_report::tests::first_comparison;
use crate::results::report::segmentation_report::tests::first_report;
use crate::results::report::{
    ComparisonReport, PerfusionReport, RaisedFlag, SegmentScore, SegmentationReport,
    TerritoryScore, Thickness, Thicknesses, VolumeIntervalsReport, WallVolumes,
};
use dicom_core::Tag;
use dicom_object::{DefaultDicomObject, InMemDicomObject, from_reader};
use nalgebra::Matrix3;
use std::collections::{BTreeMap, BTreeSet};

const SCAN_SHAPE: [usize; 3] = [30, 26, 22];

fn moment() -> Moment {
    Moment {
        date: "20261123".into(),
        time: "013000".into(),
    }
}

fn provenance() -> Provenance {
    let some = |text: &str| Some(text.to_owned());
    Provenance {
        patient_name: some("Müller^Jürgen"),
        patient_id: some("P-17"),
        patient_birth_date: some("19500203"),
        patient_sex: some("M"),
        study_uid: some("1.2.3.4"),
        study_date: some("20250115"),
        study_time: some("103000"),
        study_id: some("S1"),
        accession_number: some("ACC1"),
        referring_physician: some("House^Gregory"),
        series_uid: some("1.2.3.4.5"),
        series_number: some("2"),
        series_description: some("SA rest"),
        modality: some("NM"),
        frame_of_reference_uid: some("1.2.3.4.9"),
        sop_class_uid: some(uids::NUCLEAR_MEDICINE_IMAGE_STORAGE),
        sop_instance_uid: some("1.2.3.4.5.6"),
        slice_frames: (1..=SCAN_SHAPE[2] as u32).rev().collect(),
        ..Provenance::default()
    }
}

/// Everything that results are made of.
struct Scene {
    scan: SourceScan,
    mask: Mask,
    mesh: TriMesh,
    report: SegmentationReport,
    png: Vec<u8>,
}

fn polar() -> PolarSummary {
    let segment = |number: usize| PolarSegment {
        number,
        name: "x".into(),
        territory: None,
        mean_percent: Some(60.0 + number as f64),
        extent_percent: number as f64,
        area_mm2: 100.0,
    };
    PolarSummary {
        reference: 1.0,
        threshold_percent: 60.0,
        extent_percent: 12.5,
        note: String::new(),
        segments: (1..=17).map(segment).collect(),
        territories: Vec::new(),
        rows: 32,
        columns: 60,
        orientation: "frame".into(),
        first_column: None,
        direction: None,
        attenuation: None,
    }
}

impl Scene {
    /// A cup in a volume whose axes are the columns of `axes`, 3 x 3.5 x 4 mm apart.
    fn new(axes: Matrix3<f64>, provenance: Provenance, placed: bool) -> Self {
        let linear = axes * Matrix3::from_diagonal(&Vec3::new(3.0, 3.5, 4.0));
        let middle = Vec3::new(14.5, 12.5, 10.5);
        let frame = VoxelToPatient::new(linear, Vec3::new(7.0, -30.0, 45.0) - linear * middle);
        let frame = frame.unwrap();
        let mut mesh = shapes::cup(60.0, 30.0, 10.0, 24);
        let centre = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len() as f64;
        for vertex in &mut mesh.vertices {
            *vertex += frame.to_patient(&middle) - centre + Vec3::new(1.0, -2.0, 3.0);
        }
        let mask = voxelise(&mesh, SCAN_SHAPE, &frame, &Monitor::silent()).unwrap();
        assert!(mask.count() > 500);
        let mut report = first_report();
        report.volumes_ml.wall = 101.25;
        report.volumes_ml.cavity = Some(55.5);
        report.wall_thickness_mm = Some(9.5);
        report.polar = Some(polar());
        report.flags = vec![RaisedFlag {
            code: "x".into(),
            reason: "The wall is thin; größer als üblich.".into(),
        }];
        Self {
            scan: SourceScan::new(provenance, frame, SCAN_SHAPE, placed, moment()),
            mask,
            mesh,
            report,
            png: Image::filled(5, 3, [10, 20, 30]).png(),
        }
    }

    fn results(&self) -> DicomResults<'_> {
        let structure = Structure::from_organ("left_ventricle");
        let text = serde_json::to_string(&self.report).unwrap();
        DicomResults::new(&self.scan, structure, &self.mask, &self.mesh, &text)
            .with_figures(&self.report)
            .with_pictures(Some(&self.png), Some(&self.png))
    }

    fn write(&self, object: DicomObject) -> Vec<u8> {
        self.results().write(object).unwrap().unwrap()
    }

    fn read(&self, object: DicomObject) -> DefaultDicomObject {
        from_reader(&self.write(object)[..]).unwrap()
    }
}

fn straight() -> Scene {
    Scene::new(Matrix3::identity(), provenance(), true)
}

fn text(set: &InMemDicomObject, tag: Tag) -> String {
    set.element(tag)
        .unwrap()
        .to_str()
        .unwrap()
        .trim_end_matches('\0')
        .trim_end()
        .to_owned()
}

fn numbers(set: &InMemDicomObject, tag: Tag) -> Vec<f64> {
    set.element(tag).unwrap().to_multi_float64().unwrap()
}

fn items(set: &InMemDicomObject, tag: Tag) -> &[InMemDicomObject] {
    set.element(tag).unwrap().items().unwrap()
}

fn only(set: &InMemDicomObject, tag: Tag) -> &InMemDicomObject {
    let items = items(set, tag);
    assert_eq!(items.len(), 1);
    &items[0]
}

/// The 24 ways to turn a volume by right angles and their 24 mirror images, and two oblique ones.
fn orientations() -> Vec<Matrix3<f64>> {
    let mut all = Vec::new();
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        for signs in 0..8 {
            let mut axes = Matrix3::zeros();
            for (column, row) in order.into_iter().enumerate() {
                axes[(row, column)] = if signs >> column & 1 == 1 { -1.0 } else { 1.0 };
            }
            all.push(axes);
        }
    }
    let turn = *nalgebra::Rotation3::from_euler_angles(0.3, -0.5, 1.1).matrix();
    all.extend([
        turn,
        turn * Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, -1.0)),
    ]);
    all
}

/// Every voxel of the mask is where the volume has it, and its frame refers to the source's frame.
#[test]
fn the_mask_lies_where_it_was_made() {
    for axes in orientations() {
        let scene = Scene::new(axes, provenance(), true);
        let set = scene.read(DicomObject::Mask);
        let shared = only(&set, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE);
        let measures = only(shared, tags::PIXEL_MEASURES_SEQUENCE);
        let spacing = numbers(measures, tags::PIXEL_SPACING);
        assert_eq!(numbers(measures, tags::SPACING_BETWEEN_SLICES), [4.0]);
        let plane = only(shared, tags::PLANE_ORIENTATION_SEQUENCE);
        let cosines = numbers(plane, tags::IMAGE_ORIENTATION_PATIENT);
        let along_row = Vec3::from_column_slice(&cosines[..3]);
        let along_column = Vec3::from_column_slice(&cosines[3..]);
        let bytes = set.element(tags::PIXEL_DATA).unwrap().to_bytes().unwrap();
        let frames = items(&set, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
        assert_eq!(frames.len(), SCAN_SHAPE[2]);
        let mut last = f64::NEG_INFINITY;
        let mut found = BTreeSet::new();
        let (mut bit, mut expected) = (0, 0);
        for frame in frames {
            let corner = only(frame, tags::PLANE_POSITION_SEQUENCE);
            let corner = numbers(corner, tags::IMAGE_POSITION_PATIENT);
            let corner = Vec3::from_column_slice(&corner);
            let height = corner.dot(&along_row.cross(&along_column));
            assert!(height > last, "frames follow each other along the normal");
            last = height;
            for row in 0..SCAN_SHAPE[1] {
                for column in 0..SCAN_SHAPE[0] {
                    let at = corner
                        + along_row * (spacing[1] * column as f64)
                        + along_column * (spacing[0] * row as f64);
                    let index = scene.scan.frame.to_voxel(&at);
                    let voxel = [0, 1, 2].map(|axis| index[axis].round() as usize);
                    assert!((index - Vec3::from(voxel.map(|x| x as f64))).norm() < 1e-6);
                    let place = voxel[0] + SCAN_SHAPE[0] * (voxel[1] + SCAN_SHAPE[1] * voxel[2]);
                    let set = bytes[bit / 8] >> (bit % 8) & 1 == 1;
                    assert_eq!(set, scene.mask.voxels[place]);
                    expected += usize::from(set);
                    found.insert(place);
                    bit += 1;
                    if (row, column) == (0, 0) {
                        let derivation = only(frame, tags::DERIVATION_IMAGE_SEQUENCE);
                        let source = only(derivation, tags::SOURCE_IMAGE_SEQUENCE);
                        let stored = text(source, tags::REFERENCED_FRAME_NUMBER);
                        assert_eq!(stored, (SCAN_SHAPE[2] - voxel[2]).to_string());
                        assert_eq!(
                            text(source, tags::REFERENCED_SOP_INSTANCE_UID),
                            "1.2.3.4.5.6"
                        );
                        assert_eq!(text(source, tags::SPATIAL_LOCATIONS_PRESERVED), "YES");
                    }
                }
            }
        }
        assert_eq!(found.len(), SCAN_SHAPE.iter().product::<usize>());
        assert_eq!(expected, scene.mask.count());
    }
}

/// The cavity is a second segment on the same planes, told from the first by its own UIDs.
#[test]
fn the_cavity_is_a_segment_of_its_own() {
    let scene = straight();
    let mut cavity = Mask::empty(SCAN_SHAPE);
    for (voxel, set) in cavity.voxels.iter_mut().enumerate() {
        *set = voxel % 7 == 3 && !scene.mask.voxels[voxel];
    }
    let write = |cavity| scene.results().with_cavity(cavity).write(DicomObject::Mask);
    let set = from_reader(&write(Some(&cavity)).unwrap().unwrap()[..]).unwrap();
    let segments = items(&set, tags::SEGMENT_SEQUENCE);
    assert_eq!(segments.len(), 2);
    let kind = only(&segments[1], tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE);
    assert_eq!(text(kind, tags::CODE_VALUE), "LV-CAVITY");
    let tracking = [&segments[0], &segments[1]].map(|s| text(s, tags::TRACKING_UID));
    assert_ne!(tracking[0], tracking[1]);
    assert_eq!(text(&set, tags::SEGMENTS_OVERLAP), "NO");
    assert_eq!(
        text(&set, tags::NUMBER_OF_FRAMES),
        (2 * SCAN_SHAPE[2]).to_string()
    );
    let frames = items(&set, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
    let place = |frame: usize| {
        let position = only(&frames[frame], tags::PLANE_POSITION_SEQUENCE);
        numbers(position, tags::IMAGE_POSITION_PATIENT)
    };
    for k in 0..SCAN_SHAPE[2] {
        assert_eq!(place(k), place(SCAN_SHAPE[2] + k));
        for (number, frame) in [(1.0, k), (2.0, SCAN_SHAPE[2] + k)] {
            let segment = only(&frames[frame], tags::SEGMENT_IDENTIFICATION_SEQUENCE);
            assert_eq!(numbers(segment, tags::REFERENCED_SEGMENT_NUMBER), [number]);
            let content = only(&frames[frame], tags::FRAME_CONTENT_SEQUENCE);
            let index = numbers(content, tags::DIMENSION_INDEX_VALUES);
            assert_eq!(index, [number, k as f64 + 1.0]);
        }
    }
    let bytes = set.element(tags::PIXEL_DATA).unwrap().to_bytes().unwrap();
    let bit = |place: usize| bytes[place / 8] >> (place % 8) & 1 == 1;
    let both = scene.mask.voxels.iter().chain(&cavity.voxels);
    assert!(both.enumerate().all(|(place, set)| bit(place) == *set));
    let alone = from_reader(&write(None).unwrap().unwrap()[..]).unwrap();
    let uid = |set: &DefaultDicomObject| text(set, tags::SOP_INSTANCE_UID);
    assert_ne!(uid(&alone), uid(&set));
}

/// A slice whose image or frame is named is that image pixel for pixel; of an instance that is named as a whole,
/// nothing is claimed; and no picture has the places of its scan.
#[test]
fn what_lies_as_its_source_does_says_so() {
    let slices = SCAN_SHAPE[2];
    let series = || Provenance {
        slice_frames: Vec::new(),
        instance_uids: (1..=slices).map(|k| format!("1.2.3.{k}")).collect(),
        ..provenance()
    };
    let parts = Provenance {
        slice_frames: (0..slices as u32).map(|k| k % 7 + 1).collect(),
        ..series()
    };
    let whole = Provenance {
        slice_frames: Vec::new(),
        ..provenance()
    };
    for (known, framed, said) in [
        (provenance(), true, Some("YES")),
        (series(), false, Some("YES")),
        (parts, true, Some("YES")),
        (whole, false, None),
    ] {
        let scene = Scene::new(orientations()[0], known, true);
        let cavity = Mask::empty(SCAN_SHAPE);
        let made = scene.results().with_cavity(Some(&cavity));
        let made = made.write(DicomObject::Mask).unwrap().unwrap();
        let set = from_reader(&made[..]).unwrap();
        let frames = items(&set, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
        assert_eq!(frames.len(), 2 * slices);
        for frame in frames {
            let derivation = only(frame, tags::DERIVATION_IMAGE_SEQUENCE);
            let source = only(derivation, tags::SOURCE_IMAGE_SEQUENCE);
            let has = |tag| source.element(tag).is_ok();
            assert_eq!(has(tags::REFERENCED_FRAME_NUMBER), framed);
            let preserved = tags::SPATIAL_LOCATIONS_PRESERVED;
            let preserved = has(preserved).then(|| text(source, preserved));
            assert_eq!(preserved.as_deref(), said);
        }
        for picture in [DicomObject::Page, DicomObject::Polar] {
            for source in items(&scene.read(picture), tags::SOURCE_IMAGE_SEQUENCE) {
                assert_eq!(text(source, tags::SPATIAL_LOCATIONS_PRESERVED), "NO");
            }
        }
    }
}

/// Slices of a volume are filled by its contours exactly where voxel centres lie inside the mesh.
#[test]
fn the_contours_enclose_the_mask() {
    for axes in [orientations()[0], orientations()[11], orientations()[49]] {
        let scene = Scene::new(axes, provenance(), true);
        let set = scene.read(DicomObject::Contours);
        let region = only(&set, tags::ROI_CONTOUR_SEQUENCE);
        let mut filled = Mask::empty(SCAN_SHAPE);
        for contour in items(region, tags::CONTOUR_SEQUENCE) {
            let points = numbers(contour, tags::CONTOUR_DATA);
            let count: usize = text(contour, tags::NUMBER_OF_CONTOUR_POINTS)
                .parse()
                .unwrap();
            assert_eq!(points.len(), 3 * count);
            let points: Vec<Vec3> = points
                .chunks(3)
                .map(|p| scene.scan.frame.to_voxel(&Vec3::from_column_slice(p)))
                .collect();
            let slice = points[0].z.round() as usize;
            assert!(points.iter().all(|p| (p.z - slice as f64).abs() < 1e-3));
            let source = only(contour, tags::CONTOUR_IMAGE_SEQUENCE);
            let stored = text(source, tags::REFERENCED_FRAME_NUMBER);
            assert_eq!(stored, (SCAN_SHAPE[2] - slice).to_string());
            for row in 0..SCAN_SHAPE[1] {
                for column in 0..SCAN_SHAPE[0] {
                    let (x, y) = (column as f64, row as f64);
                    let crossings = (0..points.len()).filter(|i| {
                        let (a, b) = (points[*i], points[(i + 1) % points.len()]);
                        (a.y > y) != (b.y > y) && x < a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y)
                    });
                    let place = column + SCAN_SHAPE[0] * (row + SCAN_SHAPE[1] * slice);
                    filled.voxels[place] ^= crossings.count() % 2 == 1;
                }
            }
        }
        let differing = (filled.voxels.iter().zip(&scene.mask.voxels)).filter(|(a, b)| a != b);
        // Contours are rounded to the thousandth of a millimetre.
        assert!(differing.count() <= 2);
    }
}

#[test]
fn both_meshes_have_the_vertices_of_the_model() {
    let scene = straight();
    let set = scene.read(DicomObject::Mesh);
    let document = set
        .element(tags::ENCAPSULATED_DOCUMENT)
        .unwrap()
        .to_bytes()
        .unwrap();
    let length: usize = text(&set, tags::ENCAPSULATED_DOCUMENT_LENGTH)
        .parse()
        .unwrap();
    let triangles = scene.mesh.triangles.len();
    assert_eq!(length, 84 + 50 * triangles);
    for (facet, triangle) in document[84..length].chunks(50).zip(&scene.mesh.triangles) {
        for corner in 0..3 {
            let at: Vec<f32> = facet[12 + 12 * corner..24 + 12 * corner]
                .chunks(4)
                .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
                .collect();
            let vertex = scene.mesh.vertices[triangle[corner] as usize];
            assert!((0..3).all(|axis| (f64::from(at[axis]) - vertex[axis]).abs() < 0.01));
        }
    }
    assert_eq!(text(&set, tags::MODEL_MIRRORING), "NO");
    let unit = only(&set, tags::MEASUREMENT_UNITS_CODE_SEQUENCE);
    assert_eq!(text(unit, tags::CODE_VALUE), "mm");

    let set = scene.read(DicomObject::Surface);
    let surface = only(&set, tags::SURFACE_SEQUENCE);
    let points = only(surface, tags::SURFACE_POINTS_SEQUENCE);
    let coordinates = numbers(points, tags::POINT_COORDINATES_DATA);
    assert_eq!(coordinates.len(), 3 * scene.mesh.vertices.len());
    for (point, vertex) in coordinates.chunks(3).zip(&scene.mesh.vertices) {
        assert!((Vec3::from_column_slice(point) - vertex).norm() < 1e-4);
    }
    let primitives = only(surface, tags::SURFACE_MESH_PRIMITIVES_SEQUENCE);
    let list = primitives
        .element(tags::LONG_TRIANGLE_POINT_INDEX_LIST)
        .unwrap();
    let corners: Vec<u32> = list.to_multi_int().unwrap();
    let expected: Vec<u32> = scene
        .mesh
        .triangles
        .iter()
        .flatten()
        .map(|v| v + 1)
        .collect();
    assert_eq!(corners, expected);
}

/// Meaning of the concept name and the value of every NUM below `set`, with its depth first path.
fn figures(set: &InMemDicomObject, into: &mut Vec<(String, String, f64)>, site: &str) {
    let mut site = site.to_owned();
    let Some(Ok(children)) = set.get(tags::CONTENT_SEQUENCE).map(|e| e.items().ok_or(())) else {
        return;
    };
    let name = |item: &InMemDicomObject, tag| text(only(item, tag), tags::CODE_MEANING);
    for child in children {
        let named = child.get(tags::CONCEPT_NAME_CODE_SEQUENCE).is_some();
        if named && name(child, tags::CONCEPT_NAME_CODE_SEQUENCE) == "Finding Site" {
            site = name(child, tags::CONCEPT_CODE_SEQUENCE);
        }
    }
    for child in children {
        if text(child, tags::VALUE_TYPE) == "NUM" {
            let value = only(child, tags::MEASURED_VALUE_SEQUENCE);
            let number = numbers(value, tags::NUMERIC_VALUE)[0];
            let concept = name(child, tags::CONCEPT_NAME_CODE_SEQUENCE);
            into.push((concept, site.clone(), number));
        } else {
            figures(child, into, &site);
        }
    }
}

#[test]
fn the_report_repeats_the_figures() {
    let scene = straight();
    let set = scene.read(DicomObject::Measurements);
    let mut found = Vec::new();
    figures(&set, &mut found, "");
    let has = |concept: &str, site: &str, number: f64| {
        let entry = (concept.to_owned(), site.to_owned(), number);
        assert!(found.contains(&entry), "{entry:?} in {found:?}");
    };
    has("Volume", "Left ventricle", 101.25);
    has("Volume", "Cavity of left ventricle", 55.5);
    has("Wall Thickness", "Left ventricle", 9.5);
    has(
        "Extent of cardiac perfusion defect (observable entity)",
        "Left ventricle",
        12.5,
    );
    has(
        "Myocardial perfusion (observable entity)",
        "left ventricle mid inferior segment",
        70.0,
    );
    assert_eq!(found.len(), 4 + 2 * 17);
    // The evidence names the source and the mask that the content refers to.
    let study = only(&set, tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE);
    let named: Vec<String> = items(study, tags::REFERENCED_SERIES_SEQUENCE)
        .iter()
        .map(|s| {
            text(
                only(s, tags::REFERENCED_SOP_SEQUENCE),
                tags::REFERENCED_SOP_INSTANCE_UID,
            )
        })
        .collect();
    let mask = text(&scene.read(DicomObject::Mask), tags::SOP_INSTANCE_UID);
    assert_eq!(named, ["1.2.3.4.5.6", &mask]);
}

/// A wall beside limits of this protocol.
fn perfusion(protocol: &str) -> PerfusionReport {
    let segment = |segment: usize| SegmentScore {
        segment,
        name: "x".into(),
        z: (segment > 1).then_some(-(segment as f64)),
        score: (segment > 1).then_some(2),
        extent_percent: 30.0 + segment as f64,
        deficit_percent: 20.0,
        compared_percent: 90.0,
    };
    let territory = |name: &str| TerritoryScore {
        name: name.into(),
        extent_percent: 41.5,
        deficit_percent: 7.5,
        summed_score: 9,
    };
    PerfusionReport {
        normals: NormalsUsed {
            sha256: "5eba".repeat(16),
            program_version: "0.0.9".into(),
            simulated: true,
            people: "simulated, not patients".into(),
            sex: GroupSex::F,
            protocol: protocol.into(),
            tracer: "Tc-99m".into(),
            attenuation_corrected: false,
            cases: 31,
        },
        note: "TPD-like".into(),
        z_limit: 2.5,
        deficit_percent: 6.25,
        extent_percent: 18.75,
        severity: Some(3.5),
        summed_score: 32,
        summed_percent: 47.0,
        segments: (1..=17).map(segment).collect(),
        territories: ["LAD", "LCX", "RCA"].map(territory).into(),
        figures: Vec::new(),
        flags: vec![RaisedFlag {
            code: "normals_simulated".into(),
            reason: "for tests only".into(),
        }],
    }
}

/// Every text of the content below `set`, codes' values and meanings included.
fn texts(set: &InMemDicomObject) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    walk(set, &mut |_, value| {
        found.insert(value.trim_end_matches(['\0', ' ']).to_owned());
    });
    found
}

#[test]
fn a_scan_beside_normal_limits_has_their_figures_and_names_them() {
    let mut scene = straight();
    let mut before = Vec::new();
    figures(&scene.read(DicomObject::Measurements), &mut before, "");
    for (protocol, summed, state) in [
        ("stress, one day", "Summed stress score", Some("432655005")),
        ("rest", "Summed rest score", Some("128975004")),
        ("one day", "Summed score", None),
    ] {
        scene.report.perfusion = Some(perfusion(protocol));
        let set = scene.read(DicomObject::Measurements);
        let mut found = Vec::new();
        figures(&set, &mut found, "");
        let has = |concept: &str, site: &str, number: f64| {
            let entry = (concept.to_owned(), site.to_owned(), number);
            assert!(found.contains(&entry), "{entry:?} in {found:?}");
        };
        let extent = "Extent of cardiac perfusion defect (observable entity)";
        // That below a share of the maximum stays.
        has(extent, "Left ventricle", 12.5);
        has(extent, "Left ventricle", 18.75);
        has(
            "Deficit score against normal limits",
            "Left ventricle",
            6.25,
        );
        has(
            "Mean |z| of the wall below the normal limit",
            "Left ventricle",
            3.5,
        );
        has(summed, "Left ventricle", 32.0);
        // Of a territory.
        has(extent, "Left ventricle", 41.5);
        has("Summed score", "Left ventricle", 9.0);
        let segment = "left ventricle mid inferior segment";
        has("Perfusion score, 0 normal to 4 absent", segment, 2.0);
        has("Mean z, negative below the normal mean", segment, -10.0);
        has(extent, segment, 40.0);
        // A segment that nothing was compared in has no figures.
        let basal = |(_, site, number): &&(String, String, f64)| {
            site == "left ventricle basal anterior segment" && *number == 31.0
        };
        assert_eq!(found.iter().find(basal), None);
        assert_eq!(found.len(), before.len() + 4 + 3 * 3 + 16 * 4);
        let texts = texts(&set);
        let group = format!(
            "sex F, protocol {protocol}, tracer Tc-99m, attenuation corrected no, 31 cases"
        );
        let hash = "5eba".repeat(16);
        for said in [
            group.as_str(),
            hash.as_str(),
            "simulated, not patients",
            "ventriform 0.0.9",
            "TPD-like",
            "for tests only",
            "NORMAL-LIMITS",
        ] {
            assert!(texts.contains(said), "{said}");
        }
        for known in ["432655005", "128975004"] {
            assert_eq!(texts.contains(known), state == Some(known), "{protocol}");
        }
    }
    // Whether a scan of unknown protocol is at stress, limits of stress do not tell.
    let mut unknown = perfusion("stress");
    let kind = NormalsFlag::KindNotStated {
        fields: vec!["sex", "protocol"],
    };
    unknown.flags.push(RaisedFlag::new(kind.code(), &kind));
    scene.report.perfusion = Some(unknown);
    let texts = texts(&scene.read(DicomObject::Measurements));
    assert!(!texts.contains("432655005") && !texts.contains("82648-7"));
}

/// Method ("" without one), site and volume, ml, of every group that has volumes, which may be one only: readers of
/// the template tell figures apart by what their group says.
fn volumes(set: &InMemDicomObject, into: &mut Vec<(String, String, f64)>) {
    let Some(children) = set.get(tags::CONTENT_SEQUENCE).and_then(|e| e.items()) else {
        return;
    };
    let code = |item: &InMemDicomObject, tag| text(only(item, tag), tags::CODE_VALUE);
    let named = |child: &&InMemDicomObject, name: &str| {
        child.get(tags::CONCEPT_NAME_CODE_SEQUENCE).is_some()
            && code(child, tags::CONCEPT_NAME_CODE_SEQUENCE) == name
    };
    let said = |name: &str| {
        let item = children.iter().find(|child| named(child, name));
        item.map(|item| code(item, tags::CONCEPT_CODE_SEQUENCE))
            .unwrap_or_default()
    };
    if children.iter().any(|child| named(&child, "118565006")) {
        let mut found = Vec::new();
        figures(set, &mut found, "");
        let mut found = found.into_iter().filter(|(name, ..)| name == "Volume");
        let (.., number) = found.next().unwrap();
        assert!(found.next().is_none(), "two volumes in one group");
        into.push((said("370129005"), said("363698007"), number));
    }
    children.iter().for_each(|child| volumes(child, into));
}

#[test]
fn each_volume_has_a_group_that_says_which_it_is() {
    let mut scene = straight();
    let apart = |set: &InMemDicomObject| {
        let mut found = Vec::new();
        volumes(set, &mut found);
        found
    };
    let whole = apart(&scene.read(DicomObject::Measurements));
    let sites: Vec<&str> = whole.iter().map(|(_, site, _)| site.as_str()).collect();
    assert_eq!(sites, ["87878005", "LV-CAVITY"]);
    let volumes = |wall, cavity| Some(WallVolumes { wall, cavity });
    scene.report.volumes_ml.apparent = volumes(120.5, 40.25);
    scene.report.volumes_ml.anatomical = volumes(101.25, 55.5);
    scene.report.volumes_ml.anatomical_interval = Some(VolumeIntervalsReport {
        wall: [90.5, 120.25],
        cavity: [48.25, 61.75],
    });
    let thickness = |mean| Thickness { mean, spread: 1.0 };
    scene.report.thickness_mm = Some(Thicknesses {
        apparent: thickness(f64::NAN),
        anatomical: thickness(9.5),
        anatomical_interval: Some([7.5, 13.25]),
    });
    let set = scene.read(DicomObject::Measurements);
    let part = |method: &str, site: &str, number| (method.to_owned(), site.to_owned(), number);
    assert_eq!(
        apart(&set)[2..],
        [
            part("APPARENT", "87878005", 120.5),
            part("APPARENT", "LV-CAVITY", 40.25),
            part("ANATOMICAL", "87878005", 101.25),
            part("ANATOMICAL", "LV-CAVITY", 55.5),
        ]
    );
    let mut all = Vec::new();
    figures(&set, &mut all, "");
    assert_eq!(all.len(), 4 + 2 + 3 + 2 * 17);
    let mut found = Vec::new();
    ranges(&set, &mut found);
    assert_eq!(found, [10.75, 19.0, 2.0, 3.75, 7.25, 6.25]);
}

/// The distance that the truth may lie below and above, ml or mm, for each figure that states it.
fn ranges(set: &InMemDicomObject, into: &mut Vec<f64>) {
    for child in set
        .get(tags::CONTENT_SEQUENCE)
        .and_then(|e| e.items())
        .unwrap_or_default()
    {
        if text(child, tags::RELATIONSHIP_TYPE) == "HAS PROPERTIES" {
            let value = only(child, tags::MEASURED_VALUE_SEQUENCE);
            into.extend(numbers(value, tags::NUMERIC_VALUE));
        }
        ranges(child, into);
    }
}

#[test]
fn what_could_not_be_decoded_makes_no_object() {
    let lost = |fields: &[&str]| Provenance {
        patient_name: None,
        undecoded: fields.iter().map(|f| (*f).to_owned()).collect(),
        ..provenance()
    };
    let of = |scan: Provenance| Scene::new(Matrix3::identity(), scan, true);
    for field in StatedIdentity::FIELD_NAMES
        .iter()
        .chain(&["study_time", "series_uid"])
    {
        let scene = of(lost(&[field]));
        for object in DicomObject::ALL {
            let refused = scene.results().write(object);
            assert!(
                matches!(refused, Err(DicomError::Undecoded { field: named }) if named == *field),
                "{field}: {refused:?}"
            );
        }
    }
    // Descriptions are in no object.
    assert!(legible(&lost(&["series_description"])).is_ok());
    let scan = lost(&["patient_name", "protocol_name"]);
    let stated = StatedIdentity {
        patient_name: Some("Doe^Jane".into()),
        ..StatedIdentity::default()
    };
    let known = identity(Some(&scan), &stated).unwrap();
    assert!(legible(&known).is_ok());
    let scene = of(known);
    assert_eq!(
        text(&scene.read(DicomObject::Mesh), tags::PATIENT_NAME),
        "Doe^Jane"
    );
    let how = Deidentification {
        secret: b"s".to_vec(),
    };
    let mut scene = of(scan);
    scene.scan = scene.scan.deidentified(&how, &StatedIdentity::default());
    assert_eq!(text(&scene.read(DicomObject::Mesh), tags::PATIENT_NAME), "");
}

/// Calls `visit` with every element of `set` and of its sequences.
fn walk(set: &InMemDicomObject, visit: &mut dyn FnMut(Tag, &str)) {
    for element in set.iter() {
        match element.items() {
            Some(items) => items.iter().for_each(|item| walk(item, visit)),
            None => {
                let shown = element.to_str().unwrap_or_default();
                visit(element.header().tag, &shown);
            }
        }
    }
}

#[test]
fn all_belong_to_the_patient_and_have_no_private_attribute() {
    let scene = straight();
    let mut instances = BTreeSet::new();
    for object in DicomObject::ALL {
        let set = scene.read(object);
        assert_eq!(text(&set, tags::PATIENT_NAME), "Müller^Jürgen");
        assert_eq!(text(&set, tags::PATIENT_ID), "P-17");
        assert_eq!(text(&set, tags::STUDY_INSTANCE_UID), "1.2.3.4");
        assert_eq!(text(&set, tags::ACCESSION_NUMBER), "ACC1");
        if let Some(frame) = set.get(tags::FRAME_OF_REFERENCE_UID) {
            assert_eq!(frame.to_str().unwrap().trim_end_matches('\0'), "1.2.3.4.9");
        }
        let mut uids = Vec::new();
        walk(&set, &mut |tag, value| {
            assert_eq!(tag.group() % 2, 0, "{tag} of {object:?} is private");
            if value.starts_with("2.25.") {
                uids.push(value.trim_end_matches('\0').to_owned());
            }
        });
        assert!(uids.iter().all(|uid| is_uid(uid)));
        assert!(instances.insert(text(&set, tags::SOP_INSTANCE_UID)));
        assert_eq!(
            set.meta()
                .media_storage_sop_instance_uid()
                .trim_end_matches('\0'),
            text(&set, tags::SOP_INSTANCE_UID)
        );
    }
}

#[test]
fn equal_input_gives_equal_bytes_and_other_input_other_uids() {
    let (scene, again) = (straight(), straight());
    for object in DicomObject::ALL {
        assert_eq!(scene.write(object), again.write(object), "{object:?}");
    }
    let uid = |scene: &Scene| text(&scene.read(DicomObject::Mask), tags::SOP_INSTANCE_UID);
    let mut other = straight();
    other.report = first_report();
    assert_ne!(uid(&scene), uid(&other));
    let mut other = straight();
    other.mask.voxels[0] ^= true;
    assert_ne!(uid(&scene), uid(&other));
    let later = Provenance {
        patient_id: Some("P-18".into()),
        ..provenance()
    };
    assert_ne!(
        uid(&scene),
        uid(&Scene::new(Matrix3::identity(), later, true))
    );
}

#[test]
fn without_a_position_no_frame_of_reference_is_claimed() {
    let scene = Scene::new(Matrix3::identity(), provenance(), false);
    let own = text(&scene.read(DicomObject::Mask), tags::FRAME_OF_REFERENCE_UID);
    assert!(own != "1.2.3.4.9" && is_uid(&own));
    for object in [
        DicomObject::Mesh,
        DicomObject::Surface,
        DicomObject::Contours,
    ] {
        let set = scene.read(object);
        assert_eq!(text(&set, tags::FRAME_OF_REFERENCE_UID), own);
    }
}

#[test]
fn deidentified_objects_hold_nothing_of_the_patient() {
    let how = Deidentification {
        secret: b"secret".to_vec(),
    };
    let stated = StatedIdentity {
        patient_id: Some("TRIAL-1".into()),
        ..StatedIdentity::default()
    };
    let mut scene = straight();
    scene.scan = scene.scan.deidentified(&how, &stated);
    let mut studies = BTreeMap::new();
    for object in DicomObject::ALL {
        let bytes = scene.write(object);
        let set = from_reader(&bytes[..]).unwrap();
        walk(&set, &mut |tag, value| {
            let secret = [
                "ller", "P-17", "195002", "ACC1", "House", "20250115", "20261123", "1.2.3.4",
            ];
            for part in secret {
                assert!(!value.contains(part), "{part} in {tag} of {object:?}");
            }
        });
        assert_eq!(text(&set, tags::PATIENT_ID), "TRIAL-1");
        assert_eq!(text(&set, tags::PATIENT_IDENTITY_REMOVED), "YES");
        *studies
            .entry(text(&set, tags::STUDY_INSTANCE_UID))
            .or_insert(0) += 1;
    }
    assert_eq!(studies.len(), 1, "one study stays one study");
}

#[test]
fn identity_comes_from_the_file_or_from_a_person() {
    let stated = |id: Option<&str>, study: Option<&str>| StatedIdentity {
        patient_id: id.map(str::to_owned),
        study_uid: study.map(str::to_owned),
        ..StatedIdentity::default()
    };
    let missing = |field| Err(DicomError::NoIdentity { field });
    assert!(identity(Some(&provenance()), &stated(None, None)).is_ok());
    assert!(identity(Some(&provenance()), &stated(Some("P-17"), None)).is_ok());
    let other = identity(Some(&provenance()), &stated(Some("P-18"), None));
    let field = "patient_id";
    assert_eq!(other, Err(DicomError::Contradiction { field }));
    assert_eq!(
        identity(None, &stated(None, Some("1.2"))),
        missing("patient_id")
    );
    assert_eq!(
        identity(None, &stated(Some("A"), None)),
        missing("study_uid")
    );
    assert!(identity(None, &stated(Some("A"), Some("1.2"))).is_ok());
    for (id, study) in [("A\\B", "1.2"), ("", "1.2"), ("A", "1.02"), ("A", "one")] {
        let refused = identity(None, &stated(Some(id), Some(study)));
        assert!(
            matches!(refused, Err(DicomError::Identity { .. })),
            "{id} {study}"
        );
    }
}

#[test]
fn a_volume_without_dicom_images_names_no_source() {
    let caller = Provenance {
        patient_id: Some("A".into()),
        study_uid: Some("1.2.3".into()),
        ..Provenance::default()
    };
    let scene = Scene::new(Matrix3::identity(), caller, true);
    for object in DicomObject::ALL {
        let set = scene.read(object);
        let mut referenced = 0;
        let mask = text(&scene.read(DicomObject::Mask), tags::SOP_INSTANCE_UID);
        walk(&set, &mut |tag, value| {
            if tag == tags::REFERENCED_SOP_INSTANCE_UID && value.trim_end_matches('\0') != mask {
                referenced += 1;
            }
        });
        assert_eq!(referenced, 0, "{object:?}");
    }
}

#[test]
fn pictures_keep_their_pixels_and_oblique_rows_are_refused() {
    let scene = straight();
    let set = scene.read(DicomObject::Polar);
    assert_eq!(text(&set, tags::BURNED_IN_ANNOTATION), "NO");
    assert_eq!(
        (text(&set, tags::ROWS), text(&set, tags::COLUMNS)),
        ("3".into(), "5".into())
    );
    let pixels = set.element(tags::PIXEL_DATA).unwrap().to_bytes().unwrap();
    assert_eq!(pixels[..45], [10, 20, 30].repeat(15));
    assert_eq!(pixels.len(), 46);
    let bare = DicomResults {
        polar: None,
        ..scene.results()
    };
    assert_eq!(bare.write(DicomObject::Polar), Ok(None));

    let mut sheared = Matrix3::identity();
    sheared[(0, 1)] = 0.1;
    let scene = Scene::new(sheared, provenance(), true);
    assert_eq!(
        scene.results().write(DicomObject::Mask),
        Err(DicomError::Oblique)
    );
}

fn pixels(set: &InMemDicomObject) -> Vec<u8> {
    let pixels = set.element(tags::PIXEL_DATA).unwrap().to_bytes().unwrap();
    pixels.into_owned()
}

/// The page of that scan, and whether it says that it names somebody.
fn page_of(scene: &Scene) -> (Vec<u8>, bool) {
    let set = scene.read(DicomObject::Page);
    let burned_in = text(&set, tags::BURNED_IN_ANNOTATION);
    assert!(["YES", "NO"].contains(&burned_in.as_str()));
    (pixels(&set), burned_in == "YES")
}

/// Each part of the identity is in the pixels, and they say so; without any they say that there is none.
#[test]
fn a_page_names_patient_and_study_and_says_so() {
    let of = |scan: Provenance| page_of(&Scene::new(Matrix3::identity(), scan, true));
    let (named, burned_in) = of(provenance());
    assert!(burned_in);
    // A sex has three values.
    let other = |number| Some(if number == 3 { "O" } else { "19990909" }.to_owned());
    let changes: [fn(&mut Provenance) -> &mut Option<String>; 9] = [
        |scan| &mut scan.patient_name,
        |scan| &mut scan.patient_id,
        |scan| &mut scan.patient_birth_date,
        |scan| &mut scan.patient_sex,
        |scan| &mut scan.study_date,
        |scan| &mut scan.study_description,
        |scan| &mut scan.study_id,
        |scan| &mut scan.accession_number,
        |scan| &mut scan.referring_physician,
    ];
    let nobody = Provenance {
        study_uid: Some("1.2.3.4".into()),
        ..Provenance::default()
    };
    let (unnamed, burned_in) = of(nobody.clone());
    assert!(!burned_in);
    for (number, field) in changes.into_iter().enumerate() {
        let mut scan = provenance();
        *field(&mut scan) = other(number);
        assert_ne!(of(scan).0, named, "{number}");
        let mut alone = nobody.clone();
        *field(&mut alone) = other(number);
        let (shown, burned_in) = of(alone);
        assert!(burned_in && shown != unnamed, "{number}");
    }
}

/// Two patients with the same heart have the same page once they are freed of their identity, whatever they are given
/// in its place, and whatever the file said of the scan.
#[test]
fn a_page_freed_of_the_identity_names_nobody() {
    let other = Provenance {
        patient_name: Some("山田^太郎=山田".into()),
        patient_id: Some("P-99".into()),
        study_description: Some("Follow-up of Yamada".into()),
        series_description: Some("Yamada at rest".into()),
        radiopharmaceutical: Some("Yamada's tracer".into()),
        convolution_kernel: Some("Yamada's filter".into()),
        ..provenance()
    };
    let stated = [None, Some("TRIAL-1".to_owned())];
    let pages = [provenance(), other].into_iter().zip(stated);
    let pages: Vec<(Vec<u8>, bool)> = pages
        .map(|(scan, patient_id)| {
            let mut scene = Scene::new(Matrix3::identity(), scan, true);
            scene.report.warnings = vec![format!("{patient_id:?} is left out.")];
            let how = Deidentification {
                secret: b"s".to_vec(),
            };
            let stated = StatedIdentity {
                patient_id,
                ..StatedIdentity::default()
            };
            scene.scan = scene.scan.deidentified(&how, &stated);
            page_of(&scene)
        })
        .collect();
    assert!(pages[0] == pages[1], "the pixels differ");
    assert!(!pages[0].1);
}

/// A page holds its pictures: each of them, and each figure, changes its pixels and its UID.
#[test]
fn a_page_holds_pictures_and_figures() {
    let scene = straight();
    let page = |results: DicomResults<'_>| {
        let bytes = results.write(DicomObject::Page).unwrap().unwrap();
        let set = from_reader(&bytes[..]).unwrap();
        (pixels(&set), text(&set, tags::SOP_INSTANCE_UID))
    };
    let whole = page(scene.results());
    let black = Image::filled(5, 3, [0; 3]).png();
    for pictures in [
        (None, Some(&scene.png[..])),
        (Some(&black[..]), Some(&scene.png[..])),
        (Some(&scene.png[..]), None),
        (Some(&scene.png[..]), Some(&black[..])),
    ] {
        let other = page(scene.results().with_pictures(pictures.0, pictures.1));
        assert!(other.0 != whole.0 && other.1 != whole.1);
    }
    let changes: [fn(&mut SegmentationReport); 4] = [
        |report| report.volumes_ml.wall += 1.0,
        |report| report.flags[0].reason.push('!'),
        |report| report.flags.clear(),
        |report| report.template.push('x'),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut other = straight();
        change(&mut other.report);
        assert!(page(other.results()).0 != whole.0, "{number}");
    }
    // Without a report there is no page.
    let bare = DicomResults {
        figures: None,
        ..scene.results()
    };
    assert_eq!(bare.write(DicomObject::Page), Ok(None));
    let damaged = scene.results().with_pictures(Some(b"no picture"), None);
    assert!(matches!(
        damaged.write(DicomObject::Page),
        Err(DicomError::Picture {
            name: "page.dcm",
            ..
        })
    ));
}

/// A page is of the two scans: it says what the report says, and names whom both files name.
#[test]
fn a_page_of_a_comparison_names_both_studies_unless_one_is_freed_of_the_identity() {
    let report = first_comparison();
    let structure = Structure::from_organ("left_ventricle");
    let scan = |change: fn(&mut Provenance)| {
        let mut provenance = provenance();
        change(&mut provenance);
        Scene::new(Matrix3::identity(), provenance, true).scan
    };
    let page = |scans: &[SourceScan; 2], report: &ComparisonReport, pictures: &[(&str, &[u8])]| {
        let made = DicomComparison::new(structure, scans, report, "");
        let bytes = made.picture(ComparisonObject::Page, pictures).unwrap();
        let set = from_reader(&bytes.unwrap()[..]).unwrap();
        let burned_in = text(&set, tags::BURNED_IN_ANNOTATION);
        (pixels(&set), burned_in)
    };
    let same: fn(&mut Provenance) = |_| {};
    let both = [scan(same), scan(same)];
    let (named, burned_in) = page(&both, &report, &[]);
    assert_eq!(burned_in, "YES");
    let next_day: fn(&mut Provenance) = |scan| {
        scan.study_uid = Some("1.2.3.7".into());
        scan.study_date = Some("20250116".into());
    };
    let two_days = [scan(same), scan(next_day)];
    assert_ne!(page(&two_days, &report, &[]).0, named);

    let png = Image::filled(5, 3, [10, 20, 30]).png();
    for picture in ComparisonObject::Page.pictures() {
        let (shown, _) = page(&both, &report, &[(*picture, &png[..])]);
        assert_ne!(shown, named, "{picture}");
    }
    let mut other = report.clone();
    other.tid += 0.5;
    assert_ne!(page(&both, &other, &[]).0, named);

    let free = |scan: SourceScan| {
        let how = Deidentification {
            secret: b"s".to_vec(),
        };
        scan.deidentified(&how, &StatedIdentity::default())
    };
    let stranger: fn(&mut Provenance) = |scan| scan.patient_name = Some("Doe^John".into());
    let mut described = report.clone();
    described.stress.series_description = Some("Doe at stress".into());
    described.rest.warnings.push("Doe.dcm was left out.".into());
    let freed = page(&[free(scan(same)), free(scan(same))], &report, &[]);
    assert_eq!(freed.1, "NO");
    let others = [free(scan(stranger)), free(scan(stranger))];
    assert!(page(&others, &described, &[]) == freed);
    let half = [free(scan(same)), scan(stranger)];
    assert!(page(&half, &report, &[]) == freed);

    // A polar map is a file of the comparison; without it there is no such object.
    let made = DicomComparison::new(structure, &both, &report, "");
    for object in ComparisonObject::ALL {
        let alone = made.picture(object, &[]).unwrap();
        assert_eq!(alone.is_some(), object == ComparisonObject::Page);
        let Some(name) = object.needed_picture() else {
            continue;
        };
        let bytes = made.picture(object, &[(name, &png[..])]).unwrap().unwrap();
        let set = from_reader(&bytes[..]).unwrap();
        assert_eq!(pixels(&set)[..45], [10, 20, 30].repeat(15));
        assert_eq!(text(&set, tags::BURNED_IN_ANNOTATION), "NO");
    }
}
