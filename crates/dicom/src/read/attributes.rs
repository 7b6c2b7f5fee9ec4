//! The attributes of a data set that the reader needs, and their values.

use super::ReadError;
use super::real_world::{MAPPING_SEQUENCE, Mappings, UNITS_SEQUENCE};
use super::representation::standard;
use crate::characters::{CharacterSets, Division};
use crate::text::escaped;
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use dicom_encoding::transfer_syntax::Endianness;
use std::collections::{BTreeMap, BTreeSet};

/// Most values that are kept of one data set. Enough for 20,000 frames with a dozen each.
const MOST_VALUES: usize = 1 << 18;

/// Most bytes of values that are kept of one data set.
const MOST_BYTES: usize = 16 << 20;

/// An attribute that the reader needs: its tag, its sequences and its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attribute {
    /// The sequences, from the outermost, whose first items hold the attribute. The Per-frame Functional
    /// Groups Sequence stands for the functional groups of a frame or of all frames.
    pub path: &'static [Tag],
    /// Its own tag.
    pub tag: Tag,
    /// Name and tag for error messages.
    pub name: &'static str,
}

macro_rules! attributes {
    ($($id:ident = $path:expr, $tag:expr, $name:literal;)*) => {
        $(
            #[doc = $name]
            pub const $id: Attribute = Attribute { path: $path, tag: $tag, name: $name };
        )*
        /// Every attribute above.
        pub const WANTED_ATTRIBUTES: &[Attribute] = &[$($id),*];
    };
}

/// Shared Functional Groups Sequence.
const SHARED_GROUPS: Tag = tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE;
/// Per-frame Functional Groups Sequence. In a path it stands for the shared groups too.
const PER_FRAME_GROUPS: Tag = tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE;

/// Segment Sequence, whose items are counted like frames.
const SEGMENT_SEQUENCE: Tag = tags::SEGMENT_SEQUENCE;

/// The detectors of a camera, which are counted like frames as far as [`COUNTED_ATTRIBUTES`] go.
const DETECTOR_PATH: &[Tag] = &[tags::DETECTOR_INFORMATION_SEQUENCE];
/// Gated Information Sequence.
const GATED_INFORMATION: Tag = tags::GATED_INFORMATION_SEQUENCE;
/// Data Information Sequence, with an item for each R-R interval.
const DATA_INFORMATION: Tag = tags::DATA_INFORMATION_SEQUENCE;
/// The R-R intervals of a gated acquisition, which are counted like frames.
const GATED_DATA: &[Tag] = &[GATED_INFORMATION, DATA_INFORMATION];
/// The rotations of a camera, which are counted like frames as far as [`COUNTED_ATTRIBUTES`] go.
const ROTATION_PATH: &[Tag] = &[tags::ROTATION_INFORMATION_SEQUENCE];
const PHARMACEUTICAL_PATH: &[Tag] = &[tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE];
const PHARMACEUTICAL_CODE: &[Tag] = &[
    tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE,
    tags::RADIOPHARMACEUTICAL_CODE_SEQUENCE,
];
const NUCLIDE_CODE: &[Tag] = &[
    tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE,
    tags::RADIONUCLIDE_CODE_SEQUENCE,
];
const CONTEXT_NAME: &[Tag] = &[
    tags::ACQUISITION_CONTEXT_SEQUENCE,
    tags::CONCEPT_CODE_SEQUENCE,
];
const PROTOCOL_CODE: &[Tag] = &[tags::PERFORMED_PROTOCOL_CODE_SEQUENCE];
/// Energy Window Information Sequence with its Energy Window Range Sequence, of Nuclear Medicine.
const ENERGY_WINDOW: &[Tag] = &[
    tags::ENERGY_WINDOW_INFORMATION_SEQUENCE,
    tags::ENERGY_WINDOW_RANGE_SEQUENCE,
];
/// Energy Window Range Sequence, of PET.
const PET_ENERGY_WINDOW: &[Tag] = &[tags::ENERGY_WINDOW_RANGE_SEQUENCE];
const POSTURE_CODE: &[Tag] = &[
    tags::PATIENT_ORIENTATION_CODE_SEQUENCE,
    tags::PATIENT_ORIENTATION_MODIFIER_CODE_SEQUENCE,
];
const GANTRY_CODE: &[Tag] = &[tags::PATIENT_GANTRY_RELATIONSHIP_CODE_SEQUENCE];
const VIEW_CODE: &[Tag] = &[tags::VIEW_CODE_SEQUENCE];
const DETECTOR_VIEW_CODE: &[Tag] = &[
    tags::DETECTOR_INFORMATION_SEQUENCE,
    tags::VIEW_CODE_SEQUENCE,
];
const FRAME_POSITION_PATH: &[Tag] = &[PER_FRAME_GROUPS, tags::PLANE_POSITION_SEQUENCE];
const FRAME_ORIENTATION_PATH: &[Tag] = &[PER_FRAME_GROUPS, tags::PLANE_ORIENTATION_SEQUENCE];
const FRAME_MEASURES: &[Tag] = &[PER_FRAME_GROUPS, tags::PIXEL_MEASURES_SEQUENCE];
const FRAME_RESCALE: &[Tag] = &[PER_FRAME_GROUPS, tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE];
const FRAME_CONTENT: &[Tag] = &[PER_FRAME_GROUPS, tags::FRAME_CONTENT_SEQUENCE];
const FRAME_SEGMENT_PATH: &[Tag] = &[PER_FRAME_GROUPS, tags::SEGMENT_IDENTIFICATION_SEQUENCE];
const FRAME_CARDIAC: &[Tag] = &[PER_FRAME_GROUPS, tags::CARDIAC_SYNCHRONIZATION_SEQUENCE];
const FRAME_RESPIRATORY: &[Tag] = &[PER_FRAME_GROUPS, tags::RESPIRATORY_SYNCHRONIZATION_SEQUENCE];
const FRAME_TEMPORAL: &[Tag] = &[PER_FRAME_GROUPS, tags::TEMPORAL_POSITION_SEQUENCE];
const FRAME_ECHO: &[Tag] = &[PER_FRAME_GROUPS, tags::MR_ECHO_SEQUENCE];
const FRAME_DIFFUSION: &[Tag] = &[PER_FRAME_GROUPS, tags::MR_DIFFUSION_SEQUENCE];
const FRAME_CT_DETAILS: &[Tag] = &[PER_FRAME_GROUPS, tags::CTX_RAY_DETAILS_SEQUENCE];
const FRAME_TYPE_MR: &[Tag] = &[PER_FRAME_GROUPS, tags::MR_IMAGE_FRAME_TYPE_SEQUENCE];
const FRAME_TYPE_CT: &[Tag] = &[PER_FRAME_GROUPS, tags::CT_IMAGE_FRAME_TYPE_SEQUENCE];
const FRAME_TYPE_PET: &[Tag] = &[PER_FRAME_GROUPS, tags::PET_FRAME_TYPE_SEQUENCE];
/// Attributes of single-frame images for which Legacy Converted Enhanced images have no group.
const FRAME_UNASSIGNED: &[Tag] = &[
    PER_FRAME_GROUPS,
    tags::UNASSIGNED_PER_FRAME_CONVERTED_ATTRIBUTES_SEQUENCE,
];
const SEGMENT_TYPE_PATH: &[Tag] = &[
    SEGMENT_SEQUENCE,
    tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE,
];
const SEGMENT_REGION_PATH: &[Tag] = &[SEGMENT_SEQUENCE, tags::ANATOMIC_REGION_SEQUENCE];

