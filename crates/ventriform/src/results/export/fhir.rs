//! A structured report as FHIR R4: a Bundle with a DiagnosticReport and its Observations.
//!
//! In: the bytes of a structured report that [`dicom`](super::dicom) made. Out: the Bundle, after HL7's mapping of DICOM SR
//! to FHIR resources (`hl7.fhir.uv.dicom-sr`), whose Observations are written as R4 has them:
//!
//! | report | resource |
//! |---|---|
//! | patient, studies that it refers to, device, who verified it | Patient, ImagingStudy, Device, Practitioner |
//! | measurement group | Observation of category 125007, with finding, site, method and comments; `hasMember` names the measurements |
//! | measurement | Observation with `valueQuantity`; ranges and modifiers are its components |
//! | qualitative evaluation | Observation; the impression is the `conclusion` of the DiagnosticReport |
//!
//! Guaranteed: whatever one resource refers to is in the Bundle; the same report gives the same bytes. Dates without a time
//! zone become days; the moment when the report was made is UTC.
//!
//! Not guaranteed: that a server knows the patient by the ID alone. DICOM names no system of identifiers unless its issuer is
//! stated.

use super::dicom::DicomError;
use serde_json::{Map, Value, json};
use ventriform_dicom::report::{Concept, ContentItem, ContentValue, StructuredReport};
use ventriform_dicom::tags;
use ventriform_dicom::values::dashed_date;
use ventriform_dicom::write::uid::derived_urn;

/// The name of the file.
pub const FHIR_FILE: &str = "fhir.json";
/// Its media type.
pub const FHIR_MEDIA_TYPE: &str = "application/fhir+json";

const DCM: &str = "DCM";
const DCM_SYSTEM: &str = "http://dicom.nema.org/resources/ontology/DCM";
const CATEGORY_SYSTEM: &str = "http://terminology.hl7.org/CodeSystem/observation-category";
const UID_SYSTEM: &str = "urn:dicom:uid";

/// The URI of a coding scheme.
fn system(scheme: &str) -> String {
    match scheme {
        DCM => DCM_SYSTEM.to_owned(),
        "SCT" => "http://snomed.info/sct".to_owned(),
        "LN" => "http://loinc.org".to_owned(),
        "UCUM" => "http://unitsofmeasure.org".to_owned(),
        "UMLS" => "http://terminology.hl7.org/CodeSystem/umls".to_owned(),
        other => format!("urn:ventriform:scheme:{}", other.to_lowercase()),
    }
}

/// The modality of the images of a SOP class, as far as scans of the heart and what is made of them need it.
fn modality(class: Option<&str>) -> &'static str {
    match class {
        Some("1.2.840.10008.5.1.4.1.1.20") => "NM",
        Some("1.2.840.10008.5.1.4.1.1.128" | "1.2.840.10008.5.1.4.1.1.130") => "PT",
        Some("1.2.840.10008.5.1.4.1.1.2" | "1.2.840.10008.5.1.4.1.1.2.1") => "CT",
        Some("1.2.840.10008.5.1.4.1.1.4" | "1.2.840.10008.5.1.4.1.1.4.1") => "MR",
        Some("1.2.840.10008.5.1.4.1.1.66.4") => "SEG",
        _ => "OT",
    }
}

/// The Bundle of the structured report in `bytes`; `amended` says whether it replaces a former one.
///
/// # Errors
/// [`DicomError`] if the bytes are none.
pub fn bundle(bytes: &[u8], amended: bool) -> Result<Vec<u8>, DicomError> {
    let report = StructuredReport::read(bytes)?;
    let bundle = Mapping::new(&report, amended).bundle();
    Ok(format!("{bundle:#}\n").into_bytes())
}

/// The resources of one report, and what all of them state.
struct Mapping<'a> {
    report: &'a StructuredReport,
    root: ContentItem,
    status: &'static str,
    uid: String,
    issued: Option<String>,
    study_day: Option<String>,
    entries: Vec<Value>,
}

