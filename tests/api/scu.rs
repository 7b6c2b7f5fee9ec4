//! A system that sends images by DICOM: objects, and associations that carry them.

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_encoding::transfer_syntax::TransferSyntaxIndex;
use dicom_object::InMemDicomObject;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use dicom_ul::association::ClientAssociationOptions;
use dicom_ul::association::client::ClientAssociation;
use dicom_ul::pdu::{PDataValue, PDataValueType, Pdu};
use std::net::{SocketAddr, TcpStream};

pub const VERIFICATION_CLASS: &str = "1.2.840.10008.1.1";
pub const NM_CLASS: &str = "1.2.840.10008.5.1.4.1.1.20";
pub const PET_CLASS: &str = "1.2.840.10008.5.1.4.1.1.128";
pub const CT_CLASS: &str = "1.2.840.10008.5.1.4.1.1.2";
pub const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
pub const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";

/// Values of an object.
#[derive(Clone)]
pub struct Object {
    pub class: &'static str,
    pub instance: String,
    pub set: InMemDicomObject,
}

fn put(set: &mut InMemDicomObject, tag: (u16, u16), vr: VR, value: impl Into<PrimitiveValue>) {
    set.put(DataElement::new(Tag(tag.0, tag.1), vr, value.into()));
}

fn image(class: &'static str, instance: &str, series: &str) -> InMemDicomObject {
    let mut set = InMemDicomObject::new_empty();
    put(&mut set, (0x0008, 0x0016), VR::UI, class);
    put(&mut set, (0x0008, 0x0018), VR::UI, instance);
    put(&mut set, (0x0010, 0x0010), VR::PN, "Canary^Patient");
    put(&mut set, (0x0010, 0x0020), VR::LO, "CANARY-17");
    put(&mut set, (0x0020, 0x000d), VR::UI, format!("{series}.1"));
    put(&mut set, (0x0020, 0x000e), VR::UI, series);
    put(&mut set, (0x0028, 0x0002), VR::US, 1_u16);
    put(&mut set, (0x0028, 0x0004), VR::CS, "MONOCHROME2");
    put(&mut set, (0x0028, 0x0010), VR::US, 4_u16);
    put(&mut set, (0x0028, 0x0011), VR::US, 4_u16);
    put(&mut set, (0x0028, 0x0030), VR::DS, "4\\4");
    put(&mut set, (0x0028, 0x0100), VR::US, 16_u16);
    put(&mut set, (0x0028, 0x0101), VR::US, 16_u16);
    put(&mut set, (0x0028, 0x0102), VR::US, 15_u16);
    put(&mut set, (0x0028, 0x0103), VR::US, 0_u16);
    set
}

/// One slice of a CT series.
pub fn slice(series: &str, number: u16) -> Object {
    let instance = format!("{series}.{}", number + 100);
    let mut set = image(CT_CLASS, &instance, series);
    put(
        &mut set,
        (0x0008, 0x0008),
        VR::CS,
        "ORIGINAL\\PRIMARY\\AXIAL",
    );
    put(&mut set, (0x0008, 0x0060), VR::CS, "CT");
    put(&mut set, (0x0018, 0x0050), VR::DS, "5");
    put(
        &mut set,
        (0x0020, 0x0032),
        VR::DS,
        format!("0\\0\\{}", 5 * number),
    );
    put(&mut set, (0x0020, 0x0037), VR::DS, "1\\0\\0\\0\\1\\0");
    put(
        &mut set,
        (0x7fe0, 0x0010),
        VR::OW,
        PrimitiveValue::U16(vec![number; 16].into()),
    );
    Object {
        class: CT_CLASS,
        instance,
        set,
    }
}

/// A Nuclear Medicine Image of three frames.
pub fn nuclear(series: &str, instance: u16, image_type: &str) -> Object {
    let uid = format!("{series}.{instance}");
    let mut set = image(NM_CLASS, &uid, series);
    put(
        &mut set,
        (0x0008, 0x0008),
        VR::CS,
        format!("ORIGINAL\\PRIMARY\\{image_type}\\EMISSION"),
    );
    put(&mut set, (0x0008, 0x0060), VR::CS, "NM");
    put(&mut set, (0x0008, 0x1030), VR::LO, "Myocardial perfusion");
    put(&mut set, (0x0018, 0x0050), VR::DS, "4");
    put(&mut set, (0x0018, 0x0088), VR::DS, "4");
    put(&mut set, (0x0028, 0x0008), VR::IS, "3");
    let pointer = PrimitiveValue::Tags([Tag(0x0054, 0x0080)].as_slice().into());
    put(&mut set, (0x0028, 0x0009), VR::AT, pointer);
    put(
        &mut set,
        (0x0054, 0x0080),
        VR::US,
        PrimitiveValue::U16(vec![1, 2, 3].into()),
    );
    let mut detector = InMemDicomObject::new_empty();
    put(&mut detector, (0x0020, 0x0032), VR::DS, "0\\0\\0");
    put(&mut detector, (0x0020, 0x0037), VR::DS, "1\\0\\0\\0\\1\\0");
    let sequence = DataSetSequence::from(vec![detector]);
    set.put(DataElement::new(Tag(0x0054, 0x0022), VR::SQ, sequence));
    let pixels: Vec<u16> = (0..48).map(|n| n + instance).collect();
    put(
        &mut set,
        (0x7fe0, 0x0010),
        VR::OW,
        PrimitiveValue::U16(pixels.into()),
    );
    Object {
        class: NM_CLASS,
        instance: uid,
        set,
    }
}

