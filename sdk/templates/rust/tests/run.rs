//! Runs the plugin in arhost for five frames; all of them must pass through it.
//! Set ARHOST to the program's path if it is not in the PATH.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

#[test]
fn five_frames_pass_through() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    // `cargo test` does not build the library.
    let built = Command::new(env!("CARGO")).args(["build", "--target-dir", "target"]).current_dir(here).status();
    assert!(built.unwrap().success());
    let status = Command::new(env::var("ARHOST").unwrap_or("arhost".into()))
        .current_dir(here)
        .args(["--config", "try.yaml", "--frames", "5"])
        .status()
        .expect("cannot start arhost; set ARHOST to its path");
    assert!(status.success());
    let stats = fs::read_to_string(here.join("out/stats.json")).unwrap();
    assert!(stats.contains("\"@COUNT@\": 5"), "frames.@COUNT@ in out/stats.json must be 5:\n{}", stats);
}
