//! Runs the plugin in arhost for five frames; all of them must have come through it.
//! ARHOST is the program, where it is not in the PATH.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

#[test]
fn five_frames_come_through() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    // `cargo test` alone does not make the library.
    let built = Command::new(env!("CARGO")).args(["build", "--target-dir", "target"]).current_dir(here).status();
    assert!(built.unwrap().success());
    let status = Command::new(env::var("ARHOST").unwrap_or("arhost".into()))
        .current_dir(here)
        .args(["--config", "try.yaml", "--frames", "5"])
        .status()
        .expect("arhost can't be started; set ARHOST to its path");
    assert!(status.success());
    let stats = fs::read_to_string(here.join("out/stats.json")).unwrap();
    assert!(stats.contains("\"@COUNT@\": 5"), "frames.@COUNT@ in out/stats.json must be 5:\n{}", stats);
}