/// A gate of eight as a gated Nuclear Medicine Image of its own, whose number only the Instance Number tells.
pub fn one_gate(series: &str, gate: u16) -> Object {
    let mut object = nuclear(series, gate, "RECON GATED TOMO");
    let vectors = [0x0060, 0x0070, 0x0080].map(|element| Tag(0x0054, element));
    let set = &mut object.set;
    put(set, (0x0020, 0x0013), VR::IS, gate.to_string());
    let pointer = PrimitiveValue::Tags(vectors.as_slice().into());
    put(set, (0x0028, 0x0009), VR::AT, pointer);
    for element in [0x0060, 0x0070] {
        let ones = PrimitiveValue::U16(vec![1; 3].into());
        put(set, (0x0054, element), VR::US, ones);
    }
    object
}

/// A slice of one of eight gates of a PET study, of which each gate is a series of its own.
pub fn slice_of_a_gate(study: &str, gate: u16, number: u16) -> Object {
    let mut object = slice(&format!("{study}.{gate}"), number);
    object.class = PET_CLASS;
    let set = &mut object.set;
    put(set, (0x0008, 0x0016), VR::UI, PET_CLASS);
    put(set, (0x0008, 0x0060), VR::CS, "PT");
    put(set, (0x0008, 0x0008), VR::CS, "ORIGINAL\\PRIMARY");
    put(set, (0x0008, 0x0032), VR::TM, format!("0915{gate:02}"));
    put(set, (0x0008, 0x103e), VR::LO, format!("Gated, gate {gate}"));
    put(
        set,
        (0x0018, 0x1060),
        VR::DS,
        format!("{}", 100 * (gate - 1)),
    );
    put(set, (0x0020, 0x000d), VR::UI, study.to_owned());
    put(set, (0x0020, 0x0011), VR::IS, (100 + gate).to_string());
    put(set, (0x0020, 0x0013), VR::IS, number.to_string());
    put(set, (0x0054, 0x0071), VR::US, 8_u16);
    put(set, (0x0054, 0x1000), VR::CS, "GATED\\IMAGE");
    put(set, (0x0054, 0x1001), VR::CS, "BQML");
    let pixels = PrimitiveValue::U16(vec![10 * gate + number; 16].into());
    put(set, (0x7fe0, 0x0010), VR::OW, pixels);
    object
}

impl Object {
    /// The object in that series of that study.
    pub fn of_study(mut self, study: &str, series: &str) -> Self {
        put(&mut self.set, (0x0020, 0x000d), VR::UI, study);
        put(&mut self.set, (0x0020, 0x000e), VR::UI, series);
        self
    }

    /// Gives it another SOP Instance UID.
    pub fn rename(&mut self, instance: &str) {
        put(&mut self.set, (0x0008, 0x0018), VR::UI, instance);
        instance.clone_into(&mut self.instance);
    }

    /// The object with another description of its series.
    pub fn described(mut self, description: &str) -> Self {
        put(&mut self.set, (0x0008, 0x103e), VR::LO, description);
        self
    }

    /// The data set in that transfer syntax.
    pub fn data_set(&self, syntax: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        let syntax = TransferSyntaxRegistry.get(syntax).unwrap();
        self.set.write_dataset_with_ts(&mut bytes, syntax).unwrap();
        bytes
    }

    /// The Nuclear Medicine Image in a file.
    pub fn of_nm(file: &[u8]) -> Self {
        let set = dicom_object::from_reader(file).unwrap().into_inner();
        let instance = set.element_by_name("SOPInstanceUID").unwrap();
        Self {
            class: NM_CLASS,
            instance: instance.to_str().unwrap().into_owned(),
            set,
        }
    }

    /// The object as another of the same study: another instance and series, with that description.
    pub fn in_series(mut self, number: u8, description: &str) -> Self {
        let [instance, series] = ["SOPInstanceUID", "SeriesInstanceUID"].map(|name| {
            let uid = self.set.element_by_name(name).unwrap();
            let uid = uid.to_str().unwrap().into_owned();
            format!("{}.{number}", uid.trim_end_matches('\0'))
        });
        put(&mut self.set, (0x08, 0x18), VR::UI, instance.as_str());
        put(&mut self.set, (0x20, 0x0e), VR::UI, series.as_str());
        put(&mut self.set, (0x08, 0x103e), VR::LO, description);
        Self { instance, ..self }
    }