impl<'a> Mapping<'a> {
    fn new(report: &'a StructuredReport, amended: bool) -> Self {
        let verified = report.text(tags::VERIFICATION_FLAG).as_deref() == Some("VERIFIED");
        let date = report.text(tags::CONTENT_DATE);
        let time = report.text(tags::CONTENT_TIME);
        Self {
            root: report.root(),
            status: match (verified, amended) {
                (true, true) => "amended",
                (true, false) => "final",
                (false, _) => "preliminary",
            },
            uid: report.text(tags::SOP_INSTANCE_UID).unwrap_or_default(),
            issued: date
                .zip(time)
                .and_then(|(date, time)| instant(&date, &time)),
            study_day: report
                .text(tags::STUDY_DATE)
                .and_then(|date| dashed_date(&date)),
            entries: Vec::new(),
            report,
        }
    }

    fn bundle(mut self) -> Value {
        let report_url = self.url("report");
        // The report comes first; what it refers to is not known yet.
        self.entries.push(Value::Null);
        self.patient();
        self.device();
        let studies = self.studies();
        let reader = self.reader();
        let results = self.observations(&studies);
        let impression = self.impression();
        let mut diagnostic = self.resource("DiagnosticReport");
        diagnostic.insert("identifier".into(), json!([uid_identifier(&self.uid)]));
        diagnostic.insert("category".into(), json!([{"coding": [{
            "system": "http://terminology.hl7.org/CodeSystem/v2-0074", "code": "NMS", "display": "Nuclear Medicine Scan",
        }]}]));
        let mut code = json!({"coding": coding(self.root.name.as_ref())});
        if let Some(procedure) = self.root.code(DCM, "121058") {
            code["text"] = procedure.meaning.as_str().into();
        }
        diagnostic.insert("code".into(), code);
        put(&mut diagnostic, "imagingStudy", references(&studies));
        put(&mut diagnostic, "result", references(&results));
        if let Some(reader) = reader {
            diagnostic.insert("resultsInterpreter".into(), references(&[reader]));
        }
        if let Some(impression) = impression {
            diagnostic.insert("conclusion".into(), impression.into());
        }
        self.entries[0] = entry(&report_url, diagnostic);
        let mut bundle = json!({
            "resourceType": "Bundle",
            "type": "collection",
            "identifier": uid_identifier(&self.uid),
            "entry": self.entries,
        });
        if let Some(issued) = &self.issued {
            bundle["timestamp"] = issued.as_str().into();
        }
        bundle
    }

    /// The address of the resource called `name`.
    fn url(&self, name: &str) -> String {
        derived_urn(&[self.uid.as_bytes(), name.as_bytes()])
    }

    fn add(&mut self, name: &str, resource: Map<String, Value>) -> String {
        let url = self.url(name);
        self.entries.push(entry(&url, resource));
        url
    }

    /// A resource with the state, the subject and the times of the report.
    fn resource(&self, kind: &str) -> Map<String, Value> {
        let mut resource = Map::new();
        resource.insert("resourceType".into(), kind.into());
        resource.insert("status".into(), self.status.into());
        resource.insert("subject".into(), json!({"reference": self.url("patient")}));
        put(&mut resource, "effectiveDateTime", json!(self.study_day));
        put(&mut resource, "issued", json!(self.issued));
        resource
    }

    fn patient(&mut self) {
        let mut patient = Map::new();
        patient.insert("resourceType".into(), "Patient".into());
        if let Some(id) = self.report.text(tags::PATIENT_ID) {
            let mut identifier = json!({"value": id});
            if let Some(issuer) = self.report.text(tags::ISSUER_OF_PATIENT_ID) {
                identifier["assigner"] = json!({"display": issuer});
            }
            patient.insert("identifier".into(), json!([identifier]));
        }
        if let Some(name) = self.report.text(tags::PATIENT_NAME) {
            patient.insert("name".into(), json!([human_name(&name)]));
        }
        let born = self.report.text(tags::PATIENT_BIRTH_DATE);
        put(
            &mut patient,
            "birthDate",
            json!(born.and_then(|date| dashed_date(&date))),
        );
        let gender = self.report.text(tags::PATIENT_SEX);
        let gender = gender.map(|sex| match sex.as_str() {
            "M" => "male",
            "F" => "female",
            "O" => "other",
            _ => "unknown",
        });
        put(&mut patient, "gender", json!(gender));
        self.add("patient", patient);
    }

