// SPDX-License-Identifier: Apache-2.0
#include "fits.hpp"

#include <opencv2/core.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace arhost::fiducial {
namespace {

struct Step {
    double value, slope;
};

// The distribution function of the standard normal distribution, and its derivative. The function is the profile of a
// blurred step from 0 to 1. Both are interpolated by cubic polynomials, which takes a fifth of the time of std::erf
// and std::exp. The errors are below 1e-7 and 1e-5, respectively.
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
        if (!(std::abs(z) < limit)) // also true for NaN
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
    static constexpr int per_unit = 16, limit = 6;
    // One node more than necessary, because rounding may yield 2 * limit.
    static constexpr int count = 2 * limit * per_unit + 2;
    std::array<Step, count> nodes_; // slopes are per interval
};

struct Model {
    double offset_px = 0, turn = 0, blur_px = 0; // the edge is at offset_px + turn * along_px
    double before = 0, contrast = 0;
};
constexpr int unknowns = 5; // in the order of the members of Model

struct Pixel : EdgePixel {
    // Residual of the light, and the light's derivatives with respect to members of Model.
    double residual = 0, by_offset = 0, by_blur = 0, by_contrast = 0;

    std::array<double, unknowns> derivatives() const {
        return {by_offset, by_offset * along_px, by_blur, 1, by_contrast};
    }
};

constexpr double min_blur_px = 0.25;
using Normal = cv::Matx<double, unknowns, unknowns>;
using Vector = cv::Vec<double, unknowns>;

struct Linearized {
    Normal normal = Normal::zeros(); // JᵀJ, where J are the derivatives of the light
    Vector gradient;                 // Jᵀ·residuals
    double cost = 0;                 // sum of the squared residuals
};

// Sets the residuals and derivatives of the pixels.
Linearized linearize(std::span<Pixel> pixels, const Model &model) {
    static const BlurredStep step;
    // The sums of the products of derivatives, the upper triangle row by row. They are local to stay in registers:
    // the compiler must assume that a result in memory may be one of the pixels.
    std::array<double, unknowns *(unknowns + 1) / 2> products{};
    std::array<double, unknowns> gradient{};
    double cost = 0;
    const double per_px = 1 / model.blur_px;
    for (Pixel &pixel : pixels) {
        const double z = (pixel.across_px - model.offset_px - model.turn * pixel.along_px) * per_px;
        const auto [value, slope] = step.at(z);
        const double residual = pixel.light - model.before - model.contrast * value;
        pixel.residual = residual;
        pixel.by_offset = -model.contrast * per_px * slope;
        pixel.by_blur = pixel.by_offset * z;
        pixel.by_contrast = value;
        const std::array<double, unknowns> j = pixel.derivatives();
        std::size_t next = 0;
#pragma GCC unroll 5
        for (std::size_t a = 0; a < unknowns; ++a) {
            gradient[a] += j[a] * residual;
#pragma GCC unroll 5
            for (std::size_t b = a; b < unknowns; ++b)
                products[next++] += j[a] * j[b];
        }
        cost += residual * residual;
    }
    Linearized sum{{}, Vector(gradient.data()), cost};
    std::size_t next = 0;
    for (int a = 0; a < unknowns; ++a)
        for (int b = a; b < unknowns; ++b)
            sum.normal(a, b) = sum.normal(b, a) = products[next++];
    return sum;
}

// Removes outliers. A column is an outlier if its RMS residual is greater than `min_error` and much greater than the
// RMS residual of the median column. Returns whether there were any outliers.
bool remove_outliers(std::vector<Pixel> &pixels, double min_error) {
    constexpr double max_ratio = 6; // mean squared residual of a column divided by that of the median column
    struct Column {
        double squares = 0;
        int pixels = 0;
        double mean_square() const { return squares / std::max(pixels, 1); }
    };
    std::vector<Column> columns(static_cast<std::size_t>(pixels.back().column) + 1);
    for (const Pixel &pixel : pixels) {
        columns[pixel.column].squares += pixel.residual * pixel.residual;
        ++columns[pixel.column].pixels;
    }
    const auto exceeds = [](double bound) {
        return [bound](const Column &column) { return column.mean_square() > bound; };
    };
    const double min_square = min_error * min_error;
    if (std::ranges::none_of(columns, exceeds(min_square))) // saves the median
        return false;
    std::vector<double> sorted;
    sorted.reserve(columns.size());
    for (const Column &column : columns)
        if (column.pixels > 0)
            sorted.push_back(column.mean_square());
    const auto is_outlier = exceeds(std::max(max_ratio * median(sorted), min_square));
    return std::erase_if(pixels, [&](const Pixel &pixel) { return is_outlier(columns[pixel.column]); }) > 0;
}