    /// The object as a file.
    pub fn file(&self) -> Vec<u8> {
        let start = ventriform::results::export::dicom::file_start(
            self.class,
            &self.instance,
            EXPLICIT_LITTLE,
        );
        [start.unwrap(), self.data_set(EXPLICIT_LITTLE)].concat()
    }
}

/// Bytes of a data set that are sent at once, below the usual limit on a PDU of 16 KiB.
const PDU_BYTES: usize = 16_000;

/// An open association.
pub struct Scu(ClientAssociation<TcpStream>);

impl Scu {
    pub fn call(to: SocketAddr, calling: &str, called: &str) -> Result<Self, String> {
        let options = ClientAssociationOptions::new()
            .calling_ae_title(calling.to_owned())
            .called_ae_title(called.to_owned())
            .with_presentation_context(VERIFICATION_CLASS, vec![IMPLICIT_LITTLE])
            .with_presentation_context(NM_CLASS, vec![EXPLICIT_LITTLE])
            .with_presentation_context(CT_CLASS, vec![IMPLICIT_LITTLE])
            // Secondary Capture and High-Throughput JPEG 2000 are not read.
            .with_presentation_context("1.2.840.10008.5.1.4.1.1.7", vec![IMPLICIT_LITTLE])
            .with_presentation_context(NM_CLASS, vec!["1.2.840.10008.1.2.4.201"])
            .with_presentation_context(PET_CLASS, vec![IMPLICIT_LITTLE]);
        options
            .establish(to)
            .map(Self)
            .map_err(|e| format!("{e:?}"))
    }

    pub fn open(to: SocketAddr) -> Self {
        Self::call(to, "CAMERA", "VENTRIFORM").unwrap()
    }

    /// The ids of the accepted contexts.
    pub fn contexts(&self) -> Vec<u8> {
        let contexts = self.0.presentation_contexts().iter();
        contexts.map(|context| context.id).collect()
    }

    pub fn send(&mut self, value_type: PDataValueType, context: u8, data: Vec<u8>, is_last: bool) {
        let value = PDataValue {
            presentation_context_id: context,
            value_type,
            is_last,
            data,
        };
        self.0.send(&Pdu::PData { data: vec![value] }).unwrap();
    }

    pub fn receive(&mut self) -> Result<Pdu, String> {
        self.0.receive().map_err(|e| e.to_string())
    }

    /// The status of the next response.
    pub fn status(&mut self) -> u16 {
        let Pdu::PData { data } = self.receive().unwrap() else {
            panic!("no response");
        };
        let set = &data[0].data;
        let at = set.windows(8).position(|w| w == [0, 0, 0, 9, 2, 0, 0, 0]);
        let at = at.unwrap() + 8;
        u16::from_le_bytes([set[at], set[at + 1]])
    }

    pub fn echo(&mut self) -> u16 {
        let set = command(0x0030, VERIFICATION_CLASS, None);
        self.send(PDataValueType::Command, 1, set, true);
        self.status()
    }

    /// Sends an object and returns the status.
    pub fn store(&mut self, object: &Object) -> u16 {
        let (context, syntax) = match object.class {
            NM_CLASS => (3, EXPLICIT_LITTLE),
            PET_CLASS => (11, IMPLICIT_LITTLE),
            _ => (5, IMPLICIT_LITTLE),
        };
        let set = command(0x0001, object.class, Some(&object.instance));
        self.send(PDataValueType::Command, context, set, true);
        let data = object.data_set(syntax);
        // At least two, and each within a PDU.
        let length = PDU_BYTES.min(data.len().div_ceil(2));
        let last = data.len().div_ceil(length) - 1;
        for (number, part) in data.chunks(length).enumerate() {
            self.send(PDataValueType::Data, context, part.to_vec(), number == last);
        }
        self.status()
    }

    pub fn release(self) {
        self.0.release().unwrap();
    }

    pub fn abort(self) {
        self.0.abort().unwrap();
    }
}

/// A command set.
pub fn command(field: u16, class: &str, instance: Option<&str>) -> Vec<u8> {
    let mut set = Vec::new();
    let mut put = |element: u16, value: &[u8]| {
        set.extend_from_slice(&[0, 0]);
        set.extend_from_slice(&element.to_le_bytes());
        set.extend_from_slice(&(value.len() as u32).to_le_bytes());
        set.extend_from_slice(value);
    };
    let uid = |text: &str| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        bytes
    };
    let data: u16 = if instance.is_some() { 0 } else { 0x0101 };
    put(0x0002, &uid(class));
    put(0x0100, &field.to_le_bytes());
    put(0x0110, &7_u16.to_le_bytes());
    put(0x0800, &data.to_le_bytes());
    if let Some(instance) = instance {
        put(0x1000, &uid(instance));
    }
    set
}
