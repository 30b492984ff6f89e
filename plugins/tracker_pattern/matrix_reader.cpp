// SPDX-License-Identifier: Apache-2.0
#include "matrix_reader.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <bit>
#include <string>

namespace tracker_pattern {

using arhost::fiducial::MatrixFamily;

namespace {

constexpr double min_correlation = 0.8; // correlation of the samples with the code's picture

} // namespace

void MatrixReader::add(const MatrixFamily &type, std::int32_t id, std::uint32_t family) {
    Code code{&type, id, family, type.word(static_cast<std::uint32_t>(id)), {}};
    if (const auto twin = std::ranges::find(codes_, code.word, &Code::word); twin != codes_.end())
        throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, std::string("the markers ") + twin->type->name +
                                                                     "-" + std::to_string(twin->id) + " and " +
                                                                     type.name + "-" + std::to_string(id) +
                                                                     " look the same; use the markers of one family");
    code.picture = picture_of(type, id);
    codes_.push_back(code);
}

// Returns the samples that an ideal image of the marker would have.
Samples MatrixReader::picture_of(const MatrixFamily &type, std::int32_t id) const {
    Samples cells(cells_ + 2, cells_ + 2, 0.0F);
    const std::vector<bool> black = arhost::fiducial::matrix_cells(type, id);
    for (int i = 0; i < cells_ * cells_; ++i)
        cells(1 + i / cells_, 1 + i % cells_) = black[static_cast<std::size_t>(i)] ? 0 : 255;
    Samples picture;
    cv::resize(cells, picture, {side(), side()}, 0, 0, cv::INTER_NEAREST);
    return normalized(picture);
}

// Returns std::nullopt if some cells are neither clearly black nor clearly white, or if the border is not black.
std::optional<std::vector<bool>> MatrixReader::black_cells(const Samples &samples) const {
    constexpr float min_contrast = 20;    // grey levels
    constexpr float min_distance = 0.15F; // distance from the threshold, relative to the contrast
    Samples centres(cells_ + 2, cells_ + 2);
    for (int row = 0; row < centres.rows; ++row)
        for (int column = 0; column < centres.cols; ++column)
            centres(row, column) = samples(row * samples_per_cell + samples_per_cell / 2,
                                           column * samples_per_cell + samples_per_cell / 2);
    double darkest = 0, brightest = 0;
    cv::minMaxLoc(centres, &darkest, &brightest);
    const auto contrast = static_cast<float>(brightest - darkest),
               threshold = static_cast<float>(darkest) + contrast / 2;
    if (contrast < min_contrast)
        return std::nullopt;
    std::vector<bool> black;
    for (int row = 0; row < centres.rows; ++row)
        for (int column = 0; column < centres.cols; ++column) {
            const float value = centres(row, column);
            if (std::abs(value - threshold) < min_distance * contrast)
                return std::nullopt;
            if (row % (cells_ + 1) != 0 && column % (cells_ + 1) != 0)
                black.push_back(value < threshold);
            else if (value > threshold)
                return std::nullopt;
        }
    return black;
}

std::optional<MatrixReader::Reading> MatrixReader::read(const Samples &samples) const {
    Samples upright = samples;
    for (int turns = 0; turns < 4; ++turns) {
        const auto black = black_cells(upright);
        if (!black)
            return std::nullopt;
        if (const auto word = arhost::fiducial::matrix_word(*black, cells_)) { // no other orientation fits
            const Samples picture = normalized(upright);
            return picture.empty() ? std::nullopt : std::optional(Reading{*word, turns, picture});
        }
        Samples turned;
        cv::rotate(upright, turned, cv::ROTATE_90_COUNTERCLOCKWISE);
        upright = turned;
    }
    return std::nullopt;
}

std::optional<MatrixReader::Match> MatrixReader::match(const Samples &samples) const {
    const auto reading = read(samples);
    if (!reading)
        return std::nullopt;
    std::optional<Match> best;
    for (const Code &code : codes_)
        if (const int wrong = std::popcount(code.word ^ reading->word);
            wrong <= code.type->corrects && (!best || wrong < best->wrong_cells))
            best = {code.id, code.family, wrong, reading->upright.dot(code.picture), reading->quarter_turns};
    return best && best->correlation >= min_correlation ? best : std::nullopt;
}

std::vector<MatrixReader::AnyCode> MatrixReader::codes(const Samples &samples) const {
    std::vector<AnyCode> codes;
    const auto reading = read(samples);
    if (!reading)
        return codes;
    for (const MatrixFamily &type : arhost::fiducial::matrix_families()) {
        const auto id = type.side == cells_ ? arhost::fiducial::matrix_id(type, reading->word) : std::nullopt;
        const double correlation = id ? reading->upright.dot(picture_of(type, *id)) : 0;
        if (correlation >= min_correlation)
            codes.push_back({&type, *id, correlation});
    }
    return codes;
}

} // namespace tracker_pattern
