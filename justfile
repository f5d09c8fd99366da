# Shortcuts; each is one plain command, so `just` is optional.

# The complete CI.
check:
    .ci/run

test:
    cargo test

# Speed of one frame of 2592 x 2048.
bench:
    cargo bench --bench extract

demo:
    cargo run --release --no-default-features -- demo

# Licences, sources and advisories of the dependencies (needs cargo-deny).
deny:
    cargo deny check
