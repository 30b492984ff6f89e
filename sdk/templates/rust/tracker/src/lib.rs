//! @NAME@: a tracker for arhost. It takes the brightest patch of the image for a white square that faces the camera:
//! its middle gives the direction, its area the distance.

use arhost_sys::*;

struct @CLASS@ {
    threshold: u8,
    /// Of the camera, and of the one marker that is looked for: the first that the configuration lists.
    setup: Option<(arhost_intrinsics, arhost_marker_config)>,
}

/// A patch of the image, in px.
struct Patch {
    x: f64,
    y: f64,
    area: f64,
}

impl @CLASS@ {
    /// FILL IN: your detector.
    fn detect(&self, frame: &Frame) -> Option<Patch> {
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
            None
        } else {
            Some(Patch { x: x / area, y: y / area, area })
        }
    }
}

impl Plugin for @CLASS@ {
    fn new(_host: Host, options: &Options) -> Result<Self, Failure> {
        Ok(@CLASS@ { threshold: options.integer("threshold") as u8, setup: None })
    }
}

impl Tracker for @CLASS@ {
    fn start(&mut self, setup: &arhost_tracker_setup) -> Result<(), Failure> {
        self.setup = Some((*setup.intrinsics(), *setup.markers()[0]));
        Ok(())
    }

    fn track(&mut self, frame: &Frame, result: &mut arhost_tracker_result) -> Result<(), Failure> {
        let (lens, wanted) = self.setup.expect("start comes first");
        let patch = match self.detect(frame) {
            Some(patch) => patch,
            None => return Ok(()), // nothing found is no error: the video goes on without an overlay
        };
        let half = patch.area.sqrt() / 2.0;
        let distance = lens.fx * wanted.side_mm / (2.0 * half);

        result.marker_count = 1;
        let marker = &mut result.markers[0];
        marker.struct_size = std::mem::size_of::<arhost_marker>() as u32;
        marker.id = wanted.id;
        for (to, from) in marker.family.iter_mut().zip(b"bright") {
            *to = *from as _;
        }
        marker.state = ARHOST_MARKER_DETECTED;
        // Top left, top right, bottom right, bottom left of the upright print.
        marker.corners_px = [
            [patch.x - half, patch.y - half],
            [patch.x + half, patch.y - half],
            [patch.x + half, patch.y + half],
            [patch.x - half, patch.y + half],
        ];
        // Marker to camera, column-major, x right, y up, looking along -z, in mm. Not turned: it faces the camera.
        for i in [0, 5, 10, 15] {
            marker.mt[i] = 1.0;
        }
        marker.mt[12] = distance * (patch.x - lens.cx) / lens.fx;
        marker.mt[13] = -distance * (patch.y - lens.cy) / lens.fy;
        marker.mt[14] = -distance;
        Ok(())
    }
}

plugin! {
    tracker @CLASS@, "@NAME@", "Takes the brightest patch for the marker.",
    capabilities: 0,
    // arhost checks the configuration against these before `new` sees a value.
    options: [
        option!(ARHOST_OPTION_INTEGER, "threshold", "200", "Grey level from which on a pixel counts as bright.", 1.0, 255.0),
    ]
}