attributes! {
    CHARACTER_SET = &[], tags::SPECIFIC_CHARACTER_SET, "Specific Character Set (0008,0005)";
    PHARMACEUTICAL_SET = PHARMACEUTICAL_PATH, tags::SPECIFIC_CHARACTER_SET,
        "Specific Character Set (0008,0005)";
    PHARMACEUTICAL_CODE_SET = PHARMACEUTICAL_CODE, tags::SPECIFIC_CHARACTER_SET,
        "Specific Character Set (0008,0005)";
    NUCLIDE_SET = NUCLIDE_CODE, tags::SPECIFIC_CHARACTER_SET, "Specific Character Set (0008,0005)";
    CONTEXT_SET = CONTEXT_NAME, tags::SPECIFIC_CHARACTER_SET, "Specific Character Set (0008,0005)";
    PROTOCOL_SET = PROTOCOL_CODE, tags::SPECIFIC_CHARACTER_SET,
        "Specific Character Set (0008,0005)";
    IMAGE_TYPE = &[], tags::IMAGE_TYPE, "Image Type (0008,0008)";
    SOP_CLASS = &[], tags::SOP_CLASS_UID, "SOP Class UID (0008,0016)";
    SOP_INSTANCE = &[], tags::SOP_INSTANCE_UID, "SOP Instance UID (0008,0018)";
    STUDY_DATE = &[], tags::STUDY_DATE, "Study Date (0008,0020)";
    SERIES_DATE = &[], tags::SERIES_DATE, "Series Date (0008,0021)";
    ACQUISITION_DATE = &[], tags::ACQUISITION_DATE, "Acquisition Date (0008,0022)";
    CONTENT_DATE = &[], tags::CONTENT_DATE, "Content Date (0008,0023)";
    ACQUISITION_DATE_TIME = &[], tags::ACQUISITION_DATE_TIME, "Acquisition DateTime (0008,002A)";
    CONTENT_TIME = &[], tags::CONTENT_TIME, "Content Time (0008,0033)";
    STUDY_TIME = &[], tags::STUDY_TIME, "Study Time (0008,0030)";
    ACQUISITION_TIME = &[], tags::ACQUISITION_TIME, "Acquisition Time (0008,0032)";
    ACCESSION_NUMBER = &[], tags::ACCESSION_NUMBER, "Accession Number (0008,0050)";
    MODALITY = &[], tags::MODALITY, "Modality (0008,0060)";
    MANUFACTURER = &[], tags::MANUFACTURER, "Manufacturer (0008,0070)";
    REFERRING_PHYSICIAN = &[], tags::REFERRING_PHYSICIAN_NAME,
        "Referring Physician's Name (0008,0090)";
    STUDY_DESCRIPTION = &[], tags::STUDY_DESCRIPTION, "Study Description (0008,1030)";
    SERIES_DESCRIPTION = &[], tags::SERIES_DESCRIPTION, "Series Description (0008,103E)";
    MODEL_NAME = &[], tags::MANUFACTURER_MODEL_NAME, "Manufacturer's Model Name (0008,1090)";
    PATIENT_NAME = &[], tags::PATIENT_NAME, "Patient's Name (0010,0010)";
    PATIENT_ID = &[], tags::PATIENT_ID, "Patient ID (0010,0020)";
    PATIENT_BIRTH_DATE = &[], tags::PATIENT_BIRTH_DATE, "Patient's Birth Date (0010,0030)";
    PATIENT_SEX = &[], tags::PATIENT_SEX, "Patient's Sex (0010,0040)";
    SLICE_THICKNESS = &[], tags::SLICE_THICKNESS, "Slice Thickness (0018,0050)";
    KVP = &[], tags::KVP, "KVP (0018,0060)";
    ECHO_TIME = &[], tags::ECHO_TIME, "Echo Time (0018,0081)";
    INVERSION_TIME = &[], tags::INVERSION_TIME, "Inversion Time (0018,0082)";
    ECHO_NUMBERS = &[], tags::ECHO_NUMBERS, "Echo Number(s) (0018,0086)";
    SPACING_BETWEEN_SLICES = &[], tags::SPACING_BETWEEN_SLICES,
        "Spacing Between Slices (0018,0088)";
    SOFTWARE_VERSIONS = &[], tags::SOFTWARE_VERSIONS, "Software Versions (0018,1020)";
    PROTOCOL_NAME = &[], tags::PROTOCOL_NAME, "Protocol Name (0018,1030)";
    TRIGGER_TIME = &[], tags::TRIGGER_TIME, "Trigger Time (0018,1060)";
    GATE_NOMINAL_INTERVAL = GATED_DATA, tags::NOMINAL_INTERVAL, "Nominal Interval (0018,1062)";
    GATE_FRAME_TIME = GATED_DATA, tags::FRAME_TIME, "Frame Time (0018,1063)";
    GATE_LOW_RR = GATED_DATA, tags::LOW_RR_VALUE, "Low R-R Value (0018,1081)";
    GATE_HIGH_RR = GATED_DATA, tags::HIGH_RR_VALUE, "High R-R Value (0018,1082)";
    GATE_INTERVALS_ACQUIRED = GATED_DATA, tags::INTERVALS_ACQUIRED,
        "Intervals Acquired (0018,1083)";
    GATE_INTERVALS_REJECTED = GATED_DATA, tags::INTERVALS_REJECTED,
        "Intervals Rejected (0018,1084)";
    NOMINAL_INTERVAL = &[], tags::NOMINAL_INTERVAL, "Nominal Interval (0018,1062)";
    FRAME_TIME = &[], tags::FRAME_TIME, "Frame Time (0018,1063)";
    LOW_RR_VALUE = &[], tags::LOW_RR_VALUE, "Low R-R Value (0018,1081)";
    HIGH_RR_VALUE = &[], tags::HIGH_RR_VALUE, "High R-R Value (0018,1082)";
    INTERVALS_ACQUIRED = &[], tags::INTERVALS_ACQUIRED, "Intervals Acquired (0018,1083)";
    INTERVALS_REJECTED = &[], tags::INTERVALS_REJECTED, "Intervals Rejected (0018,1084)";
    HEART_RATE = &[], tags::HEART_RATE, "Heart Rate (0018,1088)";
    B_VALUE = &[], tags::DIFFUSION_B_VALUE, "Diffusion b-value (0018,9087)";
    FLIP_ANGLE = &[], tags::FLIP_ANGLE, "Flip Angle (0018,1314)";
    CONVOLUTION_KERNEL = &[], tags::CONVOLUTION_KERNEL, "Convolution Kernel (0018,1210)";
    STUDY_UID = &[], tags::STUDY_INSTANCE_UID, "Study Instance UID (0020,000D)";
    SERIES_UID = &[], tags::SERIES_INSTANCE_UID, "Series Instance UID (0020,000E)";
    STUDY_ID = &[], tags::STUDY_ID, "Study ID (0020,0010)";
    SERIES_NUMBER = &[], tags::SERIES_NUMBER, "Series Number (0020,0011)";
    ACQUISITION_NUMBER = &[], tags::ACQUISITION_NUMBER, "Acquisition Number (0020,0012)";
    INSTANCE_NUMBER = &[], tags::INSTANCE_NUMBER, "Instance Number (0020,0013)";
    POSITION = &[], tags::IMAGE_POSITION_PATIENT, "Image Position (Patient) (0020,0032)";
    ORIENTATION = &[], tags::IMAGE_ORIENTATION_PATIENT, "Image Orientation (Patient) (0020,0037)";
    FRAME_OF_REFERENCE = &[], tags::FRAME_OF_REFERENCE_UID, "Frame of Reference UID (0020,0052)";
    TEMPORAL_POSITION = &[], tags::TEMPORAL_POSITION_IDENTIFIER,
        "Temporal Position Identifier (0020,0100)";
    IMAGES_IN_ACQUISITION = &[], tags::IMAGES_IN_ACQUISITION, "Images in Acquisition (0020,1002)";
    TRIGGER_DELAY = &[], tags::NOMINAL_CARDIAC_TRIGGER_DELAY_TIME,
        "Nominal Cardiac Trigger Delay Time (0020,9153)";
    CARDIAC_PHASE = &[], tags::NOMINAL_PERCENTAGE_OF_CARDIAC_PHASE,
        "Nominal Percentage of Cardiac Phase (0020,9241)";
    POSITION_REFERENCE = &[], tags::POSITION_REFERENCE_INDICATOR,
        "Position Reference Indicator (0020,1040)";
    SAMPLES = &[], tags::SAMPLES_PER_PIXEL, "Samples per Pixel (0028,0002)";
    PHOTOMETRIC = &[], tags::PHOTOMETRIC_INTERPRETATION, "Photometric Interpretation (0028,0004)";
    PATIENT_POSITION = &[], tags::PATIENT_POSITION, "Patient Position (0018,5100)";
    CORRECTED_IMAGE = &[], tags::CORRECTED_IMAGE, "Corrected Image (0028,0051)";
    NUMBER_OF_FRAMES = &[], tags::NUMBER_OF_FRAMES, "Number of Frames (0028,0008)";
    FRAME_POINTER = &[], tags::FRAME_INCREMENT_POINTER, "Frame Increment Pointer (0028,0009)";
    ROWS = &[], tags::ROWS, "Rows (0028,0010)";
    COLUMNS = &[], tags::COLUMNS, "Columns (0028,0011)";
    PIXEL_SPACING = &[], tags::PIXEL_SPACING, "Pixel Spacing (0028,0030)";
    BITS_ALLOCATED = &[], tags::BITS_ALLOCATED, "Bits Allocated (0028,0100)";
    BITS_STORED = &[], tags::BITS_STORED, "Bits Stored (0028,0101)";
    HIGH_BIT = &[], tags::HIGH_BIT, "High Bit (0028,0102)";
    PIXEL_REPRESENTATION = &[], tags::PIXEL_REPRESENTATION, "Pixel Representation (0028,0103)";
    PADDING = &[], tags::PIXEL_PADDING_VALUE, "Pixel Padding Value (0028,0120)";
    PADDING_LIMIT = &[], tags::PIXEL_PADDING_RANGE_LIMIT, "Pixel Padding Range Limit (0028,0121)";
    FLOAT_PADDING = &[], tags::FLOAT_PIXEL_PADDING_VALUE, "Float Pixel Padding Value (0028,0122)";
    DOUBLE_PADDING = &[], tags::DOUBLE_FLOAT_PIXEL_PADDING_VALUE,
        "Double Float Pixel Padding Value (0028,0123)";
    FLOAT_PADDING_LIMIT = &[], tags::FLOAT_PIXEL_PADDING_RANGE_LIMIT,
        "Float Pixel Padding Range Limit (0028,0124)";
    DOUBLE_PADDING_LIMIT = &[], tags::DOUBLE_FLOAT_PIXEL_PADDING_RANGE_LIMIT,
        "Double Float Pixel Padding Range Limit (0028,0125)";
    RESCALE_INTERCEPT = &[], tags::RESCALE_INTERCEPT, "Rescale Intercept (0028,1052)";
    RESCALE_SLOPE = &[], tags::RESCALE_SLOPE, "Rescale Slope (0028,1053)";
    MODALITY_TABLE = &[tags::MODALITY_LUT_SEQUENCE], tags::LUT_DESCRIPTOR,
        "Modality LUT Sequence (0028,3000)";
    RR_INTERVAL_VECTOR = &[], tags::RR_INTERVAL_VECTOR, "R-R Interval Vector (0054,0060)";
    TIME_SLOT_VECTOR = &[], tags::TIME_SLOT_VECTOR, "Time Slot Vector (0054,0070)";
    ENERGY_WINDOW_VECTOR = &[], tags::ENERGY_WINDOW_VECTOR, "Energy Window Vector (0054,0010)";
    DETECTOR_VECTOR = &[], tags::DETECTOR_VECTOR, "Detector Vector (0054,0020)";
    ROTATION_VECTOR = &[], tags::ROTATION_VECTOR, "Rotation Vector (0054,0050)";
    RR_INTERVALS = &[], tags::NUMBER_OF_RR_INTERVALS, "Number of R-R Intervals (0054,0061)";
    TIME_SLOTS = &[], tags::NUMBER_OF_TIME_SLOTS, "Number of Time Slots (0054,0071)";
    NUMBER_OF_SLICES = &[], tags::NUMBER_OF_SLICES, "Number of Slices (0054,0081)";
    TIME_SLICES = &[], tags::NUMBER_OF_TIME_SLICES, "Number of Time Slices (0054,0101)";
    SERIES_TYPE = &[], tags::SERIES_TYPE, "Series Type (0054,1000)";
    UNITS = &[], tags::UNITS, "Units (0054,1001)";
    SLICE_VECTOR = &[], tags::SLICE_VECTOR, "Slice Vector (0054,0080)";
    RECONSTRUCTION_METHOD = &[], tags::RECONSTRUCTION_METHOD, "Reconstruction Method (0054,1103)";
    FRAME_REFERENCE_TIME = &[], tags::FRAME_REFERENCE_TIME, "Frame Reference Time (0054,1300)";
    IMAGE_INDEX = &[], tags::IMAGE_INDEX, "Image Index (0054,1330)";
    SEGMENTATION_TYPE = &[], tags::SEGMENTATION_TYPE, "Segmentation Type (0062,0001)";
    MAXIMUM_FRACTION = &[], tags::MAXIMUM_FRACTIONAL_VALUE, "Maximum Fractional Value (0062,000E)";
    DETECTOR_POSITION = DETECTOR_PATH, tags::IMAGE_POSITION_PATIENT,
        "Image Position (Patient) (0020,0032)";
    DETECTOR_ORIENTATION = DETECTOR_PATH, tags::IMAGE_ORIENTATION_PATIENT,
        "Image Orientation (Patient) (0020,0037)";
    PHARMACEUTICAL_NAME = PHARMACEUTICAL_PATH, tags::RADIOPHARMACEUTICAL,
        "Radiopharmaceutical (0018,0031)";
    SCAN_ARC = ROTATION_PATH, tags::SCAN_ARC, "Scan Arc (0018,1143)";
    INJECTED_DOSE = PHARMACEUTICAL_PATH, tags::RADIONUCLIDE_TOTAL_DOSE,
        "Radionuclide Total Dose (0018,1074)";
    INJECTION_TIME = PHARMACEUTICAL_PATH, tags::RADIOPHARMACEUTICAL_START_TIME,
        "Radiopharmaceutical Start Time (0018,1072)";
    INJECTION_DATE_TIME = PHARMACEUTICAL_PATH, tags::RADIOPHARMACEUTICAL_START_DATE_TIME,
        "Radiopharmaceutical Start DateTime (0018,1078)";
    PHARMACEUTICAL_MEANING = PHARMACEUTICAL_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    NUCLIDE_MEANING = NUCLIDE_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    POSTURE = POSTURE_CODE, tags::CODE_VALUE, "Code Value (0008,0100)";
    POSTURE_MEANING = POSTURE_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    GANTRY = GANTRY_CODE, tags::CODE_VALUE, "Code Value (0008,0100)";
    GANTRY_MEANING = GANTRY_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    VIEW = VIEW_CODE, tags::CODE_VALUE, "Code Value (0008,0100)";
    VIEW_MEANING = VIEW_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    DETECTOR_VIEW = DETECTOR_VIEW_CODE, tags::CODE_VALUE, "Code Value (0008,0100)";
    DETECTOR_VIEW_MEANING = DETECTOR_VIEW_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    PROGRESSION = &[], tags::SLICE_PROGRESSION_DIRECTION, "Slice Progression Direction (0054,0500)";
    PATIENT_LETTERS = &[], tags::PATIENT_ORIENTATION, "Patient Orientation (0020,0020)";
    CONTEXT_MEANING = CONTEXT_NAME, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    PROTOCOL_MEANING = PROTOCOL_CODE, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    FRAME_POSITION = FRAME_POSITION_PATH, tags::IMAGE_POSITION_PATIENT,
        "Image Position (Patient) (0020,0032)";
    FRAME_ORIENTATION = FRAME_ORIENTATION_PATH, tags::IMAGE_ORIENTATION_PATIENT,
        "Image Orientation (Patient) (0020,0037)";
    FRAME_THICKNESS = FRAME_MEASURES, tags::SLICE_THICKNESS, "Slice Thickness (0018,0050)";
    FRAME_BETWEEN_SLICES = FRAME_MEASURES, tags::SPACING_BETWEEN_SLICES,
        "Spacing Between Slices (0018,0088)";
    FRAME_PIXEL_SPACING = FRAME_MEASURES, tags::PIXEL_SPACING, "Pixel Spacing (0028,0030)";
    FRAME_RESCALE_INTERCEPT = FRAME_RESCALE, tags::RESCALE_INTERCEPT,
        "Rescale Intercept (0028,1052)";
    FRAME_RESCALE_SLOPE = FRAME_RESCALE, tags::RESCALE_SLOPE, "Rescale Slope (0028,1053)";
    FRAME_DATE_TIME = FRAME_CONTENT, tags::FRAME_ACQUISITION_DATE_TIME,
        "Frame Acquisition DateTime (0018,9074)";
    FRAME_TEMPORAL_INDEX = FRAME_CONTENT, tags::TEMPORAL_POSITION_INDEX,
        "Temporal Position Index (0020,9128)";
    FRAME_REFERENCE_DATE_TIME = FRAME_CONTENT, tags::FRAME_REFERENCE_DATE_TIME,
        "Frame Reference DateTime (0018,9151)";
    FRAME_ACQUISITION_NUMBER = FRAME_CONTENT, tags::FRAME_ACQUISITION_NUMBER,
        "Frame Acquisition Number (0020,9156)";
    FRAME_DIMENSIONS = FRAME_CONTENT, tags::DIMENSION_INDEX_VALUES,
        "Dimension Index Values (0020,9157)";
    FRAME_STACK = FRAME_CONTENT, tags::STACK_ID, "Stack ID (0020,9056)";
    FRAME_TIME_OFFSET = FRAME_TEMPORAL, tags::TEMPORAL_POSITION_TIME_OFFSET,
        "Temporal Position Time Offset (0020,930D)";
    FRAME_TRIGGER_DELAY = FRAME_CARDIAC, tags::NOMINAL_CARDIAC_TRIGGER_DELAY_TIME,
        "Nominal Cardiac Trigger Delay Time (0020,9153)";
    FRAME_ACTUAL_DELAY = FRAME_CARDIAC, tags::ACTUAL_CARDIAC_TRIGGER_DELAY_TIME,
        "Actual Cardiac Trigger Delay Time (0020,9252)";
    FRAME_CARDIAC_PHASE = FRAME_CARDIAC, tags::NOMINAL_PERCENTAGE_OF_CARDIAC_PHASE,
        "Nominal Percentage of Cardiac Phase (0020,9241)";
    FRAME_RR_NOMINAL = FRAME_CARDIAC, tags::RR_INTERVAL_TIME_NOMINAL,
        "R-R Interval Time Nominal (0020,9251)";
    FRAME_LOW_RR = FRAME_CARDIAC, tags::LOW_RR_VALUE, "Low R-R Value (0018,1081)";
    FRAME_HIGH_RR = FRAME_CARDIAC, tags::HIGH_RR_VALUE, "High R-R Value (0018,1082)";
    FRAME_INTERVALS_ACQUIRED = FRAME_CARDIAC, tags::INTERVALS_ACQUIRED,
        "Intervals Acquired (0018,1083)";
    FRAME_INTERVALS_REJECTED = FRAME_CARDIAC, tags::INTERVALS_REJECTED,
        "Intervals Rejected (0018,1084)";
    FRAME_RESPIRATORY_DELAY = FRAME_RESPIRATORY, tags::NOMINAL_RESPIRATORY_TRIGGER_DELAY_TIME,
        "Nominal Respiratory Trigger Delay Time (0020,9255)";
    FRAME_RESPIRATORY_PHASE = FRAME_RESPIRATORY, tags::NOMINAL_PERCENTAGE_OF_RESPIRATORY_PHASE,
        "Nominal Percentage of Respiratory Phase (0020,9245)";
    FRAME_ECHO_TIME = FRAME_ECHO, tags::EFFECTIVE_ECHO_TIME, "Effective Echo Time (0018,9082)";
    FRAME_B_VALUE = FRAME_DIFFUSION, tags::DIFFUSION_B_VALUE, "Diffusion b-value (0018,9087)";
    FRAME_KVP = FRAME_CT_DETAILS, tags::KVP, "KVP (0018,0060)";
    FRAME_MR_TYPE = FRAME_TYPE_MR, tags::FRAME_TYPE, "Frame Type (0008,9007)";
    FRAME_CT_TYPE = FRAME_TYPE_CT, tags::FRAME_TYPE, "Frame Type (0008,9007)";
    FRAME_PET_TYPE = FRAME_TYPE_PET, tags::FRAME_TYPE, "Frame Type (0008,9007)";
    OLD_TEMPORAL_POSITION = FRAME_UNASSIGNED, tags::TEMPORAL_POSITION_IDENTIFIER,
        "Temporal Position Identifier (0020,0100)";
    OLD_TRIGGER_TIME = FRAME_UNASSIGNED, tags::TRIGGER_TIME, "Trigger Time (0018,1060)";
    OLD_REFERENCE_TIME = FRAME_UNASSIGNED, tags::FRAME_REFERENCE_TIME,
        "Frame Reference Time (0054,1300)";
    OLD_ECHO_TIME = FRAME_UNASSIGNED, tags::ECHO_TIME, "Echo Time (0018,0081)";
    OLD_ACQUISITION_TIME = FRAME_UNASSIGNED, tags::ACQUISITION_TIME, "Acquisition Time (0008,0032)";
    OLD_IMAGE_INDEX = FRAME_UNASSIGNED, tags::IMAGE_INDEX, "Image Index (0054,1330)";
    OLD_INSTANCE_NUMBER = FRAME_UNASSIGNED, tags::INSTANCE_NUMBER, "Instance Number (0020,0013)";
    SEGMENT_NUMBER = &[SEGMENT_SEQUENCE], tags::SEGMENT_NUMBER, "Segment Number (0062,0004)";
    SEGMENT_LABEL = &[SEGMENT_SEQUENCE], tags::SEGMENT_LABEL, "Segment Label (0062,0005)";
    SEGMENT_TYPE_VALUE = SEGMENT_TYPE_PATH, tags::CODE_VALUE, "Code Value (0008,0100)";
    SEGMENT_TYPE_MEANING = SEGMENT_TYPE_PATH, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    SEGMENT_REGION_VALUE = SEGMENT_REGION_PATH, tags::CODE_VALUE, "Code Value (0008,0100)";
    SEGMENT_REGION_MEANING = SEGMENT_REGION_PATH, tags::CODE_MEANING, "Code Meaning (0008,0104)";
    FRAME_SEGMENT = FRAME_SEGMENT_PATH, tags::REFERENCED_SEGMENT_NUMBER,
        "Referenced Segment Number (0062,000B)";
    PATIENT_ID_ISSUER = &[], tags::ISSUER_OF_PATIENT_ID, "Issuer of Patient ID (0010,0021)";
    RESCALE_TYPE = &[], tags::RESCALE_TYPE, "Rescale Type (0028,1054)";
    COUNTS_SOURCE = &[], tags::COUNTS_SOURCE, "Counts Source (0054,1002)";
    SUV_TYPE = &[], tags::SUV_TYPE, "SUV Type (0054,1006)";
    RANDOMS_METHOD = &[], tags::RANDOMS_CORRECTION_METHOD, "Randoms Correction Method (0054,1100)";
    ATTENUATION_METHOD = &[], tags::ATTENUATION_CORRECTION_METHOD,
        "Attenuation Correction Method (0054,1101)";
    DECAY_CORRECTION = &[], tags::DECAY_CORRECTION, "Decay Correction (0054,1102)";
    SCATTER_METHOD = &[], tags::SCATTER_CORRECTION_METHOD, "Scatter Correction Method (0054,1105)";
    ENERGY_LOWER = ENERGY_WINDOW, tags::ENERGY_WINDOW_LOWER_LIMIT,
        "Energy Window Lower Limit (0054,0014)";
    ENERGY_UPPER = ENERGY_WINDOW, tags::ENERGY_WINDOW_UPPER_LIMIT,
        "Energy Window Upper Limit (0054,0015)";
    ANGULAR_VIEW_VECTOR = &[], tags::ANGULAR_VIEW_VECTOR, "Angular View Vector (0054,0090)";
    ENERGY_WINDOWS = &[], tags::NUMBER_OF_ENERGY_WINDOWS, "Number of Energy Windows (0054,0011)";
    DETECTORS = &[], tags::NUMBER_OF_DETECTORS, "Number of Detectors (0054,0021)";
    ROTATIONS = &[], tags::NUMBER_OF_ROTATIONS, "Number of Rotations (0054,0051)";
    DETECTOR_START = DETECTOR_PATH, tags::START_ANGLE, "Start Angle (0054,0200)";
    DETECTOR_TILT = DETECTOR_PATH, tags::GANTRY_DETECTOR_TILT, "Gantry/Detector Tilt (0018,1120)";
    COLLIMATOR_TYPE = DETECTOR_PATH, tags::COLLIMATOR_TYPE, "Collimator Type (0018,1181)";
    ZOOM_FACTOR = DETECTOR_PATH, tags::ZOOM_FACTOR, "Zoom Factor (0028,0031)";
    CENTRE_OF_ROTATION = DETECTOR_PATH, tags::CENTER_OF_ROTATION_OFFSET,
        "Center of Rotation Offset (0018,1145)";
    ROTATION_START = ROTATION_PATH, tags::START_ANGLE, "Start Angle (0054,0200)";
    ANGULAR_STEP = ROTATION_PATH, tags::ANGULAR_STEP, "Angular Step (0018,1144)";
    ROTATION_DIRECTION = ROTATION_PATH, tags::ROTATION_DIRECTION, "Rotation Direction (0018,1140)";
    ROTATION_FRAMES = ROTATION_PATH, tags::NUMBER_OF_FRAMES_IN_ROTATION,
        "Number of Frames in Rotation (0054,0053)";
    FRAME_DURATION = ROTATION_PATH, tags::ACTUAL_FRAME_DURATION,
        "Actual Frame Duration (0018,1242)";
    PET_ENERGY_LOWER = PET_ENERGY_WINDOW, tags::ENERGY_WINDOW_LOWER_LIMIT,
        "Energy Window Lower Limit (0054,0014)";
    PET_ENERGY_UPPER = PET_ENERGY_WINDOW, tags::ENERGY_WINDOW_UPPER_LIMIT,
        "Energy Window Upper Limit (0054,0015)";
}

