// SPDX-License-Identifier: Apache-2.0
#include "corner_refinement.hpp"
#include "fits.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace arhost::fiducial {
namespace {

using Homography = cv::Matx33d;

cv::Vec2d transform(const Homography &h, const cv::Vec2d &at) {
    const cv::Vec3d v = h * cv::Vec3d(at[0], at[1], 1);
    return {v[0] / v[2], v[1] / v[2]};
}

// Returns the derivative of transform() with respect to `at`. `v`: h * (at, 1).
cv::Matx22d derivative(const Homography &h, const cv::Vec3d &v) {
    const double x = v[0] / v[2], y = v[1] / v[2];
    return cv::Matx22d(h(0, 0) - x * h(2, 0), h(0, 1) - x * h(2, 1), h(1, 0) - y * h(2, 0), h(1, 1) - y * h(2, 1)) *
           (1 / v[2]);
}

// The unknowns of the fit. The print is the printed marker (fiducial::Print).
struct Model {
    cv::Vec<double, 8> corners_px; // undistorted
    double blur_px;                // standard deviation
    // Light of black, and light of white minus light of black; negative if the print is inverted.
    double black, contrast;
    cv::Vec2d slope; // relative change of the illumination across the print along its columns and rows
};
constexpr int unknowns = 13; // in the order of the members of Model

// Maps cells to undistorted px.
Homography px_from_cells(const cv::Vec<double, 8> &corners_px, const Print &print) {
    // Heckbert, Fundamentals of Texture Mapping and Image Warping (1989), section 2.2.3: the unit square to a
    // quadrilateral.
    const cv::Vec2d a(corners_px[0], corners_px[1]), b(corners_px[2], corners_px[3]), c(corners_px[4], corners_px[5]),
        d(corners_px[6], corners_px[7]), skew = a - b + c - d, x = b - c, y = d - c;
    const auto cross = [](const cv::Vec2d &v, const cv::Vec2d &w) { return v[0] * w[1] - v[1] * w[0]; };
    const double g = cross(skew, y) / cross(x, y), h = cross(x, skew) / cross(x, y);
    const cv::Vec2d u = b - a + g * b, v = d - a + h * d;
    const double scale = 1.0 / print.side(), shift = -scale * print.margin;
    return Homography(u[0], v[0], a[0], u[1], v[1], a[1], g, h, 1) *
           Homography(scale, 0, shift, 0, scale, shift, 0, 0, 1);
}

// Pixels with this code or a higher one may be clipped, so their light may be brighter than the code indicates. The
// value is below 255, because video compression turns some codes 255 into 254.
constexpr std::uint8_t saturated = 254;

// A pixel whose light depends only on the print.
struct Pixel {
    cv::Vec2d place; // undistorted
    double light;
    bool is_saturated;
    // Results of the last call of linearize(): the light of the pixel minus the light of the model, and the change of
    // the model's light if the print moves by 1 px.
    double residual = 0, change_per_px = 0;
};

// Returns the pixels of the print; for large prints, only a subset. Returns none if a part of the print's
// surroundings is outside the field of view of the lens.
std::vector<Pixel> pixels_of(const cv::Mat &grey, const LightOfCode &light_of_code, const Corners &corners_px,
                             const Lens &lens, const Homography &cells_from_px, const Print &print) {
    // The part of the margin that is used, in cells. Farther out, blur mixes the margin with its surroundings.
    constexpr double reach = 0.25;
    constexpr double max_pixels = 1'000;
    const std::vector<cv::Point2f> points(corners_px.begin(), corners_px.end());
    cv::Rect part = cv::boundingRect(points);
    const int margin_px = 1 + static_cast<int>(std::max(part.width, part.height) * reach / 2);
    part = cv::Rect(part.x - margin_px, part.y - margin_px, part.width + 2 * margin_px, part.height + 2 * margin_px) &
           cv::Rect({}, grey.size());
    // The minimum share of its bounding box that the print is assumed to fill. If the actual share is smaller, fewer
    // pixels are used.
    constexpr double min_filled = 0.1;
    const double area_px = std::max(cv::contourArea(points), part.area() * min_filled);
    const double stride = std::max(std::sqrt(area_px / max_pixels), 1.0);
    const int columns = static_cast<int>(part.width / stride), rows = static_cast<int>(part.height / stride);
    std::vector<cv::Point2d> at;
    at.reserve(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column)
            at.emplace_back(part.x + std::floor(column * stride), part.y + std::floor(row * stride));
    const auto places = lens.undistort(at);
    std::vector<Pixel> pixels;
    if (!places)
        return pixels;
    pixels.reserve(at.size());
    for (std::size_t i = 0; i < at.size(); ++i) {
        const cv::Vec2d place = (*places)[i], cell = transform(cells_from_px, place);
        const std::uint8_t code = grey.at<std::uint8_t>(at[i]);
        if (std::min({cell[0], cell[1], print.cells.rows - cell[0], print.cells.rows - cell[1]}) >=
            print.margin - reach)
            pixels.push_back({place, light_of_code[code], code >= saturated});
    }
    return pixels;
}

// Whiteness, and its derivatives with respect to the column u and the row v, in cells.
struct Whiteness {
    float value, u, v, uu, uv, vv;
};
using Sample = cv::Vec<float, 6>; // a Whiteness

// Returns the number of samples per cell that resolves a blur of this covariance, within limits.
int samples_per_cell(const Print &print, const cv::Matx22d &covariance_cells2) {
    constexpr double min_sigma = 1.2, max_per_cell = 12, max_size = 240; // samples
    const double half_trace = cv::trace(covariance_cells2) / 2;
    const double smallest =
        half_trace - std::sqrt(std::max(half_trace * half_trace - cv::determinant(covariance_cells2), 0.0));
    return static_cast<int>(std::clamp(std::ceil(min_sigma / std::sqrt(std::fmax(smallest, 1e-9))), 3.0,
                                       std::clamp(max_size / print.cells.rows, 3.0, max_per_cell)));
}

// A table of the blurred print. The number of samples stays constant during the steps of a fit, because the
// interpolation errors depend on it.
class BlurredPrint {
public:
    BlurredPrint(const Print &print, int per_cell, double tolerance) : tolerance(tolerance), per_cell_(per_cell) {
        cv::resize(print.cells, sharp_, {}, per_cell, per_cell, cv::INTER_NEAREST);
        values_.create(sharp_.size());
    }

