// SPDX-License-Identifier: Apache-2.0
#include "source_under_test.hpp"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>

namespace fs = std::filesystem;
using arhost::test::ScratchFolder;
using arhost::test::shared_data;
using arhost::test::SourceFrame;
using arhost::test::SourceUnderTest;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;
using Options = std::map<std::string, std::string>;

namespace {

Bytes bytes_of(const fs::path &file) {
    std::ifstream stream(file, std::ios::binary);
    return Bytes(std::istreambuf_iterator<char>(stream), {});
}

void write_bytes(const fs::path &file, const Bytes &bytes) {
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

Bytes bytes_of(const cv::Mat &image) {
    Bytes bytes;
    for (int y = 0; y < image.rows; ++y)
        bytes.insert(bytes.end(), image.ptr(y), image.ptr(y) + image.cols * static_cast<int>(image.elemSize()));
    return bytes;
}

// Runs ffmpeg in `folder`. The shell splits `arguments`, so they must not need quoting.
void ffmpeg(const fs::path &folder, const std::string &arguments) {
    const std::string command = "cd '" + folder.string() + "' && " ARHOST_FFMPEG " -nostdin -v error -y " + arguments;
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
}

// Decodes a file with the ffmpeg command and returns its frames.
std::vector<Bytes> reference_frames(const fs::path &file, const std::string &pixel_format, std::size_t frame_bytes) {
    const fs::path raw = file.string() + ".raw";
    ffmpeg(file.parent_path(), "-noautorotate -i " + file.filename().string() +
                                   " -vsync passthrough -f rawvideo -pix_fmt " + pixel_format + " " +
                                   raw.filename().string());
    const Bytes all = bytes_of(raw);
    EXPECT_EQ(all.size() % frame_bytes, 0u);
    std::vector<Bytes> frames;
    for (std::size_t at = 0; at + frame_bytes <= all.size(); at += frame_bytes)
        frames.emplace_back(all.begin() + static_cast<std::ptrdiff_t>(at),
                            all.begin() + static_cast<std::ptrdiff_t>(at + frame_bytes));
    return frames;
}

cv::Mat colourful(int width, int height, int seed = 0) {
    cv::Mat image(height, width, CV_8UC3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<uchar>(7 * x + 31 * seed), static_cast<uchar>(5 * y),
                                                  static_cast<uchar>(x * y + seed));
    return image;
}

std::string four_digits(std::uint64_t number) {
    const std::string digits = std::to_string(number);
    return std::string(4 - digits.size(), '0') + digits;
}

class InFolder : public testing::Test {
protected:
    // Writes one image for each of `numbers`. Image n is the result of colourful() with the seed n.
    void write_images(const std::vector<int> &numbers, int width = 48, int height = 32) const {
        for (const int n : numbers)
            ASSERT_TRUE(cv::imwrite(path("image_" + four_digits(static_cast<std::uint64_t>(n)) + ".png"),
                                    colourful(width, height, n)));
    }
    // The options for a file in the folder.
    Options file(const std::string &name, Options more = {}) const {
        more["path"] = path(name);
        return more;
    }
    // The options for the numbered images in the folder.
    Options images(const Options &more = {}) const { return file("image_%04d.png", more); }
    fs::path path(const std::string &name) const { return folder_.path() / name; }

    ScratchFolder folder_;
};
class ImageSequence : public InFolder {};
class SingleImage : public InFolder {};
class Rejection : public InFolder {};
class Paced : public InFolder {};
class Video : public testing::Test {
protected:
    void SetUp() override { ARHOST_REQUIRE_FFMPEG(); }
};

// Checks that the source rejects its configuration with one error message that contains all of `words`.
void expect_rejection(const Options &options, const std::vector<std::string> &words, arhost_source_setup setup = {}) {
    const std::string errors =
        SourceUnderTest::rejection("source_file", options, ARHOST_STATUS_ERROR_CONFIGURATION, setup);
    for (const std::string &word : words)
        EXPECT_THAT(errors, HasSubstr(word));
}

arhost_source_setup from(std::uint64_t sequence) {
    arhost_source_setup setup{};
    setup.first_sequence = sequence;
    return setup;
}
arhost_source_setup at_rate(double fps) {
    return arhost::test::source_setup(fps, false);
}
arhost_source_setup paced(double fps) {
    return arhost::test::source_setup(fps, true);
}

// A short video in a scratch folder.
class VideoFile {
public:
    // `format` contains the ffmpeg options for the output file; `picture` names the lavfi source of the pictures.
    VideoFile(const std::string &name, const std::string &format, const std::string &size = "96x64", int frames = 40,
              const std::string &picture = "testsrc2")
        : file_(folder_.path() / name) {
        ffmpeg(folder_.path(), "-f lavfi -i " + picture + (picture.find('=') == std::string::npos ? "=" : ":") +
                                   "size=" + size + ":rate=25 -frames:v " + std::to_string(frames) + " " + format +
                                   " " + name);
    }
    const fs::path &file() const { return file_; }
    const fs::path &folder() const { return folder_.path(); }
    Options options() const { return {{"path", file_.string()}}; }

private:
    ScratchFolder folder_;
    fs::path file_;
};

const char *const h264 = "-c:v libx264 -preset veryfast -g 12 -bf 2 -pix_fmt yuv420p";

} // namespace

// ---- Images ----------------------------------------------------------------------------------------

TEST_F(ImageSequence, MatchesOpenCvByteForByteOnARealSequence) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    const fs::path folder = shared_data("markers/rbt_sequence");
    SourceUnderTest source("source_file", {{"path", folder / "color_image_%04d.png"}});
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
    EXPECT_EQ(source.format().width, 640u);
    EXPECT_EQ(source.format().height, 480u);
    EXPECT_EQ(source.format().fps, 30.0);
    EXPECT_EQ(source.properties().frame_count, 40u);
    for (std::uint64_t n = 0; n < 40; ++n) {
        const SourceFrame frame = source.read_frame(n);
        ASSERT_EQ(frame.bytes, bytes_of(cv::imread(folder / ("color_image_" + four_digits(n) + ".png"))));
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MEDIA);
        EXPECT_EQ(frame.info.capture_ns, std::llround(static_cast<double>(n) * 1e9 / 30));
    }
    EXPECT_EQ(source.read(40).status, ARHOST_STATUS_END);
    EXPECT_EQ(source.read(40).status, ARHOST_STATUS_END);
}

