//! @NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid
//! gives the direction, their area the distance.

use arhost_sys::*;

struct @CLASS@ {
    threshold: u8,
    /// The camera, and the first configured marker; this tracker ignores the others.
    setup: Option<(arhost_intrinsics, arhost_marker_config)>,
}

/// Centroid and area, in px.
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

    fn track(&mut self, request: &mut TrackRequest, result: &mut arhost_tracker_result) -> Result<(), Failure> {
        let (lens, target) = self.setup.expect("started");
        let patch = match self.detect(&request.frame()) {
            Some(patch) => patch,
            None => return Ok(()), // no marker in this frame: not an error
        };
        let half = patch.area.sqrt() / 2.0;
        let distance = lens.fx * target.side_mm / (2.0 * half);

        result.marker_count = 1;
        let marker = &mut result.markers[0];
        marker.struct_size = std::mem::size_of::<arhost_marker>() as u32;
        marker.id = target.id;
        for (to, from) in marker.family.iter_mut().zip(b"bright") {
            *to = *from as _;
        }
        marker.state = ARHOST_MARKER_DETECTED;
        // Top left, top right, bottom right, bottom left on the upright print.
        marker.corners_px = [
            [patch.x - half, patch.y - half],
            [patch.x + half, patch.y - half],
            [patch.x + half, patch.y + half],
            [patch.x - half, patch.y + half],
        ];
        // Marker to camera, column-major; camera axes x right, y up, looking along -z; mm. No rotation: frontal view.
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
    tracker @CLASS@, "@NAME@", "Tracks a bright patch as the marker.",
    capabilities: 0,
    // arhost validates the configuration against these before it calls `new`.
    options: [
        option!(ARHOST_OPTION_INTEGER, "threshold", "200", "Minimum grey level of a bright pixel.", 1.0, 255.0),
    ]
}
