//! Compiles farm.proto without protoc.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=farm.proto");
    let descriptors = protox::compile(["farm.proto"], ["."])?;
    // Chunks stay views of the buffer that they arrived in.
    tonic_prost_build::configure().bytes(".").compile_fds(descriptors)?;
    Ok(())
}