TEST_F(ImageSequence, StartsAtTheLowestNumberOrTheOptionStart) {
    write_images({1, 2, 3, 4});
    SourceUnderTest source("source_file", images());
    EXPECT_EQ(source.properties().frame_count, 4u);
    EXPECT_EQ(source.read(0).bytes, bytes_of(colourful(48, 32, 1)));
    ASSERT_EQ(source.start(images({{"start", "3"}})), ARHOST_STATUS_OK) << source.log();
    EXPECT_EQ(source.properties().frame_count, 2u);
    EXPECT_EQ(source.read(0).bytes, bytes_of(colourful(48, 32, 3)));
}

TEST_F(ImageSequence, EndsBeforeAMissingFileWithAWarning) {
    write_images({0, 1, 2, 5});
    SourceUnderTest source("source_file", images());
    EXPECT_EQ(source.read_all().size(), 4u); // 3 frames and the end status
    EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING), HasSubstr("image_0003.png' is missing"));
    EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING), HasSubstr("up to 5"));
}

TEST_F(ImageSequence, UsesTheConfiguredRate) {
    write_images({0, 1, 2});
    SourceUnderTest source("source_file", images(), at_rate(8));
    EXPECT_EQ(source.format().fps, 8.0);
    EXPECT_EQ(source.read(2).info.capture_ns, 250'000'000);
}

TEST_F(ImageSequence, RejectsAChangedSizeAndNamesTheFile) {
    write_images({0, 1});
    write_images({2}, 50, 32);
    SourceUnderTest source("source_file", images());
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_OK);
    EXPECT_EQ(source.read(2).status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr("image_0002.png' is 50×32"));
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr("image_0000.png' is 48×32"));
}

TEST_F(ImageSequence, FirstImageDeterminesGreyOrColour) {
    cv::Mat grey(32, 48, CV_8UC1, cv::Scalar(77));
    cv::imwrite(path("image_0000.png"), grey);
    write_images({1});
    SourceUnderTest source("source_file", images());
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    EXPECT_EQ(source.read(0).bytes, bytes_of(grey));
    EXPECT_EQ(source.read(1).bytes, bytes_of(cv::imread(path("image_0001.png"), cv::IMREAD_GRAYSCALE)));
}

TEST_F(ImageSequence, NamesADamagedImage) {
    write_images({0, 1, 2});
    fs::resize_file(path("image_0001.png"), fs::file_size(path("image_0001.png")) / 2);
    write_bytes(path("image_0002.png"), {});
    SourceUnderTest source("source_file", images());
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr("image_0001.png' cannot be read: damaged"));
    EXPECT_EQ(source.read(2).status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr("image_0002.png' cannot be read: the file is empty"));
}

TEST_F(ImageSequence, DeliversAnyFrameAfterARestart) {
    write_images({0, 1, 2, 3, 4});
    SourceUnderTest source("source_file", images(), from(3));
    EXPECT_EQ(source.read(3).bytes, bytes_of(colourful(48, 32, 3)));
    EXPECT_EQ(source.read(1).bytes, bytes_of(colourful(48, 32, 1)));
    ASSERT_EQ(source.start(images(), from(5)), ARHOST_STATUS_OK);
    EXPECT_EQ(source.read(5).status, ARHOST_STATUS_END);
}

TEST_F(ImageSequence, LoopsAndStopsAtTheLimit) {
    write_images({0, 1, 2});
    SourceUnderTest source("source_file", images({{"loop", "true"}, {"frames", "7"}}));
    EXPECT_EQ(source.properties().frame_count, 7u);
    const auto frames = source.read_all();
    ASSERT_EQ(frames.size(), 8u);
    EXPECT_EQ(frames[7].status, ARHOST_STATUS_END);
    for (std::size_t n = 0; n < 7; ++n) {
        EXPECT_EQ(frames[n].bytes, bytes_of(colourful(48, 32, static_cast<int>(n % 3))));
        EXPECT_EQ(frames[n].info.capture_ns, std::llround(static_cast<double>(n) * 1e9 / 30));
    }
    ASSERT_EQ(source.start(images({{"loop", "true"}})), ARHOST_STATUS_OK);
    EXPECT_EQ(source.properties().frame_count, 0u) << "a loop has no end";
    ASSERT_EQ(source.start(images({{"frames", "2"}})), ARHOST_STATUS_OK);
    EXPECT_EQ(source.properties().frame_count, 2u);
    EXPECT_EQ(source.read_all().size(), 3u);
}

