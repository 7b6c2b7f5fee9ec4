# The build: dependencies first, so that a change of our sources does not compile them again.
FROM rust:1-bookworm AS build
WORKDIR /build
COPY Cargo.toml Cargo.lock ./
# Not built, but named by the manifest.
COPY benches benches
RUN mkdir src \
 && echo 'fn main() {}' > src/main.rs \
 && touch src/lib.rs \
 && cargo build --release --locked --bin ventriform \
 && rm -rf src
COPY src src
COPY README.md ./
# cargo goes by modification times: the sources must be newer than the stand-ins.
RUN find src -exec touch {} + \
 && cargo build --release --locked --bin ventriform

# The image: the program, one volume, nobody's rights.
FROM debian:bookworm-slim
LABEL org.opencontainers.image.title="ventriform" \
      org.opencontainers.image.description="Surface models of the left ventricle from cardiac SPECT" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0"
RUN install -d -o 10001 -g 10001 -m 0750 /data
COPY --from=build /build/target/release/ventriform /usr/local/bin/ventriform
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
