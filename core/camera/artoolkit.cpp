// SPDX-License-Identifier: Apache-2.0
//
// The file format is that of artoolkitX, Source/ARX/AR/paramFile.c (arParamLoad); the formulas are those of
// paramDistortion.c (arParamIdeal2Observ). All numbers are big-endian: the 32-bit integers xsize and ysize, the
// 3×4 matrix `mat` in doubles, row by row, and the doubles `dist_factor`. The number of elements of `dist_factor`
// determines the version of the distortion:
//   1: x0 y0 f1 s (arParamLoad swaps the last two)    2: x0 y0 s f1 f2    3: x0 y0 s a f1 f2
//   4: k1 k2 p1 p2 fx fy x0 y0 s    5: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 fx fy x0 y0 s
// `mat` projects a point in camera coordinates (x right, y down, z forward) to the ideal pixel (ix, iy), and
// `dist_factor` maps this to the observed pixel (ox, oy):
//   1 to 3: (x, y) = s (ix − x0, iy − y0),  l = x² + y²,  d = 1 − 1e-8 f1 l − 1e-13 f2 l²,
//           ox = a d x + x0,  oy = d y + y0   (f2 = 0 in version 1, a = 1 in versions 1 and 2)
//   4, 5:   (x, y) = s ((ix − x0) / fx, (iy − y0) / fy),  ox = fx x'' + x0,  oy = fy y'' + y0,
//           (x'', y'') = OpenCV's distortion of (x, y)
// Pixel centres are at integers as in arhost/frame.h: arGetLine.c uses the indices of pixels as observed positions.
#include "camera/artoolkit.hpp"

#include "camera/lens_model.hpp"
#include "yaml/yaml.hpp"

#include <arhost/frame.h>
#include <arhost/shading/lens.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <span>
#include <sstream>
#include <vector>

namespace arhost::camera {
namespace {

constexpr double max_error_px = 0.1;
constexpr double exact_px = 0.001; // a smaller error is due to rounding in the program that wrote the file

struct Parameters {
    std::uint32_t xsize, ysize;
    std::array<double, 12> mat;
    std::vector<double> dist_factor;
    int version;
};

// A direction on the plane z = 1 and the pixel that observes it.
struct Observation {
    glm::dvec3 direction;
    glm::dvec2 pixel;
};

// Parses a file; its methods name the file in error messages.
class File {
public:
    explicit File(const std::string &name) : name_(name) {}

    [[noreturn]] void fail(const std::string &message) const { throw yaml::Error(name_ + ": " + message); }

    void expect_positive(double value, const std::string &field) const {
        if (value > 0)
            return;
        std::ostringstream message;
        message << field << ": must be greater than 0, but is " << value << "; calibrate again";
        fail(message.str());
    }

    // Checks a factor that is close to 1 in valid files. Also detects most truncated files, whose sizes are those of
    // lower versions.
    void expect_scale(double value, std::size_t index) const {
        if (value >= 0.1 && value <= 10)
            return;
        std::ostringstream message;
        message << "dist_factor[" << index << "]: must be 0.1 to 10 as a scale, but is " << value
                << "; if the file is truncated, copy it again, otherwise calibrate again";
        fail(message.str());
    }

