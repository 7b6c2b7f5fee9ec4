//! The attributes of a data set that the reader needs, and their values.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use super::characters::{CharacterSets, Division};
use super::real_world::{MAPPING_SEQUENCE, Mappings, UNITS_SEQUENCE};
use super::representation::standard;
use crate::base::text::escaped;
use dicom_core::{Tag, VR};
use std::collections::{BTreeMap, BTreeSet};

/// Most values that are kept of one data set. Enough for 20,000 frames with a dozen each.
const MOST_VALUES: usize = 1 << 18;

/// Most bytes of values that are kept of one data set.
const MOST_BYTES: usize = 16 << 20;

/// An attribute that the reader needs: its tag, its sequences and its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attribute {
    /// The sequences, from the outermost, whose first items hold the attribute. [`PER_FRAME_GROUPS`] stands for
    /// the functional groups of a frame or of all frames.
    pub(super) path: &'static [Tag],
    pub(super) tag: Tag,
    /// Name and tag for error messages.
    pub name: &'static str,
}

macro_rules! attributes {
    ($($id:ident = $path:expr, $group:literal, $element:literal, $name:literal;)*) => {
        $(pub(super) const $id: Attribute = Attribute {
            path: $path,
            tag: Tag($group, $element),
            name: $name,
        };)*
        /// Every attribute above.
        pub(super) const WANTED_ATTRIBUTES: &[Attribute] = &[$($id),*];
    };
}

/// Shared Functional Groups Sequence.
const SHARED_GROUPS: Tag = Tag(0x5200, 0x9229);
/// Per-frame Functional Groups Sequence. In a path it stands for the shared groups too.
const PER_FRAME_GROUPS: Tag = Tag(0x5200, 0x9230);

/// Segment Sequence, whose items are counted like frames.
const SEGMENT_SEQUENCE: Tag = Tag(0x0062, 0x0002);

const DETECTOR_PATH: &[Tag] = &[Tag(0x0054, 0x0022)];
/// Gated Information Sequence.
const GATED_INFORMATION: Tag = Tag(0x0054, 0x0062);
/// Data Information Sequence, with an item for each R-R interval.
const DATA_INFORMATION: Tag = Tag(0x0054, 0x0063);
/// The R-R intervals of a gated acquisition, which are counted like frames.
const GATED_DATA: &[Tag] = &[GATED_INFORMATION, DATA_INFORMATION];
const ROTATION_PATH: &[Tag] = &[Tag(0x0054, 0x0052)];
const PHARMACEUTICAL_PATH: &[Tag] = &[Tag(0x0054, 0x0016)];
const PHARMACEUTICAL_CODE: &[Tag] = &[Tag(0x0054, 0x0016), Tag(0x0054, 0x0304)];
const NUCLIDE_CODE: &[Tag] = &[Tag(0x0054, 0x0016), Tag(0x0054, 0x0300)];
const CONTEXT_NAME: &[Tag] = &[Tag(0x0040, 0x0555), Tag(0x0040, 0xa168)];
const PROTOCOL_CODE: &[Tag] = &[Tag(0x0040, 0x0260)];
/// Energy Window Information Sequence with its Energy Window Range Sequence, of Nuclear Medicine.
const ENERGY_WINDOW: &[Tag] = &[Tag(0x0054, 0x0012), Tag(0x0054, 0x0013)];
/// Energy Window Range Sequence, of PET.
const PET_ENERGY_WINDOW: &[Tag] = &[Tag(0x0054, 0x0013)];
const POSTURE_CODE: &[Tag] = &[Tag(0x0054, 0x0410), Tag(0x0054, 0x0412)];
const GANTRY_CODE: &[Tag] = &[Tag(0x0054, 0x0414)];
const VIEW_CODE: &[Tag] = &[Tag(0x0054, 0x0220)];
const DETECTOR_VIEW_CODE: &[Tag] = &[Tag(0x0054, 0x0022), Tag(0x0054, 0x0220)];
const FRAME_POSITION_PATH: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9113)];
const FRAME_ORIENTATION_PATH: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9116)];
const FRAME_MEASURES: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0028, 0x9110)];
const FRAME_RESCALE: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0028, 0x9145)];
const FRAME_CONTENT: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9111)];
const FRAME_SEGMENT_PATH: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0062, 0x000a)];
const FRAME_CARDIAC: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9118)];
const FRAME_RESPIRATORY: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9253)];
const FRAME_TEMPORAL: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9310)];
const FRAME_ECHO: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9114)];
const FRAME_DIFFUSION: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9117)];
const FRAME_CT_DETAILS: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9325)];
const FRAME_TYPE_MR: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9226)];
const FRAME_TYPE_CT: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9329)];
const FRAME_TYPE_PET: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0018, 0x9751)];
/// Attributes of single-frame images for which Legacy Converted Enhanced images have no group.
const FRAME_UNASSIGNED: &[Tag] = &[PER_FRAME_GROUPS, Tag(0x0020, 0x9171)];
const SEGMENT_TYPE_PATH: &[Tag] = &[SEGMENT_SEQUENCE, Tag(0x0062, 0x000f)];
const SEGMENT_REGION_PATH: &[Tag] = &[SEGMENT_SEQUENCE, Tag(0x0008, 0x2218)];

