// SPDX-License-Identifier: Apache-2.0
#include "sink_under_test.hpp"
#include "source_under_test.hpp"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <sstream>

using namespace arhost::test;
using Json = nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

constexpr const char *description =
    R"({"format": "arhost-session", "version": 2, "id": "this run", "configuration": "version: 1\n"})";

// Frames of one format with pseudo-random pixels, which depend on the number of the frame.
class Frames {
public:
    Frames(arhost_pixel_format pixels, std::uint32_t width, std::uint32_t height,
           arhost_yuv_range range = ARHOST_YUV_RANGE_LIMITED, arhost_transfer transfer = ARHOST_TRANSFER_SRGB) {
        format_.transfer = transfer;
        format_.struct_size = sizeof format_;
        format_.pixel_format = pixels;
        format_.width = width;
        format_.height = height;
        format_.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
        format_.yuv_range = range;
        format_.fps = 30;
        arhost_frame_layout(&format_);
    }
    const arhost_frame_format &format() const { return format_; }
    std::vector<std::uint8_t> slot(std::uint64_t number) const {
        std::vector<std::uint8_t> bytes(format_.byte_size);
        std::uint32_t random = static_cast<std::uint32_t>(number) + 1;
        for (std::uint8_t &byte : bytes)
            byte = static_cast<std::uint8_t>((random = random * 1664525u + 1013904223u) >> 24);
        return bytes;
    }
    // The pixels of a frame without the padding of its rows. `row`: bytes of the pixels of a row, by plane.
    std::vector<std::uint8_t> pixels(std::uint64_t number, const std::vector<std::size_t> &row) const {
        const std::vector<std::uint8_t> bytes = slot(number);
        std::vector<std::uint8_t> packed;
        for (std::size_t plane = 0; plane < row.size(); ++plane)
            for (std::size_t y = 0; y < (plane ? format_.height / 2 : format_.height); ++y) {
                const auto begin =
                    bytes.begin() + static_cast<std::ptrdiff_t>(format_.offset[plane] + y * format_.stride[plane]);
                packed.insert(packed.end(), begin, begin + static_cast<std::ptrdiff_t>(row[plane]));
            }
        return packed;
    }

private:
    arhost_frame_format format_{};
};

class Recorder {
public:
    explicit Recorder(const std::filesystem::path &folder, std::map<std::string, std::string> options = {})
        : plugin_("sink_session") {
        options["path"] = folder;
        plugin_.create(options);
    }
    arhost_status start(const Frames &frames, std::uint64_t first_sequence = 0,
                        const char *run_description = description) {
        frames_ = &frames;
        const arhost_frame_format &format = frames.format();
        const arhost_sink_setup setup{.struct_size = sizeof setup,
                                      .width = format.width,
                                      .height = format.height,
                                      .reserved = 0,
                                      .fps = 30,
                                      .first_sequence = first_sequence,
                                      .intrinsics = nullptr,
                                      .video_format = &format,
                                      .run_description = run_description};
        return functions().start(plugin_.instance(), &setup);
    }
    arhost_status write(std::uint64_t number) {
        const std::vector<std::uint8_t> slot = frames_->slot(number);
        const arhost_frame_format &format = frames_->format();
        const std::vector<std::uint8_t> bgr(std::size_t{3} * format.width * format.height);
        const arhost_record record = make_record(number);
        arhost_output output{};
        output.struct_size = sizeof output;
        output.stride = 3 * format.width;
        output.width = format.width;
        output.height = format.height;
        output.bgr = bgr.data();
        output.record = &record;
        for (std::uint32_t i = 0; i < format.plane_count; ++i)
            output.video[i] = slot.data() + format.offset[i];
        return functions().write(plugin_.instance(), &output);
    }
    void write(std::uint64_t first, std::uint64_t end) {
        for (; first < end; ++first)
            ASSERT_EQ(write(first), ARHOST_STATUS_OK) << log();
    }
    arhost_status stop() { return functions().stop(plugin_.instance()); }
    std::string log() const { return plugin_.log(); }

private:
    const arhost_sink &functions() const { return plugin_.functions<arhost_sink>(); }
    PluginUnderTest plugin_;
    const Frames *frames_ = nullptr;
};