    Parameters parse(std::string_view bytes) const {
        constexpr std::size_t factor_counts[] = {4, 5, 6, 9, 17}, head_bytes = 2 * 4 + 12 * 8;
        const auto count = std::ranges::find(factor_counts, bytes.size(),
                                             [](std::size_t factors) { return head_bytes + 8 * factors; });
        if (count == std::end(factor_counts))
            fail(
                "is a binary file of " + std::to_string(bytes.size()) +
                " bytes, but ARToolKit's camera parameters have 136, 144, 152, 176 or 240; if the file is truncated, "
                "copy it again; if it is YAML, save it as UTF-8 without NUL characters");
        Parameters p{};
        p.version = static_cast<int>(count - factor_counts) + 1;
        p.xsize = side(bytes, "xsize");
        p.ysize = side(bytes, "ysize");
        for (std::size_t i = 0; i < p.mat.size(); ++i)
            p.mat[i] = real(bytes, "mat[" + std::to_string(i / 4) + "][" + std::to_string(i % 4) + "]");
        for (std::size_t i = 0; i < *count; ++i)
            p.dist_factor.push_back(real(bytes, "dist_factor[" + std::to_string(i) + "]"));
        const auto &[m00, m01, m02, m03, m10, m11, m12, m13, m20, m21, m22, m23] = p.mat;
        if (m10 != 0 || m20 != 0 || m21 != 0 || m22 != 1 || m03 != 0 || m13 != 0 || m23 != 0)
            fail("mat: must be [fx, skew, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], row by row, without rotation and "
                 "translation; calibrate again");
        expect_positive(m00, "mat[0][0], the focal length in px");
        expect_positive(m11, "mat[1][1], the focal length in px");
        return p;
    }

private:
    // Each of the next functions reads a number from the start of `bytes` and removes it from `bytes`.
    static std::uint64_t big_endian(std::string_view &bytes, std::size_t byte_size) {
        std::uint64_t value = 0;
        for (const char byte : bytes.substr(0, byte_size))
            value = value << 8 | static_cast<unsigned char>(byte);
        bytes.remove_prefix(byte_size);
        return value;
    }
    std::uint32_t side(std::string_view &bytes, const std::string &field) const {
        const std::uint64_t value = big_endian(bytes, 4);
        if (value < 1 || value > ARHOST_MAX_IMAGE_SIDE)
            fail(field + ": must be 1 to " + std::to_string(ARHOST_MAX_IMAGE_SIDE) + ", but is " +
                 std::to_string(value) + "; is this a calibration of ARToolKit?");
        return static_cast<std::uint32_t>(value);
    }
    double real(std::string_view &bytes, const std::string &field) const {
        const auto value = std::bit_cast<double>(big_endian(bytes, 8));
        if (!std::isfinite(value))
            fail(field + ": must be a finite number; calibrate again");
        return value;
    }