    fn device(&mut self) {
        let mut device = Map::new();
        device.insert("resourceType".into(), "Device".into());
        if let Some(uid) = self.root.text(DCM, "121012") {
            device.insert("identifier".into(), json!([uid_identifier(uid)]));
        }
        let stated = |tag| self.report.text(tag);
        put(
            &mut device,
            "manufacturer",
            json!(stated(tags::MANUFACTURER)),
        );
        if let Some(name) = stated(tags::MANUFACTURER_MODEL_NAME) {
            device.insert(
                "deviceName".into(),
                json!([{"name": name, "type": "model-name"}]),
            );
        }
        if let Some(version) = stated(tags::SOFTWARE_VERSIONS) {
            device.insert("version".into(), json!([{"value": version}]));
        }
        self.add("device", device);
    }

    /// The study of the report, and the others that it refers to.
    fn studies(&mut self) -> Vec<String> {
        let own = self
            .report
            .text(tags::STUDY_INSTANCE_UID)
            .unwrap_or_default();
        let mut studies = self.report.evidence();
        if !studies.iter().any(|study| study.uid == own) {
            let series = Vec::new();
            let uid = own.clone();
            studies.insert(0, ventriform_dicom::report::ReferencedStudy { uid, series });
        }
        let mut urls = Vec::new();
        for study in studies {
            let mut resource = Map::new();
            resource.insert("resourceType".into(), "ImagingStudy".into());
            let mut identifiers = vec![uid_identifier(&study.uid)];
            if study.uid == own {
                let accession = self.report.text(tags::ACCESSION_NUMBER);
                identifiers.extend(accession.map(|number| json!({
                    "type": {"coding": [{
                        "system": "http://terminology.hl7.org/CodeSystem/v2-0203", "code": "ACSN",
                    }]},
                    "value": number,
                })));
                put(&mut resource, "started", json!(self.study_day));
                put(
                    &mut resource,
                    "description",
                    json!(self.report.text(tags::STUDY_DESCRIPTION)),
                );
            }
            resource.insert("identifier".into(), identifiers.into());
            resource.insert("status".into(), "available".into());
            resource.insert("subject".into(), json!({"reference": self.url("patient")}));
            let series = study.series.iter().map(|(uid, instances)| {
                let class = instances.first().map(|[class, _]| class.as_str());
                let instances = instances.iter().map(|[class, instance]| json!({
                    "uid": instance,
                    "sopClass": {"system": "urn:ietf:rfc:3986", "code": format!("urn:oid:{class}")},
                }));
                json!({
                    "uid": uid,
                    "modality": {"system": DCM_SYSTEM, "code": modality(class)},
                    "instance": instances.collect::<Vec<_>>(),
                })
            });
            put(&mut resource, "series", series.collect::<Vec<_>>().into());
            urls.push(self.add(&format!("study {}", study.uid), resource));
        }
        urls
    }

    /// Who verified the report.
    fn reader(&mut self) -> Option<String> {
        let sequence = tags::VERIFYING_OBSERVER_SEQUENCE;
        let name = self
            .report
            .text_in(sequence, tags::VERIFYING_OBSERVER_NAME)?;
        let mut reader = Map::new();
        reader.insert("resourceType".into(), "Practitioner".into());
        reader.insert("name".into(), json!([human_name(&name)]));
        Some(self.add("reader", reader))
    }

    fn observations(&mut self, studies: &[String]) -> Vec<String> {
        let groups: Vec<ContentItem> = (self.root.named(DCM, "126010"))
            .flat_map(|measurements| measurements.named(DCM, "125007").cloned())
            .collect();
        let groups: Vec<String> = (groups.iter().enumerate())
            .map(|(number, group)| self.group(number, group, studies))
            .collect();
        let evaluations: Vec<ContentItem> = (self.root.named("UMLS", "C0034375"))
            .flat_map(|evaluations| evaluations.content.clone())
            .filter(|item| !is_impression(item))
            .collect();
        let evaluations = evaluations.iter().enumerate().map(|(number, item)| {
            let mut resource = self.observation(item.name.as_ref());
            match &item.value {
                ContentValue::Text(text) => {
                    resource.insert("valueString".into(), text.as_str().into())
                }
                ContentValue::Code(code) => {
                    resource.insert("valueCodeableConcept".into(), codeable(code))
                }
                _ => None,
            };
            self.add(&format!("evaluation {number}"), resource)
        });
        let evaluations: Vec<String> = evaluations.collect();
        groups.into_iter().chain(evaluations).collect()
    }

