# One static binary and nothing else. Build it first:
#   RUSTFLAGS='-C target-feature=+crt-static' cargo build --release --target x86_64-unknown-linux-gnu -p lightfarm
FROM scratch
COPY target/x86_64-unknown-linux-gnu/release/lightfarm /lightfarm
ENTRYPOINT ["/lightfarm"]