TEST_F(SingleImage, IsDeliveredOnceOrFramesTimes) {
    const std::string name = "100%.png"; // the name of an existing file is not parsed as a pattern
    cv::imwrite(path(name), colourful(33, 21));
    SourceUnderTest source("source_file", file(name));
    EXPECT_EQ(source.properties().frame_count, 1u);
    EXPECT_EQ(source.read(0).bytes, bytes_of(colourful(33, 21)));
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_END);
    ASSERT_EQ(source.start(file(name, {{"frames", "3"}})), ARHOST_STATUS_OK);
    EXPECT_EQ(source.properties().frame_count, 3u);
    EXPECT_EQ(source.read(2).bytes, bytes_of(colourful(33, 21)));
    EXPECT_EQ(source.read(3).status, ARHOST_STATUS_END);
    ASSERT_EQ(source.start(file(name, {{"loop", "true"}})), ARHOST_STATUS_OK);
    EXPECT_EQ(source.properties().frame_count, 0u);
    EXPECT_EQ(source.read(100'000).status, ARHOST_STATUS_OK);
}

TEST_F(SingleImage, ConvertsSixteenBitsToEightAndDropsAlpha) {
    SourceUnderTest source("source_file");

    cv::Mat deep(4, 6, CV_16UC1);
    for (int i = 0; i < 24; ++i)
        deep.at<std::uint16_t>(i / 6, i % 6) = static_cast<std::uint16_t>(i * 2849);
    cv::imwrite(path("deep.png"), deep);
    ASSERT_EQ(source.start(file("deep.png")), ARHOST_STATUS_OK);
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    const Bytes grey = source.read(0).bytes;
    for (std::size_t i = 0; i < 24; ++i)
        EXPECT_NEAR(grey.at(i), static_cast<double>(i) * 2849 / 257, 1);

    const cv::Mat colour = colourful(6, 4);
    cv::Mat with_alpha(4, 6, CV_8UC4);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 6; ++x) {
            const auto c = colour.at<cv::Vec3b>(y, x);
            with_alpha.at<cv::Vec4b>(y, x) = cv::Vec4b(c[0], c[1], c[2], static_cast<uchar>(20 * x));
        }
    cv::imwrite(path("alpha.png"), with_alpha);
    ASSERT_EQ(source.start(file("alpha.png")), ARHOST_STATUS_OK);
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
    EXPECT_EQ(source.read(0).bytes, bytes_of(colour));
}

// OpenCV ignores this orientation. The test adds it to a file without metadata (WebP Container Specification).
TEST_F(SingleImage, AppliesTheExifOrientationOfWebP) {
    const auto number = [](std::uint32_t value, int size) {
        std::string bytes;
        for (int i = 0; i < size; ++i)
            bytes += static_cast<char>(value >> 8 * i);
        return bytes;
    };
    const auto chunk = [&](const std::string &name, const std::string &content) {
        return name + number(static_cast<std::uint32_t>(content.size()), 4) + content +
               std::string(content.size() % 2, '\0');
    };
    const cv::Mat upright = colourful(6, 4);
    for (int orientation = 1; orientation <= 8; ++orientation) {
        // The stored image, from the upright one: the inverse of what the orientation demands.
        cv::Mat stored = upright.clone();
        if (orientation == 2 || orientation == 7 || orientation == 3 || orientation == 6)
            cv::flip(stored, stored, orientation == 3 || orientation == 7 ? -1 : 1);
        if (orientation == 4 || orientation == 8)
            cv::flip(stored, stored, 0);
        if (orientation >= 5)
            cv::transpose(stored, stored);
        std::vector<uchar> encoded;
        cv::imencode(".webp", stored, encoded, {cv::IMWRITE_WEBP_QUALITY, 101}); // lossless
        const std::string exif = std::string("II*\0", 4) + number(8, 4) + number(1, 2) + number(0x112, 2) +
                                 number(3, 2) + number(1, 4) + number(static_cast<std::uint32_t>(orientation), 4) +
                                 number(0, 4);
        const std::string extended = number(8, 4) + number(static_cast<std::uint32_t>(stored.cols - 1), 3) +
                                     number(static_cast<std::uint32_t>(stored.rows - 1), 3); // 8: has Exif
        const std::string content =
            "WEBP" + chunk("VP8X", extended) + std::string(encoded.begin() + 12, encoded.end()) + chunk("EXIF", exif);
        std::ofstream(path("a.webp"), std::ios::binary) << chunk("RIFF", content);
        SourceUnderTest source("source_file");
        ASSERT_EQ(source.start(file("a.webp")), ARHOST_STATUS_OK) << source.log();
        EXPECT_EQ(source.read(0).bytes, bytes_of(upright)) << "orientation " << orientation;
    }
}

// ---- Unreadable input ------------------------------------------------------------------------------

