//! @NAME@: a sink for arhost. Writes each frame as an image: <path>000000.ppm, …

use arhost_sys::*;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

struct @CLASS@ {
    path: String, // absolute
    temporary: PathBuf,
}

impl Plugin for @CLASS@ {
    fn new(_host: Host, options: &Options) -> Result<Self, Failure> {
        let path = options.text("path");
        let temporary = PathBuf::from(format!("{}.part", path));
        Ok(@CLASS@ { path, temporary })
    }
}

fn write_image(file: &Path, output: &Output) -> std::io::Result<()> {
    let mut file = BufWriter::new(fs::File::create(file)?);
    write!(file, "P6\n{} {}\n255\n", output.width, output.height)?;
    for row in 0..output.height {
        for [b, g, r] in output.row(row) {
            file.write_all(&[*r, *g, *b])?;
        }
    }
    file.flush()
}

impl Sink for @CLASS@ {
    /// Reports an unwritable path now, but leaves existing files unchanged until the first frame: another component may
    /// still reject the run.
    fn start(&mut self, _setup: &arhost_sink_setup) -> Result<(), Failure> {
        if let Some(folder) = self.temporary.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::File::create(&self.temporary)?;
        Ok(fs::remove_file(&self.temporary)?)
    }

    /// FILL IN: your output. output.record() has the frame's pose, time and more.
    fn write(&mut self, output: &Output) -> Result<bool, Failure> {
        let name = PathBuf::from(format!("{}{:06}.ppm", self.path, output.record().sequence));
        write_image(&self.temporary, output)
            .and_then(|()| fs::rename(&self.temporary, &name)) // atomic: only complete files get the final name
            .map_err(|error| {
                Failure::new(ARHOST_STATUS_ERROR_IO, format!("cannot write {}: {}", name.display(), error))
            })?;
        Ok(true) // from here on the frame must survive a kill of the process
    }
}

plugin! {
    // FILL IN: your domain in reverse order.
    sink @CLASS@, "org.example", "@NAME@", "Writes each frame as an image (PPM).",
    capabilities: 0,
    // arhost validates the configuration against these before it calls `new`.
    options: [
        option!(ARHOST_OPTION_OUTPUT_PATH, "path", required, "Prefix of the file names; a number and .ppm are appended."),
    ]
}
