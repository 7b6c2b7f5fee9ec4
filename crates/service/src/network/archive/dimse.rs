//! C-STORE to an archive without DICOMweb (PS3.4 annex B): one association for each object, over TLS if
//! the settings say so. Called on blocking threads.

use super::web::{Stored, store_failure};
use super::{ArchiveObject, DicomPeer, DicomTls};
use crate::base::error::AttemptError;
use crate::base::pem;
use crate::base::records::Fault;
use dicom_core::{PrimitiveValue, VR, dicom_value};
use dicom_dictionary_std::{tags, uids};
use dicom_encoding::TransferSyntaxIndex;
use dicom_object::mem::InMemElement;
use dicom_object::{InMemDicomObject, OpenFileOptions};
use dicom_transfer_syntax_registry::{TransferSyntaxRegistry, entries};
use dicom_ul::association::client::{ClientAssociation, ClientAssociationOptions};
use dicom_ul::association::{CloseSocket, Error};
use dicom_ul::pdu::{PDataValue, PDataValueType, Pdu};
use rustls::ClientConfig;
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

/// Longest time to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest response that is read, bytes.
const RESPONSE_BYTES: usize = 64 << 10;

const STORE_REQUEST: u16 = 0x0001;
const MESSAGE_NUMBER: u16 = 1;

/// Stores an object by C-STORE.
///
/// # Errors
/// If the archive does not take it, or does not answer.
pub(super) fn store(
    peer: &DicomPeer,
    object: &ArchiveObject,
    timeout: Duration,
) -> Result<Stored, AttemptError> {
    let syntaxes = [
        uids::EXPLICIT_VR_LITTLE_ENDIAN,
        uids::IMPLICIT_VR_LITTLE_ENDIAN,
    ];
    let options = ClientAssociationOptions::new()
        .calling_ae_title(peer.calling.as_str())
        .called_ae_title(peer.called.as_str())
        .with_presentation_context(object.class.as_str(), syntaxes.to_vec())
        .connection_timeout(CONNECT_TIMEOUT.min(timeout))
        .read_timeout(timeout)
        .write_timeout(timeout);
    let address = peer.address.as_str();
    match &peer.tls {
        None => {
            let association = options.establish(address);
            send(association.map_err(|error| refusal(&error))?, object)
        }
        Some(files) => {
            let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
            let options = options
                .tls_config(client_config(files)?)
                .server_name(host.trim_matches(['[', ']']));
            let association = options.establish_tls(address);
            send(association.map_err(|error| refusal(&error))?, object)
        }
    }
}

/// Stores an object over an association that offers its SOP class alone.
fn send<S: CloseSocket + Read + Write>(
    mut association: ClientAssociation<S>,
    object: &ArchiveObject,
) -> Result<Stored, AttemptError> {
    let context = association.presentation_contexts().first().cloned();
    let context = context.ok_or_else(unsupported)?;
    let broken = |_| AttemptError::retry("The archive broke the association off.");
    let command = command(object)?;
    association
        .send(&Pdu::PData {
            data: vec![PDataValue {
                presentation_context_id: context.id,
                value_type: PDataValueType::Command,
                is_last: true,
                data: command,
            }],
        })
        .map_err(broken)?;
    let data_set = data_set(object, context.transfer_syntax.trim_end_matches('\0'))?;
    {
        let mut writer = association.send_pdata(context.id);
        let written = writer.write_all(&data_set);
        written
            .and_then(|()| writer.finish())
            .map_err(|_| AttemptError::retry("The archive broke the association off."))?;
    }
    let mut response = Vec::new();
    loop {
        let Pdu::PData { data } = association.receive().map_err(broken)? else {
            return Err(AttemptError::retry("The archive ended the association."));
        };
        let mut last = false;
        for value in data {
            response.extend_from_slice(&value.data);
            last |= value.is_last;
        }
        if response.len() > RESPONSE_BYTES {
            return Err(AttemptError::retry("The archive's response has no end."));
        }
        if last {
            break;
        }
    }
    let status = status(&response);
    // What matters is the response; the archive may end the association as it likes.
    let _ = association.release();
    match status {
        // Success, and the warnings of PS3.4 B.2.3.
        Some(0x0000 | 0xB000 | 0xB006 | 0xB007) => Ok(Stored::Now),
        other => store_failure(other),
    }
}

