// SPDX-License-Identifier: Apache-2.0
#include "desk.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/imgproc.hpp>
#include <turbojpeg.h>

#include <memory>
#include <sstream>
#include <vector>

// The texture atlas of the desk: four square images, one below the other. They have the same centre on the desk, and
// each covers twice the width of the image above it. The middle of each lower image is therefore not needed and may
// hold other data: the second image holds the colour of the card, and the third image holds the coverage of the card.
asm(".section .rodata\n"
    "desk_jpeg: .incbin \"" DESK_JPEG "\"\n"
    "desk_jpeg_end:\n"
    ".previous");
extern "C" [[gnu::visibility("hidden")]] const unsigned char desk_jpeg[], desk_jpeg_end[];

namespace arhost::synthetic {
namespace {

constexpr float atlas_texel = 0.25f; // texel size of the first image
constexpr float card_texel = 0.5f;
constexpr int ink_permille = 175; // sRGB code of the ink relative to that of the paper

cv::Mat load_atlas() {
    const std::unique_ptr<void, int (*)(void *)> decoder(tjInitDecompress(), tjDestroy);
    const auto size = static_cast<unsigned long>(desk_jpeg_end - desk_jpeg);
    int width = 0, height = 0, subsampling = 0, colours = 0;
    tjDecompressHeader3(decoder.get(), desk_jpeg, size, &width, &height, &subsampling, &colours);
    cv::Mat atlas(height, width, CV_8UC4);
    if (tjDecompress2(decoder.get(), desk_jpeg, size, atlas.data, width, 0, height, TJPF_RGBA, TJFLAG_ACCURATEDCT) !=
        0)
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL,
                      "cannot decode the desk's texture: " + std::string(tjGetErrorStr2(decoder.get())));
    return atlas;
}

cv::Mat centre(const cv::Mat &image, int side) {
    return image(cv::Rect((image.cols - side) / 2, (image.rows - side) / 2, side, side));
}

// Computes the fourth channel, the gloss of the varnish, from the colour: only varnished wood is red enough.
void add_gloss(cv::Mat &image) {
    std::vector<cv::Mat> rgba;
    cv::split(image, rgba);
    cv::addWeighted(rgba[0], 16, rgba[1], -16 * 1.15, 0, rgba[3]);
    rgba[3] = cv::min(rgba[3], 210);
    cv::merge(rgba, image);
}

void print_caption(const MarkerSheet &sheet, cv::Mat &image) {
    constexpr double px_per_mm = 1 / atlas_texel;
    const auto print = [&](const std::string &text, double y_mm, double capital_mm, int pen_px) {
        const cv::Point2d at(-60, y_mm); // relative to the marker's centre, y up
        const cv::Point px(image.cols / 2 + cvRound(at.x * px_per_mm), image.rows / 2 - cvRound(at.y * px_per_mm));
        constexpr double capital_px = 21; // height of a capital letter of the font at scale 1
        cv::putText(image, text, px, cv::FONT_HERSHEY_DUPLEX, capital_mm * px_per_mm / capital_px,
                    cv::Scalar(45, 44, 45), pen_px, cv::LINE_AA);
    };
    print(sheet.family + "  " + std::to_string(sheet.id), 62, 4.4, 2);
    std::ostringstream side;
    side << "side " << sheet.side_mm << " mm";
    print(side.str(), 50.5, 2, 1);
}

// Draws the marker in the middle of `image`. Each texel is the exact mean of the cells that cover it, weighted by
// area.
void print_marker(const cv::Mat &cells, cv::Mat &image, float texel) {
    const int side = static_cast<int>(marker_side / texel), cell_px = side / cells.cols + 1;
    cv::Mat white, paper = centre(image, side);
    cv::resize(cells, white, {}, cell_px, cell_px, cv::INTER_NEAREST);
    cv::resize(white, white, {side, side}, 0, 0, cv::INTER_AREA);
    // Uses integers, because OpenCV rounds products of floats differently on different instruction sets.
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const int factor = ink_permille * 255 + (1000 - ink_permille) * white.at<std::uint8_t>(y, x);
            for (int c = 0; c < 4; ++c) {
                std::uint8_t &code = paper.at<cv::Vec4b>(y, x)[c];
                code = static_cast<std::uint8_t>((code * factor + 127'500) / 255'000);
            }
        }
}

// Position of the window relative to the marker. The window is an upright rectangle in a wall.
constexpr Point window_at{-640, 702};
constexpr Point into_window{-0.674f, 0.739f}, along_window{0.739f, 0.674f};
constexpr float window_bottom = 240, window_top = 1180, window_half_width = 400;

} // namespace

DeskTextures make_desk(const MarkerSheet &sheet) {
    const cv::Mat atlas = load_atlas();
    const int side = atlas.cols;
    std::vector<cv::Mat> clips(1);
    for (int row = 0; row < atlas.rows; row += side)
        clips.push_back(atlas.rowRange(row, row + side));

    std::vector<cv::Mat> card;
    cv::split(centre(clips[2], side / 2), card);
    cv::extractChannel(centre(clips[3], side / 2), card[3], 0);
    cv::Mat card_image;
    cv::merge(card, card_image);

    for (auto clip = clips.begin() + 1; clip != clips.end(); ++clip)
        add_gloss(*clip);
    print_caption(sheet, clips[1]);
    // Adds a finer level that covers only the marker and its surroundings.
    cv::resize(centre(clips[1], side / 2), clips[0], {side, side}, 0, 0, cv::INTER_CUBIC);
    print_marker(sheet.cells, clips[0], atlas_texel / 2);
    return {Pyramid(clips, atlas_texel / 2), Pyramid(std::span(&card_image, 1), card_texel)};
}

float reflected_light(Point at, Vec3 view) {
    const float cosine = std::max(-view.z, 0.0f), grazing = 1 - cosine;
    const float fresnel = 0.04f + 0.96f * grazing * grazing * grazing * grazing * grazing; // Schlick, n = 1.5
    const Point out{view.x, view.y}; // the reflected direction is (view.x, view.y, −view.z)
    float light = 0.28f;             // light that the room reflects
    if (const float approach = dot(out, into_window); approach > 1e-3f) {
        const float s = dot(window_at - at, into_window) / approach; // distance to the window's plane
        const float side = dot(at + out * s - window_at, along_window), height = -view.z * s;
        const float blur = 25 + 0.055f * s; // the varnish is not a perfect mirror
        const auto between = [&](float x, float low, float high) {
            return smoothstep(low - blur, low + blur, x) * smoothstep(high + blur, high - blur, x);
        };
        constexpr float bar = 38, crossbar_height = 840;
        const float panes = between(side, -window_half_width, -bar) + between(side, bar, window_half_width);
        const float crossbar = 1 - between(height, crossbar_height - bar, crossbar_height + bar);
        light += 4.6f * panes * between(height, window_bottom, window_top) * crossbar;
    }
    return fresnel * light;
}

} // namespace arhost::synthetic
