// SPDX-License-Identifier: Apache-2.0
//! Safe views of the arguments of a call, valid only during that call.

use crate::abi::*;
use std::borrow::Cow;
use std::ffi::CStr;
use std::ops::Deref;
use std::os::raw::{c_char, c_void};
use std::slice;

/// A frame to read.
pub struct Frame<'a>(pub(crate) &'a arhost_frame);

impl Frame<'_> {
    pub fn format(&self) -> &arhost_frame_format {
        unsafe { &*self.0.format }
    }
    /// Full-range luma.
    pub fn grey_row(&self, row: u32) -> &[u8] {
        let format = self.format();
        assert!(row < format.height);
        unsafe {
            slice::from_raw_parts(self.0.grey.add(row as usize * format.grey_stride as usize), format.width as usize)
        }
    }
    /// One plane: `format().stride[plane]` bytes per row.
    pub fn plane(&self, plane: usize) -> &[u8] {
        let format = self.format();
        unsafe { slice::from_raw_parts(self.0.plane[plane], plane_size(format, plane)) }
    }
}
/// The input of `Tracker::track`.
pub struct TrackRequest<'a>(pub(crate) &'a arhost_track_request);

impl TrackRequest<'_> {
    pub fn frame(&self) -> Frame<'_> {
        Frame(unsafe { &*self.0.frame })
    }
    /// False: a detector may search only where markers are expected.
    pub fn search_everywhere(&self) -> bool {
        self.0.search_everywhere != 0
    }
    /// The markers that are expected because of the motion of their targets in earlier frames.
    pub fn expected(&self) -> Vec<&arhost_expected_marker> {
        unsafe { elements(self.0.expected, self.0.expected_count) }
    }
    /// What an earlier call wrote to `state_after`; `None` in the first frame.
    pub fn state_before(&self) -> Option<&[u8]> {
        unsafe { state_before(self.0.state_before, self.0.state_size) }
    }
    /// To be written completely.
    pub fn state_after(&mut self) -> &mut [u8] {
        unsafe { state_after(self.0.state_after, self.0.state_size) }
    }
}

/// Receives the results of `Tracker::track`.
pub struct TrackResult<'a> {
    pub(crate) result: &'a mut arhost_tracker_result,
    pub(crate) target_count: u32,
}

impl TrackResult<'_> {
    /// Adds a marker that the tracker sees in the frame. Returns false, and ignores it, if there are already
    /// `ARHOST_MAX_OBSERVATIONS`.
    pub fn observe(&mut self, seen: arhost_observation) -> bool {
        let result = &mut *self.result;
        let count = &mut result.observation_count;
        unsafe { append(result.observations, count, ARHOST_MAX_OBSERVATIONS as u32, seen) }
    }
    /// Tells how many quadrilaterals the tracker has examined, including those that turned out not to be markers; at
    /// least as many as observations.
    pub fn set_candidate_count(&mut self, count: u32) {
        self.result.candidate_count = count.min(i32::MAX as u32) as i32;
    }
    /// Adds the pose of a body, for trackers with `ARHOST_TRACKER_CAPABILITY_REPORTS_POSES`. Returns false, and ignores it, if
    /// there are already as many as targets.
    pub fn report_pose(&mut self, pose: arhost_body_pose) -> bool {
        let result = &mut *self.result;
        unsafe { append(result.poses, &mut result.pose_count, self.target_count, pose) }
    }
}

/// Writes an element of an array whose first field is its size, which it keeps.
unsafe fn append<T>(first: *mut T, count: &mut u32, capacity: u32, value: T) -> bool {
    if *count >= capacity {
        return false;
    }
    let struct_size = *first.cast::<u32>();
    let element = first.cast::<u8>().add(*count as usize * struct_size as usize);
    element.cast::<T>().write(value);
    element.cast::<u32>().write(struct_size);
    *count += 1;
    true
}

impl Default for arhost_observation {
    fn default() -> Self {
        let struct_size = std::mem::size_of::<Self>() as u32;
        let (corners_px, projected_px) = ([[0.0; 2]; 4], [[0.0; 2]; 4]);
        let (id, family, hamming) = (0, 0, 0);
        let (decision_margin, corner_sigma_px, false_positive_rate) = (0.0, 0.0, 0.0);
        arhost_observation {
            struct_size,
            id,
            family,
            hamming,
            corners_px,
            decision_margin,
            corner_sigma_px,
            false_positive_rate,
            projected_px,
        }
    }
}

