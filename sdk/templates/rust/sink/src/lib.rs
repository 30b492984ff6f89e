//! @NAME@: a sink for arhost. It writes each frame as a picture, <path>000000.ppm and so on.

use arhost_sys::*;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

struct @CLASS@ {
    path: String, // absolute
    part: PathBuf,
}

impl Plugin for @CLASS@ {
    fn new(_host: Host, options: &Options) -> Result<Self, Failure> {
        let path = options.text("path");
        let part = PathBuf::from(format!("{}.part", path));
        Ok(@CLASS@ { path, part })
    }
}

fn write_picture(file: &Path, output: &Output) -> std::io::Result<()> {
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
    /// Where nothing can be written this tells so now. It leaves what is there as it is until the first frame:
    /// another component may yet refuse the run.
    fn start(&mut self, _setup: &arhost_sink_setup) -> Result<(), Failure> {
        if let Some(folder) = self.part.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::File::create(&self.part)?;
        Ok(fs::remove_file(&self.part)?)
    }

    /// FILL IN: what becomes of a frame. output.record() tells its pose, its time and how its overlay arose.
    fn write(&mut self, output: &Output) -> Result<bool, Failure> {
        let name = PathBuf::from(format!("{}{:06}.ppm", self.path, output.record().sequence));
        write_picture(&self.part, output)
            .and_then(|()| fs::rename(&self.part, &name)) // under its own name only when it is whole
            .map_err(|error| Failure::new(ARHOST_STATUS_ERROR_IO, format!("can't write {}: {}", name.display(), error)))?;
        Ok(true) // the frame must now survive the death of this process
    }
}

plugin! {
    sink @CLASS@, "@NAME@", "Writes each frame as a picture (PPM).",
    capabilities: 0,
    // arhost checks the configuration against these before `new` sees a value.
    options: [
        option!(ARHOST_OPTION_OUTPUT_PATH, "path", required, "What the pictures' names begin with; a number and .ppm follow."),
    ]
}