TEST_F(Rejection, NamesAMissingFileAndListsTheFolder) {
    write_images({0});
    expect_rejection(file("video.mp4"), {"video.mp4' cannot be opened", "image_0000.png"});
    expect_rejection({{"path", "/nowhere/video.mp4"}}, {"'/nowhere/video.mp4'"});
}

TEST_F(Rejection, NamesTheFirstNumberedFileAndListsTheFolder) {
    expect_rejection(images(), {"no file matches", "looked for", "image_0000.png' first", "is empty"});
    write_bytes(path("image_1.png"), {});    // too few digits for %04d
    write_bytes(path("image_-001.png"), {}); // no sign is allowed
    write_bytes(path("notes.txt"), {});
    expect_rejection(images(), {"has 3 entries", "image_1.png", "notes.txt"});
    write_images({3, 4});
    expect_rejection(images({{"start", "0"}}),
                     {"image_0000.png' first", "2 matching files, with numbers from 3 to 4", "'start'"});
    expect_rejection({{"path", "/nowhere/image_%d.png"}}, {"/nowhere/image_0.png", "cannot be listed"});
}

TEST_F(Rejection, AllowsOneDecimalNumberInANumberedName) {
    for (const char *name : {"a_%s.png", "a_%n.png", "a_%4d.png", "a_%04x.png", "a_%00d.png", "a_%099d.png",
                             "a_%-4d.png", "a_%*d.png", "a_%ld.png", "a_%", "a_%04", "a_%1$d.png"})
        expect_rejection({{"path", std::string("/frames/") + name}}, {name, "is not %d or %0Nd", "%05d"});
    expect_rejection({{"path", "/frames/a_%d_%d.png"}}, {"a second number, '%d'"});
    expect_rejection({{"path", "/frames/%d/a.png"}}, {"there is no %d"});
    expect_rejection({{"path", "/frames/100%%.png"}}, {"there is no %d"});
}

TEST_F(Rejection, NumberedNamesMayHavePercentSignsAndVaryingDigits) {
    cv::imwrite(path("50%_9.png"), colourful(8, 8, 9));
    cv::imwrite(path("50%_10.png"), colourful(8, 8, 10));
    SourceUnderTest source("source_file", file("50%%_%d.png"));
    EXPECT_EQ(source.properties().frame_count, 2u);
    EXPECT_EQ(source.read(1).bytes, bytes_of(colourful(8, 8, 10)));
}

TEST_F(Rejection, ReportsAFolder) {
    write_images({0});
    expect_rejection(file(""), {"is a folder", "image_%04d.png", "image_0000.png"});
    expect_rejection({{"path", "/dev/null"}}, {"is not a regular file"});
}