impl Deref for Frame<'_> {
    type Target = arhost_frame;
    fn deref(&self) -> &arhost_frame {
        self.0
    }
}

/// A frame to write.
pub struct FrameBuffer<'a>(pub(crate) &'a arhost_frame_buffer);

impl FrameBuffer<'_> {
    pub fn format(&self) -> &arhost_frame_format {
        unsafe { &*self.0.format }
    }
    /// One plane: `format().stride[plane]` bytes per row.
    pub fn plane_mut(&mut self, plane: usize) -> &mut [u8] {
        let size = plane_size(self.format(), plane);
        unsafe { slice::from_raw_parts_mut(self.0.plane[plane], size) }
    }
}
impl Deref for FrameBuffer<'_> {
    type Target = arhost_frame_buffer;
    fn deref(&self) -> &arhost_frame_buffer {
        self.0
    }
}

fn plane_size(format: &arhost_frame_format, plane: usize) -> usize {
    assert!(plane < format.plane_count as usize);
    let halved = plane > 0; // only NV12 and I420 have more than one plane
    format.stride[plane] as usize * (format.height as usize / if halved { 2 } else { 1 })
}

/// A pixel of an image of `ARHOST_IMAGE_FORM_LINEAR`: eight binary16 numbers, added light and transmittance.
pub type LinearPixel = [u16; 8];

/// A pixel that virtual objects do not affect.
pub const UNTOUCHED: LinearPixel = [0, 0, 0, 0, 0x3c00, 0x3c00, 0x3c00, 0];

/// `transmittance`: the share of the video that stays visible, 0 on virtual objects.
pub fn linear_pixel(added: [f32; 3], transmittance: [f32; 3]) -> LinearPixel {
    let ([r, g, b], [x, y, z]) = (added.map(half_of), transmittance.map(half_of));
    [r, g, b, 0, x, y, z, 0]
}

/// Converts to binary16, rounded to nearest, ties to even. Numbers that are too large become infinite.
pub fn half_of(number: f32) -> u16 {
    let (sign, bits) = ((number.to_bits() >> 16 & 0x8000) as u16, number.to_bits() & 0x7fff_ffff);
    let half = if bits < (127 - 14) << 23 {
        // The sum's last bit is that of a subnormal half.
        (f32::from_bits(bits) + 0.5).to_bits() - 0.5f32.to_bits()
    } else if bits >= 0x477f_f000 {
        if bits > 0x7f80_0000 { 0x7e00 } else { 0x7c00 }
    } else {
        (bits + 0xfff + (bits >> 13 & 1) - ((127 - 15) << 23)) >> 13
    };
    sign | half as u16
}

/// The image to write, in the form that the setup asks for: straight RGBA8 (sRGB-encoded, alpha exactly 0 where no ray
/// hit), or linear pixels.
pub struct Image<'a>(pub(crate) &'a arhost_image);

impl Image<'_> {
    pub fn width(&self) -> u32 {
        self.0.width
    }
    pub fn height(&self) -> u32 {
        self.0.height
    }
    /// Only if the form is `ARHOST_IMAGE_FORM_STRAIGHT`.
    pub fn row_mut(&mut self, row: u32) -> &mut [[u8; 4]] {
        assert!(row < self.0.height && !self.0.rgba.is_null());
        unsafe {
            let first = self.0.rgba.add(row as usize * self.0.stride as usize);
            slice::from_raw_parts_mut(first.cast(), self.0.width as usize)
        }
    }
    /// Only if the form is `ARHOST_IMAGE_FORM_LINEAR`.
    pub fn linear_row_mut(&mut self, row: u32) -> &mut [LinearPixel] {
        assert!(row < self.0.height && !self.0.linear.is_null());
        unsafe {
            let first = self.0.linear.cast::<u8>().add(row as usize * self.0.stride as usize);
            slice::from_raw_parts_mut(first.cast(), self.0.width as usize)
        }
    }
}

/// An augmented frame to read: B, G, R bytes per pixel.
pub struct Output<'a>(pub(crate) &'a arhost_output);

impl Output<'_> {
    pub fn record(&self) -> &arhost_record {
        unsafe { &*self.0.record }
    }
    pub fn row(&self, row: u32) -> &[[u8; 3]] {
        assert!(row < self.0.height);
        unsafe {
            let first = self.0.bgr.add(row as usize * self.0.stride as usize);
            slice::from_raw_parts(first.cast(), self.0.width as usize)
        }
    }
}
impl Deref for Output<'_> {
    type Target = arhost_output;
    fn deref(&self) -> &arhost_output {
        self.0
    }
}

