// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "run_config/access.hpp"

#include <gmock/gmock.h>

#include <fstream>

using namespace arhost::run_config;
using namespace arhost::yaml;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
namespace fs = std::filesystem;

namespace {

struct Access : testing::Test {
    arhost::sandbox::Policy of(const std::string &component, bool is_output) {
        std::ofstream(folder / "run.yaml") << component;
        return access_of(Node::load(folder / "run.yaml"), is_output, arhost::sandbox::Mode::standard);
    }
    std::string error_of(const std::string &component) {
        return arhost::test::error_of([&] { of(component, false); });
    }
    void file(const std::string &name) {
        fs::create_directories((folder / name).parent_path());
        std::ofstream(folder / name) << "x";
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
};

} // namespace

TEST_F(Access, GrantsNothingByDefault) {
    const auto policy = of("{plugin: tracker_aruco, options: {corner_refinement: none, threads: 4}}", false);
    EXPECT_THAT(policy.readable, IsEmpty());
    EXPECT_THAT(policy.writable, IsEmpty());
    EXPECT_THAT(policy.allow, IsEmpty());
}

TEST_F(Access, ASourceMayReadItsFile) {
    file("video.mp4");
    file("video.mp4.key");
    EXPECT_THAT(of("{plugin: source_file, path: video.mp4}", false).readable, ElementsAre(folder / "video.mp4"));
    EXPECT_THAT(of("{plugin: source_file, options: {path: video.mp4}}", false).readable,
                ElementsAre(folder / "video.mp4"));
}

TEST_F(Access, AUsbDeviceIsNamedByItsIdsAndSerialNumber) {
    EXPECT_EQ(of("{plugin: source_uvc, usb: {vendor: 046D, product: 0825}}", false).usb_device, "046d:0825");
    EXPECT_EQ(of("{plugin: source_uvc, usb: {vendor: 046d, product: 0825, serial: 0001}}", false).usb_device,
              "046d:0825:0001");
    EXPECT_EQ(of("{plugin: source_uvc}", false).usb_device, "");
    EXPECT_THAT(error_of("{usb: {vendor: 46d, product: 0825}}"), HasSubstr("must have four hexadecimal digits"));
    EXPECT_THAT(error_of("{usb: {vendor: 046g, product: 0825}}"), HasSubstr("must have four hexadecimal digits"));
    EXPECT_THAT(error_of("{usb: {vendor: 046d}}"), HasSubstr("product"));
    EXPECT_THAT(error_of("{usb: {vendor: 046d, product: 0825, bus: 1}}"), HasSubstr("bus"));
    EXPECT_THAT(error_of("{usb: {vendor: 046d, product: 0825, serial: " + std::string(300, 'a') + "}}"),
                HasSubstr("too long"));
}

TEST_F(Access, APatternGrantsItsFolder) {
    file("frames/0001.png");
    EXPECT_THAT(of("{plugin: source_file, path: frames/%04d.png}", false).readable, ElementsAre(folder / "frames"));
}

TEST_F(Access, PathsNeverGrantDevicesOrBroadFolders) {
    for (const char *path : {"/dev/null", "missing.mp4", "/", "/missing.mp4", "/%04d.png", "/dev/../"}) {
        EXPECT_THAT(of("{plugin: source_file, path: " + std::string(path) + "}", false).readable, IsEmpty()) << path;
        EXPECT_THAT(of("{plugin: p, options: {folder: " + std::string(path) + "}}", false).readable, IsEmpty())
            << path;
    }
    const char *home = std::getenv("HOME");
    EXPECT_THAT(of("{plugin: p, options: {folder: " + std::string(home ? home : "/") + "}}", false).readable,
                IsEmpty());
}

TEST_F(Access, AnOutputMayWriteToItsFolder) {
    const std::string path = (folder / "out/video.mp4").string();
    EXPECT_THAT(of("{plugin: sink_video, path: " + path + "}", true).writable, ElementsAre(folder / "out"));
    EXPECT_THAT(of("{plugin: sink_video, options: {path: " + path + "}}", true).writable,
                ElementsAre(folder / "out"));
}

TEST_F(Access, StandardOutputGrantsNoFolder) {
    for (const char *path : {"\"-\"", "/dev/stdout"}) {
        const auto policy = of("{plugin: sink_pipe, path: " + std::string(path) + "}", true);
        EXPECT_TRUE(policy.standard_output) << path;
        EXPECT_THAT(policy.writable, IsEmpty()) << path;
    }
    EXPECT_FALSE(of("{plugin: sink_pipe, path: ./-}", true).standard_output);
}

TEST_F(Access, ALinkedOutputMayAlsoWriteToTheTargetsFolder) {
    file("there/video.mp4");
    fs::create_symlink(folder / "there/video.mp4", folder / "link.mp4");
    EXPECT_THAT(of("{plugin: sink_video, path: " + (folder / "link.mp4").string() + "}", true).writable,
                ElementsAre(folder, folder / "there"));
}

TEST_F(Access, OptionsGrantTheFilesTheyName) {
    file("tags.txt");
    const auto policy = of("{plugin: p, options: {file: tags.txt, device: /dev/null, other: none.txt}}", false);
    EXPECT_THAT(policy.readable, ElementsAre(folder / "tags.txt"));
}

TEST_F(Access, KeysGrantMore) {
    file("data/a.txt");
    const auto policy = of("{plugin: p, allow: [gpu, video], reads: [data, data/a.txt], writes: [/var/tmp]}", false);
    EXPECT_THAT(policy.allow, ElementsAre("gpu", "video"));
    EXPECT_THAT(policy.readable, ElementsAre(folder / "data", folder / "data/a.txt"));
    EXPECT_THAT(policy.writable, ElementsAre("/var/tmp"));
}

TEST_F(Access, MissingPathsAreErrors) {
    file("data/a.txt");
    EXPECT_THAT(error_of("{plugin: p, reads: [data, dta]}"),
                AllOf(HasSubstr("run.yaml:1:27: reads[1]: there is no file or folder '" + (folder / "dta").string()),
                      HasSubstr("correct the path")));
    EXPECT_THAT(error_of("{plugin: p, writes: [/no/such]}"),
                AllOf(HasSubstr("run.yaml:1:22: writes[0]: there is no folder '/no/such'"), HasSubstr("mkdir -p")));
    EXPECT_THAT(error_of("{plugin: p, writes: [" + (folder / "data/a.txt").string() + "]}"),
                HasSubstr("there is no folder '" + (folder / "data/a.txt").string()));
    EXPECT_THAT(error_of("{plugin: p, reads: ['']}"), HasSubstr("run.yaml:1:21: reads[0]: must not be empty"));
    EXPECT_FALSE(fs::exists(folder / "dta"));
}

TEST_F(Access, RootProcAndDevicesAreErrors) {
    fs::create_symlink("/", folder / "root");
    for (const char *path : {"/", "root", "/proc", "/proc/self", "/dev", "/dev/null"})
        EXPECT_THAT(error_of("{plugin: p, reads: [" + std::string(path) + "]}"),
                    AllOf(HasSubstr("run.yaml:1:21: reads[0]: the sandbox cannot grant '"),
                          HasSubstr("name the files or folders that the plugin needs")))
            << path;
    EXPECT_THAT(error_of("{plugin: p, writes: [/]}"),
                HasSubstr("run.yaml:1:22: writes[0]: the sandbox cannot grant"));
    EXPECT_THAT(of("{plugin: p, reads: [/dev/shm, /sys/kernel]}", false).readable,
                ElementsAre("/dev/shm", "/sys/kernel"));
    for (const char *path : {"/video.mp4", "/dev/video.mp4"})
        EXPECT_THROW(of("{plugin: sink_video, path: " + std::string(path) + "}", true), Error) << path;
}

TEST_F(Access, DotDotAfterALinkStartsAtItsTarget) {
    file("there/inner/x");
    file("there/tags.txt");
    file("tags.txt");
    fs::create_directory_symlink(folder / "there/inner", folder / "link");
    EXPECT_THAT(of("{plugin: p, options: {file: link/../tags.txt}}", false).readable,
                ElementsAre(folder / "there/tags.txt"));
    EXPECT_THAT(of("{plugin: p, reads: [link/..]}", false).readable, ElementsAre(folder / "there"));
    const std::string up = (folder / "link/..").string();
    EXPECT_THAT(of("{plugin: p, writes: [" + up + "]}", false).writable, ElementsAre(folder / "there"));
    EXPECT_THAT(of("{plugin: p, path: " + up + "/video.mp4}", true).writable, ElementsAre(folder / "there"));
}

TEST_F(Access, EnvironmentVariablesAreGrantedByName) {
    EXPECT_THAT(of("{plugin: p, environment: [LICENCE_FILE]}", false).environment, ElementsAre("LICENCE_FILE"));
    for (const char *name : {"LICENCE_FILE=/x", R"("LICENCE\nFILE")", R"("LICENCE\0FILE")", "'A B'", "''"})
        EXPECT_THAT(error_of("{plugin: p, environment: [" + std::string(name) + "]}"),
                    HasSubstr("run.yaml:1:27: environment[0]: must "))
            << name;
}

TEST_F(Access, WarnsIfAnOutputMayWriteToHomeOrTheWorkingDirectory) {
    const auto warning = [&](const std::string &path) {
        std::ofstream(folder / "run.yaml") << "path: " << path;
        return warning_of_output(Node::load(folder / "run.yaml").require("path"), "my_sink");
    };
    const std::string home = fs::canonical(std::getenv("HOME")).string();
    EXPECT_THAT(warning(home + "/video.mp4"),
                HasSubstr("run.yaml:1:7: path: 'my_sink' may write to everything in and below '" + home + "'"));
    EXPECT_THAT(warning("video.mp4"), HasSubstr("give this output its own folder, as in 'path: output/video.mp4'"));
    EXPECT_THAT(warning("/video.mp4"), HasSubstr("everything in and below '/'"));
    EXPECT_EQ(warning("out/video.mp4"), "");
    EXPECT_EQ(warning((folder / "video.mp4").string()), "");
}

TEST_F(Access, UnknownPermissionsAreErrors) {
    EXPECT_THAT(error_of("{plugin: p, allow: [everything]}"), AllOf(HasSubstr("allow[0]"), HasSubstr("network")));
}