/// TLS with the files of the settings, which are read each time: they may have been renewed.
fn client_config(files: &DicomTls) -> Result<ClientConfig, AttemptError> {
    let unusable = |key: &str, path: &Path, reason: String| {
        let path = path.display();
        AttemptError::retry(format!("`{key}` ({path}) cannot be used: {reason}."))
    };
    let authorities = pem::authorities(&files.ca_file)
        .map_err(|reason| unusable("dicom_ca_file", &files.ca_file, reason))?;
    let builder = ClientConfig::builder_with_provider(pem::provider())
        .with_protocol_versions(&pem::TLS_VERSIONS)
        .map_err(|error| AttemptError::retry(format!("TLS cannot be used: {error}.")))?
        .with_root_certificates(authorities);
    let Some((certificate, key)) = &files.own else {
        return Ok(builder.with_no_client_auth());
    };
    let chain = pem::certificates(certificate)
        .map_err(|reason| unusable("dicom_cert_file", certificate, reason))?;
    let secret = pem::private_key(key).map_err(|reason| unusable("dicom_key_file", key, reason))?;
    builder
        .with_client_auth_cert(chain, secret)
        .map_err(|error| unusable("dicom_cert_file", certificate, error.to_string()))
}

fn refusal(error: &Error) -> AttemptError {
    match error {
        Error::TlsHandshake { .. }
        | Error::TlsConnection { .. }
        | Error::InvalidServerName { .. } => AttemptError::retry(
            "The archive and this service do not agree on TLS: check `dicom_ca_file`, the name \
                 in the archive's certificate, and whether it asks for a certificate of this service.",
        ),
        Error::TlsNotSupported => {
            AttemptError::retry("The archive speaks TLS: set `dicom_ca_file`.")
        }
        Error::Rejected { .. } => {
            AttemptError::retry("The archive rejects the association: check both AE titles.")
        }
        Error::NoAcceptedPresentationContexts { .. } => unsupported(),
        _ => AttemptError::retry("The archive could not be reached, or broke the association off."),
    }
}

fn unsupported() -> AttemptError {
    AttemptError::permanent(
        Fault::Service,
        "archive-refuses",
        "The archive does not support the SOP class of the object.",
        "Ask the archive's administrator to allow it; then send the object again.",
    )
}

fn broken_object() -> AttemptError {
    AttemptError::permanent(
        Fault::Service,
        "internal",
        "The object cannot be encoded for the archive.",
        "Report it with the job's id.",
    )
}

/// The command set of C-STORE-RQ (PS3.7, 9.3.1).
fn command(object: &ArchiveObject) -> Result<Vec<u8>, AttemptError> {
    let number = |tag, value: u16| InMemElement::new(tag, VR::US, dicom_value!(U16, [value]));
    let text = |tag, value: &str| InMemElement::new(tag, VR::UI, PrimitiveValue::from(value));
    let command = InMemDicomObject::command_from_element_iter([
        text(tags::AFFECTED_SOP_CLASS_UID, &object.class),
        number(tags::COMMAND_FIELD, STORE_REQUEST),
        number(tags::MESSAGE_ID, MESSAGE_NUMBER),
        number(tags::PRIORITY, 0),
        // A data set follows.
        number(tags::COMMAND_DATA_SET_TYPE, 0),
        text(tags::AFFECTED_SOP_INSTANCE_UID, &object.instance),
    ]);
    let mut bytes = Vec::new();
    let implicit = entries::IMPLICIT_VR_LITTLE_ENDIAN.erased();
    command
        .write_dataset_with_ts(&mut bytes, &implicit)
        .map_err(|_| broken_object())?;
    Ok(bytes)
}

/// The data set in the transfer syntax that was agreed on.
fn data_set(object: &ArchiveObject, syntax: &str) -> Result<Vec<u8>, AttemptError> {
    let file = OpenFileOptions::new().from_reader(object.bytes.as_slice());
    let file = file.map_err(|_| broken_object())?;
    let syntax = TransferSyntaxRegistry
        .get(syntax)
        .ok_or_else(broken_object)?;
    let mut bytes = Vec::with_capacity(object.bytes.len());
    file.write_dataset_with_ts(&mut bytes, syntax)
        .map_err(|_| broken_object())?;
    Ok(bytes)
}

/// The status of a response.
fn status(response: &[u8]) -> Option<u16> {
    let implicit = entries::IMPLICIT_VR_LITTLE_ENDIAN.erased();
    let command = InMemDicomObject::read_dataset_with_ts(response, &implicit).ok()?;
    command.get(tags::STATUS)?.to_int().ok()
}