// Statistics of the derivative of the cost with respect to the offset. Each column contributes one term to it.
struct Contributions {
    double squares = 0, independent = 0; // sum of the squared terms, and its expected value for independent errors
    double correlation = 0;              // between the terms of neighbouring columns
    double columns = 0;                  // number of columns

    // Returns the variance of the offset, divided by the variance that independent pixel errors would cause. The
    // ratio exceeds 1 for two reasons. The errors within a column are similar, which makes the terms larger. The
    // terms of successive columns resemble a first-order autoregressive process. Returns 1 if the correlation may be
    // due to chance.
    double variance_ratio() const {
        // Limits the correlation, because errors with a higher one vary so slowly along the edge that the fit mostly
        // follows them.
        constexpr double min_deviations = 2, max_correlation = 0.7;
        if (!(correlation * std::sqrt(columns) > min_deviations))
            return 1;
        const double known = std::min(correlation, max_correlation);
        return std::max(squares / independent, 1.0) * (1 + known) / (1 - known);
    }
};

Contributions contributions(std::span<const Pixel> pixels) {
    Contributions all;
    double products = 0, last = 0, residuals = 0, derivatives = 0;
    int column = -2;
    for (auto first = pixels.begin(); first != pixels.end(); ++all.columns) {
        double sum = 0;
        if (first->column != column + 1) // columns were skipped
            last = 0;
        for (column = first->column; first != pixels.end() && first->column == column; ++first) {
            sum += first->by_offset * first->residual;
            residuals += first->residual * first->residual;
            derivatives += first->by_offset * first->by_offset;
        }
        products += sum * last;
        all.squares += sum * sum;
        last = sum;
    }
    all.independent = residuals * derivatives / static_cast<double>(pixels.size());
    all.correlation = all.squares > 0 ? products / all.squares : 0;
    return all;
}

// Returns the initial model. Most pixels are away from the slope, so they show the light of one of the two areas.
Model first_model(std::span<const Pixel> pixels, double blur_px) {
    const auto median_light = [&](double sign) {
        std::vector<double> light;
        for (const Pixel &pixel : pixels)
            if (sign * pixel.across_px > blur_px)
                light.push_back(pixel.light);
        return light.empty() ? 0 : median(light);
    };
    const double before = median_light(-1), after = median_light(1);
    return {0, 0, blur_px, before, after - before};
}

// Deviation of an area's light from the model: offset + slope_per_px * along_px.
struct LightLine {
    double offset = 0, slope_per_px = 0, slope_variance = 0;

    // `light`: the light of the bright area.
    bool is_clear(double half_length_px, double light) const {
        constexpr double min_change = 0.002;   // relative to `light`, from the middle to an end of the edge
        constexpr double min_deviations = 3.5; // standard deviations; smaller deviations would often be due to chance
        return std::abs(slope_per_px) * half_length_px > min_change * light &&
               slope_per_px * slope_per_px > min_deviations * min_deviations * slope_variance;
    }
    double at(double along_px) const { return offset + slope_per_px * along_px; }
};

// Fits a line to the residuals of the area before the edge (`side` is -1) or after it (+1). Uses only pixels that are
// so far from the edge that their residuals do not depend on the edge's direction. Returns a line of 0 if there are
// few such pixels.
LightLine light_line(std::span<const Pixel> pixels, const Model &model, double side) {
    constexpr double min_pixels = 10;
    // Interpolation by a renderer or of a Bayer pattern affects pixels up to 1.2 px from the edge.
    const double min_distance_px = std::max(2 * model.blur_px, 1.2);
    double count = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (const Pixel &pixel : pixels)
        if (side * (pixel.across_px - model.offset_px - model.turn * pixel.along_px) > min_distance_px) {
            ++count;
            x += pixel.along_px;
            y += pixel.residual;
            xx += pixel.along_px * pixel.along_px;
            xy += pixel.along_px * pixel.residual;
            yy += pixel.residual * pixel.residual;
        }
    if (count < min_pixels)
        return {};
    xx -= x * x / count, xy -= x * y / count, yy -= y * y / count;
    const double slope = xy / xx;
    return {(y - slope * x) / count, slope, std::max(yy - slope * xy, 0.0) / (count - 2) / xx};
}

// The lines of the areas before and after the edge.
using LightLines = std::array<LightLine, 2>;