TEST_F(Rejection, ReportsEmptyAndInvalidFilesOnce) {
    Bytes garbage(20'000);
    std::uint32_t random = 1;
    for (std::uint8_t &byte : garbage)
        byte = static_cast<std::uint8_t>((random = random * 1664525u + 1013904223u) >> 24);
    for (const char *name : {"video.mp4", "video.avi", "video"}) {
        write_bytes(path(name), {});
        expect_rejection(file(name), {name, "cannot be read"});
        write_bytes(path(name), garbage);
        expect_rejection(file(name), {name, "cannot be read"});
    }
    write_bytes(path("image.png"), garbage);
    expect_rejection(file("image.png"), {"image.png' cannot be read"});
}

TEST_F(Rejection, ReportsMissingPermission) {
    write_bytes(path("video.mp4"), {1, 2, 3});
    fs::permissions(path("video.mp4"), fs::perms::none);
    fs::permissions(folder_.path(), fs::perms::all);
    const bool root = geteuid() == 0;
    ASSERT_EQ(seteuid(root ? 65534 : geteuid()), 0); // permissions do not limit root
    expect_rejection(file("video.mp4"), {"video.mp4", "Permission denied"});
    ASSERT_EQ(seteuid(root ? 0 : geteuid()), 0);
}

TEST_F(Rejection, ReportsAFileWithoutVideo) {
    ARHOST_REQUIRE_FFMPEG();
    ffmpeg(folder_.path(), "-f lavfi -i sine=duration=0.2 tone.wav");
    expect_rejection(file("tone.wav"), {"tone.wav", "no video stream"});
}

TEST_F(Rejection, ReportsAnUnknownCodec) {
    ARHOST_REQUIRE_FFMPEG();
    const VideoFile video("video.avi", "-c:v mpeg4");
    Bytes bytes = bytes_of(video.file());
    const std::string fourcc = "FMP4", unknown = "QQQQ";
    for (auto at = bytes.begin(); (at = std::search(at, bytes.end(), fourcc.begin(), fourcc.end())) != bytes.end();)
        at = std::copy(unknown.begin(), unknown.end(), at);
    write_bytes(video.file(), bytes);
    expect_rejection(video.options(), {"video.avi", "no decoder"});
}

TEST_F(Rejection, ReportsACameraOfAnotherSize) {
    write_images({0});
    const arhost_intrinsics camera = arhost::test::intrinsics_of_size(640, 480);
    arhost_source_setup setup{};
    setup.intrinsics = &camera;
    expect_rejection(images(), {"48×32", "calibration is for 640×480"}, setup);
}

// ---- Videos ----------------------------------------------------------------------------------------

TEST_F(Video, PassesPlanarYuvUnchanged) {
    struct Case {
        const char *name, *codec;
        arhost_yuv_range range;
        arhost_yuv_matrix matrix;
    };
    const std::string tagged = std::string(h264) + " -colorspace bt709 -color_primaries bt709 -color_trc bt709";
    for (const Case &c :
         {Case{"a.mp4", h264, ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_MATRIX_BT601},
          Case{"b.mp4", tagged.c_str(), ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_MATRIX_BT709},
          Case{"c.mp4", "-c:v mpeg4 -q:v 3", ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_MATRIX_BT601},
          Case{"d.avi", "-c:v mjpeg -q:v 3 -pix_fmt yuvj420p", ARHOST_YUV_RANGE_FULL, ARHOST_YUV_MATRIX_BT601}}) {
        SCOPED_TRACE(c.name);
        const VideoFile video(c.name, c.codec);
        SourceUnderTest source("source_file", video.options());
        EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
        EXPECT_EQ(source.format().yuv_matrix, c.matrix);
        EXPECT_EQ(source.format().yuv_range, c.range);
        EXPECT_EQ(source.format().fps, 25.0);
        EXPECT_EQ(source.properties().frame_count, 40u);
        const auto expected = reference_frames(
            video.file(), c.range == ARHOST_YUV_RANGE_FULL ? "yuvj420p" : "yuv420p", 96 * 64 * 3 / 2);
        const auto frames = source.read_all();
        ASSERT_EQ(frames.size(), 41u);
        ASSERT_EQ(expected.size(), 40u);
        for (std::size_t n = 0; n < 40; ++n) {
            ASSERT_EQ(frames[n].bytes, expected[n]) << "frame " << n;
            EXPECT_EQ(frames[n].info.capture_ns, static_cast<std::int64_t>(n) * 40'000'000);
            EXPECT_EQ(frames[n].info.clock, ARHOST_CLOCK_MEDIA);
        }
        EXPECT_EQ(frames[40].status, ARHOST_STATUS_END);
        EXPECT_EQ(source.read(40).status, ARHOST_STATUS_END);
        EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
        EXPECT_EQ(source.log(ARHOST_SEVERITY_ERROR), "");
    }
}

TEST_F(Video, GuessesBt709ForUntaggedHighDefinition) {
    const VideoFile video("hd.mp4", h264, "1280x720", 2);
    SourceUnderTest source("source_file", video.options());
    EXPECT_EQ(source.format().yuv_matrix, ARHOST_YUV_MATRIX_BT709);
}

TEST_F(Video, GreyStaysGrey) {
    const VideoFile video("grey.mkv", "-vf scale=33:21 -c:v ffv1 -pix_fmt gray", "96x64", 5);
    SourceUnderTest source("source_file", video.options());
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    const auto expected = reference_frames(video.file(), "gray", 33 * 21);
    ASSERT_EQ(expected.size(), 5u);
    for (std::size_t n = 0; n < 5; ++n)
        EXPECT_EQ(source.read(n).bytes, expected[n]);
}

TEST_F(Video, GreyOfLimitedRangeIsExpanded) {
    const VideoFile video("grey.mkv", "-c:v ffv1 -pix_fmt gray -color_range tv", "64x48", 1);
    SourceUnderTest source("source_file", video.options());
    ASSERT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    const Bytes stored = reference_frames(video.file(), "gray", 64 * 48).at(0);
    const Bytes given = source.read(0).bytes;
    for (std::size_t i = 0; i < given.size(); ++i)
        ASSERT_NEAR(given[i], std::clamp((stored[i] - 16) * 255.0 / 219, 0.0, 255.0), 0.51);
}

TEST_F(Video, OddSizesAndOtherFormatsBecomeBgrWithCorrectColours) {
    struct Case {
        const char *name, *codec, *size;
        int w, h;
    };
    for (const Case &c :
         {Case{"odd.mkv", "-vf scale=97:65 -c:v ffv1 -pix_fmt yuv420p", "96x64", 97, 65},
          Case{"full.mkv", "-c:v ffv1 -pix_fmt yuv444p", "96x64", 96, 64},
          Case{"deep.mkv", "-vf scale=out_color_matrix=bt709 -c:v ffv1 -pix_fmt yuv420p10le -colorspace bt709",
               "96x64", 96, 64},
          Case{"rgb.mkv", "-c:v ffv1 -pix_fmt bgr0", "96x64", 96, 64}}) {
        SCOPED_TRACE(c.name);
        // The picture has one colour, so the scaler's filter and the chroma siting do not affect it.
        const VideoFile video(c.name, c.codec, c.size, 1, "color=c=0xC86432");
        SourceUnderTest source("source_file", video.options());
        ASSERT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
        EXPECT_EQ(source.format().width, static_cast<unsigned>(c.w));
        EXPECT_EQ(source.format().height, static_cast<unsigned>(c.h));
        const Bytes frame = source.read(0).bytes;
        ASSERT_EQ(frame.size(), static_cast<std::size_t>(c.w * c.h * 3));
        for (std::size_t i = 0; i < frame.size(); i += 3) {
            ASSERT_NEAR(frame[i], 0x32, 2) << "pixel " << i / 3;
            ASSERT_NEAR(frame[i + 1], 0x64, 2);
            ASSERT_NEAR(frame[i + 2], 0xC8, 2);
        }
    }
}

TEST_F(Video, RgbIsLossless) {
    const VideoFile video("rgb.mkv", "-c:v ffv1 -pix_fmt bgr0", "50x30", 3);
    SourceUnderTest source("source_file", video.options());
    const auto expected = reference_frames(video.file(), "bgr24", 50 * 30 * 3);
    for (std::size_t n = 0; n < 3; ++n)
        EXPECT_EQ(source.read(n).bytes, expected.at(n));
}

// Compares the frames with those that the ffmpeg command rotates.
TEST_F(Video, AppliesTheRotationOfItsMetadata) {
    for (const char *codec : {"-c:v libx264 -pix_fmt yuv420p", "-c:v libx264rgb -qp 0 -pix_fmt rgb24"})
        for (const char *degrees : {"90", "180", "270"}) {
            SCOPED_TRACE(std::string(codec) + " " + degrees);
            const VideoFile video("video.mp4", codec, "96x64", 3);
            ffmpeg(video.folder(),
                   "-i video.mp4 -c copy -metadata:s:v rotate=" + std::string(degrees) + " turned.mp4");
            SourceUnderTest source("source_file", {{"path", (video.folder() / "turned.mp4").string()}});
            const bool upright = std::string(degrees) == "180";
            EXPECT_EQ(source.format().width, upright ? 96u : 64u);
            EXPECT_EQ(source.format().height, upright ? 64u : 96u);
            const bool rgb = source.format().pixel_format == ARHOST_PIXEL_FORMAT_BGR8;
            ffmpeg(video.folder(),
                   std::string("-i turned.mp4 -f rawvideo -pix_fmt ") + (rgb ? "bgr24" : "yuv420p") + " turned.raw");
            const Bytes expected = bytes_of(video.folder() / "turned.raw");
            Bytes given;
            for (int n = 0; n < 3; ++n) {
                const Bytes frame = source.read(static_cast<std::uint64_t>(n)).bytes;
                given.insert(given.end(), frame.begin(), frame.end());
            }
            EXPECT_EQ(given, expected);
        }
}

TEST_F(Video, ARestartAtAnyFrameGivesTheSameFrames) {
    for (const char *codec :
         {h264, "-c:v libx264 -x264-params open-gop=1:keyint=10:bframes=3:b-pyramid=strict", "-c:v mpeg4 -bf 2"}) {
        SCOPED_TRACE(codec);
        const VideoFile video("video.mp4", codec);
        SourceUnderTest source("source_file", video.options());
        const auto whole = source.read_all();
        ASSERT_EQ(whole.size(), 41u);
        for (const std::size_t n : {0u, 1u, 9u, 10u, 11u, 25u, 39u}) {
            ASSERT_EQ(source.start(video.options(), from(n)), ARHOST_STATUS_OK);
            for (std::size_t i = n; i < std::min<std::size_t>(n + 3, 40); ++i) {
                const SourceFrame frame = source.read(i);
                ASSERT_EQ(frame.bytes, whole[i].bytes) << "frame " << i << " after a restart at " << n;
                EXPECT_EQ(frame.info.capture_ns, whole[i].info.capture_ns);
            }
        }
        ASSERT_EQ(source.start(video.options(), from(40)), ARHOST_STATUS_OK);
        EXPECT_EQ(source.read(40).status, ARHOST_STATUS_END);
        EXPECT_EQ(source.read(39).bytes, whole[39].bytes) << "reading an earlier frame after the end failed";
        EXPECT_EQ(source.read(2).bytes, whole[2].bytes);
    }
}

TEST_F(Video, TimeContinuesInALoop) {
    const VideoFile video("video.mp4", h264, "96x64", 6);
    const Options options{{"path", video.file()}, {"loop", "true"}, {"frames", "15"}};
    SourceUnderTest source("source_file", options);
    EXPECT_EQ(source.properties().frame_count, 15u);
    const auto frames = source.read_all();
    ASSERT_EQ(frames.size(), 16u);
    for (std::size_t n = 0; n < 15; ++n) {
        EXPECT_EQ(frames[n].bytes, frames[n % 6].bytes);
        EXPECT_EQ(frames[n].info.capture_ns, static_cast<std::int64_t>(n) * 40'000'000);
    }
    for (const std::size_t n : {6u, 13u}) {
        ASSERT_EQ(source.start(options, from(n)), ARHOST_STATUS_OK);
        EXPECT_EQ(source.read(n).bytes, frames[n].bytes);
        EXPECT_EQ(source.read(n + 1).info.capture_ns, frames[n + 1].info.capture_ns);
    }
}

TEST_F(Video, KeepsVariableRateTimesUnlessARateIsConfigured) {
    const VideoFile video("video.mkv", "-vf setpts=N*N/25/TB -vsync vfr -c:v libx264", "96x64", 5);
    SourceUnderTest source("source_file", video.options());
    for (std::uint64_t n = 0; n < 5; ++n)
        EXPECT_NEAR(static_cast<double>(source.read(n).info.capture_ns), static_cast<double>(n * n) * 4e7, 1e6);
    ASSERT_EQ(source.start(video.options(), at_rate(10)), ARHOST_STATUS_OK);
    EXPECT_EQ(source.format().fps, 10.0);
    EXPECT_EQ(source.read(4).info.capture_ns, 400'000'000);
}

// The second film begins at another time, and the counters of its packets do not continue those of the first one.
TEST_F(Video, TimeContinuesWhereTwoFilmsAreJoined) {
    struct Join {
        const char *codec, *first_s, *second_s;
    };
    for (const auto &[codec, first_s, second_s] :
         {Join{h264, "0", "0"}, Join{h264, "100", "5"}, Join{h264, "5", "100"},
          Join{"-c:v mpeg2video -bf 0", "100", "5"}}) {
        const auto film = [&, encoder = codec](const char *start_s) {
            return VideoFile("film.ts", std::string(encoder) + " -output_ts_offset " + start_s);
        };
        const VideoFile first = film(first_s), second = film(second_s);
        const fs::path joined = first.folder() / "joined.ts";
        std::ofstream(joined, std::ios::binary) << std::ifstream(first.file(), std::ios::binary).rdbuf()
                                                << std::ifstream(second.file(), std::ios::binary).rdbuf();
        SourceUnderTest source("source_file", {{"path", joined.string()}});
        const std::vector<SourceFrame> frames = source.read_all();
        const std::string where = std::string(codec) + ", " + first_s + " s and " + second_s + " s";
        EXPECT_EQ(frames.back().status, ARHOST_STATUS_END) << where;
        ASSERT_EQ(frames.size(), 81u) << where; // and the end
        for (std::size_t n = 1; n < 80; ++n) {
            const std::int64_t step_ns = frames[n].info.capture_ns - frames[n - 1].info.capture_ns;
            EXPECT_GT(step_ns, 0) << where << ", frame " << n;
            EXPECT_LE(step_ns, 80'000'000) << where << ", frame " << n;
        }
        EXPECT_NEAR(static_cast<double>(frames[79].info.capture_ns), 79 * 4e7, 4e7) << where;
        EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "") << where;
    }
}