/// What is kept of every detector, rotation and energy window. Of the second on the number of the item, from 0, is that
/// of the frame; the first stands for all that are read without one.
const COUNTED_ATTRIBUTES: &[Attribute] = &[
    DETECTOR_START,
    DETECTOR_TILT,
    COLLIMATOR_TYPE,
    ZOOM_FACTOR,
    CENTRE_OF_ROTATION,
    ROTATION_START,
    ANGULAR_STEP,
    ROTATION_DIRECTION,
    SCAN_ARC,
    ROTATION_FRAMES,
    FRAME_DURATION,
    ENERGY_LOWER,
    ENERGY_UPPER,
];

/// The attribute of an item after the first with `tag` inside the sequences `open`, and the item's number from 0.
fn of_later_item(open: &[(Tag, usize)], tag: Tag) -> Option<(Attribute, Option<usize>)> {
    let ((_, items), inner) = open.split_first()?;
    if *items < 2 || inner.iter().any(|(_, items)| *items != 1) {
        return None;
    }
    let path = || open.iter().map(|(tag, _)| tag);
    let found = |a: &&Attribute| a.tag == tag && a.path.iter().eq(path());
    let attribute = COUNTED_ATTRIBUTES.iter().find(found)?;
    Some((*attribute, Some(items - 1)))
}

