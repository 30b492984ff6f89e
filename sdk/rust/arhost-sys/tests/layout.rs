// SPDX-License-Identifier: Apache-2.0
//! What is declared here is what a C compiler makes of the headers: sizes, offsets, constants, frame layouts.
//! ARHOST_INCLUDE is the headers' folder, where they are not installed beside this crate.

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
    let made = Command::new(compiler).args(["-std=c11", "-I", &include, "-o"]).arg(&program).arg(&source).status();
    assert!(made.unwrap().success(), "the C program does not compile: a name that the headers do not have");
    let output = Command::new(&program).output().unwrap();
    fs::remove_dir_all(&folder).unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn sizes_and_offsets_are_those_of_the_headers() {
    let (mut program, mut expected) = (String::new(), vec![]);
    for (name, size, fields) in arhost_sys::layouts() {
        writeln!(program, "printf(\"{0} %zu\\n\", sizeof({0}));", name).unwrap();
        expected.push(format!("{} {}", name, size));
        for (field, offset) in fields {
            let field = field.trim_end_matches('_');
            writeln!(program, "printf(\"{0}.{1} %zu\\n\", offsetof({0}, {1}));", name, field).unwrap();
            expected.push(format!("{}.{} {}", name, field, offset));
        }
    }
    assert!(expected.len() > 250);
    assert_eq!(run_c("layout", &program), expected);
}

#[test]
fn constants_are_those_of_the_headers() {
    let (mut program, mut expected) = (String::new(), vec![]);
    for (name, value) in arhost_sys::constants() {
        // Signed and unsigned ones alike: as 64 bits.
        writeln!(program, "printf(\"{0} %llx\\n\", (unsigned long long){0});", name).unwrap();
        expected.push(format!("{} {:x}", name, value as u64));
    }
    assert!(expected.len() > 70);
    assert_eq!(run_c("constants", &program), expected);
}

#[test]
fn texts_are_those_of_the_headers() {
    let printed = run_c("texts", "puts(ARHOST_DEVICES_EXTENSION);\n");
    assert_eq!(printed.concat().as_bytes(), arhost_sys::ARHOST_DEVICES_EXTENSION.strip_suffix(b"\0").unwrap());
}

#[test]
fn frames_are_laid_out_as_by_the_headers() {
    let (mut program, mut expected) = (String::new(), vec![]);
    for pixel_format in 0..=7 {
        for (width, height) in [(640, 360), (1, 1), (65, 64), (66, 33), (0, 5), (16385, 2)] {
            let mut format: arhost_sys::arhost_frame_format = unsafe { std::mem::zeroed() };
            format.pixel_format = pixel_format;
            format.width = width;
            format.height = height;
            expected.push(if format.lay_out() {
                format!(
                    "{} {:?} {:?} {} {} {}",
                    format.plane_count,
                    format.stride,
                    format.offset,
                    format.grey_stride,
                    format.grey_offset,
                    format.byte_size
                )
            } else {
                "not valid".into()
            });
            writeln!(
                program,
                "{{ arhost_frame_format f; memset(&f, 0, sizeof f); f.pixel_format = {}; f.width = {}; f.height = {};
                if (arhost_frame_layout(&f))
                    printf(\"%u [%u, %u, %u] [%llu, %llu, %llu] %u %llu %llu\\n\", f.plane_count, f.stride[0],
                        f.stride[1], f.stride[2], (unsigned long long)f.offset[0], (unsigned long long)f.offset[1],
                        (unsigned long long)f.offset[2], f.grey_stride, (unsigned long long)f.grey_offset,
                        (unsigned long long)f.byte_size);
                else puts(\"not valid\"); }}",
                pixel_format, width, height
            )
            .unwrap();
        }
    }
    assert_eq!(run_c("frames", &program), expected);
}