TEST_F(Video, DeliversASingleFrame) {
    const VideoFile video("one.mp4", h264, "96x64", 1);
    SourceUnderTest source("source_file", video.options());
    EXPECT_EQ(source.properties().frame_count, 1u);
    EXPECT_EQ(source.read(0).status, ARHOST_STATUS_OK);
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_END);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
}

TEST_F(Video, TruncatedIsPlayedToTheLastFrameWithAWarning) {
    for (const auto &[name, codec] : {std::pair{"video.mp4", "-c:v libx264 -g 5 -movflags +faststart"},
                                      {"video.avi", "-c:v mjpeg -q:v 2"},
                                      {"video.mkv", "-c:v libx264 -g 5"}}) {
        SCOPED_TRACE(name);
        const VideoFile video(name, codec, "160x120", 40);
        SourceUnderTest source("source_file", video.options());
        const auto whole = source.read_all();
        fs::resize_file(video.file(), fs::file_size(video.file()) * 6 / 10);
        ASSERT_EQ(source.start(video.options()), ARHOST_STATUS_OK) << source.log();
        const auto frames = source.read_all();
        ASSERT_GT(frames.size(), 10u);
        ASSERT_LT(frames.size(), 38u);
        EXPECT_EQ(frames.back().status, ARHOST_STATUS_END_TRUNCATED);
        const std::size_t good = frames.size() - 1;
        // Near the cut, some frames may be missing, because a file may store a frame later than frames that follow
        // it. Therefore frames are compared by their capture times.
        for (std::size_t n = 0, same = 0; n < good; ++n, ++same) {
            while (whole.at(same).info.capture_ns < frames[n].info.capture_ns)
                ++same;
            EXPECT_EQ(frames[n].bytes, whole[same].bytes) << "frame " << n;
        }
        EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING),
                    HasSubstr(std::string(name) + "' is truncated: it ends after frame " + std::to_string(good - 1)));
        EXPECT_EQ(source.read(good).status, ARHOST_STATUS_END_TRUNCATED);
    }
}

