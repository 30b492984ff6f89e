//! @NAME@: a source for arhost. Produces a moving gradient.

use arhost_sys::*;
use std::thread::sleep;
use std::time::{Duration, Instant};

struct @CLASS@ {
    host: Host,
    width: u32,
    height: u32,
    frames: u64, // 0: endless
    fps: f64,
    /// In mode live: the number and time of the first frame.
    pace: Option<(u64, Instant)>,
}

impl Plugin for @CLASS@ {
    fn new(host: Host, options: &Options) -> Result<Self, Failure> {
        Ok(@CLASS@ {
            host,
            width: options.integer("width") as u32,
            height: options.integer("height") as u32,
            frames: options.integer("frames") as u64,
            fps: 0.0,
            pace: None,
        })
    }
}

impl Source for @CLASS@ {
    fn start(&mut self, setup: &arhost_source_setup, properties: &mut arhost_source_properties) -> Result<(), Failure> {
        // FILL IN: open the device or file.
        self.fps = if setup.fps > 0.0 { setup.fps } else { 30.0 };
        if setup.paced != 0 {
            self.pace = Some((setup.first_sequence, Instant::now()));
        }
        properties.frame_count = self.frames;
        properties.format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
        properties.format.width = self.width;
        properties.format.height = self.height;
        properties.format.fps = self.fps;
        Ok(())
    }

    fn read(&mut self, buffer: &mut FrameBuffer, info: &mut arhost_frame_info) -> Result<bool, Failure> {
        let n = buffer.sequence;
        if self.frames > 0 && n >= self.frames {
            return Ok(false);
        }
        info.clock = ARHOST_CLOCK_MEDIA; // for a camera: ARHOST_CLOCK_MONOTONIC, at the time of exposure
        info.capture_ns = (1e9 * n as f64 / self.fps) as i64;
        if let Some((first, start_time)) = self.pace {
            let due = start_time + Duration::from_secs_f64(n.saturating_sub(first) as f64 / self.fps);
            while Instant::now() < due {
                // Poll this in every wait.
                if self.host.cancelled() {
                    return Err(Failure::new(ARHOST_STATUS_ERROR_CANCELLED, ""));
                }
                sleep(Duration::from_millis(2));
            }
        }

        // FILL IN: your pixels. arhost computes the grey plane for trackers from them.
        let (width, stride) = (self.width as usize, buffer.format().stride[0] as usize);
        for (row, line) in buffer.plane_mut(0).chunks_exact_mut(stride).enumerate() {
            for (column, rgb) in line.chunks_exact_mut(3).take(width).enumerate() {
                rgb[0] = (column as u64 + 4 * n) as u8;
                rgb[1] = row as u8;
                rgb[2] = 128;
            }
        }
        Ok(true)
    }
}

plugin! {
    // FILL IN: your domain in reverse order.
    source @CLASS@, "org.example", "@NAME@", "Moving gradient.",
    capabilities: ARHOST_SOURCE_CAPABILITY_SEEK, // frame n is the same wherever reading starts
    // arhost validates the configuration against these before it calls `new`.
    options: [
        option!(ARHOST_OPTION_INTEGER, "width", "640", "Image width in px.", 1.0, 4096.0),
        option!(ARHOST_OPTION_INTEGER, "height", "360", "Image height in px.", 1.0, 4096.0),
        option!(ARHOST_OPTION_INTEGER, "frames", "60", "Number of frames; 0: endless.", 0.0, 1e9),
    ]
}
