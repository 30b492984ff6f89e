// SPDX-License-Identifier: Apache-2.0
#include "renderer.hpp"

#include "parallel.hpp"
#include "random.hpp"
#include "simd.hpp"

#include <arhost/shading/lens.hpp>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::synthetic {
namespace {

constexpr int cell_px = span_px; // cell size of the coarse grid
constexpr int srgb_table_size = 4096;
constexpr int grain_side = 256;
constexpr float grain_unit = 4096; // value of one standard deviation
constexpr float min_slope = 0.02f; // flatter rays are clamped to this slope, so they hit the desk
constexpr float sharpness = 0.8f; // texel size relative to the footprint; below 1, because the pyramid itself smooths
constexpr float aperture = 3.2f; // diameter of the circle of confusion in px = aperture·focal_px·|1/depth − 1/focus|

// Returns a tile of approximately normally distributed noise (Irwin–Hall with n = 4). Channels and neighbouring
// pixels are partly correlated, as after demosaicing.
std::vector<std::array<int16_t, 4>> make_grain(std::uint64_t seed) {
    constexpr int n = grain_side;
    const auto normal = [&](int x, int y, int channel) {
        float sum = 0;
        for (int i = 0; i < 4; ++i)
            sum += random_unit(seed, (y & (n - 1)) * n + (x & (n - 1)), channel * 4 + i);
        return (sum - 2) * 1.732f;
    };
    std::vector<float> white(static_cast<std::size_t>(n) * n * 4);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
            for (int c = 0; c < 4; ++c)
                white[(static_cast<std::size_t>(y) * n + x) * 4 + c] = normal(x, y, c);
    const auto at = [&](int x, int y, int c) {
        return white[(static_cast<std::size_t>(y & (n - 1)) * n + (x & (n - 1))) * 4 + c];
    };
    std::vector<std::array<int16_t, 4>> grain(static_cast<std::size_t>(n) * n);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
            for (int c = 0; c < 3; ++c) {
                const float channel = 0.5f * at(x, y, c) + 0.25f * (at(x + 1, y, c) + at(x, y + 1, c)) +
                                      0.15f * at(x + 1, y + 1, c) + 0.2f * (at(x - 1, y, c) + at(x, y - 1, c));
                const float value = 0.8f * at(x, y, 3) + 0.75f * channel;
                grain[static_cast<std::size_t>(y) * n + x][c] =
                    static_cast<int16_t>(std::clamp(value * grain_unit, -32767.0f, 32767.0f));
            }
    return grain;
}

// Decodes sRGB with a least-squares fit of a quartic. Above code 10 the error is less than 0.2 of 255 codes.
inline float decoded(float code) {
    return 0.0011388f + code * (0.0265387f + code * (0.5694731f + code * (0.5121703f - code * 0.1099398f)));
}

} // namespace

// The state of one frame.
struct Renderer::Frame {
    std::optional<Card> card;
    std::vector<Plane> planes;
    std::vector<std::vector<Node>> nodes; // one coarse grid per plane
    std::uint64_t sequence;
};