class Session : public testing::Test {
protected:
    std::filesystem::path folder() const { return scratch_.path() / "take"; }
    std::vector<Json> lines() const {
        std::istringstream text(read_text(folder() / "frames.jsonl"));
        std::vector<Json> found;
        for (std::string line; std::getline(text, line);)
            found.push_back(Json::parse(line));
        return found;
    }
    // Records the frames 0 to `count` - 1.
    void record(const Frames &frames, std::uint64_t count,
                const std::map<std::string, std::string> &options = {}) const {
        Recorder sink(folder(), options);
        ASSERT_EQ(sink.start(frames), ARHOST_STATUS_OK) << sink.log();
        sink.write(0, count);
        ASSERT_EQ(sink.stop(), ARHOST_STATUS_OK);
    }
    // Expects that the session contains the frames 0 to `count` - 1 and the line that ends it.
    void expect_frames(std::uint64_t count, bool is_complete = true) const {
        std::vector<Json> all = lines();
        if (is_complete) {
            EXPECT_EQ(all.back(), Json({{"end", true}}));
            all.pop_back();
        }
        ASSERT_EQ(all.size(), count);
        for (std::uint64_t i = 0; i < count; ++i)
            EXPECT_EQ(all[i]["frame"], i);
        EXPECT_EQ(all[count - 1]["video_end"], std::filesystem::file_size(folder() / "video.mkv"));
    }
    SourceUnderTest replay() const { return SourceUnderTest("source_file", {{"path", folder() / "video.mkv"}}); }
    // Expects that a replay reads the same pixels from the video.
    void expect_pixels(const Frames &frames, std::uint64_t count, const std::vector<std::size_t> &row) const {
        SourceUnderTest source = replay();
        EXPECT_EQ(source.format().pixel_format, frames.format().pixel_format);
        EXPECT_EQ(source.format().fps, 30);
        for (std::uint64_t i = 0; i < count; ++i)
            EXPECT_EQ(source.read(i).bytes, frames.pixels(i, row)) << i;
        EXPECT_EQ(source.read(count).status, ARHOST_STATUS_END) << source.log();
    }

    // Starts the sink, records the frames [first, end), then simulates a kill.
    void record_and_die(std::uint64_t first, std::uint64_t end) const {
        Recorder sink(folder());
        ASSERT_EQ(sink.start(frames, first), ARHOST_STATUS_OK) << sink.log();
        sink.write(first, end);
    }

    const Frames frames{ARHOST_PIXEL_FORMAT_GREY8, 32, 24};
    ScratchFolder scratch_;
};

} // namespace

TEST_F(Session, ConsistsOfDescriptionConfigurationLogAndVideo) {
    const Frames frames(ARHOST_PIXEL_FORMAT_BGR8, 32, 24);
    Recorder sink(folder());
    ASSERT_EQ(sink.start(frames), ARHOST_STATUS_OK) << sink.log();
    EXPECT_FALSE(std::filesystem::exists(folder())) << "another component may still reject the run";
    sink.write(0, 3);
    ASSERT_EQ(sink.stop(), ARHOST_STATUS_OK);
    EXPECT_THAT(names_in(folder()), ElementsAre("configuration.yaml", "frames.jsonl", "session.json", "video.mkv"));
    EXPECT_EQ(read_text(folder() / "configuration.yaml"), "version: 1\n");
    EXPECT_EQ(Json::parse(read_text(folder() / "session.json")),
              Json({{"format", "arhost-session"},
                    {"version", 2},
                    {"id", "this run"},
                    {"video", {{"file", "video.mkv"}, {"codec", "ffv1"}, {"lossless", true}}}}));
    expect_frames(3);
}