attributes! {
    CHARACTER_SET = &[], 0x0008, 0x0005, "Specific Character Set (0008,0005)";
    PHARMACEUTICAL_SET = PHARMACEUTICAL_PATH, 0x0008, 0x0005, "Specific Character Set (0008,0005)";
    PHARMACEUTICAL_CODE_SET = PHARMACEUTICAL_CODE, 0x0008, 0x0005,
        "Specific Character Set (0008,0005)";
    NUCLIDE_SET = NUCLIDE_CODE, 0x0008, 0x0005, "Specific Character Set (0008,0005)";
    CONTEXT_SET = CONTEXT_NAME, 0x0008, 0x0005, "Specific Character Set (0008,0005)";
    PROTOCOL_SET = PROTOCOL_CODE, 0x0008, 0x0005, "Specific Character Set (0008,0005)";
    IMAGE_TYPE = &[], 0x0008, 0x0008, "Image Type (0008,0008)";
    SOP_CLASS = &[], 0x0008, 0x0016, "SOP Class UID (0008,0016)";
    SOP_INSTANCE = &[], 0x0008, 0x0018, "SOP Instance UID (0008,0018)";
    STUDY_DATE = &[], 0x0008, 0x0020, "Study Date (0008,0020)";
    SERIES_DATE = &[], 0x0008, 0x0021, "Series Date (0008,0021)";
    ACQUISITION_DATE = &[], 0x0008, 0x0022, "Acquisition Date (0008,0022)";
    CONTENT_DATE = &[], 0x0008, 0x0023, "Content Date (0008,0023)";
    ACQUISITION_DATE_TIME = &[], 0x0008, 0x002a, "Acquisition DateTime (0008,002A)";
    CONTENT_TIME = &[], 0x0008, 0x0033, "Content Time (0008,0033)";
    STUDY_TIME = &[], 0x0008, 0x0030, "Study Time (0008,0030)";
    ACQUISITION_TIME = &[], 0x0008, 0x0032, "Acquisition Time (0008,0032)";
    ACCESSION_NUMBER = &[], 0x0008, 0x0050, "Accession Number (0008,0050)";
    MODALITY = &[], 0x0008, 0x0060, "Modality (0008,0060)";
    MANUFACTURER = &[], 0x0008, 0x0070, "Manufacturer (0008,0070)";
    REFERRING_PHYSICIAN = &[], 0x0008, 0x0090, "Referring Physician's Name (0008,0090)";
    STUDY_DESCRIPTION = &[], 0x0008, 0x1030, "Study Description (0008,1030)";
    SERIES_DESCRIPTION = &[], 0x0008, 0x103e, "Series Description (0008,103E)";
    MODEL_NAME = &[], 0x0008, 0x1090, "Manufacturer's Model Name (0008,1090)";
    PATIENT_NAME = &[], 0x0010, 0x0010, "Patient's Name (0010,0010)";
    PATIENT_ID = &[], 0x0010, 0x0020, "Patient ID (0010,0020)";
    PATIENT_BIRTH_DATE = &[], 0x0010, 0x0030, "Patient's Birth Date (0010,0030)";
    PATIENT_SEX = &[], 0x0010, 0x0040, "Patient's Sex (0010,0040)";
    SLICE_THICKNESS = &[], 0x0018, 0x0050, "Slice Thickness (0018,0050)";
    KVP = &[], 0x0018, 0x0060, "KVP (0018,0060)";
    ECHO_TIME = &[], 0x0018, 0x0081, "Echo Time (0018,0081)";
    INVERSION_TIME = &[], 0x0018, 0x0082, "Inversion Time (0018,0082)";
    ECHO_NUMBERS = &[], 0x0018, 0x0086, "Echo Number(s) (0018,0086)";
    SPACING_BETWEEN_SLICES = &[], 0x0018, 0x0088, "Spacing Between Slices (0018,0088)";
    SOFTWARE_VERSIONS = &[], 0x0018, 0x1020, "Software Versions (0018,1020)";
    PROTOCOL_NAME = &[], 0x0018, 0x1030, "Protocol Name (0018,1030)";
    TRIGGER_TIME = &[], 0x0018, 0x1060, "Trigger Time (0018,1060)";
    GATE_NOMINAL_INTERVAL = GATED_DATA, 0x0018, 0x1062, "Nominal Interval (0018,1062)";
    GATE_FRAME_TIME = GATED_DATA, 0x0018, 0x1063, "Frame Time (0018,1063)";
    GATE_LOW_RR = GATED_DATA, 0x0018, 0x1081, "Low R-R Value (0018,1081)";
    GATE_HIGH_RR = GATED_DATA, 0x0018, 0x1082, "High R-R Value (0018,1082)";
    GATE_INTERVALS_ACQUIRED = GATED_DATA, 0x0018, 0x1083, "Intervals Acquired (0018,1083)";
    GATE_INTERVALS_REJECTED = GATED_DATA, 0x0018, 0x1084, "Intervals Rejected (0018,1084)";
    NOMINAL_INTERVAL = &[], 0x0018, 0x1062, "Nominal Interval (0018,1062)";
    FRAME_TIME = &[], 0x0018, 0x1063, "Frame Time (0018,1063)";
    LOW_RR_VALUE = &[], 0x0018, 0x1081, "Low R-R Value (0018,1081)";
    HIGH_RR_VALUE = &[], 0x0018, 0x1082, "High R-R Value (0018,1082)";
    INTERVALS_ACQUIRED = &[], 0x0018, 0x1083, "Intervals Acquired (0018,1083)";
    INTERVALS_REJECTED = &[], 0x0018, 0x1084, "Intervals Rejected (0018,1084)";
    HEART_RATE = &[], 0x0018, 0x1088, "Heart Rate (0018,1088)";
    B_VALUE = &[], 0x0018, 0x9087, "Diffusion b-value (0018,9087)";
    FLIP_ANGLE = &[], 0x0018, 0x1314, "Flip Angle (0018,1314)";
    CONVOLUTION_KERNEL = &[], 0x0018, 0x1210, "Convolution Kernel (0018,1210)";
    STUDY_UID = &[], 0x0020, 0x000d, "Study Instance UID (0020,000D)";
    SERIES_UID = &[], 0x0020, 0x000e, "Series Instance UID (0020,000E)";
    STUDY_ID = &[], 0x0020, 0x0010, "Study ID (0020,0010)";
    SERIES_NUMBER = &[], 0x0020, 0x0011, "Series Number (0020,0011)";
    ACQUISITION_NUMBER = &[], 0x0020, 0x0012, "Acquisition Number (0020,0012)";
    INSTANCE_NUMBER = &[], 0x0020, 0x0013, "Instance Number (0020,0013)";
    POSITION = &[], 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    ORIENTATION = &[], 0x0020, 0x0037, "Image Orientation (Patient) (0020,0037)";
    FRAME_OF_REFERENCE = &[], 0x0020, 0x0052, "Frame of Reference UID (0020,0052)";
    TEMPORAL_POSITION = &[], 0x0020, 0x0100, "Temporal Position Identifier (0020,0100)";
    IMAGES_IN_ACQUISITION = &[], 0x0020, 0x1002, "Images in Acquisition (0020,1002)";
    TRIGGER_DELAY = &[], 0x0020, 0x9153, "Nominal Cardiac Trigger Delay Time (0020,9153)";
    CARDIAC_PHASE = &[], 0x0020, 0x9241, "Nominal Percentage of Cardiac Phase (0020,9241)";
    POSITION_REFERENCE = &[], 0x0020, 0x1040, "Position Reference Indicator (0020,1040)";
    SAMPLES = &[], 0x0028, 0x0002, "Samples per Pixel (0028,0002)";
    PHOTOMETRIC = &[], 0x0028, 0x0004, "Photometric Interpretation (0028,0004)";
    PATIENT_POSITION = &[], 0x0018, 0x5100, "Patient Position (0018,5100)";
    CORRECTED_IMAGE = &[], 0x0028, 0x0051, "Corrected Image (0028,0051)";
    NUMBER_OF_FRAMES = &[], 0x0028, 0x0008, "Number of Frames (0028,0008)";
    FRAME_POINTER = &[], 0x0028, 0x0009, "Frame Increment Pointer (0028,0009)";
    ROWS = &[], 0x0028, 0x0010, "Rows (0028,0010)";
    COLUMNS = &[], 0x0028, 0x0011, "Columns (0028,0011)";
    PIXEL_SPACING = &[], 0x0028, 0x0030, "Pixel Spacing (0028,0030)";
    BITS_ALLOCATED = &[], 0x0028, 0x0100, "Bits Allocated (0028,0100)";
    BITS_STORED = &[], 0x0028, 0x0101, "Bits Stored (0028,0101)";
    HIGH_BIT = &[], 0x0028, 0x0102, "High Bit (0028,0102)";
    PIXEL_REPRESENTATION = &[], 0x0028, 0x0103, "Pixel Representation (0028,0103)";
    PADDING = &[], 0x0028, 0x0120, "Pixel Padding Value (0028,0120)";
    PADDING_LIMIT = &[], 0x0028, 0x0121, "Pixel Padding Range Limit (0028,0121)";
    FLOAT_PADDING = &[], 0x0028, 0x0122, "Float Pixel Padding Value (0028,0122)";
    DOUBLE_PADDING = &[], 0x0028, 0x0123, "Double Float Pixel Padding Value (0028,0123)";
    FLOAT_PADDING_LIMIT = &[], 0x0028, 0x0124, "Float Pixel Padding Range Limit (0028,0124)";
    DOUBLE_PADDING_LIMIT = &[], 0x0028, 0x0125,
        "Double Float Pixel Padding Range Limit (0028,0125)";
    RESCALE_INTERCEPT = &[], 0x0028, 0x1052, "Rescale Intercept (0028,1052)";
    RESCALE_SLOPE = &[], 0x0028, 0x1053, "Rescale Slope (0028,1053)";
    MODALITY_TABLE = &[Tag(0x0028, 0x3000)], 0x0028, 0x3002, "Modality LUT Sequence (0028,3000)";
    RR_INTERVAL_VECTOR = &[], 0x0054, 0x0060, "R-R Interval Vector (0054,0060)";
    TIME_SLOT_VECTOR = &[], 0x0054, 0x0070, "Time Slot Vector (0054,0070)";
    ENERGY_WINDOW_VECTOR = &[], 0x0054, 0x0010, "Energy Window Vector (0054,0010)";
    DETECTOR_VECTOR = &[], 0x0054, 0x0020, "Detector Vector (0054,0020)";
    ROTATION_VECTOR = &[], 0x0054, 0x0050, "Rotation Vector (0054,0050)";
    RR_INTERVALS = &[], 0x0054, 0x0061, "Number of R-R Intervals (0054,0061)";
    TIME_SLOTS = &[], 0x0054, 0x0071, "Number of Time Slots (0054,0071)";
    NUMBER_OF_SLICES = &[], 0x0054, 0x0081, "Number of Slices (0054,0081)";
    TIME_SLICES = &[], 0x0054, 0x0101, "Number of Time Slices (0054,0101)";
    SERIES_TYPE = &[], 0x0054, 0x1000, "Series Type (0054,1000)";
    UNITS = &[], 0x0054, 0x1001, "Units (0054,1001)";
    SLICE_VECTOR = &[], 0x0054, 0x0080, "Slice Vector (0054,0080)";
    RECONSTRUCTION_METHOD = &[], 0x0054, 0x1103, "Reconstruction Method (0054,1103)";
    FRAME_REFERENCE_TIME = &[], 0x0054, 0x1300, "Frame Reference Time (0054,1300)";
    IMAGE_INDEX = &[], 0x0054, 0x1330, "Image Index (0054,1330)";
    SEGMENTATION_TYPE = &[], 0x0062, 0x0001, "Segmentation Type (0062,0001)";
    MAXIMUM_FRACTION = &[], 0x0062, 0x000e, "Maximum Fractional Value (0062,000E)";
    DETECTOR_POSITION = DETECTOR_PATH, 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    DETECTOR_ORIENTATION = DETECTOR_PATH, 0x0020, 0x0037, "Image Orientation (Patient) (0020,0037)";
    PHARMACEUTICAL_NAME = PHARMACEUTICAL_PATH, 0x0018, 0x0031, "Radiopharmaceutical (0018,0031)";
    SCAN_ARC = ROTATION_PATH, 0x0018, 0x1143, "Scan Arc (0018,1143)";
    INJECTED_DOSE = PHARMACEUTICAL_PATH, 0x0018, 0x1074, "Radionuclide Total Dose (0018,1074)";
    INJECTION_TIME = PHARMACEUTICAL_PATH, 0x0018, 0x1072, "Radiopharmaceutical Start Time (0018,1072)";
    INJECTION_DATE_TIME = PHARMACEUTICAL_PATH, 0x0018, 0x1078,
        "Radiopharmaceutical Start DateTime (0018,1078)";
    PHARMACEUTICAL_MEANING = PHARMACEUTICAL_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    NUCLIDE_MEANING = NUCLIDE_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    POSTURE = POSTURE_CODE, 0x0008, 0x0100, "Code Value (0008,0100)";
    POSTURE_MEANING = POSTURE_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    GANTRY = GANTRY_CODE, 0x0008, 0x0100, "Code Value (0008,0100)";
    GANTRY_MEANING = GANTRY_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    VIEW = VIEW_CODE, 0x0008, 0x0100, "Code Value (0008,0100)";
    VIEW_MEANING = VIEW_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    DETECTOR_VIEW = DETECTOR_VIEW_CODE, 0x0008, 0x0100, "Code Value (0008,0100)";
    DETECTOR_VIEW_MEANING = DETECTOR_VIEW_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    PROGRESSION = &[], 0x0054, 0x0500, "Slice Progression Direction (0054,0500)";
    PATIENT_LETTERS = &[], 0x0020, 0x0020, "Patient Orientation (0020,0020)";
    CONTEXT_MEANING = CONTEXT_NAME, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    PROTOCOL_MEANING = PROTOCOL_CODE, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    FRAME_POSITION = FRAME_POSITION_PATH, 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    FRAME_ORIENTATION = FRAME_ORIENTATION_PATH, 0x0020, 0x0037,
        "Image Orientation (Patient) (0020,0037)";
    FRAME_THICKNESS = FRAME_MEASURES, 0x0018, 0x0050, "Slice Thickness (0018,0050)";
    FRAME_BETWEEN_SLICES = FRAME_MEASURES, 0x0018, 0x0088, "Spacing Between Slices (0018,0088)";
    FRAME_PIXEL_SPACING = FRAME_MEASURES, 0x0028, 0x0030, "Pixel Spacing (0028,0030)";
    FRAME_RESCALE_INTERCEPT = FRAME_RESCALE, 0x0028, 0x1052, "Rescale Intercept (0028,1052)";
    FRAME_RESCALE_SLOPE = FRAME_RESCALE, 0x0028, 0x1053, "Rescale Slope (0028,1053)";
    FRAME_DATE_TIME = FRAME_CONTENT, 0x0018, 0x9074, "Frame Acquisition DateTime (0018,9074)";
    FRAME_TEMPORAL_INDEX = FRAME_CONTENT, 0x0020, 0x9128, "Temporal Position Index (0020,9128)";
    FRAME_REFERENCE_DATE_TIME = FRAME_CONTENT, 0x0018, 0x9151,
        "Frame Reference DateTime (0018,9151)";
    FRAME_ACQUISITION_NUMBER = FRAME_CONTENT, 0x0020, 0x9156,
        "Frame Acquisition Number (0020,9156)";
    FRAME_DIMENSIONS = FRAME_CONTENT, 0x0020, 0x9157, "Dimension Index Values (0020,9157)";
    FRAME_STACK = FRAME_CONTENT, 0x0020, 0x9056, "Stack ID (0020,9056)";
    FRAME_TIME_OFFSET = FRAME_TEMPORAL, 0x0020, 0x930d, "Temporal Position Time Offset (0020,930D)";
    FRAME_TRIGGER_DELAY = FRAME_CARDIAC, 0x0020, 0x9153,
        "Nominal Cardiac Trigger Delay Time (0020,9153)";
    FRAME_ACTUAL_DELAY = FRAME_CARDIAC, 0x0020, 0x9252,
        "Actual Cardiac Trigger Delay Time (0020,9252)";
    FRAME_CARDIAC_PHASE = FRAME_CARDIAC, 0x0020, 0x9241,
        "Nominal Percentage of Cardiac Phase (0020,9241)";
    FRAME_RR_NOMINAL = FRAME_CARDIAC, 0x0020, 0x9251, "R-R Interval Time Nominal (0020,9251)";
    FRAME_LOW_RR = FRAME_CARDIAC, 0x0018, 0x1081, "Low R-R Value (0018,1081)";
    FRAME_HIGH_RR = FRAME_CARDIAC, 0x0018, 0x1082, "High R-R Value (0018,1082)";
    FRAME_INTERVALS_ACQUIRED = FRAME_CARDIAC, 0x0018, 0x1083, "Intervals Acquired (0018,1083)";
    FRAME_INTERVALS_REJECTED = FRAME_CARDIAC, 0x0018, 0x1084, "Intervals Rejected (0018,1084)";
    FRAME_RESPIRATORY_DELAY = FRAME_RESPIRATORY, 0x0020, 0x9255,
        "Nominal Respiratory Trigger Delay Time (0020,9255)";
    FRAME_RESPIRATORY_PHASE = FRAME_RESPIRATORY, 0x0020, 0x9245,
        "Nominal Percentage of Respiratory Phase (0020,9245)";
    FRAME_ECHO_TIME = FRAME_ECHO, 0x0018, 0x9082, "Effective Echo Time (0018,9082)";
    FRAME_B_VALUE = FRAME_DIFFUSION, 0x0018, 0x9087, "Diffusion b-value (0018,9087)";
    FRAME_KVP = FRAME_CT_DETAILS, 0x0018, 0x0060, "KVP (0018,0060)";
    FRAME_MR_TYPE = FRAME_TYPE_MR, 0x0008, 0x9007, "Frame Type (0008,9007)";
    FRAME_CT_TYPE = FRAME_TYPE_CT, 0x0008, 0x9007, "Frame Type (0008,9007)";
    FRAME_PET_TYPE = FRAME_TYPE_PET, 0x0008, 0x9007, "Frame Type (0008,9007)";
    OLD_TEMPORAL_POSITION = FRAME_UNASSIGNED, 0x0020, 0x0100,
        "Temporal Position Identifier (0020,0100)";
    OLD_TRIGGER_TIME = FRAME_UNASSIGNED, 0x0018, 0x1060, "Trigger Time (0018,1060)";
    OLD_REFERENCE_TIME = FRAME_UNASSIGNED, 0x0054, 0x1300, "Frame Reference Time (0054,1300)";
    OLD_ECHO_TIME = FRAME_UNASSIGNED, 0x0018, 0x0081, "Echo Time (0018,0081)";
    OLD_ACQUISITION_TIME = FRAME_UNASSIGNED, 0x0008, 0x0032, "Acquisition Time (0008,0032)";
    OLD_IMAGE_INDEX = FRAME_UNASSIGNED, 0x0054, 0x1330, "Image Index (0054,1330)";
    OLD_INSTANCE_NUMBER = FRAME_UNASSIGNED, 0x0020, 0x0013, "Instance Number (0020,0013)";
    SEGMENT_NUMBER = &[SEGMENT_SEQUENCE], 0x0062, 0x0004, "Segment Number (0062,0004)";
    SEGMENT_LABEL = &[SEGMENT_SEQUENCE], 0x0062, 0x0005, "Segment Label (0062,0005)";
    SEGMENT_TYPE_VALUE = SEGMENT_TYPE_PATH, 0x0008, 0x0100, "Code Value (0008,0100)";
    SEGMENT_TYPE_MEANING = SEGMENT_TYPE_PATH, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    SEGMENT_REGION_VALUE = SEGMENT_REGION_PATH, 0x0008, 0x0100, "Code Value (0008,0100)";
    SEGMENT_REGION_MEANING = SEGMENT_REGION_PATH, 0x0008, 0x0104, "Code Meaning (0008,0104)";
    FRAME_SEGMENT = FRAME_SEGMENT_PATH, 0x0062, 0x000b, "Referenced Segment Number (0062,000B)";
    PATIENT_ID_ISSUER = &[], 0x0010, 0x0021, "Issuer of Patient ID (0010,0021)";
    RESCALE_TYPE = &[], 0x0028, 0x1054, "Rescale Type (0028,1054)";
    COUNTS_SOURCE = &[], 0x0054, 0x1002, "Counts Source (0054,1002)";
    SUV_TYPE = &[], 0x0054, 0x1006, "SUV Type (0054,1006)";
    RANDOMS_METHOD = &[], 0x0054, 0x1100, "Randoms Correction Method (0054,1100)";
    ATTENUATION_METHOD = &[], 0x0054, 0x1101, "Attenuation Correction Method (0054,1101)";
    DECAY_CORRECTION = &[], 0x0054, 0x1102, "Decay Correction (0054,1102)";
    SCATTER_METHOD = &[], 0x0054, 0x1105, "Scatter Correction Method (0054,1105)";
    ENERGY_LOWER = ENERGY_WINDOW, 0x0054, 0x0014, "Energy Window Lower Limit (0054,0014)";
    ENERGY_UPPER = ENERGY_WINDOW, 0x0054, 0x0015, "Energy Window Upper Limit (0054,0015)";
    PET_ENERGY_LOWER = PET_ENERGY_WINDOW, 0x0054, 0x0014, "Energy Window Lower Limit (0054,0014)";
    PET_ENERGY_UPPER = PET_ENERGY_WINDOW, 0x0054, 0x0015, "Energy Window Upper Limit (0054,0015)";
}