    fn observation(&self, name: Option<&Concept>) -> Map<String, Value> {
        let mut resource = self.resource("Observation");
        resource.insert("category".into(), json!([imaging()]));
        resource.insert("code".into(), json!({"coding": coding(name)}));
        resource.insert("device".into(), json!({"reference": self.url("device")}));
        resource
    }

    /// A measurement group, and the measurements in it.
    fn group(&mut self, number: usize, group: &ContentItem, studies: &[String]) -> String {
        let site = group.code("SCT", "363698007").cloned();
        let method = group.code("SCT", "370129005").cloned();
        let measured_by = |resource: &mut Map<String, Value>| {
            let (site, method) = (site.as_ref(), method.as_ref());
            put(resource, "bodySite", json!(site.map(codeable)));
            put(resource, "method", json!(method.map(codeable)));
            put(resource, "derivedFrom", references(studies));
        };
        let mut members = Vec::new();
        for (at, item) in group.content.iter().enumerate() {
            let ContentValue::Number(value, unit) = &item.value else {
                continue;
            };
            let mut resource = self.observation(item.name.as_ref());
            resource.insert("valueQuantity".into(), quantity(*value, unit));
            measured_by(&mut resource);
            let properties: Vec<Value> = item.content.iter().filter_map(component).collect();
            put(&mut resource, "component", properties.into());
            members.push(self.add(&format!("group {number} measurement {at}"), resource));
        }
        let mut resource = self.observation(group.name.as_ref());
        resource.insert(
            "category".into(),
            json!([imaging(), {"coding": coding(group.name.as_ref())}]),
        );
        let tracking = group.text(DCM, "112039");
        if let Some(tracking) = tracking {
            resource["code"]["text"] = tracking.into();
        }
        if let Some(uid) = group.text(DCM, "112040") {
            resource.insert("identifier".into(), json!([uid_identifier(uid)]));
        }
        let finding = group.code(DCM, "121071");
        put(
            &mut resource,
            "valueCodeableConcept",
            json!(finding.map(codeable)),
        );
        measured_by(&mut resource);
        let told = ["363698007", "370129005", "121071"];
        let others = group.content.iter().filter(|item| {
            let named = item.name.as_ref();
            matches!(item.value, ContentValue::Code(_))
                && named.is_some_and(|name| !told.contains(&name.value.as_str()))
        });
        let others: Vec<Value> = others.filter_map(component).collect();
        put(&mut resource, "component", others.into());
        let notes = group
            .named(DCM, "121106")
            .filter_map(|item| match &item.value {
                ContentValue::Text(text) => Some(json!({"text": text})),
                _ => None,
            });
        put(&mut resource, "note", notes.collect::<Vec<_>>().into());
        put(&mut resource, "hasMember", references(&members));
        self.add(&format!("group {number}"), resource)
    }

    fn impression(&self) -> Option<String> {
        let evaluations = self.root.named("UMLS", "C0034375");
        let mut items = evaluations.flat_map(|evaluations| &evaluations.content);
        items.find_map(|item| match &item.value {
            ContentValue::Text(text) if is_impression(item) => Some(text.clone()),
            _ => None,
        })
    }
}

fn is_impression(item: &ContentItem) -> bool {
    item.name
        .as_ref()
        .is_some_and(|name| name.is(DCM, "121073"))
}

/// Puts a value unless it is `null` or an empty list, which FHIR does not allow.
fn put(resource: &mut Map<String, Value>, name: &str, value: Value) {
    let empty = value.is_null() || value.as_array().is_some_and(Vec::is_empty);
    if !empty {
        resource.insert(name.to_owned(), value);
    }
}