Renderer::Renderer(DeskTextures textures, const arhost_intrinsics &camera, const Sensor &sensor, int threads)
    : textures_(std::move(textures)), width_(static_cast<int>(camera.width)),
      height_(static_cast<int>(camera.height)), threads_(threads), padded_((width_ + span_px) / span_px * span_px),
      grid_width_(padded_ / cell_px + 1), grid_height_(height_ / cell_px + 2),
      focal_px_(std::sqrt(camera.fx * camera.fy)), seed_(sensor.seed) {
    const shading::Lens lens(camera);
    lens_columns_ = (grid_width_ - 1) * cell_px / lens_px + 2;
    const int lens_rows = (grid_height_ - 1) * cell_px / lens_px + 2;
    for (auto &axis : ray_)
        axis.resize(static_cast<std::size_t>(lens_columns_) * lens_rows);
    in_parallel(lens_rows, threads_, [&](int first, int last) {
        for (int j = first; j < last; ++j)
            for (int i = 0; i < lens_columns_; ++i)
                if (const auto ray = lens.ray({static_cast<double>(i * lens_px), static_cast<double>(j * lens_px)})) {
                    const std::size_t at = static_cast<std::size_t>(j) * lens_columns_ + i;
                    ray_[0][at] = static_cast<float>(ray->x);
                    ray_[1][at] = static_cast<float>(ray->y);
                    ray_[2][at] = static_cast<float>(ray->z);
                }
    });

    // Most lenses blur red and blue slightly more than green.
    const double softness[4] = {1.15, 1.0, 1.22, 1.0};
    const int radius = sensor.blur_px > 0 ? static_cast<int>(std::ceil(2.6 * sensor.blur_px)) : 0;
    kernel_.resize(radius + 1);
    for (int c = 0; c < 4; ++c) {
        std::vector<double> weight(radius + 1, 1.0);
        double sum = 1;
        for (int i = 1; i <= radius; ++i) {
            weight[i] = std::exp(-0.5 * std::pow(i / (softness[c] * sensor.blur_px), 2));
            sum += 2 * weight[i];
        }
        int remainder = 65535;
        for (int i = radius; i > 0; --i) {
            kernel_[i][c] = kernel_[i][c + 4] = static_cast<uint16_t>(std::lround(2 * 65535 * weight[i] / sum));
            remainder -= kernel_[i][c];
        }
        kernel_[0][c] = kernel_[0][c + 4] = static_cast<uint16_t>(remainder);
    }

    // Shot noise and read noise, in linear light at the sensor, where 1 is white.
    const double shot_noise = 1.3e-4, read_noise = 0.0014, gain = std::exp2(sensor.exposure_ev);
    const double unit = full_scale * gain, scale = sensor.noise * sensor.noise;
    shot_ = static_cast<float>(scale * shot_noise / unit);
    read2_ = static_cast<float>(scale * read_noise * read_noise / (unit * unit));
    srgb_.resize(srgb_table_size);
    for (int i = 0; i < srgb_table_size; ++i) {
        const double root = (i + 0.5) / srgb_table_size;
        srgb_[i] = static_cast<uint8_t>(std::lround(255 * shading::srgb_encode(root * root * unit)));
    }
    grain_ = make_grain(hashed(sensor.seed + 11));
}

Renderer::Plane Renderer::plane_of(const Mt &m) {
    // Returns a camera axis in desk coordinates: a row of the rotation. y and z are negated to convert from GL to
    // OpenCV axes.
    const auto axis = [&](int row, double sign) {
        return shading::Vec3T<double>{sign * m[row], sign * m[4 + row], sign * m[8 + row]};
    };
    const std::array axes{axis(0, 1), axis(1, -1), axis(2, -1)};
    const auto eye = -(axes[0] * m[12] + axes[1] * -m[13] + axes[2] * -m[14]);
    // A ray d in camera coordinates has the direction D = Σ d_i axis_i and hits the plane z = 0 at eye − D·eye.z/D.z.
    Plane plane;
    for (int i = 0; i < 3; ++i) {
        plane.row[0][i] = static_cast<float>(eye.z * axes[i].x - eye.x * axes[i].z);
        plane.row[1][i] = static_cast<float>(eye.z * axes[i].y - eye.y * axes[i].z);
        plane.row[2][i] = static_cast<float>(-axes[i].z);
        plane.axes[i] = {static_cast<float>(axes[i].x), static_cast<float>(axes[i].y), static_cast<float>(axes[i].z)};
    }
    plane.eye = {static_cast<float>(eye.x), static_cast<float>(eye.y), static_cast<float>(eye.z)};
    return plane;
}

