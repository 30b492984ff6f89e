// SPDX-License-Identifier: Apache-2.0
#include "blurred_edge.hpp"

#include <opencv2/core.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <span>

namespace arhost::fiducial {
namespace {

struct Step {
    double value, slope;
};

// The distribution function of the standard normal distribution and its derivative: a blurred step from 0 to 1.
// Interpolated by cubic polynomials, which takes a fifth of the time of std::erf and std::exp; the errors are below
// 1e-7 and 1e-5.
class BlurredStep {
public:
    BlurredStep() {
        for (int i = 0; i < count; ++i) {
            const double z = static_cast<double>(i) / per_unit - limit;
            nodes_[i] = {0.5 * std::erfc(-z / std::numbers::sqrt2),
                         std::exp(-0.5 * z * z) * std::numbers::inv_sqrtpi / std::numbers::sqrt2 / per_unit};
        }
    }
    Step at(double z) const {
        if (!(std::abs(z) < limit)) // also for NaN
            return {z > 0 ? 1.0 : 0.0, 0};
        const double place = (z + limit) * per_unit;
        const int i = static_cast<int>(place);
        const double t = place - i;
        const Step &a = nodes_[i], &b = nodes_[i + 1];
        const double rise = b.value - a.value, c2 = 3 * rise - 2 * a.slope - b.slope,
                     c3 = a.slope + b.slope - 2 * rise;
        return {a.value + t * (a.slope + t * (c2 + t * c3)), per_unit * (a.slope + t * (2 * c2 + t * 3 * c3))};
    }

private:
    static constexpr int per_unit = 16;
    static constexpr double limit = 6;
    static constexpr int count = 2 * 6 * per_unit + 2; // one more, because a sum may be rounded to 2 * limit
    std::array<Step, count> nodes_;                    // slopes: per interval
};

struct Model {
    double offset_px = 0, turn = 0, blur_px = 0; // the edge is at offset_px + turn * along_px
    double before = 0, contrast = 0;
};
constexpr int unknowns = 5; // in this order
constexpr double min_blur_px = 0.25;
using Normal = cv::Matx<double, unknowns, unknowns>;
using Vector = cv::Vec<double, unknowns>;

struct Linearized {
    Normal normal = Normal::zeros(); // JᵀJ, where J are the derivatives of the light
    Vector gradient;                 // Jᵀ·residuals
    double cost = 0;                 // sum of the squared residuals
};

// Sets the residuals and derivatives of the pixels.
Linearized linearize(std::span<EdgePixel> pixels, const Model &model) {
    static const BlurredStep step;
    Linearized sum;
    const double per_px = 1 / model.blur_px;
    for (EdgePixel &pixel : pixels) {
        const double z = (pixel.across_px - model.offset_px - model.turn * pixel.along_px) * per_px;
        const auto [value, slope] = step.at(z);
        pixel.residual = pixel.light - model.before - model.contrast * value;
        pixel.by_offset = -model.contrast * per_px * slope;
        const std::array<double, unknowns> j = {pixel.by_offset, pixel.by_offset * pixel.along_px,
                                                pixel.by_offset * z, 1, value};
#pragma GCC unroll 5
        for (int a = 0; a < unknowns; ++a) {
            sum.gradient[a] += j[a] * pixel.residual;
#pragma GCC unroll 5
            for (int b = a; b < unknowns; ++b)
                sum.normal(a, b) += j[a] * j[b];
        }
        sum.cost += pixel.residual * pixel.residual;
    }
    for (int a = 0; a < unknowns; ++a)
        for (int b = 0; b < a; ++b)
            sum.normal(a, b) = sum.normal(b, a);
    return sum;
}

// Removes the columns whose residuals are greater than those of most columns, and than `min_error`. Returns whether
// there were any.
bool remove_outliers(std::vector<EdgePixel> &pixels, double min_error) {
    constexpr double max_ratio = 6; // of the mean squared residuals of a column and the median column
    struct Column {
        double squares = 0;
        int pixels = 0;
        double mean_square() const { return squares / std::max(pixels, 1); }
    };
    std::vector<Column> columns(static_cast<std::size_t>(pixels.back().column) + 1);
    for (const EdgePixel &pixel : pixels) {
        columns[pixel.column].squares += pixel.residual * pixel.residual;
        ++columns[pixel.column].pixels;
    }
    std::vector<double> sorted;
    sorted.reserve(columns.size());
    for (const Column &column : columns)
        if (column.pixels > 0)
            sorted.push_back(column.mean_square());
    const auto median = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, median);
    const double bound = std::max(max_ratio * *median, min_error * min_error);
    return std::erase_if(pixels,
                         [&](const EdgePixel &pixel) { return columns[pixel.column].mean_square() > bound; }) > 0;
}

// Returns the correlation of what neighbouring columns contribute to the derivative of the cost by the offset.
double correlation(std::span<const EdgePixel> pixels) {
    double products = 0, squares = 0, last = 0;
    for (auto first = pixels.begin(); first != pixels.end();) {
        const auto next =
            std::find_if(first, pixels.end(), [&](const EdgePixel &one) { return one.column != first->column; });
        const double sum = std::accumulate(first, next, 0.0, [](double total, const EdgePixel &one) {
            return total + one.by_offset * one.residual;
        });
        products += sum * last;
        squares += sum * sum;
        last = sum;
        first = next;
    }
    return products / squares;
}

// Where to start: most pixels beside the slope show the light of the two areas.
Model first_model(std::span<const EdgePixel> pixels, double blur_px) {
    const auto median_light = [&](double sign) {
        std::vector<double> light;
        for (const EdgePixel &pixel : pixels)
            if (sign * pixel.across_px > blur_px)
                light.push_back(pixel.light);
        const auto median = light.begin() + static_cast<std::ptrdiff_t>(light.size() / 2);
        std::ranges::nth_element(light, median);
        return light.empty() ? 0 : *median;
    };
    const double before = median_light(-1), after = median_light(1);
    return {0, 0, blur_px, before, after - before};
}

// Whether the light of the bright area, at some distance from the edge, clearly changes along it. The fit would take
// that for a change of the direction.
bool is_uneven(std::span<const EdgePixel> pixels, const Model &model, double half_length_px) {
    constexpr double min_deviations = 4; // standard deviations
    constexpr double min_change = 0.005; // relative, from the middle to an end
    const double min_distance_px = 2 * model.blur_px, bright = model.contrast > 0 ? 1 : -1;
    double count = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (const EdgePixel &pixel : pixels)
        if (bright * (pixel.across_px - model.offset_px - model.turn * pixel.along_px) > min_distance_px) {
            ++count;
            x += pixel.along_px;
            y += pixel.residual;
            xx += pixel.along_px * pixel.along_px;
            xy += pixel.along_px * pixel.residual;
            yy += pixel.residual * pixel.residual;
        }
    xx -= x * x / count, xy -= x * y / count, yy -= y * y / count;
    const double slope = xy / xx, variance = (yy - slope * xy) / (count - 2) / xx; // of a line fit
    return std::abs(slope) * half_length_px > min_change * std::max(model.before, model.before + model.contrast) &&
           slope * slope > min_deviations * min_deviations * variance; // false for NaN
}

// Minimizes the squared residuals by the method of Levenberg and Marquardt: edges that are sharper than pixels have
// hardly any slope, so undamped steps may lead far away. `sum` is that of `model` and the pixels; afterwards, its
// derivatives and the residuals of the pixels may be those beside the last, small step. Returns whether the fit has
// converged near the line.
bool minimize(std::vector<EdgePixel> &pixels, double half_length_px, double max_blur_px, Model &model,
              Linearized &sum) {
    constexpr double first_damping = 1e-4, max_offset_px = 1, converged_px = 0.02, converged_light = 0.01;
    constexpr int max_steps = 20;
    double damping = first_damping;
    for (int step = 0; step < max_steps; ++step) {
        Normal damped = sum.normal;
        for (int i = 0; i < unknowns; ++i)
            damped(i, i) *= 1 + damping;
        Vector change;
        if (!cv::solve(damped, sum.gradient, change, cv::DECOMP_CHOLESKY))
            return false;
        change[2] =
            std::clamp(model.blur_px + change[2], min_blur_px, std::max(max_blur_px, min_blur_px)) - model.blur_px;
        const Model next{model.offset_px + change[0], model.turn + change[1], model.blur_px + change[2],
                         model.before + change[3], model.contrast + change[4]};
        if (!(std::abs(next.offset_px) + half_length_px * std::abs(next.turn) < max_offset_px)) { // also for NaN
            damping *= 10;
            continue;
        }
        const bool is_converged =
            std::abs(change[0]) + half_length_px * std::abs(change[1]) + std::abs(change[2]) < converged_px &&
            std::abs(change[3]) + std::abs(change[4]) < converged_light * std::abs(model.contrast);
        if (is_converged && damping <= first_damping) { // hardly damped
            model = next;
            sum.cost += change.dot(sum.normal * change) - 2 * change.dot(sum.gradient); // as the derivatives tell
            return true;
        }
        const Linearized candidate = linearize(pixels, next);
        const bool is_better = candidate.cost <= sum.cost;
        damping *= is_better ? 0.1 : 10;
        if (is_better) {
            model = next;
            sum = candidate;
        }
        if (is_converged)
            return true;
    }
    return false;
}

} // namespace

