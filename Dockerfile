# warpknit for servers: the command without the window, which needs neither a graphics card nor a driver.
#
#     docker build -t warpknit .
#     docker run --rm -v "$PWD:/work" -u "$(id -u):$(id -g)" warpknit drape garment.obj --fabric locknit -o garment.glb

FROM rust:1.95-slim-bookworm AS build
WORKDIR /source
COPY . .
ARG WARPKNIT_COMMIT
RUN cargo build --profile dist --locked --no-default-features --features cli

FROM debian:bookworm-slim
COPY --from=build /source/target/dist/warpknit /usr/local/bin/warpknit
COPY --from=build /source/LICENSE-APACHE /source/LICENSE-MIT /usr/share/doc/warpknit/
# Strained repeats are kept here for the next run: mount a volume to keep them longer than a container.
ENV XDG_CACHE_HOME=/var/cache/warpknit
RUN mkdir -m 1777 /var/cache/warpknit
WORKDIR /work
USER nobody
ENTRYPOINT ["warpknit"]