fn entry(url: &str, resource: Map<String, Value>) -> Value {
    json!({"fullUrl": url, "resource": resource})
}

fn references(urls: &[String]) -> Value {
    let references = urls.iter().map(|url| json!({"reference": url}));
    references.collect::<Vec<_>>().into()
}

fn uid_identifier(uid: &str) -> Value {
    json!({"system": UID_SYSTEM, "value": format!("urn:oid:{uid}")})
}

fn imaging() -> Value {
    json!({"coding": [{"system": CATEGORY_SYSTEM, "code": "imaging"}]})
}

fn coding(concept: Option<&Concept>) -> Value {
    let coding = concept.map(|concept| {
        json!({"system": system(&concept.scheme), "code": concept.value, "display": concept.meaning})
    });
    coding.into_iter().collect::<Vec<_>>().into()
}

fn codeable(concept: &Concept) -> Value {
    json!({"coding": coding(Some(concept)), "text": concept.meaning})
}

fn quantity(value: f64, unit: &Concept) -> Value {
    json!({"value": value, "unit": unit.meaning, "system": system(&unit.scheme), "code": unit.value})
}

/// What qualifies an item, as a component of its Observation.
fn component(item: &ContentItem) -> Option<Value> {
    let name = item.name.as_ref()?;
    let mut component = json!({"code": codeable(name)});
    match &item.value {
        ContentValue::Number(value, unit) => component["valueQuantity"] = quantity(*value, unit),
        ContentValue::Code(code) => component["valueCodeableConcept"] = codeable(code),
        ContentValue::Text(text) => component["valueString"] = text.as_str().into(),
        _ => return None,
    }
    Some(component)
}

/// A name of VR PN.
fn human_name(name: &str) -> Value {
    let alphabetic = name.split('=').next().unwrap_or_default();
    let mut parts = alphabetic.split('^').map(str::trim);
    let mut next = || parts.next().filter(|part| !part.is_empty());
    let (family, given, middle) = (next(), next(), next());
    let (prefix, suffix) = (next(), next());
    let given: Vec<&str> = given.into_iter().chain(middle).collect();
    let spoken: Vec<&str> = (prefix.iter().chain(&given).chain(family.iter()))
        .copied()
        .collect();
    let mut human = Map::new();
    human.insert("text".into(), spoken.join(" ").into());
    put(&mut human, "family", json!(family));
    put(&mut human, "given", json!(given));
    put(&mut human, "prefix", json!(prefix.map(|prefix| [prefix])));
    put(&mut human, "suffix", json!(suffix.map(|suffix| [suffix])));
    human.into()
}