// Returns the light of the pixel without the changes along the edge, so that both areas have the light of the model.
// Values between the lights of the two areas stay between them. Works for factors (uneven illumination) and for added
// light (glare).
double light_without(const LightLines &lines, const Model &model, const Pixel &pixel) {
    const double before = lines[0].at(pixel.along_px), after = lines[1].at(pixel.along_px);
    return model.before + (pixel.light - model.before - before) * model.contrast / (model.contrast + after - before);
}

// Returns by how much the unknowns change if `lines` are removed. `inverse`: the inverse of JᵀJ. The derivatives of
// the pixels may be those of a slightly different model, see minimize().
Vector change_without(const LightLines &lines, const Model &model, std::span<const Pixel> pixels,
                      const Normal &inverse) {
    Vector gradient;
    for (const Pixel &pixel : pixels) {
        const double change = light_without(lines, model, pixel) - pixel.light;
        const auto derivatives = pixel.derivatives();
        for (int i = 0; i < unknowns; ++i)
            gradient[i] += derivatives[static_cast<std::size_t>(i)] * change;
    }
    return inverse * gradient;
}

// Solves normal · change = gradient. In contrast to cv::solve(), allocates no memory.
bool solve(Normal normal, const Vector &gradient, Vector &change) {
    change = gradient;
    return cv::Cholesky(normal.val, unknowns * sizeof(double), unknowns, change.val, sizeof(double), 1);
}