    // The relative difference of the covariance up to which blur() keeps the table; linearize() corrects it to the
    // first order.
    double tolerance = 0;

    // Blurs the print, unless it is blurred nearly so. `covariance_cells2`: the covariance of the blur.
    void blur(const cv::Matx22d &covariance_cells2) {
        if (cv::norm(covariance_cells2 - covariance_cells2_) <= tolerance * cv::norm(covariance_cells2))
            return;
        ++blurs_;
        covariance_cells2_ = covariance_cells2;
        constexpr double cutoff = 3, max_radius = 40; // `cutoff`: standard deviations; `max_radius`: samples
        const cv::Matx22d covariance =
            double(per_cell_ * per_cell_) * covariance_cells2 + 1e-3 * cv::Matx22d::eye(); // in samples; invertible
        const cv::Matx22d inverse = covariance.inv();
        const auto radius = [&](int axis) {
            return static_cast<int>(std::min(std::ceil(cutoff * std::sqrt(covariance(axis, axis))), max_radius));
        };
        const int columns = radius(0), rows = radius(1);
        cv::Mat_<float> kernel(2 * rows + 1, 2 * columns + 1);
        for (int y = -rows; y <= rows; ++y)
            for (int x = -columns; x <= columns; ++x) {
                const cv::Vec2d d(x, y);
                kernel(y + rows, x + columns) = static_cast<float>(std::exp(-0.5 * d.dot(inverse * d)));
            }
        kernel /= cv::sum(kernel)[0];
        cv::filter2D(sharp_, white_, -1, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
        differentiate();
    }

    int blurs() const { return blurs_; } // how often blur() has changed the table
    // The covariance of the blur of the table.
    const cv::Matx22d &covariance_cells2() const { return covariance_cells2_; }

    // Interpolates bilinearly, and corrects the value by means of the slopes. This reduces the error from second to
    // third order.
    Whiteness at(const cv::Vec2d &cell) const {
        const double x = std::clamp(cell[0] * per_cell_ - 0.5, 0.0, values_.cols - 1.001);
        const double y = std::clamp(cell[1] * per_cell_ - 0.5, 0.0, values_.rows - 1.001);
        const int column = static_cast<int>(x), row = static_cast<int>(y);
        const auto a = static_cast<float>(x - column), b = static_cast<float>(y - row);
        const Sample *upper = &values_(row, column), *lower = upper + values_.cols;
        const Sample left = (1 - b) * upper[0] + b * lower[0], right = (1 - b) * upper[1] + b * lower[1];
        const Sample w = (1 - a) * left + a * right;
        const float top_v = (1 - a) * upper[0][2] + a * upper[1][2],
                    bottom_v = (1 - a) * lower[0][2] + a * lower[1][2];
        const float correction = (a * (1 - a) * (left[1] - right[1]) + b * (1 - b) * (top_v - bottom_v)) /
                                 static_cast<float>(2 * per_cell_);
        return {w[0] + correction, w[1], w[2], w[3], w[4], w[5]};
    }

private:
    // Uses differences of the fourth order, except for the mixed derivative. Differences of the second order would be
    // up to 40 % too small where the blur is narrower than a sample, as in large cells. The steps of the fit would
    // then be too long.
    void differentiate() {
        const auto first = static_cast<float>(per_cell_) / 12, second = first * static_cast<float>(per_cell_);
        for (int y = 0; y < white_.rows; ++y) {
            const auto row = [&](int offset) { return white_[std::clamp(y + offset, 0, white_.rows - 1)]; };
            const float *const rows[] = {row(-2), row(-1), row(0), row(1), row(2)};
            for (int x = 0; x < white_.cols; ++x) {
                const int left = std::max(x - 1, 0), right = std::min(x + 1, white_.cols - 1),
                          left2 = std::max(x - 2, 0), right2 = std::min(x + 2, white_.cols - 1);
                const float *const r = rows[2];
                const float here = r[x];
                values_(y, x) = {here,
                                 first * (8 * (r[right] - r[left]) - (r[right2] - r[left2])),
                                 first * (8 * (rows[3][x] - rows[1][x]) - (rows[4][x] - rows[0][x])),
                                 second * (16 * (r[left] + r[right]) - (r[left2] + r[right2]) - 30 * here),
                                 second * 3 * (rows[1][left] - rows[1][right] - rows[3][left] + rows[3][right]),
                                 second * (16 * (rows[1][x] + rows[3][x]) - (rows[0][x] + rows[4][x]) - 30 * here)};
            }
        }
    }

    int per_cell_; // samples along each axis
    int blurs_ = 0;
    cv::Matx22d covariance_cells2_ = cv::Matx22d::zeros(); // zeros: not blurred yet
    cv::Mat_<float> sharp_, white_;
    cv::Mat_<Sample> values_;
};

struct Fit {
    cv::Matx<double, unknowns, unknowns> normal; // JᵀJ, where J are the derivatives of the light
    cv::Vec<double, unknowns> gradient;          // Jᵀ·residuals
    int pixels = 0;  // number of pixels, without saturated pixels that give no information
    double cost = 0; // sum of the squared residuals; infinite if the corners are not those
                     // of a square seen from the front
};

// Returns the derivative of px with respect to cells at the centre of the print.
cv::Matx22d px_per_cell_at_centre(const Homography &to_px, const Print &print) {
    const double middle = print.cells.rows / 2.0;
    return derivative(to_px, to_px * cv::Vec3d(middle, middle, 1));
}

Fit linearize(std::span<Pixel> pixels, const Print &print, BlurredPrint &blurred, const Model &model) {
    const Homography to_px = px_from_cells(model.corners_px, print), to_cells = to_px.inv();
    Fit fit;
    const cv::Matx22d px_per_cell = px_per_cell_at_centre(to_px, print);
    if (!(cv::determinant(px_per_cell) > 0)) { // also true for NaN
        fit.cost = std::numeric_limits<double>::infinity();
        return fit;
    }
    const cv::Matx22d cells_per_px = px_per_cell.inv(), ellipse = cells_per_px * cells_per_px.t();
    blurred.blur(model.blur_px * model.blur_px * ellipse);

    // First computes the derivatives with respect to the nine elements of the homography and the other unknowns.
    constexpr int count = 14;
    std::array<double, count * count> normal{};
    std::array<double, count> gradient{};
    for (Pixel &pixel : pixels) {
        const cv::Vec3d h = to_cells * cv::Vec3d(pixel.place[0], pixel.place[1], 1);
        if (!(h[2] > 0)) {
            fit.cost = std::numeric_limits<double>::infinity();
            return fit;
        }
        const cv::Vec2d cell(h[0] / h[2], h[1] / h[2]);
        Whiteness white = blurred.at(cell);
        // A blur obeys the heat equation: the derivative of the whiteness with respect to the variance of the blur is
        // half of its Laplacian in px. The table assumes a linear map, and an elliptical blur nearly as at the centre
        // of the print. Three terms correct this to the first order of the perspective:
        // - The ellipse at this cell differs from that of the table. The term is half of the difference times the
        //   second derivatives.
        // - The map is not linear. The term shifts the whiteness.
        // - The ellipse changes within the blur. The term shifts the spread.
        const double variance_px2 = model.blur_px * model.blur_px;
        const cv::Matx22d cells_per_px_here = derivative(to_cells, h),
                          ellipse_here = cells_per_px_here * cells_per_px_here.t();
        const auto spread = [](const cv::Matx22d &covariance, const Whiteness &of) {
            return covariance(0, 0) * of.uu + 2 * covariance(0, 1) * of.uv + covariance(1, 1) * of.vv;
        };
        const double spread_here = spread(ellipse_here, white), by_blur = model.blur_px * spread_here;
        const cv::Vec2d shift = cells_per_px_here * cv::Vec2d(to_cells(2, 0), to_cells(2, 1)) * (variance_px2 / h[2]);
        const Whiteness shifted = blurred.at(cell - shift);
        white.value =
            shifted.value +
            static_cast<float>(spread(variance_px2 * ellipse_here - blurred.covariance_cells2(), white) / 2 +
                               variance_px2 * (spread(ellipse_here, shifted) - spread_here));
        const double u = cell[0] / print.cells.cols - 0.5, v = cell[1] / print.cells.rows - 0.5;
        const double illumination = 1 + model.slope[0] * u + model.slope[1] * v;
        const double light = model.black + model.contrast * white.value,
                     residual = pixel.light - illumination * light;
        pixel.residual = residual;
        const double contrast = illumination * model.contrast;
        // The derivative of the light with respect to a motion of the print in undistorted px.
        const cv::Vec2d by_px = -contrast * (cells_per_px_here.t() * cv::Vec2d(white.u, white.v));
        pixel.change_per_px = cv::norm(by_px);
        if (pixel.is_saturated && residual < 0) // the true light of the pixel is unknown, but at least this high
            continue;
        const double x = by_px[0], y = by_px[1];
        // The homography maps `h` to (pixel.place, 1).
        const double w = -(x * pixel.place[0] + y * pixel.place[1]);
        const std::array<double, count> j = {x * h[0],  x * h[1],           x * h[2],     y * h[0],
                                             y * h[1],  y * h[2],           w * h[0],     w * h[1],
                                             w * h[2],  contrast * by_blur, illumination, illumination * white.value,
                                             light * u, light * v};
#pragma GCC unroll 14
        for (int a = 0; a < count; ++a) {
            gradient[a] += j[a] * residual;
            for (int b = a / 2 * 2; b < count; ++b) // the upper triangle
                normal[a * count + b] += j[a] * j[b];
        }
        fit.cost += residual * residual;
        ++fit.pixels;
    }

    for (int a = 0; a < count; ++a)
        for (int b = 0; b < a; ++b)
            normal[a * count + b] = normal[b * count + a];

    // Second step: converts `normal` and `gradient` to derivatives with respect to the coordinates of the corners,
    // which determine the homography, in place of its elements.
    cv::Matx<double, count, unknowns> by_unknown = cv::Matx<double, count, unknowns>::zeros();
    for (int i = 0; i < 8; ++i) {
        constexpr double step_px = 0.1;
        cv::Vec<double, 8> corners_px = model.corners_px;
        corners_px[i] += step_px;
        const Homography moved = px_from_cells(corners_px, print);
        for (int element = 0; element < 9; ++element)
            by_unknown(element, i) = (moved.val[element] - to_px.val[element]) / step_px;
    }
    for (int i = 9; i < count; ++i)
        by_unknown(i, i - 1) = 1;
    fit.normal = by_unknown.t() * cv::Matx<double, count, count>(normal.data()) * by_unknown;
    fit.gradient = by_unknown.t() * cv::Vec<double, count>(gradient.data());
    return fit;
}

double sum_of_squared_differences_from_mean(std::span<const Pixel> pixels) {
    double sum = 0, squares = 0;
    for (const Pixel &pixel : pixels) {
        sum += pixel.light;
        squares += pixel.light * pixel.light;
    }
    return squares - sum * sum / static_cast<double>(pixels.size());
}

// Returns which pixels show the print. The other pixels show a highlight, show an object that hides the print, or are
// so close to such pixels that blur mixes them. `max_error`: the maximum error of a pixel, relative to the contrast
// of the print.
std::vector<bool> inliers(std::span<const Pixel> pixels, const LightOfCode &light_of_code, const Model &model,
                          double max_error) {
    constexpr double max_deviations = 4, reach = 4; // standard deviations of the noise and of the blur, respectively
    constexpr double max_edge_px = 0.1; // displacement; a lens does not blur an edge exactly as the model does
    const auto tells_its_light = [](const Pixel &pixel) { return !pixel.is_saturated || pixel.residual > 0; };
    std::vector<const Pixel *> outliers;
    for (const Pixel &pixel : pixels)
        if (tells_its_light(pixel) &&
            std::abs(pixel.residual) > max_error * std::abs(model.contrast) + max_edge_px * pixel.change_per_px)
            outliers.push_back(&pixel);
    if (outliers.empty())
        return std::vector<bool>(pixels.size(), true);

    // Compares errors in codes, because noise depends less on the brightness in codes than in light.
    const auto code_of = [&](double light) {
        const double within = std::clamp<double>(light, light_of_code.front(), light_of_code.back());
        const auto above =
            // Never the first element.
            std::min(std::ranges::upper_bound(light_of_code, within), light_of_code.end() - 1);
        const double below = *(above - 1);
        return static_cast<double>(above - light_of_code.begin() - 1) + (within - below) / (*above - below);
    };
    const auto code_error = [&](const Pixel &pixel) {
        return std::abs(code_of(pixel.light) - code_of(pixel.light - pixel.residual));
    };
    std::vector<double> errors{0}; // never empty
    for (const Pixel &pixel : pixels)
        if (tells_its_light(pixel) && pixel.light > light_of_code.front()) // black may be clipped, too
            errors.push_back(code_error(pixel));
    const double deviation = 1.4826 * median(errors); // standard deviation, if the errors are normally distributed
    std::erase_if(outliers, [&](const Pixel *one) { return code_error(*one) <= max_deviations * deviation; });
    std::vector<bool> result;
    result.reserve(pixels.size());
    for (const Pixel &pixel : pixels)
        result.push_back(std::ranges::none_of(outliers, [&](const Pixel *outlier) {
            return cv::norm(pixel.place - outlier->place) <= reach * model.blur_px;
        }));
    return result;
}

using CornerMotions = cv::Matx<double, 8, 6>;

// Returns the derivatives of a square's corners, in undistorted px, with respect to its pose: shifts along three
// axes, and rotations about its centre. Derives the axes from the homography, although noise makes them slightly
// oblique.
CornerMotions corner_motions(const cv::Vec<double, 8> &corners_px, const cv::Vec2d &focal_px) {
    const cv::Point2f square[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    cv::Point2f corners[4];
    for (int i = 0; i < 4; ++i)
        corners[i] = cv::Point2d(corners_px[2 * i] / focal_px[0], corners_px[2 * i + 1] / focal_px[1]);
    const Homography camera_from_square = cv::getPerspectiveTransform(square, corners); // up to a scale
    CornerMotions motions;
    for (int i = 0; i < 4; ++i) {
        const cv::Vec3d from_centre = camera_from_square * cv::Vec3d(square[i].x, square[i].y, 0),
                        at = from_centre + camera_from_square * cv::Vec3d(0, 0, 1);
        for (int degree = 0; degree < 6; ++degree) {
            cv::Vec3d axis;
            axis[degree % 3] = 1;
            const cv::Vec3d motion = degree < 3 ? axis : axis.cross(from_centre);
            for (int k = 0; k < 2; ++k)
                motions(2 * i + k, degree) = focal_px[k] * (motion[k] - at[k] / at[2] * motion[2]) / at[2];
        }
    }
    return motions;
}

// Returns the variance of independent noise that is equivalent to `covariance`: the 95 % ellipsoid of the pose that
// it yields contains the true pose in 95 % of cases. Only the part of the noise that `motions` span changes the pose.
// The square of this part is a sum of squares with unequal variances. Satterthwaite's approximation of its
// distribution is a scaled chi-squared distribution with fewer degrees of freedom.
double equivalent_variance(const cv::Matx<double, 8, 8> &covariance, const CornerMotions &motions) {
    const auto projected = (motions.t() * motions).inv() * (motions.t() * covariance * motions);
    const double sum = cv::trace(projected), sum_of_squares = cv::trace(projected * projected);
    const double freedom = sum * sum / sum_of_squares;
    // 95 % quantile of the chi-squared distribution (Wilson–Hilferty)
    const auto quantile = [](double n) { return n * std::pow(1 - 2 / (9 * n) + 1.645 * std::sqrt(2 / (9 * n)), 3); };
    return sum_of_squares / sum * quantile(freedom) / quantile(6);
}

// Fits a print to pixels.
class PrintFit {
public:
    // `pixels`: includes outliers. `cells_per_px`: at the centre of the print. `shortest_px`: the shortest side of
    // the square. `blur_px`: the initial value.
    PrintFit(const Print &print, const LightOfCode &light_of_code, std::vector<Pixel> pixels,
             const cv::Vec<double, 8> &corners_px, const cv::Matx22d &cells_per_px, double shortest_px,
             double blur_px)
        : print_(print), light_of_code_(light_of_code), all_(std::move(pixels)), cells_per_px_(cells_per_px),
          first_px_(corners_px), shortest_px_(shortest_px),
          table_blur_px_(blur_px), model_{corners_px, blur_px, 0, 1, {}} {}

    // Returns whether the fit has converged to a picture that resembles the pixels. Call only once.
    bool run() {
        constexpr double max_hidden = 0.25, max_left_out = 0.5; // shares of the pixels, at the end and during the fit
        constexpr double least_max_error = 0.05;
        constexpr int max_rounds = 8;
        // Most of the steps need only some of the pixels, and no exact table.
        constexpr double tolerance = 0.05;
        constexpr std::size_t stride = 4, min_pixels = 4 * stride * unknowns;
        for (std::size_t i = 0; i<all_.size(); i += all_.size()> min_pixels ? stride : 1)
            pixels_.push_back(all_[i]);
        linearize_model();
        if (!std::isfinite(fit_.cost))
            return false;
        // First fits the light, which is a linear problem, because the other derivatives depend on it.
        const auto light = fit_.normal.get_minor<2, 2>(9, 9).inv() * cv::Vec2d(fit_.gradient[9], fit_.gradient[10]);
        model_.black += light[0];
        model_.contrast += light[1];
        linearize_model();
        if (pixels_.size() < all_.size()) {
            minimize();
            pixels_ = all_;
        }
        blurred_.tolerance = tolerance;
        linearize_model();
        // A hidden part displaces the first fits, so at first only the largest errors count as outliers.
        double max_error = 0.4;
        std::vector<bool> kept(all_.size(), true);
        for (int round = 0;; ++round) {
            const bool is_converged = minimize();
            if (pixels_.size() == all_.size() && has_residuals_)
                all_.swap(pixels_);
            else if (!std::isfinite(linearized(all_, model_).cost))
                return false;
            std::vector<bool> next;
            do
                next = inliers(all_, light_of_code_, model_, max_error);
            while (next == kept && (max_error /= 2) >= least_max_error);
            const double left_out =
                static_cast<double>(std::ranges::count(next, false)) / static_cast<double>(all_.size());
            if (next == kept || round == max_rounds || steps_left_ == 0)
                return is_converged && (next == kept || round == max_rounds) && left_out <= max_hidden && resembles();
            if (left_out > max_left_out)
                return false;
            max_error = std::max(max_error / 2, least_max_error);
            kept = std::move(next);
            pixels_.clear();
            for (std::size_t i = 0; i < all_.size(); ++i)
                if (kept[i])
                    pixels_.push_back(all_[i]);
            linearize_model();
        }
    }

    // Returns the light of white where the illumination is brightest.
    double white() const {
        return (model_.black + std::max(model_.contrast, 0.0)) *
               (1 + (std::abs(model_.slope[0]) + std::abs(model_.slope[1])) / 2);
    }
    std::uint64_t work() const { return work_; } // see refine_by_print()
    const cv::Vec<double, 8> &corners_px() const { return model_.corners_px; }
    cv::Matx<double, 8, 8> covariance_px2() const {
        const auto covariance = fit_.normal.inv(cv::DECOMP_CHOLESKY) * (fit_.cost / (fit_.pixels - unknowns));
        return covariance.get_minor<8, 8>(0, 0);
    }

private:
    Fit linearized(std::vector<Pixel> &pixels, const Model &model) {
        const int blurs = blurred_.blurs();
        Fit fit = linearize(pixels, print_, blurred_, model);
        work_ += pixels.size() + work_of_blur * static_cast<std::uint64_t>(blurred_.blurs() - blurs);
        return fit;
    }
    void linearize_model() {
        fit_ = linearized(pixels_, model_);
        has_residuals_ = true;
    }

    BlurredPrint table(double tolerance) const {
        return {print_, samples_per_cell(print_, table_blur_px_ * table_blur_px_ * cells_per_px_ * cells_per_px_.t()),
                tolerance};
    }

    // Returns whether the fit has converged.
    bool minimize() {
        constexpr double converged_px = 0.01;
        constexpr int max_steps = 20;
        constexpr double first_damping = 1e-3;
        double damping = first_damping;
        // `is_limited`: an undamped step would leave the permitted area.
        bool is_converged = false, is_limited = false;
        for (int step = 0; step < max_steps && steps_left_ > 0 && !is_converged; ++step, --steps_left_) {
            double reduction = 0;
            const std::optional<Model> next = step_from_model(damping, reduction);
            if (!next)
                return false;
            const double moved_px = std::max(cv::norm(next->corners_px, model_.corners_px, cv::NORM_INF),
                                             std::abs(next->blur_px - model_.blur_px));
            if (cv::norm(next->corners_px, first_px_, cv::NORM_INF) >= shortest_px_ / 4) {
                is_limited = true;
                damping *= 10;
                continue;
            }
            is_limited &= damping > 1;
            if (moved_px < converged_px && damping <= first_damping && !is_limited) {
                model_ = *next;
                fit_.cost -= std::min(reduction, fit_.cost / 2);
                return !renew_table();
            }
            const Fit candidate = linearized(pixels_, *next);
            is_limited |= !std::isfinite(candidate.cost);
            const bool is_better = candidate.cost < fit_.cost;
            has_residuals_ = is_better;
            // Near the minimum, the table's resolution determines whether a small step reduces the cost.
            is_converged = moved_px < converged_px && (is_better || damping <= 1) && !is_limited;
            damping *= is_better ? 0.1 : 10;
            if (is_better) {
                model_ = *next;
                fit_ = candidate;
            }
            is_converged &= !renew_table();
        }
        return is_converged;
    }

    bool resembles() const {
        constexpr double min_resemblance = 0.85;
        return fit_.pixels >= 4 * unknowns &&
               fit_.cost < (1 - min_resemblance) * sum_of_squared_differences_from_mean(pixels_);
    }

    // `reduction`: receives by how much the derivatives predict that the step reduces the cost.
    std::optional<Model> step_from_model(double damping, double &reduction) const {
        constexpr double min_blur_px = 0.3;
        auto damped = fit_.normal;
        for (int i = 0; i < unknowns; ++i)
            damped(i, i) *= 1 + damping;
        cv::Vec<double, unknowns> change;
        if (!cv::solve(damped, fit_.gradient, change, cv::DECOMP_CHOLESKY))
            return std::nullopt;
        reduction = 2 * change.dot(fit_.gradient) - change.dot(fit_.normal * change);
        Model next = model_;
        for (int i = 0; i < 8; ++i)
            next.corners_px[i] += change[i];
        next.blur_px =
            std::clamp(model_.blur_px + change[8], std::max(min_blur_px, model_.blur_px / 2), 2 * model_.blur_px);
        next.black += change[9];
        next.contrast += change[10];
        next.slope += cv::Vec2d(change[11], change[12]);
        return std::isfinite(cv::norm(change, cv::NORM_L2)) ? std::optional(next) : std::nullopt;
    }

    // Replaces the table if its resolution no longer suits the blur. Too fine a table would need a large kernel; too
    // coarse a table would not resolve the blur. Returns whether the table was replaced.
    bool renew_table() {
        constexpr double max_ratio = 1.8; // ratio of the current blur to the blur for which the table was made
        if (std::max(model_.blur_px, table_blur_px_) <= max_ratio * std::min(model_.blur_px, table_blur_px_))
            return false;
        table_blur_px_ = model_.blur_px;
        blurred_ = table(blurred_.tolerance);
        linearize_model();
        return true;
    }

    static constexpr std::uint64_t work_of_blur = 700;

    const Print &print_;
    const LightOfCode &light_of_code_;
    std::vector<Pixel> all_, pixels_; // `all_`: with outliers; `pixels_`: without outliers
    cv::Matx22d cells_per_px_;        // at the centre of the print
    cv::Vec<double, 8> first_px_;
    double shortest_px_;
    int steps_left_ = 60; // successful fits need fewer steps
    std::uint64_t work_ = 0;
    double table_blur_px_;
    BlurredPrint blurred_ = table(0.3);
    Model model_;
    Fit fit_;
    bool has_residuals_ = false; // whether the residuals in pixels_ are those of model_
};

// Returns whether white is saturated at most positions beside the edges. Saturation shifts the edges into the black.
bool is_overexposed(const cv::Mat &grey, const Corners &corners_px, int cells) {
    const cv::Point2d centre = (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]) / 4;
    const cv::Rect2d inside(0, 0, grey.cols - 1, grey.rows - 1);
    int bright = 0, all = 0;
    for (int i = 0; i < 4; ++i)
        for (const double part : {0.2, 0.4, 0.6, 0.8}) {
            const cv::Point2d on_edge = corners_px[i] + part * (corners_px[(i + 1) % 4] - corners_px[i]);
            const cv::Point2d half_cell = (on_edge - centre) / cells;
            const auto is_bright = [&](const cv::Point2d &at) {
                return inside.contains(at) && grey.at<std::uint8_t>(at) >= saturated;
            };
            bright += is_bright(on_edge + half_cell) || is_bright(on_edge - half_cell); // the border may be white
            ++all;
        }
    return 2 * bright > all;
}

} // namespace

std::optional<AlignedPrint> align_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &corners_px,
                                        const Lens &lens, const Print &print, double blur_cells,
                                        std::uint64_t *work) {
    constexpr double min_cell_px = 0.5;
    constexpr double usual_blur_px = 0.7;
    const auto corners = lens.undistort({corners_px.begin(), corners_px.end()});
    if (!corners || print.margin < 1 || !std::ranges::all_of(corners_px, [&](const cv::Point2d &corner) {
            return std::abs(corner.x) < 2 * grey.cols && std::abs(corner.y) < 2 * grey.rows;
        }))
        return std::nullopt;
    cv::Vec<double, 8> first_px;
    double shortest_px = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 4; ++i) {
        first_px[2 * i] = (*corners)[i].x;
        first_px[2 * i + 1] = (*corners)[i].y;
        shortest_px = std::min(shortest_px, cv::norm((*corners)[(i + 1) % 4] - (*corners)[i]));
    }
    if (!(shortest_px >= min_cell_px * print.side())) // false for NaN
        return std::nullopt;
    const Homography px_from_cell = px_from_cells(first_px, print);
    const cv::Matx22d px_per_cell = px_per_cell_at_centre(px_from_cell, print);
    // True for NaN, and if the corners are not those of a square seen from the front.
    if (!(cv::determinant(px_per_cell) > 0))
        return std::nullopt;
    const LightOfCode &light = light_of_code(transfer);
    std::vector<Pixel> pixels = pixels_of(grey, light, corners_px, lens, px_from_cell.inv(), print);
    if (pixels.size() < 4 * unknowns)
        return std::nullopt;
    const double blur_px = std::max(blur_cells * shortest_px / print.side(), usual_blur_px);
    PrintFit fit(print, light, std::move(pixels), first_px, px_per_cell.inv(), shortest_px, blur_px);
    const bool is_found = fit.run();
    if (work)
        *work += fit.work();
    if (!is_found)
        return std::nullopt;
    std::vector<cv::Point2d> found;
    found.reserve(4);
    for (int i = 0; i < 4; ++i)
        found.emplace_back(fit.corners_px()[2 * i], fit.corners_px()[2 * i + 1]);
    const auto distorted = lens.distort(found);
    if (!distorted)
        return std::nullopt;
    const double variance_px2 =
        equivalent_variance(fit.covariance_px2(), corner_motions(fit.corners_px(), lens.focal_px()));
    const double sigma_px = noise_scale(found, *distorted) * std::sqrt(variance_px2);
    if (!(sigma_px > 0) || !std::isfinite(sigma_px))
        return std::nullopt;
    AlignedPrint result;
    std::ranges::copy(*distorted, result.corners_px.begin());
    result.sigma_px = sigma_px;
    result.white = fit.white();
    return result;
}