    const std::string &name_;
};

// Returns the largest distance between an observed pixel and the projection of its direction, px; NaN if one is NaN.
double error_px(const arhost_intrinsics &lens, std::span<const Observation> observations) {
    double largest = 0;
    for (const auto &[direction, pixel] : observations)
        if (const double error = glm::distance(*project(lens, direction), pixel);
            error > largest || std::isnan(error))
            largest = error;
    return largest;
}

// Adjusts focal lengths, principal point, k1, k2, p1, p2 and k3 to minimize the sum of the squared distances between
// pixels and projections. Gauss–Newton method: for given focal lengths, the projection is linear in the coefficients,
// so a few steps suffice.
arhost_intrinsics fitted(arhost_intrinsics lens, std::span<const Observation> observations) {
    lens.coefficient_count = std::max(lens.coefficient_count, 5u);
    double *const k = lens.coefficients;
    double *const parameters[] = {&lens.fx, &lens.fy, &lens.cx, &lens.cy, k, k + 1, k + 2, k + 3, k + 4};
    constexpr std::size_t n = std::size(parameters);
    for (int step = 0; step < 10; ++step) {
        double equations[n][n + 1] = {}; // the normal equations
        for (const auto &[direction, pixel] : observations) {
            glm::dvec2 columns[n + 1]; // the derivative by each parameter, and the error
            for (std::size_t i = 0; i < n; ++i) {
                const double value = *parameters[i], h = 1e-4 * std::max(1.0, std::abs(value));
                *parameters[i] = value + h;
                const glm::dvec2 above = *project(lens, direction);
                *parameters[i] = value - h;
                columns[i] = (above - *project(lens, direction)) / (2 * h);
                *parameters[i] = value;
            }
            columns[n] = pixel - *project(lens, direction);
            for (std::size_t i = 0; i < n; ++i)
                for (std::size_t j = 0; j <= n; ++j)
                    equations[i][j] += glm::dot(columns[i], columns[j]);
        }
        // Gauss–Jordan elimination; the matrix is positive definite, so pivoting is not necessary.
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t row = 0; row < n; ++row)
                if (const double factor = equations[row][i] / equations[i][i]; row != i)
                    for (std::size_t j = i; j <= n; ++j)
                        equations[row][j] -= factor * equations[i][j];
        for (std::size_t i = 0; i < n; ++i)
            *parameters[i] += equations[i][n] / equations[i][i];
    }
    return lens;
}

// The distortion as a lens that maps a point (x, y) of the plane z = 1 to the observed pixel. `ideal_fx` and
// `ideal_fy` are focal lengths that map the same point to the ideal pixel, with the same principal point.
struct Distortion {
    arhost_intrinsics lens{};
    double ideal_fx, ideal_fy;
};
Distortion distortion_of(const Parameters &p, const File &file) {
    Distortion distortion{};
    arhost_intrinsics &lens = distortion.lens;
    lens.struct_size = sizeof lens;
    lens.width = p.xsize;
    lens.height = p.ysize;
    lens.distortion = ARHOST_DISTORTION_BROWN;
    const std::vector<double> &d = p.dist_factor;
    if (p.version <= 3) {
        const double s = p.version == 1 ? d[3] : d[2], a = p.version == 3 ? d[3] : 1;
        const double f1 = p.version == 1 ? d[2] : d[d.size() - 2], f2 = p.version == 1 ? 0 : d.back();
        file.expect_scale(s, p.version == 1 ? 3 : 2);
        file.expect_scale(a, 3);
        // These versions have no focal length, because x and y are in px: any can be chosen.
        distortion.ideal_fx = distortion.ideal_fy = p.mat[0];
        const double focal_px = s * p.mat[0];
        lens.fx = a * focal_px;
        lens.fy = focal_px;
        lens.cx = d[0];
        lens.cy = d[1];
        lens.coefficient_count = 4;
        lens.coefficients[0] = -1e-8 * f1 * std::pow(focal_px, 2);
        lens.coefficients[1] = -1e-13 * f2 * std::pow(focal_px, 4);
    } else {
        lens.coefficient_count = static_cast<std::uint32_t>(d.size() - 5);
        std::copy_n(d.begin(), lens.coefficient_count, lens.coefficients);
        const double *const rest = &d[lens.coefficient_count]; // fx fy x0 y0 s
        for (const std::size_t i : {0, 1})
            file.expect_positive(rest[i], "dist_factor[" + std::to_string(lens.coefficient_count + i) + "]");
        file.expect_scale(rest[4], lens.coefficient_count + 4);
        lens.fx = rest[0];
        lens.fy = rest[1];
        lens.cx = rest[2];
        lens.cy = rest[3];
        distortion.ideal_fx = rest[0] / rest[4];
        distortion.ideal_fy = rest[1] / rest[4];
    }
    return distortion;
}

// Returns what the camera observes at points that cover the image, including its edges.
std::vector<Observation> observations_of(const Parameters &p, const Distortion &distortion, const File &file) {
    constexpr int columns = 17, rows = 13;
    const auto &[m00, m01, m02, m03, m10, m11, m12, m13, m20, m21, m22, m23] = p.mat;
    const shading::Lens lens(distortion.lens);
    std::vector<Observation> observations;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
            const glm::dvec2 pixel(column * (p.xsize - 1.0) / (columns - 1), row * (p.ysize - 1.0) / (rows - 1));
            const auto ray = lens.ray({pixel.x, pixel.y});
            if (!ray) {
                std::ostringstream message;
                message << "dist_factor: the distortion folds the image: no direction has the pixel (" << pixel.x
                        << ", " << pixel.y << "); calibrate again";
                file.fail(message.str());
            }
            const double ix = distortion.ideal_fx * ray->x + distortion.lens.cx,
                         iy = distortion.ideal_fy * ray->y + distortion.lens.cy;
            const double y = (iy - m12) / m11, x = (ix - m02 - m01 * y) / m00;
            observations.push_back({{x, y, 1}, pixel});
        }
    return observations;
}

} // namespace

arhost_intrinsics parse_artoolkit(std::string_view bytes, const std::string &name) {
    const File file(name);
    const Parameters p = file.parse(bytes);
    const Distortion distortion = distortion_of(p, file);
    const std::vector<Observation> observations = observations_of(p, distortion, file);
    // If the matrix has the distortion's focal lengths and principal point, the distortion's lens is the whole
    // camera.
    arhost_intrinsics lens = distortion.lens;
    if (!(error_px(lens, observations) <= exact_px))
        lens = fitted(lens, observations);
    if (const double error = error_px(lens, observations); !(error <= max_error_px)) {
        std::ostringstream message;
        message.precision(2);
        message << "the lens model of version " << p.version
                << " of ARToolKit's distortion differs from arhost's by up to " << error
                << " px with these parameters, which is more than " << max_error_px
                << " px; calibrate again with artoolkitX or OpenCV (docs/camera.md)";
        file.fail(message.str());
    }
    if (std::ranges::all_of(lens.coefficients, [](double k) { return k == 0; })) {
        lens.distortion = ARHOST_DISTORTION_NONE;
        lens.coefficient_count = 0;
    }
    return lens;
}

} // namespace arhost::camera
