// SPDX-License-Identifier: Apache-2.0
//! `lay_out` computes the same frame layouts as arhost_frame_layout in C. (The other declarations are generated.)
//! ARHOST_INCLUDE is the folder of the headers, if they are not installed next to this crate.

use std::fmt::Write;
use std::process::Command;
use std::{env, fs};

/// Compiles and runs a C program with the headers, and returns the lines that it prints.
fn run_c(name: &str, statements: &str) -> Vec<String> {
    let folder = env::temp_dir().join(format!("arhost-sys-{}-{}", name, std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (source, program) = (folder.join("main.c"), folder.join("main"));
    let text = format!(
        "#include <arhost/arhost.h>\n#include <stdio.h>\n#include <string.h>\nint main(void) {{\n{}return 0;\n}}\n",
        statements
    );
    fs::write(&source, text).unwrap();
    let include = env::var("ARHOST_INCLUDE").unwrap_or(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../include").into());
    let compiler = env::var("CC").unwrap_or("cc".into());
    let compiled = Command::new(compiler).args(["-std=c11", "-I", &include, "-o"]).arg(&program).arg(&source).status();
    assert!(compiled.unwrap().success(), "the C program does not compile");
    let output = Command::new(&program).output().unwrap();
    fs::remove_dir_all(&folder).unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn frame_layouts_match_the_headers() {
    let (mut program, mut expected) = (String::new(), vec![]);
    for pixel_format in 0..=7 {
        for (width, height) in [(640, 360), (1, 1), (65, 64), (66, 33), (0, 5), (16385, 2)] {
            let mut format: arhost_sys::arhost_frame_format = unsafe { std::mem::zeroed() };
            format.pixel_format = pixel_format;
            format.width = width;
            format.height = height;
            format.has_depth = (width % 2) as i32;
            expected.push(if format.lay_out() {
                format!(
                    "{} {:?} {:?} {} {} {} {} {}",
                    format.plane_count,
                    format.stride,
                    format.offset,
                    format.grey_stride,
                    format.grey_offset,
                    format.depth_stride,
                    format.depth_offset,
                    format.byte_size
                )
            } else {
                "invalid".into()
            });
            writeln!(
                program,
                "{{ arhost_frame_format f; memset(&f, 0, sizeof f); f.pixel_format = {}; f.width = {}; f.height = {};
                f.has_depth = f.width % 2;
                if (arhost_frame_layout(&f))
                    printf(\"%u [%u, %u, %u] [%llu, %llu, %llu] %u %llu %u %llu %llu\\n\", f.plane_count, f.stride[0],
                        f.stride[1], f.stride[2], (unsigned long long)f.offset[0], (unsigned long long)f.offset[1],
                        (unsigned long long)f.offset[2], f.grey_stride, (unsigned long long)f.grey_offset,
                        f.depth_stride, (unsigned long long)f.depth_offset, (unsigned long long)f.byte_size);
                else puts(\"invalid\"); }}",
                pixel_format, width, height
            )
            .unwrap();
        }
    }
    assert_eq!(run_c("frames", &program), expected);
}