/// Whether `tag` is a sequence that holds a needed attribute.
pub(super) fn is_path(tag: Tag) -> bool {
    let mut of_attributes = WANTED_ATTRIBUTES.iter().flat_map(|a| a.path);
    [SHARED_GROUPS, MAPPING_SEQUENCE, UNITS_SEQUENCE].contains(&tag)
        || of_attributes.any(|sequence| *sequence == tag)
}

impl Attribute {
    /// Group and element, as the Frame Increment Pointer names the attribute.
    pub(super) fn pointer(self) -> [u16; 2] {
        [self.tag.0, self.tag.1]
    }

    /// The needed attribute with `tag` inside the sequences `open`, each with the number of items
    /// begun, and the frame, segment or R-R interval to which the value belongs, from 0; `None` for a value
    /// that belongs to the data set or to all frames.
    pub(super) fn find(open: &[(Tag, usize)], tag: Tag) -> Option<(Self, Option<usize>)> {
        // Some writers give every interval a Gated Information of its own.
        if let [(GATED_INFORMATION, outer), (DATA_INFORMATION, inner)] = *open {
            let interval = (outer.min(inner) == 1).then(|| outer.max(inner) - 1)?;
            let mut of_interval = WANTED_ATTRIBUTES.iter().filter(|a| a.path == GATED_DATA);
            return Some((*of_interval.find(|a| a.tag == tag)?, Some(interval)));
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
pub(super) fn clip(text: &str) -> String {
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
pub(super) struct Attributes {
    /// Name of the file, for error messages.
    pub file: String,
    /// Byte order of the values.
    pub byte_order: ByteOrder,
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
    pub(super) fn new(file: &str, byte_order: ByteOrder) -> Self {
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
    pub(super) fn has_room(&self, length: u64) -> bool {
        self.values.len() < MOST_VALUES && self.bytes as u64 + length <= MOST_BYTES as u64
    }

    /// Stores the bytes of `attribute`, which belong to `frame` or to all.
    pub(super) fn insert(&mut self, attribute: Attribute, frame: Option<usize>, value: Vec<u8>) {
        self.bytes += value.len();
        let key = (attribute.path, attribute.tag, frame);
        self.values.insert(key, value);
    }

    /// Notes that a value of `attribute` was stated in another representation than the standard's.
    pub(super) fn put_right(&mut self, attribute: Attribute, stated: VR) {
        self.note(format!(
            "{} has the value representation {stated} in place of {}: its value was converted.",
            attribute.name,
            standard(attribute.tag)
        ));
    }

    /// Notes what was put right.
    pub(super) fn note(&mut self, note: String) {
        self.notes.insert(note);
    }

    /// What was put right, for people to read.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        self.notes.iter().cloned()
    }

    /// The error for an invalid value of `field`. Long values are cut.
    pub(super) fn wrong(&self, field: &'static str, value: &str, reason: String) -> VolumeError {
        VolumeError::Field {
            file: self.file.clone(),
            field,
            value: clip(value),
            reason,
            byte: None,
        }
    }

    /// The error for a required attribute that the data set lacks.
    pub(super) fn missing(&self, attribute: Attribute) -> VolumeError {
        self.wrong(
            attribute.name,
            "missing",
            "the attribute is required".into(),
        )
    }

    /// Whether the file says what kind of object it is, as far as it was read.
    pub(super) fn names_a_class(&self) -> bool {
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
    #[cfg(test)]
    pub(super) fn raw(&self, attribute: Attribute) -> Option<Vec<u8>> {
        let stated = |((path, tag, _), _): &(&Key, &Vec<u8>)| {
            (*path, *tag) == (attribute.path, attribute.tag)
        };
        self.values
            .iter()
            .find(stated)
            .map(|(_, value)| value.clone())
    }

    /// Number of frames that the functional groups describe by attributes that are kept.
    pub(super) fn frames_described(&self) -> usize {
        let of_frames = |path: &[Tag]| path.first() == Some(&PER_FRAME_GROUPS);
        let described = (self.values.keys()).filter(|(path, ..)| of_frames(path));
        let frames = described.filter_map(|(.., frame)| *frame);
        frames.max().map_or(0, |last| last + 1)
    }

    /// Whether the attribute has a value that belongs to `frame` alone; for `None`, to the data set.
    pub(super) fn states(&self, attribute: Attribute, frame: Option<usize>) -> bool {
        let value = self.values.get(&(attribute.path, attribute.tag, frame));
        value.is_some_and(|value| !value.is_empty())
    }

    /// The values of a text attribute, which are separated by backslashes; an empty list if the
    /// attribute is absent or empty.
    pub(super) fn texts(&self, attribute: Attribute) -> Vec<String> {
        self.texts_of(attribute, None)
    }

    /// As [`Attributes::texts`], for stored frame number `frame`, from 0.
    pub(super) fn texts_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<String> {
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
    pub(super) fn text(&self, attribute: Attribute) -> Option<String> {
        let first = self.texts(attribute).into_iter().next();
        first.filter(|text| !text.is_empty() && text.len() <= LONGEST_TEXT)
    }

    /// The values of a code string, as many and as long as any that the standard has.
    pub(super) fn codes(&self, attribute: Attribute) -> Vec<String> {
        let mut codes = self.texts(attribute);
        codes.truncate(MOST_CODES);
        codes.retain(|code| code.len() <= LONGEST_TEXT);
        codes
    }

    /// The whole text of an attribute, for people to read; `None` if it is absent, empty, or cannot
    /// be decoded.
    pub(super) fn prose(&self, attribute: Attribute) -> Option<String> {
        self.prose_of(attribute, None)
    }

    /// As [`Attributes::prose`], for frame or segment number `item`, from 0.
    pub(super) fn prose_of(&self, attribute: Attribute, item: Option<usize>) -> Option<String> {
        self.decoded_of(attribute, item).ok().flatten()
    }

    /// The whole text of an attribute, decoded by the character sets that the data set, or the item
    /// of the attribute, names; `None` if it is absent or empty.
    ///
    /// # Errors
    /// Why the text cannot be told, without any of it.
    pub(super) fn decoded(&self, attribute: Attribute) -> Result<Option<String>, String> {
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
    pub(super) fn character_sets(&self, path: &'static [Tag]) -> CharacterSets {
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
    /// [`VolumeError::Field`] for any other count or text.
    pub(super) fn decimals<const N: usize>(
        &self,
        attribute: Attribute,
    ) -> Result<Option<[f64; N]>, VolumeError> {
        self.decimals_of(attribute, None)
    }

    /// As [`Attributes::decimals`], for stored frame number `frame`, from 0.
    pub(super) fn decimals_of<const N: usize>(
        &self,
        attribute: Attribute,
        frame: Option<usize>,
    ) -> Result<Option<[f64; N]>, VolumeError> {
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
    pub(super) fn shorts(&self, attribute: Attribute) -> Vec<u16> {
        self.shorts_of(attribute, None)
    }

    /// As [`Attributes::shorts`], for stored frame number `frame`, from 0.
    pub(super) fn shorts_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<u16> {
        let bytes = self.bytes_of(attribute, frame).unwrap_or_default();
        let (numbers, _) = bytes.as_chunks::<2>();
        let number = |b: &[u8; 2]| match self.byte_order {
            ByteOrder::Little => u16::from_le_bytes(*b),
            ByteOrder::Big => u16::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// The 32-bit numbers (UL) of an attribute of `frame`; an empty list if it is absent.
    pub(super) fn longs_of(&self, attribute: Attribute, frame: Option<usize>) -> Vec<u32> {
        let bytes = self.bytes_of(attribute, frame).unwrap_or_default();
        let (numbers, _) = bytes.as_chunks::<4>();
        let number = |b: &[u8; 4]| match self.byte_order {
            ByteOrder::Little => u32::from_le_bytes(*b),
            ByteOrder::Big => u32::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// The 32-bit floating-point number (FL) of an attribute of the data set, `None` if it is absent.
    pub(super) fn single(&self, attribute: Attribute) -> Option<f32> {
        let bytes = self.bytes_of(attribute, None)?.first_chunk()?;
        Some(match self.byte_order {
            ByteOrder::Little => f32::from_le_bytes(*bytes),
            ByteOrder::Big => f32::from_be_bytes(*bytes),
        })
    }

    /// The first 16-bit number of a required attribute.
    ///
    /// # Errors
    /// [`VolumeError::Field`] if the attribute is absent.
    pub(super) fn short(&self, attribute: Attribute) -> Result<u16, VolumeError> {
        let number = self.shorts(attribute).first().copied();
        number.ok_or_else(|| self.missing(attribute))
    }

    /// The floating-point number (FD, or FL by its length) of an attribute, `None` if it is absent.
    pub(super) fn double(&self, attribute: Attribute, frame: Option<usize>) -> Option<f64> {
        let bytes = self.bytes_of(attribute, frame)?;
        let little = self.byte_order == ByteOrder::Little;
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