std::vector<Renderer::Node> Renderer::nodes_of(const Plane &plane) const {
    struct Hit {
        float u, v, depth;
    };
    const auto ray_at = [&](int column, int row) {
        const std::size_t at = static_cast<std::size_t>(row) * lens_columns_ + column;
        return Vec3{ray_[0][at], ray_[1][at], ray_[2][at]};
    };
    const auto hit = [&](Vec3 d) {
        const auto along = [&](const std::array<float, 3> &row) {
            return row[0] * d.x + row[1] * d.y + row[2] * d.z;
        };
        const float w = std::max(along(plane.row[2]), min_slope);
        return Hit{along(plane.row[0]) / w, along(plane.row[1]) / w, plane.eye.z * d.z / w};
    };
    const Pyramid &desk = textures_.desk;
    const float focus = std::sqrt(dot(plane.eye, plane.eye));
    std::vector<Node> nodes(static_cast<std::size_t>(grid_width_) * grid_height_);
    for (int j = 0; j < grid_height_; ++j)
        for (int i = 0; i < grid_width_; ++i) {
            const int column = i * cell_px / lens_px, row = j * cell_px / lens_px;
            const Vec3 ray = ray_at(column, row);
            const Hit at = hit(ray), right = hit(ray_at(column + 1, row)), below = hit(ray_at(column, row + 1));
            const float du = (below.u - at.u) / lens_px, dv = (below.v - at.v) / lens_px;
            const float wide = std::hypot(right.u - at.u, right.v - at.v) / lens_px, tall = std::hypot(du, dv);
            const float defocus =
                aperture * static_cast<float>(focal_px_) * std::abs(1 / std::max(at.depth, 1.0f) - 1 / focus);
            const float circle = std::max(1.0f, defocus);
            const float footprint = sharpness * circle * std::max(wide, 0.5f * tall);
            Node &node = nodes[static_cast<std::size_t>(j) * grid_width_ + i];
            node.step_u = 0.25f * circle * du;
            node.step_v = 0.25f * circle * dv;
            const float extent = std::max(std::abs(at.u), std::abs(at.v)) + 24 * wide;
            node.lod = std::max({0.0f, std::log2(std::max(footprint, 1e-6f) / desk.texel()), desk.finest_at(extent)});
            // cos⁴ vignetting, of which the camera corrects about half.
            const float length2 = dot(ray, ray), cos2 = ray.z > 0 ? ray.z * ray.z / length2 : 0;
            node.gain = length2 > 0 ? 0.45f + 0.55f * cos2 * cos2 : 0;
            Vec3 direction = plane.axes[0] * ray.x + plane.axes[1] * ray.y + plane.axes[2] * ray.z;
            const float length = std::sqrt(dot(direction, direction));
            if (length > 0)
                node.reflection = reflected_light({at.u, at.v}, direction * (1 / length)) / full_scale;
        }
    return nodes;
}