/// Whether `tag` is a sequence that holds a needed attribute.
pub fn is_path(tag: Tag) -> bool {
    let mut of_attributes = WANTED_ATTRIBUTES.iter().flat_map(|a| a.path);
    [SHARED_GROUPS, MAPPING_SEQUENCE, UNITS_SEQUENCE].contains(&tag)
        || of_attributes.any(|sequence| *sequence == tag)
}

impl Attribute {
    /// Group and element, as the Frame Increment Pointer names the attribute.
    pub fn pointer(self) -> [u16; 2] {
        [self.tag.0, self.tag.1]
    }

    /// The needed attribute with `tag` inside the sequences `open`, each with the number of items
    /// begun, and the frame, segment or R-R interval to which the value belongs, from 0; `None` for a value
    /// that belongs to the data set or to all frames.
    pub fn find(open: &[(Tag, usize)], tag: Tag) -> Option<(Self, Option<usize>)> {
        // Some writers give every interval a Gated Information of its own.
        if let [(GATED_INFORMATION, outer), (DATA_INFORMATION, inner)] = *open {
            let interval = (outer.min(inner) == 1).then(|| outer.max(inner) - 1)?;
            let mut of_interval = WANTED_ATTRIBUTES.iter().filter(|a| a.path == GATED_DATA);
            return Some((*of_interval.find(|a| a.tag == tag)?, Some(interval)));
        }
        if let Some(later) = of_later_item(open, tag) {
            return Some(later);
        }
        let (frame, outer) = match open.first() {
            Some((many @ (PER_FRAME_GROUPS | SEGMENT_SEQUENCE), items)) => {
                (Some(items.checked_sub(1)?), Some(*many))
            }
            Some((SHARED_GROUPS, 1)) => (None, Some(PER_FRAME_GROUPS)),
            _ => (None, None),
        };
        let first = usize::from(outer.is_some());
        if open[first..].iter().any(|(_, items)| *items != 1) {
            return None;
        }
        let wanted = WANTED_ATTRIBUTES.iter().find(|a| {
            let own = a
                .path
                .first()
                .filter(|t| [PER_FRAME_GROUPS, SEGMENT_SEQUENCE].contains(t));
            a.tag == tag
                && own == outer.as_ref()
                && a.path.len() == open.len()
                && a.path[first..]
                    .iter()
                    .eq(open[first..].iter().map(|(t, _)| t))
        });
        wanted.map(|attribute| (*attribute, frame))
    }
}