CornersByEdges refine_by_edges(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                               const Lens &lens, int cells, bool is_subpixel) {
    constexpr double max_blur_cells = 0.2;
    CornersByEdges found;
    found.edges = refine_edges(grey, transfer, rough_px, lens, cells, is_subpixel, &found.blur_cells, max_blur_cells);
    const auto &edges = found.edges;
    found.are_unreliable = !edges || edges->sigma_px == 0 || edges->blur_cells > max_blur_cells;
    found.are_overexposed = !found.are_unreliable && is_overexposed(grey, edges->corners_px, cells);
    return found;
}

std::optional<MeasuredCorners> refine_by_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                               const Lens &lens, int cells, const Print &print,
                                               const CornersByEdges &by_edges, std::uint64_t &work) {
    // `max_sigma_ratio`: sigma of the print divided by sigma of doubtful edges.
    constexpr double max_sigma_ratio = 0.1;
    constexpr double max_light = 255, max_clipped = 0.05; // `max_clipped`: share of the light of white
    constexpr double max_skew_cells = 0.25;               // maximum for a square in perspective
    const auto &edges = by_edges.edges;
    const auto is_better = [&](const AlignedPrint &found) {
        return by_edges.are_unreliable || (by_edges.are_overexposed && found.white > (1 + max_clipped) * max_light) ||
               (edges->is_doubtful && found.sigma_px < max_sigma_ratio * edges->sigma_px);
    };
    if (const auto found = align_print(grey, transfer, edges ? edges->corners_px : rough_px, lens, print,
                                       by_edges.blur_cells, &work))
        return is_better(*found) ? *found : *edges;
    // If an object hides a corner, a detector mistakes the end of the object for the corner. The position of the
    // hidden corner is estimated from the other three corners.
    const cv::Point2d skew_px = rough_px[0] - rough_px[1] + rough_px[2] - rough_px[3];
    const double diagonal_px = std::min(cv::norm(rough_px[2] - rough_px[0]), cv::norm(rough_px[3] - rough_px[1]));
    if ((by_edges.are_unreliable || edges->is_doubtful) && cv::norm(skew_px) * cells > max_skew_cells * diagonal_px)
        for (std::size_t i = 0; i < 4; ++i) {
            Corners corners_px = rough_px;
            corners_px[i] = rough_px[(i + 1) % 4] - rough_px[(i + 2) % 4] + rough_px[(i + 3) % 4];
            if (const auto found = align_print(grey, transfer, corners_px, lens, print, 0, &work);
                found && is_better(*found))
                return found;
        }
    return edges;
}

std::optional<MeasuredCorners> refine_corners(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                              const Lens &lens, int cells, const std::function<Print()> &print,
                                              bool is_subpixel) {
    const CornersByEdges by_edges = refine_by_edges(grey, transfer, rough_px, lens, cells, is_subpixel);
    std::uint64_t work = 0;
    return by_edges.need_print() ? refine_by_print(grey, transfer, rough_px, lens, cells, print(), by_edges, work)
                                 : by_edges.edges;
}

} // namespace arhost::fiducial