TEST_F(Session, Ffv1KeepsPixels) {
    const struct {
        const char *name;
        arhost_pixel_format pixels;
        std::uint32_t width, height;
        arhost_yuv_range range;
        std::vector<std::size_t> row_bytes; // by plane
    } cases[] = {
        {"BGR", ARHOST_PIXEL_FORMAT_BGR8, 37, 23, ARHOST_YUV_RANGE_LIMITED, {37 * 3}},
        {"grey", ARHOST_PIXEL_FORMAT_GREY8, 37, 23, ARHOST_YUV_RANGE_LIMITED, {37}},
        {"YUYV of limited range", ARHOST_PIXEL_FORMAT_YUYV, 36, 23, ARHOST_YUV_RANGE_LIMITED, {72}},
        {"YUYV of full range", ARHOST_PIXEL_FORMAT_YUYV, 36, 23, ARHOST_YUV_RANGE_FULL, {72}},
        {"I420", ARHOST_PIXEL_FORMAT_I420, 36, 22, ARHOST_YUV_RANGE_FULL, {36, 18, 18}},
    };
    for (const auto &[name, pixels, width, height, range, row_bytes] : cases) {
        SCOPED_TRACE(name);
        const Frames frames(pixels, width, height, range);
        ASSERT_NO_FATAL_FAILURE(record(frames, 3, {{"replace", "true"}}));
        expect_pixels(frames, 3, row_bytes);
        if (pixels == ARHOST_PIXEL_FORMAT_YUYV) {
            const arhost_frame_format format = replay().format();
            EXPECT_EQ(format.yuv_range, range);
            EXPECT_EQ(format.yuv_matrix, ARHOST_YUV_MATRIX_BT601);
        }
    }
}

TEST_F(Session, Ffv1KeepsRgbAsBgr) {
    const Frames frames(ARHOST_PIXEL_FORMAT_RGB8, 32, 24);
    ASSERT_NO_FATAL_FAILURE(record(frames, 1));
    SourceUnderTest source = replay();
    const std::vector<std::uint8_t> rgb = frames.pixels(0, {32 * 3}), bgr = source.read(0).bytes;
    ASSERT_EQ(rgb.size(), bgr.size());
    for (std::size_t i = 0; i < rgb.size(); i += 3) {
        ASSERT_EQ(bgr[i], rgb[i + 2]) << i;
        ASSERT_EQ(bgr[i + 1], rgb[i + 1]) << i;
        ASSERT_EQ(bgr[i + 2], rgb[i]) << i;
    }
}

TEST_F(Session, Ffv1KeepsTheTransfer) {
    for (const arhost_transfer transfer : {ARHOST_TRANSFER_SRGB, ARHOST_TRANSFER_LINEAR}) {
        const Frames frames(ARHOST_PIXEL_FORMAT_BGR8, 36, 22, ARHOST_YUV_RANGE_FULL, transfer);
        ASSERT_NO_FATAL_FAILURE(record(frames, 2, {{"replace", "true"}}));
        SourceUnderTest source = replay();
        EXPECT_EQ(source.format().transfer, transfer);
    }
}

TEST_F(Session, Ffv1KeepsTheSamplesOfNv12) {
    const Frames frames(ARHOST_PIXEL_FORMAT_NV12, 36, 22);
    ASSERT_NO_FATAL_FAILURE(record(frames, 1));
    SourceUnderTest source = replay();
    ASSERT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
    const std::vector<std::uint8_t> nv12 = frames.pixels(0, {36, 36}), i420 = source.read(0).bytes;
    constexpr std::size_t luma = 36 * 22, chroma = 18 * 11;
    ASSERT_EQ(i420.size(), luma + 2 * chroma);
    EXPECT_TRUE(std::equal(nv12.begin(), nv12.begin() + luma, i420.begin()));
    for (std::size_t i = 0; i < chroma; ++i) {
        ASSERT_EQ(i420[luma + i], nv12[luma + 2 * i]) << i;
        ASSERT_EQ(i420[luma + chroma + i], nv12[luma + 2 * i + 1]) << i;
    }
}

TEST_F(Session, H264IsCloseToTheFrames) {
    for (const auto &[pixels, rows] : {std::pair{ARHOST_PIXEL_FORMAT_BGR8, std::vector<std::size_t>{3 * 64}},
                                       {ARHOST_PIXEL_FORMAT_YUYV, {2 * 64}},
                                       {ARHOST_PIXEL_FORMAT_I420, {64, 32, 32}}}) {
        const Frames frames(pixels, 64, 48);
        ASSERT_NO_FATAL_FAILURE(record(frames, 3, {{"codec", "h264"}, {"crf", "1"}, {"replace", "true"}}));
        SourceUnderTest source = replay();
        EXPECT_EQ(source.format().pixel_format, pixels);
        const std::vector<std::uint8_t> before = frames.pixels(2, rows), after = source.read(2).bytes;
        ASSERT_EQ(before.size(), after.size());
        double sum = 0;
        for (std::size_t i = 0; i < before.size(); ++i)
            sum += std::abs(before[i] - after[i]);
        EXPECT_LT(sum / static_cast<double>(before.size()), 3) << "of noise, the worst case";
    }
}