// libav reports no error if the file ends exactly between two frames.
TEST_F(Video, MatroskaCutBetweenTwoFramesIsTruncated) {
    const VideoFile video("film.mkv", "-c:v mjpeg -q:v 2", "96x64", 30);
    Bytes bytes = bytes_of(video.file());
    // Each frame is a SimpleBlock (0xa3) with a JPEG; the file is cut before the fourth one.
    const std::uint8_t jpeg[] = {0xff, 0xd8, 0xff};
    auto frame = bytes.begin();
    for (int i = 0; i < 4; ++i)
        frame = std::search(frame + 1, bytes.end(), std::begin(jpeg), std::end(jpeg));
    ASSERT_NE(frame, bytes.end());
    while (*frame != 0xa3)
        --frame;
    bytes.erase(frame, bytes.end());
    write_bytes(video.file(), bytes);
    SourceUnderTest source("source_file", video.options());
    const auto frames = source.read_all();
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_END_TRUNCATED);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING), HasSubstr("film.mkv' is truncated: it ends after frame 2"));
}

TEST_F(Video, MatroskaOfUnknownSizeIsNotTruncated) {
    const VideoFile video("film.mkv", "-c:v mjpeg -q:v 2 -live 1", "96x64", 5);
    SourceUnderTest source("source_file", video.options());
    EXPECT_EQ(source.read_all().back().status, ARHOST_STATUS_END);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
}

