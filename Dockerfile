# Build stage. Dependencies are compiled first, in a layer of their own, so that a change in the sources does not
# compile them again.
FROM rust:1-bookworm AS build
WORKDIR /build
COPY Cargo.toml Cargo.lock ./
COPY crates/dicom/Cargo.toml crates/dicom/
COPY crates/ventriform/Cargo.toml crates/ventriform/
COPY crates/service/Cargo.toml crates/service/
COPY crates/store/Cargo.toml crates/store/
COPY crates/http/Cargo.toml crates/http/
COPY crates/http_client/Cargo.toml crates/http_client/
COPY crates/python/Cargo.toml crates/python/
COPY crates/evaluation/Cargo.toml crates/evaluation/
# Not built, but Cargo.toml declares them and cargo looks for their files.
COPY benches benches
RUN for crate in . crates/*; do mkdir "$crate/src" && touch "$crate/src/lib.rs" || exit; done \
 && echo 'fn main() {}' > src/main.rs \
 && cargo build --profile dist --locked --bin ventriform \
 && rm -rf src crates
COPY crates crates
COPY src src
COPY web/dist web/dist
COPY README.md ./
# cargo compares modification times: the sources must be newer than the placeholders above.
RUN find src crates -exec touch {} + \
 && cargo build --profile dist --locked --bin ventriform

# Runtime image: the program, its bill of materials, one volume, an unprivileged user.
FROM debian:bookworm-slim
LABEL org.opencontainers.image.title="ventriform" \
      org.opencontainers.image.description="Surface models of the left ventricle from cardiac SPECT" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0"
RUN install -d -o 10001 -g 10001 -m 0750 /data
COPY --from=build /build/target/dist/ventriform /usr/local/bin/ventriform
# For S3 stores, archives, webhooks and OpenID issuers behind HTTPS; mount your own over it for a private authority.
COPY --from=build /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/
# THIRD-PARTY has the licence texts of the dependencies; scripts/release/image.sh adds it.
COPY LICENSE-APACHE LICENSE-MIT ventriform.cdx.json THIRD-PARTY* /usr/share/doc/ventriform/
# The service listens beyond loopback, so it asks callers for keys unless VENTRIFORM_ALLOW_ANONYMOUS=true.
ENV VENTRIFORM_LISTEN=0.0.0.0:8080 \
    VENTRIFORM_DATA_DIR=/data \
    VENTRIFORM_LOG_FORMAT=json
USER 10001:10001
VOLUME /data
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=5s --retries=3 \
    CMD ["ventriform", "healthcheck"]
ENTRYPOINT ["ventriform"]
CMD ["serve"]