unsafe fn state_before<'a>(before: *const c_void, size: u64) -> Option<&'a [u8]> {
    (!before.is_null()).then(|| slice::from_raw_parts(before.cast(), size as usize))
}

unsafe fn state_after<'a>(after: *mut c_void, size: u64) -> &'a mut [u8] {
    if after.is_null() {
        &mut []
    } else {
        slice::from_raw_parts_mut(after.cast(), size as usize)
    }
}

/// The elements of an array that a newer host may have extended: their first field, a u32, is their size.
pub(crate) unsafe fn elements<'a, T>(first: *const T, count: u32) -> Vec<&'a T> {
    let element = |i| &*first.cast::<u8>().add(i as usize * *first.cast::<u32>() as usize).cast();
    (0..count).map(element).collect()
}

/// The scene's arena, valid until `stop`.
#[derive(Clone, Copy)]
pub struct Scene(pub(crate) *const arhost_scene);

impl Scene {
    /// The elements of a buffer: `scene.elements::<arhost_object>(scene.objects)`.
    ///
    /// # Safety
    /// `T` must be the element type documented in `arhost/scene.h`, with the buffer's stride as its size. Do not use the
    /// slice after `stop`.
    pub unsafe fn elements<'a, T>(self, buffer: arhost_buffer) -> &'a [T] {
        if buffer.count == 0 {
            return &[];
        }
        assert_eq!(buffer.stride as usize, std::mem::size_of::<T>());
        slice::from_raw_parts(self.0.cast::<u8>().add(buffer.offset as usize).cast(), buffer.count as usize)
    }
}
impl Deref for Scene {
    type Target = arhost_scene;
    fn deref(&self) -> &arhost_scene {
        unsafe { &*self.0 }
    }
}

/// The text of a pointer that is not null.
unsafe fn text<'a>(at: *const c_char) -> Cow<'a, str> {
    CStr::from_ptr(at).to_string_lossy()
}
/// The text of an array.
fn text_in(array: &[c_char]) -> Cow<'_, str> {
    let bytes = unsafe { slice::from_raw_parts(array.as_ptr().cast::<u8>(), array.len()) };
    String::from_utf8_lossy(bytes.split(|&byte| byte == 0).next().unwrap_or(bytes))
}

impl arhost_tracker_setup {
    pub fn targets(&self) -> Vec<&arhost_target_config> {
        unsafe { elements(self.targets, self.target_count) }
    }
    /// The markers of all targets.
    pub fn markers(&self) -> Vec<&arhost_marker_config> {
        unsafe { elements(self.markers, self.marker_count) }
    }
    /// The names of the markers' families and dictionaries.
    pub fn families(&self) -> Vec<Cow<'_, str>> {
        unsafe { array(self.families, self.family_count).iter().map(|&name| text(name)).collect() }
    }
    pub fn intrinsics(&self) -> &arhost_intrinsics {
        unsafe { &*self.intrinsics }
    }
}

impl arhost_target_config {
    pub fn name(&self) -> Cow<'_, str> {
        unsafe { text(self.name) }
    }
    /// `None`: the target consists of markers.
    pub fn body(&self) -> Option<Cow<'_, str>> {
        unsafe { (!self.body.is_null()).then(|| text(self.body)) }
    }
}

impl arhost_target {
    pub fn name(&self) -> Cow<'_, str> {
        text_in(&self.name)
    }
}

impl arhost_record {
    pub fn targets(&self) -> Vec<&arhost_target> {
        unsafe { elements(self.targets, self.target_count) }
    }
    pub fn observations(&self) -> Vec<&arhost_observation> {
        unsafe { elements(self.observations, self.observation_count) }
    }
    pub fn expected(&self) -> Vec<&arhost_expected_marker> {
        unsafe { elements(self.expected, self.expected_count) }
    }
    /// The name of an observation's family. Panics if there is no such family.
    pub fn family(&self, seen: &arhost_observation) -> Cow<'_, str> {
        text_in(&self.families[seen.family as usize])
    }
    /// The target of `true_mt`.
    pub fn truth_target(&self) -> Option<Cow<'_, str>> {
        (self.has_truth != 0).then(|| text_in(&self.truth_target))
    }
}

impl arhost_raytracer_setup {
    pub fn scene(&self) -> Scene {
        Scene(self.scene)
    }
}