std::optional<BlurredEdge> fit_blurred_edge(std::vector<EdgePixel> pixels, double blur_px) {
    constexpr double max_blur_ratio = 2;
    // Of the contrast, before the fit and afterwards: a lens does not blur an edge exactly as the model does.
    constexpr double min_first_error = 0.4, min_error = 0.06;
    constexpr int max_rounds = 10;
    const std::size_t min_pixels = std::max<std::size_t>(pixels.size() / 2, 4 * unknowns);
    if (pixels.size() < min_pixels)
        return std::nullopt;
    double half_length_px = 0;
    for (const EdgePixel &pixel : pixels)
        half_length_px = std::max(half_length_px, std::abs(pixel.along_px));
    Model model = first_model(pixels, blur_px);
    Linearized sum = linearize(pixels, model);
    if (remove_outliers(pixels, min_first_error * model.contrast))
        sum = linearize(pixels, model);
    for (int round = 0; round < max_rounds && pixels.size() >= min_pixels; ++round) {
        if (!minimize(pixels, half_length_px, max_blur_ratio * blur_px, model, sum))
            return std::nullopt;
        if (remove_outliers(pixels, min_error * model.contrast)) {
            sum = linearize(pixels, model);
            continue;
        }
        if (is_uneven(pixels, model, half_length_px))
            return std::nullopt;
        const double variance = sum.cost / static_cast<double>(pixels.size() - unknowns);
        const Normal covariance = variance * sum.normal.inv(cv::DECOMP_CHOLESKY);
        const double pivot_px = -covariance(0, 1) / covariance(1, 1);
        return BlurredEdge{pivot_px,           model.offset_px + model.turn * pivot_px,
                           model.turn,         covariance(0, 0) + pivot_px * covariance(0, 1),
                           covariance(1, 1),   model.blur_px,
                           correlation(pixels)};
    }
    return std::nullopt;
}

} // namespace arhost::fiducial