/// Most bytes of a text that is kept: a name has at most three groups of 64 characters of four bytes (PS3.5, 6.2), a
/// description 64 characters.
const LONGEST_TEXT: usize = 1024;

/// Most values of a code string that are kept.
const MOST_CODES: usize = 16;

/// `text`, cut to 100 characters for an error message, control characters escaped.
pub fn clip(text: &str) -> String {
    const MAX_TEXT_CHARS: usize = 100;
    match text.char_indices().nth(MAX_TEXT_CHARS) {
        Some((end, _)) => format!("{}...", escaped(&text[..end])),
        None => escaped(text).into_owned(),
    }
}

/// Key of a value: sequences, tag, frame.
type Key = (&'static [Tag], Tag, Option<usize>);

/// Values of the needed attributes that the data set contains, as stored bytes.
#[derive(Debug)]
pub struct Attributes {
    /// Name of the file, for error messages.
    pub file: String,
    /// Byte order of the values.
    pub byte_order: Endianness,
    /// Media Storage SOP Class UID (0002,0002), which stands in for a missing SOP Class UID.
    pub media_class: Option<String>,
    /// The items of the Real World Value Mapping.
    pub mappings: Mappings,
    /// What was put right, for people to read.
    notes: BTreeSet<String>,
    values: BTreeMap<Key, Vec<u8>>,
    bytes: usize,
}

impl Attributes {
    /// No values yet, for the data set of `file`.
    pub fn new(file: &str, byte_order: Endianness) -> Self {
        Self {
            file: file.into(),
            byte_order,
            media_class: None,
            mappings: Mappings::default(),
            notes: BTreeSet::new(),
            values: BTreeMap::new(),
            bytes: 0,
        }
    }

    /// Whether a value of `length` bytes more can be kept.
    pub fn has_room(&self, length: u64) -> bool {
        self.values.len() < MOST_VALUES && self.bytes as u64 + length <= MOST_BYTES as u64
    }

    /// Stores the bytes of `attribute`, which belong to `frame` or to all.
    pub fn insert(&mut self, attribute: Attribute, frame: Option<usize>, value: Vec<u8>) {
        self.bytes += value.len();
        let key = (attribute.path, attribute.tag, frame);
        self.values.insert(key, value);
    }

    /// Notes that a value of `attribute` was stated in another representation than the standard's.
    pub fn put_right(&mut self, attribute: Attribute, stated: VR) {
        self.note(format!(
            "{} has the value representation {stated} in place of {}: its value was converted.",
            attribute.name,
            standard(attribute.tag)
        ));
    }

    /// Notes what was put right.
    pub fn note(&mut self, note: String) {
        self.notes.insert(note);
    }

    /// What was put right, for people to read.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.notes.iter().cloned()
    }

    /// The error for an invalid value of `field`. Long values are cut.
    pub fn wrong(&self, field: &'static str, value: &str, reason: String) -> ReadError {
        ReadError::Field {
            file: self.file.clone(),
            field,
            value: clip(value),
            reason,
            byte: None,
        }
    }

    /// The error for a required attribute that the data set lacks.
    pub fn missing(&self, attribute: Attribute) -> ReadError {
        self.wrong(
            attribute.name,
            "missing",
            "the attribute is required".into(),
        )
    }

    /// Whether the file says what kind of object it is, as far as it was read.
    pub fn names_a_class(&self) -> bool {
        self.media_class.is_some() || self.text(SOP_CLASS).is_some()
    }

    fn bytes_of(&self, attribute: Attribute, frame: Option<usize>) -> Option<&[u8]> {
        let value = |frame| {
            let value = self.values.get(&(attribute.path, attribute.tag, frame))?;
            (!value.is_empty()).then_some(value.as_slice())
        };
        match frame {
            Some(_) => value(frame).or_else(|| value(None)),
            None => value(None),
        }
    }

    /// The stored bytes of `attribute`, of whatever frame.
    pub fn raw(&self, attribute: Attribute) -> Option<Vec<u8>> {
        let stated = |((path, tag, _), _): &(&Key, &Vec<u8>)| {
            (*path, *tag) == (attribute.path, attribute.tag)
        };
        self.values
            .iter()
            .find(stated)
            .map(|(_, value)| value.clone())
    }

    /// Number of frames that the functional groups describe by attributes that are kept.
    pub fn frames_described(&self) -> usize {
        let of_frames = |path: &[Tag]| path.first() == Some(&PER_FRAME_GROUPS);
        let described = (self.values.keys()).filter(|(path, ..)| of_frames(path));
        let frames = described.filter_map(|(.., frame)| *frame);
        frames.max().map_or(0, |last| last + 1)
    }

    /// Whether the attribute has a value that belongs to `frame` alone; for `None`, to the data set.
    pub fn states(&self, attribute: Attribute, frame: Option<usize>) -> bool {
        let value = self.values.get(&(attribute.path, attribute.tag, frame));
        value.is_some_and(|value| !value.is_empty())
    }

    /// The values of a text attribute, which are separated by backslashes; an empty list if the
    /// attribute is absent or empty.
    pub fn texts(&self, attribute: Attribute) -> Vec<String> {
        self.texts_of(attribute, None)
    }

    /// Where values of item number `item`, from 0, are kept; `None` if that item does not state the attribute.
    fn kept_item(&self, attribute: Attribute, item: usize) -> Option<Option<usize>> {
        let kept = (item > 0).then_some(item);
        self.states(attribute, kept).then_some(kept)
    }

    /// As [`Attributes::texts`], of item number `item`, from 0, of the detectors, rotations or energy windows alone.
    pub fn texts_of_item(&self, attribute: Attribute, item: usize) -> Vec<String> {
        let kept = self.kept_item(attribute, item);
        kept.map_or_else(Vec::new, |item| self.texts_of(attribute, item))
    }

    /// As [`Attributes::shorts`], of item number `item`, from 0, of the detectors, rotations or energy windows alone.
    pub fn shorts_of_item(&self, attribute: Attribute, item: usize) -> Vec<u16> {
        let kept = self.kept_item(attribute, item);
        kept.map_or_else(Vec::new, |item| self.shorts_of(attribute, item))
    }

    /// As [`Attributes::decimals`], of item number `item`, from 0, of the detectors, rotations or energy windows alone.
    ///
    /// # Errors
    /// As [`Attributes::decimals`].
    pub fn decimals_of_item<const N: usize>(
        &self,
        attribute: Attribute,
        item: usize,
    ) -> Result<Option<[f64; N]>, ReadError> {
        let kept = self.kept_item(attribute, item);
        kept.map_or(Ok(None), |item| self.decimals_of(attribute, item))
    }

    /// As [`Attributes::texts`], for stored frame number `frame`, from 0.
    pub fn texts_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<String> {
        let text = String::from_utf8_lossy(self.bytes_of(attribute, frame).unwrap_or_default());
        let parts = text
            .split('\\')
            .map(|p| p.trim_matches(['\0', ' ']).to_owned());
        let parts: Vec<_> = parts.collect();
        if parts.iter().all(String::is_empty) {
            Vec::new()
        } else {
            parts
        }
    }

    /// The first value of a text attribute; none if it is longer than any that the standard has.
    pub fn text(&self, attribute: Attribute) -> Option<String> {
        let first = self.texts(attribute).into_iter().next();
        first.filter(|text| !text.is_empty() && text.len() <= LONGEST_TEXT)
    }

    /// The values of a code string, as many and as long as any that the standard has.
    pub fn codes(&self, attribute: Attribute) -> Vec<String> {
        let mut codes = self.texts(attribute);
        codes.truncate(MOST_CODES);
        codes.retain(|code| code.len() <= LONGEST_TEXT);
        codes
    }

    /// The whole text of an attribute, for people to read; `None` if it is absent, empty, or cannot
    /// be decoded.
    pub fn prose(&self, attribute: Attribute) -> Option<String> {
        self.prose_of(attribute, None)
    }

    /// As [`Attributes::prose`], for frame or segment number `item`, from 0.
    pub fn prose_of(&self, attribute: Attribute, item: Option<usize>) -> Option<String> {
        self.decoded_of(attribute, item).ok().flatten()
    }

    /// The whole text of an attribute, decoded by the character sets that the data set, or the item
    /// of the attribute, names; `None` if it is absent or empty.
    ///
    /// # Errors
    /// Why the text cannot be told, without any of it.
    pub fn decoded(&self, attribute: Attribute) -> Result<Option<String>, String> {
        self.decoded_of(attribute, None)
    }

    fn decoded_of(
        &self,
        attribute: Attribute,
        item: Option<usize>,
    ) -> Result<Option<String>, String> {
        let Some(bytes) = self.bytes_of(attribute, item) else {
            return Ok(None);
        };
        // These texts are stored with every volume, and listed.
        if bytes.len() > LONGEST_TEXT {
            return Err(format!(
                "it has {} bytes, more than the {LONGEST_TEXT} of the longest text",
                bytes.len()
            ));
        }
        let representation = standard(attribute.tag);
        let sets = self.character_sets(attribute.path);
        let text = sets.decode(bytes, Division::from_representation(representation))?;
        Ok((!text.is_empty()).then_some(text))
    }

    /// The character sets of an item inside the sequences `path`: those that the item or, if it names
    /// none, an item around it or the data set names (PS3.3 C.12.1.1.2).
    pub fn character_sets(&self, path: &'static [Tag]) -> CharacterSets {
        let stated = (0..=path.len()).rev().find_map(|depth| {
            let key = (&path[..depth], CHARACTER_SET.tag, None);
            self.values.get(&key)
        });
        let text = String::from_utf8_lossy(stated.map_or(&[][..], Vec::as_slice));
        let terms = text.split('\\').map(|term| term.trim_matches(['\0', ' ']));
        let terms: Vec<String> = terms.map(str::to_owned).collect();
        CharacterSets::from_terms(&terms)
    }

    /// The `N` decimal numbers (DS, IS) of an attribute, `None` if it is absent or empty.
    ///
    /// # Errors
    /// [`ReadError::Field`] for any other count or text.
    pub fn decimals<const N: usize>(
        &self,
        attribute: Attribute,
    ) -> Result<Option<[f64; N]>, ReadError> {
        self.decimals_of(attribute, None)
    }

    /// As [`Attributes::decimals`], for stored frame number `frame`, from 0.
    pub fn decimals_of<const N: usize>(
        &self,
        attribute: Attribute,
        frame: Option<usize>,
    ) -> Result<Option<[f64; N]>, ReadError> {
        let texts = self.texts_of(attribute, frame);
        if texts.is_empty() {
            return Ok(None);
        }
        let number = |t: &String| t.parse().ok().filter(|v: &f64| v.is_finite());
        let numbers: Option<Vec<f64>> = texts.iter().map(number).collect();
        match numbers.map(<[f64; N]>::try_from) {
            Some(Ok(numbers)) => Ok(Some(numbers)),
            _ => {
                let reason = format!("{N} decimal number(s) expected");
                Err(self.wrong(attribute.name, &texts.join("\\"), reason))
            }
        }
    }

    /// The 16-bit numbers (US, AT) of an attribute; an empty list if it is absent.
    pub fn shorts(&self, attribute: Attribute) -> Vec<u16> {
        self.shorts_of(attribute, None)
    }

    /// As [`Attributes::shorts`], for stored frame number `frame`, from 0.
    pub fn shorts_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<u16> {
        let bytes = self.bytes_of(attribute, frame).unwrap_or_default();
        let (numbers, _) = bytes.as_chunks::<2>();
        let number = |b: &[u8; 2]| match self.byte_order {
            Endianness::Little => u16::from_le_bytes(*b),
            Endianness::Big => u16::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// The 32-bit numbers (UL) of an attribute of `frame`; an empty list if it is absent.
    pub fn longs_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<u32> {
        let bytes = self.bytes_of(attribute, frame).unwrap_or_default();
        let (numbers, _) = bytes.as_chunks::<4>();
        let number = |b: &[u8; 4]| match self.byte_order {
            Endianness::Little => u32::from_le_bytes(*b),
            Endianness::Big => u32::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// The 32-bit floating-point number (FL) of an attribute of the data set, `None` if it is absent.
    pub fn single(&self, attribute: Attribute) -> Option<f32> {
        let bytes = self.bytes_of(attribute, None)?.first_chunk()?;
        Some(match self.byte_order {
            Endianness::Little => f32::from_le_bytes(*bytes),
            Endianness::Big => f32::from_be_bytes(*bytes),
        })
    }

    /// The first 16-bit number of a required attribute.
    ///
    /// # Errors
    /// [`ReadError::Field`] if the attribute is absent.
    pub fn short(&self, attribute: Attribute) -> Result<u16, ReadError> {
        let number = self.shorts(attribute).first().copied();
        number.ok_or_else(|| self.missing(attribute))
    }

    /// The floating-point number (FD, or FL by its length) of an attribute, `None` if it is absent.
    pub fn double(&self, attribute: Attribute, frame: Option<usize>) -> Option<f64> {
        let bytes = self.bytes_of(attribute, frame)?;
        let little = self.byte_order == Endianness::Little;
        if let Ok(single) = <[u8; 4]>::try_from(bytes) {
            let read = if little {
                f32::from_le_bytes
            } else {
                f32::from_be_bytes
            };
            return Some(read(single).into());
        }
        let read = if little {
            f64::from_le_bytes
        } else {
            f64::from_be_bytes
        };
        Some(read(*bytes.first_chunk()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_ends_with_the_tag_of_its_attribute_or_sequence() {
        for attribute in WANTED_ATTRIBUTES {
            let tags = attribute.path.iter().chain([&attribute.tag]);
            let mut written = tags.map(|tag| format!(" ({:04X},{:04X})", tag.0, tag.1));
            let named = written.any(|tag| attribute.name.ends_with(&tag));
            assert!(named, "{} is {:?}", attribute.name, attribute.tag);
        }
    }
}