TEST_F(Session, ARestartedSinkContinuesTheSameFiles) {
    record_and_die(0, 4);
    record_and_die(4, 8);
    record_and_die(5, 10);
    Recorder sink(folder());
    ASSERT_EQ(sink.start(frames, 9), ARHOST_STATUS_OK) << sink.log(); // frame 9 was written, but not confirmed
    sink.write(9, 12);
    ASSERT_EQ(sink.stop(), ARHOST_STATUS_OK);
    expect_frames(12);
    expect_pixels(frames, 12, {32});
}

TEST_F(Session, ARestartedSinkRemovesAFrameThatIsIncomplete) {
    record_and_die(0, 3);
    std::ofstream(folder() / "video.mkv", std::ios::app) << "a part of a cluster";
    std::ofstream(folder() / "frames.jsonl", std::ios::app) << "{\"frame\": 3, \"capt";
    Recorder sink(folder());
    ASSERT_EQ(sink.start(frames, 3), ARHOST_STATUS_OK) << sink.log();
    sink.write(3, 6);
    ASSERT_EQ(sink.stop(), ARHOST_STATUS_OK);
    expect_frames(6);
    expect_pixels(frames, 6, {32});
}

TEST_F(Session, AnExistingFolderIsReplacedOnlyOnRequest) {
    std::filesystem::create_directories(folder());
    std::ofstream(folder() / "notes.txt") << "mine";
    Recorder refused(folder());
    EXPECT_EQ(refused.start(frames), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(refused.log(), HasSubstr("take' exists; choose another path, or replace the session in it with "
                                         "'replace: true'"));
    EXPECT_THAT(names_in(folder()), ElementsAre("notes.txt"));
    ASSERT_NO_FATAL_FAILURE(record(frames, 5, {{"replace", "true"}}));
    ASSERT_NO_FATAL_FAILURE(record(frames, 2, {{"replace", "true"}}));
    expect_frames(2);
    EXPECT_EQ(read_text(folder() / "notes.txt"), "mine");
}

TEST_F(Session, ASinkKilledBeforeItsFirstAnswerStartsAgain) {
    record_and_die(0, 1);
    Recorder other(folder());
    EXPECT_EQ(other.start(frames, 0, R"({"id": "another run"})"), ARHOST_STATUS_ERROR_CONFIGURATION);
    ASSERT_NO_FATAL_FAILURE(record(frames, 2));
    expect_frames(2);
}

TEST_F(Session, AFullDiskKeepsTheFramesBefore) {
    const Frames frames(ARHOST_PIXEL_FORMAT_GREY8, 64, 48);
    std::uint64_t written = 0;
    {
        Recorder sink(folder());
        ASSERT_EQ(sink.start(frames), ARHOST_STATUS_OK);
        const FileSizeLimit limit(20'000);
        while (sink.write(written) == ARHOST_STATUS_OK)
            ASSERT_LT(++written, 100u);
        EXPECT_THAT(sink.log(), HasSubstr("video.mkv': File too large"));
        EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    }
    ASSERT_GT(written, 0u);
    expect_frames(written, false);
    expect_pixels(frames, written, {64});
}

TEST_F(Session, AFileInPlaceOfTheFolderIsAnError) {
    std::ofstream(folder()) << "file";
    Recorder sink(folder());
    EXPECT_EQ(sink.start(frames), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("take' is not a folder; choose another path"));
}

TEST_F(Session, IsNotCreatedWithoutFrames) {
    Recorder sink(folder());
    ASSERT_EQ(sink.start(frames), ARHOST_STATUS_OK);
    EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    EXPECT_FALSE(std::filesystem::exists(folder()));
    EXPECT_THAT(sink.log(), HasSubstr("was not written, because there were no frames"));
}