ARHOST_WIDE void Renderer::warp_span(int x, int y, const Frame &frame, Texel16 *out) const {
    const int upper = y / cell_px;
    const float down = static_cast<float>(y % cell_px) / cell_px;
    const auto weight = static_cast<std::uint32_t>(65536 / frame.planes.size());
    Texel16 sum[span_px] = {};
    float ray[3][span_px];
    const std::size_t node = static_cast<std::size_t>(y / lens_px) * lens_columns_ + x / lens_px;
    const float below_node = static_cast<float>(y % lens_px) / lens_px;
    for (int axis = 0; axis < 3; ++axis) {
        float exact[span_px / lens_px + 1];
        for (int i = 0; i <= span_px / lens_px; ++i)
            exact[i] = mix(ray_[axis][node + i], ray_[axis][node + i + lens_columns_], below_node);
        for (int i = 0; i < span_px; ++i)
            ray[axis][i] = mix(exact[i / lens_px], exact[i / lens_px + 1], static_cast<float>(i % lens_px) / lens_px);
    }
    for (std::size_t k = 0; k < frame.planes.size(); ++k) {
        const Plane &plane = frame.planes[k];
        Footprints at;
        const auto &[dx, dy, dz] = ray;
        const auto [a, b, c] = plane.row;
        for (int i = 0; i < span_px; ++i) {
            float w = c[0] * dx[i] + c[1] * dy[i] + c[2] * dz[i];
            w = w > min_slope ? w : min_slope;
            const float scale = 1 / w;
            at.u[i] = (a[0] * dx[i] + a[1] * dy[i] + a[2] * dz[i]) * scale;
            at.v[i] = (b[0] * dx[i] + b[1] * dy[i] + b[2] * dz[i]) * scale;
        }
        const Node *above = &frame.nodes[k][static_cast<std::size_t>(upper) * grid_width_ + x / cell_px];
        const Node *below = above + grid_width_;
        const auto pair = [&](float Node::*field) {
            return std::array{mix(above[0].*field, below[0].*field, down),
                              mix(above[1].*field, below[1].*field, down)};
        };
        at.step_u = pair(&Node::step_u);
        at.step_v = pair(&Node::step_v);
        at.lod = pair(&Node::lod);
        Texel16 desk[span_px];
        textures_.desk.sample(at, desk);

        if (const auto &placed = frame.card) {
            const auto rotated = [&](Point p) {
                return Point{dot(p, placed->x_axis), dot(p, {-placed->x_axis.y, placed->x_axis.x})};
            };
            Footprints on_card = at;
            bool near = false;
            for (int i = 0; i < span_px; ++i) {
                const Point p = rotated(Point{at.u[i], at.v[i]} - placed->at);
                on_card.u[i] = p.x;
                on_card.v[i] = p.y;
                near |= std::abs(p.x) < card_half.x + 30 && std::abs(p.y) < card_half.y + 30;
            }
            if (near) {
                const float finer = std::log2(textures_.card.texel() / textures_.desk.texel());
                for (int end = 0; end < 2; ++end) {
                    const Point step = rotated({at.step_u[end], at.step_v[end]});
                    on_card.step_u[end] = step.x;
                    on_card.step_v[end] = step.y;
                    on_card.lod[end] = std::max(0.0f, at.lod[end] - finer);
                }
                Texel16 card[span_px];
                textures_.card.sample(on_card, card);
                for (int i = 0; i < span_px; ++i) {
                    const std::uint32_t visible =
                        65536 - card[i][3] * 65536u / static_cast<std::uint32_t>(texel16_unit);
                    for (int c = 0; c < 4; ++c) {
                        const std::uint32_t colour = c < 3 ? card[i][c] : 0; // the card has no gloss
                        desk[i][c] = static_cast<uint16_t>(std::min(((desk[i][c] * visible) >> 16) + colour, 65535u));
                    }
                }
            }
        }
        if (frame.planes.size() == 1) {
            std::copy_n(desk, span_px, sum);
        } else {
            for (int i = 0; i < span_px; ++i)
                for (int c = 0; c < 4; ++c)
                    sum[i][c] = static_cast<uint16_t>(sum[i][c] + ((desk[i][c] * weight) >> 16));
        }
    }
    std::copy_n(sum, span_px, out);
}

// The buffers of one thread of develop_row().
struct Renderer::Scratch {
    std::vector<const Texel16 *> window; // the rows from `radius` above the current row to `radius` below it
    std::vector<Texel16> down,
        across; // rows after the vertical and the horizontal blur; `down` is padded by `radius` texels at both ends
};

