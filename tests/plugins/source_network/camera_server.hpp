// SPDX-License-Identifier: Apache-2.0
//
// Runs server.py, which serves numbered pictures like network cameras do.
#pragma once

#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace arhost::test {

constexpr const char *user_and_password = "camera:s3cr%3At%40%2F";
constexpr int picture_count = 16; // distinct ones, which the cameras show in a loop

// Pictures of 160×120 px in uniform grey: picture n mod 16 has the luma 40 + 12 n, given by `luma` as a function of
// it.
inline std::string numbered_pictures(std::string luma) {
    luma.replace(luma.find('Y'), 1, "(40+12*mod(N,16))");
    return "-f lavfi -i \"nullsrc=s=160x120:r=25,format=yuv420p,geq=lum='" + luma + "':cb=128:cr=128\"";
}

// The files that the servers serve.
class Media {
public:
    Media() {
        shell(ARHOST_FFMPEG " -nostdin -v error " +
              numbered_pictures("16+Y*219/255") + // ffmpeg then converts to full range
              " -frames:v 16 -q:v 2 -pix_fmt yuvj420p -start_number 0 %02d.jpg");
        shell(ARHOST_FFMPEG " -nostdin -v error -f lavfi -i color=gray:s=320x240 -frames:v 1 -f mjpeg large");
        shell(ARHOST_FFMPEG " -nostdin -v error " + numbered_pictures("Y") +
              " -frames:v 500 -c:v libx264 -preset ultrafast -qp 5 -g 25 -bf 0 -f hls -hls_time 1 "
              "-hls_list_size 2 -hls_segment_filename hls%d.ts all.m3u8");
        shell("head -n 8 all.m3u8 > vod.m3u8 && echo '#EXT-X-ENDLIST' >> vod.m3u8");
        shell("openssl req -x509 -newkey rsa:2048 -nodes -days 1 -subj /CN=camera -keyout key.pem "
              "-out certificate.pem 2> openssl.txt");
    }
    const std::filesystem::path &folder() const { return folder_.path(); }

private:
    void shell(const std::string &command) const {
        if (std::system(("cd '" + folder().string() + "' && " + command).c_str()) != 0)
            throw std::runtime_error("failed: " + command);
    }
    ScratchFolder folder_;
};

// A server process. It listens on a loopback address that no other test uses, so that it finds its port free again
// after a restart.
class CameraServer {
public:
    CameraServer(std::string protocol, const Media &media)
        : protocol_(std::move(protocol)), folder_(media.folder()), address_(own_address()) {
        start();
    }
    ~CameraServer() { kill(); }
    CameraServer(const CameraServer &) = delete;
    CameraServer &operator=(const CameraServer &) = delete;

    void start() {
        int out[2];
        if (::pipe2(out, O_CLOEXEC) != 0)
            throw std::runtime_error("pipe2 failed");
        const std::string place = address_ + ":" + (port_.empty() ? "0" : port_);
        pid_ = ::fork();
        if (pid_ == 0) {
            ::dup2(out[1], STDOUT_FILENO);
            ::execl("/usr/bin/python3", "python3", "-B",
                    (arhost::test::source_directory() + "/tests/plugins/source_network/server.py").c_str(),
                    protocol_.c_str(), place.c_str(), folder_.c_str(), nullptr);
            ::_exit(127);
        }
        ::close(out[1]);
        port_.clear();
        for (char c; ::read(out[0], &c, 1) == 1 && c != '\n';)
            port_ += c;
        ::close(out[0]);
        if (port_.empty())
            throw std::runtime_error(protocol_ + " server did not start at " + place);
    }
    void kill() {
        if (pid_ > 0) {
            ::kill(pid_, SIGKILL);
            ::waitpid(pid_, nullptr, 0);
        }
        pid_ = 0;
    }
    std::string url(const std::string &path, const std::string &user = "") const {
        return protocol_ + "://" + (user.empty() ? "" : user + "@") + address_ + ":" + port_ + "/" + path;
    }
    // Whether this machine can run an RTSP server.
    static bool has_rtsp() {
        return std::system("/usr/bin/python3 -c \"import gi; gi.require_version('GstRtspServer', '1.0'); "
                           "from gi.repository import GstRtspServer\" 2> /dev/null") == 0;
    }

private:
    // Derived from the process id: 127.64.0.0 to 127.127.255.255.
    static std::string own_address() {
        const auto id = static_cast<unsigned>(::getpid());
        return "127." + std::to_string(64 + (id >> 16 & 63)) + "." + std::to_string(id >> 8 & 255) + "." +
               std::to_string(id & 255);
    }

    std::string protocol_;
    std::filesystem::path folder_;
    std::string address_, port_;
    pid_t pid_ = 0;
};

// Skips tests on machines without the server.
#define ARHOST_REQUIRE_RTSP_SERVER()                                                                                 \
    ARHOST_REQUIRE_FFMPEG();                                                                                         \
    if (!CameraServer::has_rtsp())                                                                                   \
    GTEST_SKIP() << "needs GStreamer's RTSP server (packages gir1.2-gst-rtsp-server-1.0, python3-gi)"

} // namespace arhost::test