/// A moment of VR DA and TM, UTC.
fn instant(date: &str, time: &str) -> Option<String> {
    let whole = time.len() >= 6 && time.as_bytes()[..6].iter().all(u8::is_ascii_digit);
    let day = dashed_date(date).filter(|_| whole)?;
    Some(format!(
        "{day}T{}:{}:{}Z",
        &time[..2],
        &time[2..4],
        &time[4..6]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::volume::Provenance;
    use crate::results::export::dicom::{
        DicomComparison, Moment, SignedReading, SourceScan, Structure,
    };
    use crate::results::report::ReadingReport;
    use crate::results::report::comparison_report::tests::first_comparison;
    use crate::results::report::reading_report::tests::first_reading;
    use std::collections::BTreeSet;

    fn scans() -> [SourceScan; 2] {
        let made = Moment {
            date: "20261130".into(),
            time: "221500".into(),
        };
        let whose = Provenance {
            patient_id: Some("4711".into()),
            patient_name: Some("Müller^Ada^Eva^Dr.".into()),
            patient_birth_date: Some("19500102".into()),
            patient_sex: Some("F".into()),
            study_uid: Some("1.2.3".into()),
            study_date: Some("20261129".into()),
            ..Provenance::default()
        };
        let frame = VoxelToPatient::centred([4; 3], [4.0; 3], Vec3::zeros()).unwrap();
        let scan = SourceScan::new(whose, frame, [4; 3], true, made);
        [scan.clone(), scan]
    }

    fn of(reading: Option<&ReadingReport>) -> Value {
        let (scans, report) = (scans(), first_comparison());
        let reading = reading.map(|reading| SignedReading {
            id: "rdg_1",
            reading,
        });
        let structure = Structure::from_organ("left_ventricle");
        let made = DicomComparison::new(structure, &scans, &report, "{}").with_reading(reading);
        let bytes = made.measurements().unwrap();
        let amended = reading.is_some_and(|signed| signed.reading.amends.is_some());
        let text = bundle(&bytes, amended).unwrap();
        assert_eq!(text, bundle(&bytes, amended).unwrap());
        serde_json::from_slice(&text).unwrap()
    }

    fn every<'a>(value: &'a Value, name: &str, found: &mut Vec<&'a Value>) {
        match value {
            Value::Object(map) => {
                found.extend(map.get(name));
                map.values().for_each(|value| every(value, name, found));
            }
            Value::Array(list) => list.iter().for_each(|value| every(value, name, found)),
            _ => {}
        }
    }

    #[test]
    fn every_reference_is_met_and_nothing_is_empty() {
        let bundle = of(Some(&first_reading()));
        let entries = bundle["entry"].as_array().unwrap();
        let urls: BTreeSet<&str> = entries
            .iter()
            .map(|entry| entry["fullUrl"].as_str().unwrap())
            .collect();
        assert_eq!(urls.len(), entries.len());
        let mut references = Vec::new();
        every(&bundle, "reference", &mut references);
        assert!(references.len() > 100);
        for reference in references {
            assert!(urls.contains(reference.as_str().unwrap()), "{reference}");
        }
        let text = bundle.to_string();
        assert!(!text.contains("null") && !text.contains("[]") && !text.contains("{}"));
    }

    #[test]
    fn a_report_is_preliminary_until_somebody_has_read_it() {
        let status = |bundle: &Value| bundle["entry"][0]["resource"]["status"].clone();
        let unread = of(None);
        assert_eq!(status(&unread), "preliminary");
        let mut reading = first_reading();
        let read = of(Some(&reading));
        assert_eq!(status(&read), "final");
        let diagnostic = &read["entry"][0]["resource"];
        assert_eq!(diagnostic["conclusion"], "Reversible defect.\nNo dilation.");
        let reader = &diagnostic["resultsInterpreter"][0]["reference"];
        let mut entries = read["entry"].as_array().unwrap().iter();
        let reader = entries.find(|entry| entry["fullUrl"] == *reader).unwrap();
        assert_eq!(reader["resource"]["name"][0]["text"], "Dr. Jane Doe");
        reading.amends = Some("rdg_0".into());
        assert_eq!(status(&of(Some(&reading))), "amended");
    }

    #[test]
    fn the_patient_and_a_figure_are_those_of_the_report() {
        let bundle = of(None);
        let all = bundle["entry"].as_array().unwrap();
        let of_kind = |kind: &str| {
            let kind = kind.to_owned();
            all.iter()
                .map(|entry| &entry["resource"])
                .filter(move |own| own["resourceType"] == kind.as_str())
        };
        let patient = of_kind("Patient").next().unwrap();
        assert_eq!(patient["identifier"][0]["value"], "4711");
        assert_eq!(patient["name"][0]["family"], "Müller");
        assert_eq!(patient["name"][0]["given"], json!(["Ada", "Eva"]));
        assert_eq!(patient["birthDate"], "1950-01-02");
        let study = of_kind("ImagingStudy").next().unwrap();
        assert_eq!(study["identifier"][0]["value"], "urn:oid:1.2.3");
        let tid =
            of_kind("Observation").find(|own| own["code"]["coding"][0]["code"] == "428832008");
        let tid = tid.unwrap();
        assert_eq!(tid["valueQuantity"]["value"], 1.125);
        assert_eq!(tid["component"].as_array().unwrap().len(), 2);
        assert_eq!(tid["issued"], "2026-11-30T22:15:00Z");
        assert_eq!(tid["effectiveDateTime"], "2026-11-29");
    }
}