TEST_F(Video, AviMayHaveFewerFramesThanHeaderSlots) {
    const VideoFile video("video.mp4", "-c:v mpeg4 -bf 0", "96x64", 40);
    ffmpeg(video.folder(), "-i video.mp4 -c copy copied.avi"); // the header of copied.avi says 80 frames
    SourceUnderTest source("source_file", {{"path", (video.folder() / "copied.avi").string()}});
    const auto frames = source.read_all();
    EXPECT_EQ(frames.size(), 41u);
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_END);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
}

TEST_F(Video, NamesAMissingIndex) {
    const VideoFile video("video.mp4", h264); // the file's index is at its end
    fs::resize_file(video.file(), fs::file_size(video.file()) / 2);
    expect_rejection(video.options(), {"video.mp4", "moov atom not found"});
}

struct DamagedVideo : VideoFile {
    DamagedVideo() : VideoFile("video.avi", "-c:v mpeg4 -g 8", "160x120", 40) {
        Bytes bytes = bytes_of(file());
        for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 1500; ++i)
            bytes[i] = static_cast<std::uint8_t>(i * 37);
        write_bytes(file(), bytes);
    }
};

TEST_F(Video, DamagedInTheMiddleContinuesWithAWarningAndSeeksToTheSameBytes) {
    const DamagedVideo video;
    SourceUnderTest source("source_file", video.options());
    const auto whole = source.read_all();
    EXPECT_GT(whole.size(), 30u);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING), HasSubstr("is damaged near frame"));
    ASSERT_EQ(source.start(video.options(), from(25)), ARHOST_STATUS_OK);
    EXPECT_EQ(source.read(25).bytes, whole[25].bytes);
}

TEST_F(Video, RejectsAChangedSize) {
    const VideoFile small("a.ts", "-c:v libx264", "96x64", 10), large("b.ts", "-c:v libx264", "128x96", 10);
    Bytes both = bytes_of(small.file());
    const Bytes second = bytes_of(large.file());
    both.insert(both.end(), second.begin(), second.end());
    write_bytes(small.file(), both);
    SourceUnderTest source("source_file", small.options());
    EXPECT_EQ(source.read_all().back().status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr(" is 128×96, but earlier frames are 96×64"));
}

TEST_F(Video, DecoderMessagesGoToTheDebugLogNotStderr) {
    const DamagedVideo video;
    testing::internal::CaptureStderr();
    SourceUnderTest source("source_file", video.options());
    source.read_all();
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_THAT(source.log(ARHOST_SEVERITY_DEBUG), HasSubstr("libav: "));
}

TEST_F(Video, StopsDecodingWhenCancelled) {
    const VideoFile video("video.mp4", h264);
    SourceUnderTest source("source_file", video.options());
    source.plugin().cancel();
    EXPECT_EQ(source.read(39).status, ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_ERROR), "");
    EXPECT_EQ(source.start(video.options(), from(39)), ARHOST_STATUS_ERROR_CANCELLED);
}

// ---- Live mode: frames are delivered in real time --------------------------------------------------

TEST_F(Paced, DeliversNoFrameEarly) {
    write_images({0});
    SourceUnderTest source("source_file", images({{"loop", "true"}}), paced(20));
    ASSERT_EQ(source.read(0).status, ARHOST_STATUS_OK);
    const auto first = std::chrono::steady_clock::now();
    std::uint64_t skipped = 0;
    for (std::uint64_t n = 1; n < 6; ++n) {
        const SourceFrame frame = source.read_frame(n + skipped);
        skipped += frame.info.skipped;
        EXPECT_EQ(frame.info.capture_ns, static_cast<std::int64_t>((n + skipped) * 50'000'000));
        EXPECT_GT(std::chrono::steady_clock::now() - first, std::chrono::milliseconds(50 * (n + skipped) - 5));
    }
}

TEST_F(Paced, SkipsAndCountsLateFrames) {
    ARHOST_REQUIRE_FFMPEG();
    write_images({0, 1, 2});
    const VideoFile video("video.mp4", h264);
    for (Options options : {images(), video.options()}) {
        SCOPED_TRACE(options["path"]);
        SourceUnderTest source("source_file", options);
        auto whole = source.read_all();
        whole.pop_back(); // the end
        options["loop"] = "true";
        ASSERT_EQ(source.start(options, paced(1e6)), ARHOST_STATUS_OK); // no read takes less than a microsecond
        ASSERT_EQ(source.read(0).status, ARHOST_STATUS_OK);
        std::uint64_t n = 1;
        for (int i = 0; i < 3; ++i, ++n) {
            const SourceFrame frame = source.read_frame(n);
            EXPECT_GT(frame.info.skipped, 0u);
            n += frame.info.skipped;
            EXPECT_EQ(frame.bytes, whole.at(n % whole.size()).bytes);
            EXPECT_EQ(frame.info.capture_ns, static_cast<std::int64_t>(n) * 1'000);
        }
    }
}

TEST_F(Paced, StopsWaitingWhenCancelled) {
    write_images({0, 1});
    SourceUnderTest source("source_file", images(), paced(0.05));
    ASSERT_EQ(source.read(0).status, ARHOST_STATUS_OK);
    source.plugin().cancel(3);
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_ERROR_CANCELLED); // frame 1 is due after 20 s
}
