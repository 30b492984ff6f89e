// SPDX-License-Identifier: Apache-2.0
//
// Tests what `arhost new-plugin` writes and rejects. tests/sdk builds and tests the skeletons.
#include "plugin_tools/new_plugin.hpp"

#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <fstream>
#include <regex>
#include <sstream>

using namespace arhost::plugin_tools;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

const fs::path prefix = arhost::test::build_directory();

std::string text_of(const fs::path &file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
}

std::string rejection_of(const NewPlugin &plugin, const fs::path &installed = prefix) {
    return arhost::test::error_of<std::runtime_error>([&] { new_plugin(plugin, installed); });
}

} // namespace

TEST(NewPlugin, FillsInEveryPlaceholder) {
    const arhost::test::ScratchFolder folder;
    const std::regex placeholder("@[A-Z]+@");
    for (const std::string &kind : plugin_kinds)
        for (const std::string &language : plugin_languages) {
            const fs::path into = folder.path() / language;
            EXPECT_EQ(new_plugin({kind, "my_" + kind, language, into}, prefix), 0);
            int files = 0;
            for (const auto &entry : fs::recursive_directory_iterator(into / ("my_" + kind))) {
                EXPECT_FALSE(std::regex_search(entry.path().string(), placeholder)) << entry.path();
                if (entry.is_regular_file()) {
                    ++files;
                    EXPECT_FALSE(std::regex_search(text_of(entry.path()), placeholder)) << entry.path();
                }
            }
            EXPECT_GE(files, 5) << kind << " in " << language;
            EXPECT_THAT(text_of(into / ("my_" + kind) / "README.md"), HasSubstr("my_" + kind));
        }
}

TEST(NewPlugin, NamesTheClassAfterThePlugin) {
    const arhost::test::ScratchFolder folder;
    new_plugin({"sink", "a_b2_cd", "python", folder.path()}, prefix);
    EXPECT_THAT(text_of(folder.path() / "a_b2_cd/a_b2_cd.py"), HasSubstr("class AB2Cd:"));
}

TEST(NewPlugin, RejectsInvalidNames) {
    const arhost::test::ScratchFolder folder;
    for (const char *name : {"", "Tracer", "2d", "my-tracer", "a b", "../up", "_x", "größe"})
        EXPECT_THAT(rejection_of({"sink", name, "c", folder.path()}),
                    HasSubstr("must be 1 to 64 lower-case letters"));
    EXPECT_THAT(rejection_of({"sink", "test", "c", folder.path()}), HasSubstr("choose another, as 'my_test'"));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(NewPlugin, RejectsNamesThatClashWithTheSkeleton) {
    const arhost::test::ScratchFolder folder;
    const auto expect = [&](const NewPlugin &plugin, const std::string &reason) {
        EXPECT_THAT(rejection_of(plugin), HasSubstr("the name '" + plugin.name + "' " + reason))
            << plugin.kind << " in " << plugin.language;
        EXPECT_TRUE(fs::is_empty(folder.path())) << plugin.name;
    };
    for (const char *name : {"host", "options", "plugin", "result", "failure"})
        for (const std::string &kind : plugin_kinds)
            expect({kind, name, "rust", folder.path()}, "results in the class name '");
    for (const std::string &kind : plugin_kinds)
        expect({kind, kind, "rust", folder.path()}, "results in the class name '");
    for (const char *language : {"rust", "cpp"})
        expect({"raytracer", "ray", language, folder.path()}, "results in the class name '");
    expect({"raytracer", "vec_3", "rust", folder.path()}, "results in the class name 'Vec3'");
    expect({"raytracer", "tracer", "c", folder.path()}, "is the name of another file of the skeleton");
    for (const char *name : {"numpy", "sys", "json", "random", "unittest", "tracker"})
        expect({"tracker", name, "python", folder.path()}, "has no underscore; a Python plugin needs one");
    for (const char *name : {"py_compile", "pydoc_data", "sre_parse"})
        expect({"tracker", name, "python", folder.path()}, "is a standard Python module");
    for (const char *name : {"core", "std", "test", "self", "arhost_sys", "m", "all", "edit_cache"})
        for (const std::string &language : plugin_languages)
            expect({"sink", name, language, folder.path()}, "");
}

TEST(NewPlugin, RejectsNamesOfBuiltInPlugins) {
    const arhost::test::ScratchFolder folder;
    fs::create_directories(folder.path() / "lib/arhost/plugins");
    std::ofstream(folder.path() / "lib/arhost/plugins/sink_null.so") << "x";
    EXPECT_THROW(new_plugin({"sink", "sink_null", "c", folder.path()}, folder.path()), std::runtime_error);
    EXPECT_FALSE(fs::exists(folder.path() / "sink_null"));
}

TEST(NewPlugin, DoesNotOverwriteAnExistingFile) {
    const arhost::test::ScratchFolder folder;
    const fs::path there = folder.path() / "mine";
    std::ofstream(there) << "precious";
    EXPECT_THAT(rejection_of({"sink", "mine", "c", folder.path()}), HasSubstr("already exists"));
    EXPECT_EQ(text_of(there), "precious");
}

TEST(NewPlugin, ReportsMissingTemplates) {
    const arhost::test::ScratchFolder folder;
    EXPECT_THAT(rejection_of({"sink", "mine", "c", folder.path()}, folder.path()),
                HasSubstr("share/arhost/templates"));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}