/// The input of `Raytracer::render`. Its fields are those of `arhost_render_request`.
pub struct RenderRequest<'a>(pub(crate) &'a arhost_render_request);

impl RenderRequest<'_> {
    /// The animated state of the scene; `None` for a static scene.
    pub fn motion(&self) -> Option<&arhost_motion> {
        unsafe { self.0.motion.as_ref() }
    }
    /// The frame under the overlay, only with `ARHOST_RAYTRACER_CAPABILITY_VIDEO`.
    pub fn video_frame(&self) -> Option<Frame<'_>> {
        unsafe { self.0.video.as_ref() }.map(Frame)
    }
    /// What an earlier call wrote to `state_after`; `None` in the first image.
    pub fn state_before(&self) -> Option<&[u8]> {
        unsafe { state_before(self.0.state_before, self.0.state_size) }
    }
    /// To be written completely.
    pub fn state_after(&mut self) -> &mut [u8] {
        unsafe { state_after(self.0.state_after, self.0.state_size) }
    }
}

impl Deref for RenderRequest<'_> {
    type Target = arhost_render_request;
    fn deref(&self) -> &arhost_render_request {
        self.0
    }
}

impl arhost_motion {
    pub fn moved(&self) -> &[arhost_moved_object] {
        unsafe { array(self.moved, self.moved_count) }
    }
    pub fn deformed(&self) -> &[arhost_deformed_geometry] {
        unsafe { array(self.deformed, self.deformed_count) }
    }
}

impl arhost_deformed_geometry {
    pub fn positions(&self) -> &[[f32; 3]] {
        unsafe { array(self.positions.cast(), self.vertex_count) }
    }
    /// Empty if the geometry has none.
    pub fn normals(&self) -> &[[f32; 3]] {
        unsafe { array(self.normals.cast(), if self.normals.is_null() { 0 } else { self.vertex_count }) }
    }
}

/// `first` may be null if the count is 0.
unsafe fn array<'a, T>(first: *const T, count: u32) -> &'a [T] {
    if count == 0 {
        return &[];
    }
    slice::from_raw_parts(first, count as usize)
}

impl arhost_frame_format {
    /// arhost_frame_layout of `arhost/frame.h`: fills in the second group of fields from the first. Returns false if the
    /// first group is invalid.
    pub fn lay_out(&mut self) -> bool {
        let (w, h) = (u64::from(self.width), u64::from(self.height));
        let sides = 1..=ARHOST_MAX_IMAGE_SIDE as u64;
        if !sides.contains(&w) || !sides.contains(&h) {
            return false;
        }
        let even = w % 2 == 0 && h % 2 == 0;
        // Bytes per row and number of rows of each plane; whether the first plane is luma.
        let (planes, grey_is_plane_0) = match self.pixel_format {
            ARHOST_PIXEL_FORMAT_GREY8 => (vec![(w, h)], true),
            ARHOST_PIXEL_FORMAT_RGB8 | ARHOST_PIXEL_FORMAT_BGR8 => (vec![(3 * w, h)], false),
            ARHOST_PIXEL_FORMAT_YUYV if w % 2 == 0 => (vec![(2 * w, h)], false),
            ARHOST_PIXEL_FORMAT_NV12 if even => (vec![(w, h), (w, h / 2)], true),
            ARHOST_PIXEL_FORMAT_I420 if even => (vec![(w, h), (w / 2, h / 2), (w / 2, h / 2)], true),
            _ => return false,
        };
        let stride_of = |bytes: u64| (bytes + 63) / 64 * 64;
        let mut end = 0;
        self.plane_count = planes.len() as u32;
        self.stride = [0; ARHOST_MAX_PLANES];
        self.offset = [0; ARHOST_MAX_PLANES];
        for (i, (bytes, rows)) in planes.into_iter().enumerate() {
            self.stride[i] = stride_of(bytes) as u32;
            self.offset[i] = end;
            end += stride_of(bytes) * rows;
        }
        if grey_is_plane_0 {
            self.grey_stride = self.stride[0];
            self.grey_offset = 0;
        } else {
            self.grey_stride = stride_of(w) as u32;
            self.grey_offset = end;
            end += stride_of(w) * h;
        }
        let depth_stride = if self.has_depth != 0 { stride_of(2 * w) } else { 0 };
        self.depth_stride = depth_stride as u32;
        self.depth_offset = if self.has_depth != 0 { end } else { 0 };
        self.byte_size = end + depth_stride * h;
        true
    }
}