// Minimizes the squared residuals by the method of Levenberg and Marquardt. Damping is necessary for edges that are
// sharper than a pixel: almost no pixel lies on their slope, so undamped steps may be far too long. `sum` must be the
// result of linearize() for `model`. After the call, the derivatives in `sum` and the residuals of the pixels may
// belong to a model that differs from `model` by a small step. Returns whether the fit has converged near the line.
bool minimize(std::span<Pixel> pixels, double half_length_px, double max_blur_px, Model &model, Linearized &sum) {
    constexpr double first_damping = 1e-4, max_damping = 1e3; // relative
    constexpr double max_offset_px = 1, converged_px = 0.02, converged_light = 0.01;
    constexpr int max_steps = 20;
    double damping = first_damping;
    for (int step = 0; step < max_steps && damping <= max_damping; ++step) {
        Normal damped = sum.normal;
        for (int i = 0; i < unknowns; ++i)
            damped(i, i) *= 1 + damping;
        Vector change;
        if (!solve(damped, sum.gradient, change))
            return false;
        const double blur_px = std::clamp(model.blur_px + change[2], min_blur_px, max_blur_px);
        if (const double limited = blur_px - model.blur_px; limited != change[2]) { // solve for the other unknowns
            Vector gradient = sum.gradient;
            for (int i = 0; i < unknowns; ++i) {
                gradient[i] -= damped(i, 2) * limited;
                damped(i, 2) = damped(2, i) = i == 2 ? 1 : 0;
            }
            gradient[2] = limited;
            if (!solve(damped, gradient, change))
                return false;
        }
        const Model next{model.offset_px + change[0], model.turn + change[1], model.blur_px + change[2],
                         model.before + change[3], model.contrast + change[4]};
        if (!(std::abs(next.offset_px) + half_length_px * std::abs(next.turn) < max_offset_px)) { // also true for NaN
            damping *= 10;
            continue;
        }
        // Requires weak damping, because strong damping makes every step small.
        const bool is_converged =
            damping <= 1 &&
            std::abs(change[0]) + half_length_px * std::abs(change[1]) + std::abs(change[2]) < converged_px &&
            std::abs(change[3]) + std::abs(change[4]) < converged_light * std::abs(model.contrast);
        if (is_converged && damping <= first_damping) { // hardly damped
            model = next;
            // The cost that the derivatives predict.
            sum.cost += change.dot(sum.normal * change) - 2 * change.dot(sum.gradient);
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

struct Fit {
    Model model;
    Linearized sum;
    std::vector<Pixel> pixels; // without outliers
    bool is_blur_limited;
    LightLines lines; // changes along the edge that are still in the light
};

// Fits the model that fit_blurred_edge() describes. `earlier`: the fit whose lines have been removed from the pixels,
// or null.
std::optional<Fit> fit_model(std::vector<Pixel> pixels, double half_length_px, double blur_px, const Fit *earlier) {
    constexpr double max_blur_ratio = 2;
    // A column can be an outlier only if its error, relative to the contrast, exceeds `min_first_error` before the
    // fit or `min_error` after it. Smaller errors are normal, because a lens does not blur exactly as the model does.
    constexpr double min_first_error = 0.4, min_error = 0.06;
    constexpr int max_rounds = 10;
    const std::size_t min_pixels = std::max<std::size_t>(pixels.size() / 2, 4 * unknowns);
    if (pixels.size() < min_pixels)
        return std::nullopt;
    const double max_blur_px = std::max(max_blur_ratio * blur_px, min_blur_px);
    Model model = earlier ? earlier->model : first_model(pixels, blur_px);
    Linearized sum = linearize(pixels, model);
    if (remove_outliers(pixels, min_first_error * model.contrast))
        sum = linearize(pixels, model);
    for (int round = 0; round < max_rounds && pixels.size() >= min_pixels; ++round) {
        if (!minimize(pixels, half_length_px, max_blur_px, model, sum))
            return std::nullopt;
        if (!remove_outliers(pixels, min_error * model.contrast)) {
            const LightLines lines = {light_line(pixels, model, -1), light_line(pixels, model, 1)};
            return Fit{model, sum, std::move(pixels), model.blur_px <= min_blur_px || model.blur_px >= max_blur_px,
                       lines};
        }
        sum = linearize(pixels, model);
    }
    return std::nullopt;
}

// Returns the edge of a fit, with its uncertainty. `are_lines_removed`: whether the lines of an earlier fit have been
// removed from the pixels.
BlurredEdge edge_of(Fit &fit, bool are_lines_removed) {
    constexpr double min_variance = 1e-20; // greater than 0; variance of the light, relative to the squared contrast
    const Model &model = fit.model;
    const double variance = std::max(fit.sum.cost / static_cast<double>(fit.pixels.size() - unknowns),
                                     min_variance * model.contrast * model.contrast);
    if (fit.is_blur_limited)
        for (int i = 0; i < unknowns; ++i)
            fit.sum.normal(i, 2) = fit.sum.normal(2, i) = i == 2 ? 1 : 0;
    // If an edge is parallel to the rows of pixels, few different distances from it determine the blur, the light and
    // the offset, and the matrix may be singular. This adds so little that it only matters then.
    constexpr double min_eigenvalue = 1e-9; // relative
    for (int i = 0; i < unknowns; ++i)
        fit.sum.normal(i, i) *= 1 + min_eigenvalue;
    const Normal inverse = fit.sum.normal.inv(cv::DECOMP_CHOLESKY);
    Contributions columns = contributions(fit.pixels);
    // The residuals may be those of a slightly different model, see minimize().
    if (columns.variance_ratio() > 1) {
        linearize(fit.pixels, model);
        columns = contributions(fit.pixels);
    }
    Normal covariance = columns.variance_ratio() * variance * inverse;
    if (are_lines_removed) // their errors move the edge
        for (const std::size_t side : {0U, 1U}) {
            LightLines error;
            error[side].slope_per_px = std::sqrt(fit.lines[side].slope_variance);
            const Vector change = change_without(error, model, fit.pixels, inverse);
            covariance += change * change.t();
        }
    const double pivot_px = -covariance(0, 1) / covariance(1, 1);
    return {pivot_px,           model.offset_px + model.turn * pivot_px,
            model.turn,         covariance(0, 0) + pivot_px * covariance(0, 1),
            covariance(1, 1),   model.blur_px,
            columns.correlation};
}

} // namespace

std::optional<BlurredEdge> fit_blurred_edge(std::span<const EdgePixel> edge_pixels, double blur_px) {
    constexpr int max_fits = 5;
    constexpr double max_change = 0.6; // relative to the contrast, from the middle to an end of the edge
    std::vector<Pixel> pixels;
    pixels.reserve(edge_pixels.size());
    double half_length_px = 0;
    for (const EdgePixel &pixel : edge_pixels) {
        pixels.push_back({pixel});
        half_length_px = std::max(half_length_px, std::abs(pixel.along_px));
    }
    std::optional<Fit> fit;
    for (int i = 0; i < max_fits; ++i) {
        fit = fit_model(pixels, half_length_px, blur_px, fit ? &*fit : nullptr);
        if (!fit)
            return std::nullopt;
        const Model &model = fit->model;
        const double light = std::max(model.before, model.before + model.contrast);
        const auto is_clear = [&](const LightLine &line) { return line.is_clear(half_length_px, light); };
        if (std::ranges::none_of(fit->lines, is_clear))
            return edge_of(*fit, i > 0);
        const double change = fit->lines[1].slope_per_px - fit->lines[0].slope_per_px; // relative to the contrast
        if (!(std::abs(change) * half_length_px < max_change * std::abs(model.contrast)))
            return std::nullopt;
        for (Pixel &pixel : pixels)
            pixel.light = light_without(fit->lines, model, pixel);
    }
    return std::nullopt;
}

} // namespace arhost::fiducial
