//! The cryptography behind TLS, for this program's server and clients: *ring*, installed once.

/// Makes *ring* the process's provider for rustls, unless one is installed already. To be called
/// before the first HTTP client or TLS listener is made; calling it again changes nothing.
pub fn install_cryptography() {
    // An error means that a provider is installed.
    let _ = rustls::crypto::ring::default_provider().install_default();
}
