# The service: docker build -t cager .
#
# The viewer is built first, by Node. Then two stages, both Debian 12, so that the program finds the C library it was linked with. The second holds that library, time zones,
# certificates and a user, but no shell and no package manager: a service that takes bytes from anyone should have nothing else to run.
# Only the C compiler's runtime is needed beside the C library (zstd is C), hence `cc`.

ARG NODE_VERSION=22
ARG RUST_VERSION=1.95

FROM node:${NODE_VERSION}-bookworm-slim AS page
WORKDIR /web
COPY web .
RUN npm ci --silent && npm run --silent build

FROM rust:${RUST_VERSION}-bookworm AS build
WORKDIR /src
COPY . .
COPY --from=page /web/dist web/dist
# For `cager --version`, as the context has no history: --build-arg CAGER_COMMIT="$(git rev-parse --short=10 HEAD)"
ARG CAGER_COMMIT
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    --mount=type=cache,target=/src/target \
    cargo build --release --locked --bin cager \
    && install -D -m 0555 target/release/cager /out/usr/local/bin/cager \
    && install -d -m 0750 -o 65532 -g 65532 /out/data

FROM gcr.io/distroless/cc-debian12:nonroot
LABEL org.opencontainers.image.title="cager" \
      org.opencontainers.image.description="Turns animated mesh captures into light, editable, streamable cages" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0" \
      org.opencontainers.image.source="https://github.com/cager/cager"
COPY --from=build /out /
# A number, so that Kubernetes can tell that it is not root.
USER 65532:65532
WORKDIR /data
VOLUME /data
# Other than loopback addresses need tokens: mount a file of their hashes at CAGER_TOKENS, which is a path and no secret. The rest of
# the file system may be read-only.
# hadolint ignore=DL3064
ENV CAGER_LISTEN=0.0.0.0:8080 \
    CAGER_DATA=/data \
    CAGER_TOKENS=/etc/cager/tokens/tokens.toml \
    CAGER_LOG=json
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=6s --start-period=60s --retries=3 CMD ["/usr/local/bin/cager", "health"]
ENTRYPOINT ["/usr/local/bin/cager"]
CMD ["serve"]