ARHOST_WIDE void Renderer::develop_row(int y, const Frame &frame, Scratch &scratch, uint8_t *bgr) const {
    const int radius = static_cast<int>(kernel_.size()) - 1;
    const Texel16 *row = scratch.window[radius];
    if (radius) {
        const auto weight = [&](int i) { return U16x8::load(&kernel_[i]); };
        Texel16 *down = scratch.down.data() + radius;
        for (int x = 0; x < padded_; x += 2) {
            U16x8 sum = times(U16x8::load(row + x), weight(0));
            for (int i = 1; i <= radius; ++i)
                sum = sum + times(mean(U16x8::load(scratch.window[radius - i] + x),
                                       U16x8::load(scratch.window[radius + i] + x)),
                                  weight(i));
            sum.store(down + x);
        }
        for (int i = 1; i <= radius; ++i) {
            down[-i] = down[0];
            down[width_ - 1 + i] = down[width_ - 1];
        }
        for (int x = 0; x < width_; x += 2) {
            U16x8 sum = times(U16x8::load(down + x), weight(0));
            for (int i = 1; i <= radius; ++i)
                sum = sum + times(mean(U16x8::load(down + x - i), U16x8::load(down + x + i)), weight(i));
            sum.store(&scratch.across[x]);
        }
        row = scratch.across.data();
    }
    // Each frame and each band of rows uses its own offset into the noise tile, which hides the repetition of the
    // tile.
    const std::uint64_t offset = hashed(seed_ * 0x9e3779b97f4a7c15ULL + frame.sequence * 512 + y / 64);
    const auto *grain = &grain_[static_cast<std::size_t>((offset >> 8) + y) % grain_side * grain_side];
    const float down = static_cast<float>(y % cell_px) / cell_px;
    const Node *above = &frame.nodes[frame.nodes.size() / 2][static_cast<std::size_t>(y / cell_px) * grid_width_];
    const Node *below = above + grid_width_;
    for (int left = 0; left < width_; left += cell_px, ++above, ++below) {
        // Apply the vignetting of the lens and add the reflection of the varnish.
        const float gain = mix(above[0].gain, below[0].gain, down);
        const float gain_step = (mix(above[1].gain, below[1].gain, down) - gain) / cell_px;
        const float reflection = mix(above[0].reflection, below[0].reflection, down);
        const float reflection_step = (mix(above[1].reflection, below[1].reflection, down) - reflection) / cell_px;
        float gains[4 * cell_px], reflected[4 * cell_px];
        for (int x = 0; x < cell_px; ++x) {
            const float along = static_cast<float>(x), gloss = row[left + x][3] * (1 / texel16_unit);
            for (int c = 0; c < 4; ++c) {
                gains[4 * x + c] = gain + gain_step * along;
                reflected[4 * x + c] = (reflection + reflection_step * along) * gloss;
            }
        }
        const uint16_t *codes = row[left].data();
        const int16_t *speck = grain[(left + offset % grain_side * cell_px) % grain_side].data();
        std::int32_t index[4 * cell_px];
        for (int i = 0; i < 4 * cell_px; ++i) {
            const float light = (decoded(codes[i] * (1 / texel16_unit)) + reflected[i]) * gains[i];
            float seen = light + std::sqrt(light * shot_ + read2_) * (speck[i] * (1 / grain_unit));
            seen = seen > 0 ? std::sqrt(seen) : 0;
            seen = seen < 1 ? seen : 1;
            index[i] = static_cast<std::int32_t>(seen * (srgb_table_size - 1));
        }
        for (int x = 0; x < std::min(cell_px, width_ - left); ++x)
            for (int c = 0; c < 3; ++c)
                bgr[3 * (left + x) + 2 - c] = srgb_[index[4 * x + c]];
    }
}

void Renderer::render(const Shot &shot, uint8_t *bgr, std::size_t stride) const {
    Frame frame{shot.card, {}, {}, shot.sequence};
    for (const Mt &pose : shot.poses) {
        frame.planes.push_back(plane_of(pose));
        frame.nodes.push_back(nodes_of(frame.planes.back()));
    }
    // Spans are warped in blocks of several rows, because vertical neighbours read the same texels. A ring buffer
    // keeps the rows that the blur of a block needs.
    constexpr int block_rows = 16, block_columns = 8 * span_px;
    const int radius = static_cast<int>(kernel_.size()) - 1, rows_kept = block_rows + 2 * radius;
    in_parallel(height_, threads_, [&](int first, int last) {
        std::vector<Texel16> ring(static_cast<std::size_t>(rows_kept) * padded_);
        Scratch scratch{std::vector<const Texel16 *>(2 * radius + 1), std::vector<Texel16>(padded_ + 2 * radius),
                        std::vector<Texel16>(padded_)};
        const auto kept = [&](int y) { return &ring[static_cast<std::size_t>(y % rows_kept) * padded_]; };
        int warped = std::max(0, first - radius);
        for (int block = first; block < last; block += block_rows) {
            const int block_end = std::min(block + block_rows, last), end = std::min(block_end + radius, height_);
            for (int left = 0; left < padded_; left += block_columns)
                for (int y = warped; y < end; ++y)
                    for (int x = left; x < std::min(left + block_columns, padded_); x += span_px)
                        warp_span(x, y, frame, kept(y) + x);
            warped = end;
            for (int y = block; y < block_end; ++y) {
                for (int i = -radius; i <= radius; ++i)
                    scratch.window[i + radius] = kept(std::clamp(y + i, 0, height_ - 1));
                develop_row(y, frame, scratch, bgr + stride * static_cast<std::size_t>(y));
            }
        }
    });
}

} // namespace arhost::synthetic
