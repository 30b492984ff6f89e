//! @NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid is
//! its centre, their number its area. arhost computes the pose from the corners.

use arhost_sys::*;

struct @CLASS@ {
    threshold: u8,
    /// The first configured marker; this tracker does not look for others.
    marker: Option<arhost_marker_config>,
}

impl Plugin for @CLASS@ {
    fn new(_host: Host, options: &Options) -> Result<Self, Failure> {
        Ok(@CLASS@ { threshold: options.integer("threshold") as u8, marker: None })
    }
}

impl Tracker for @CLASS@ {
    fn start(&mut self, setup: &arhost_tracker_setup) -> Result<(), Failure> {
        self.marker = Some(*setup.markers()[0]);
        Ok(())
    }

    /// FILL IN: your detector.
    fn track(&mut self, request: &mut TrackRequest, result: &mut TrackResult) -> Result<(), Failure> {
        let frame = request.frame();
        let (mut x, mut y, mut area) = (0.0, 0.0, 0.0);
        for row in 0..frame.format().height {
            for (column, &grey) in frame.grey_row(row).iter().enumerate() {
                if grey >= self.threshold {
                    x += column as f64;
                    y += f64::from(row);
                    area += 1.0;
                }
            }
        }
        if area < 100.0 {
            return Ok(()); // no marker in this frame: not an error
        }
        let marker = self.marker.expect("started");
        let (x, y, half) = (x / area, y / area, f64::sqrt(area) / 2.0);
        // Top left, top right, bottom right, bottom left on the upright print.
        let corners_px = [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]];
        result.observe(arhost_observation { id: marker.id, family: marker.family, corners_px, ..Default::default() });
        Ok(())
    }
}

plugin! {
    // FILL IN: your domain in reverse order.
    tracker @CLASS@, "org.example", "@NAME@", "Detects a bright patch as the marker.",
    capabilities: 0,
    // arhost validates the configuration against these before it calls `new`.
    options: [
        option!(ARHOST_OPTION_INTEGER, "threshold", "200", "Minimum grey level of a bright pixel.", 1.0, 255.0),
    ]
}
