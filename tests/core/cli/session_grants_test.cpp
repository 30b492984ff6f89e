// SPDX-License-Identifier: Apache-2.0
#include "cli/session_grants.hpp"

#include "documents.hpp"
#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <fstream>

namespace arhost::cli {
namespace {

using testing::HasSubstr;

// A session `take` beside a folder `secrets`. In `configuration`, SECRETS and TAKE stand for these folders.
class SessionGrants : public testing::Test {
protected:
    SessionGrants() {
        for (const char *folder : {"take", "secrets"})
            std::filesystem::create_directory(scratch_.path() / folder);
        for (const char *file :
             {"take/scene.yaml", "take/code.py", "secrets/key", "secrets/map.yaml", "secrets/1.png"})
            std::ofstream(scratch_.path() / file) << "x";
        std::filesystem::create_symlink(secrets(), scratch_.path() / "take/link");
    }
    std::string take() const { return (scratch_.path() / "take").string(); }
    std::string secrets() const { return (scratch_.path() / "secrets").string(); }

    // Returns the text with the folders in place of their names.
    std::string filled(std::string text) const {
        for (const auto &[name, folder] : {std::pair("SECRETS", secrets()), std::pair("TAKE", take())})
            for (std::size_t at; (at = text.find(name)) != std::string::npos;)
                text.replace(at, std::strlen(name), folder);
        return text;
    }
    // Returns what the session asks for but has not been granted; "" if nothing is missing.
    std::string missing(const std::string &configuration, const std::vector<std::string> &allowed = {},
                        bool with_tracker = true, const std::string &setting = "") const {
        yaml::Node root = yaml::Node::parse(filled(configuration), "configuration.yaml");
        if (!setting.empty())
            root.override_value(setting.substr(0, setting.find('=')), filled(setting.substr(setting.find('=') + 1)));
        std::vector<std::string> granted;
        for (const std::string &what : allowed)
            granted.push_back(filled(what));
        const Session session{take(), root, root, {}, ""};
        return test::error_of<yaml::Error>([&] { expect_granted(root, session, granted, with_tracker); });
    }

    test::ScratchFolder scratch_;
};

// A request of a session, and the grant that it needs.
struct Asked {
    const char *configuration, *grant;
};
// Each kind of grant, wherever a session can name it.
constexpr Asked asked[] = {
    {"raytracer: {allow: [gpu]}", "gpu"},
    {"raytracer: {allow: [network, processes]}", "processes"},
    {"raytracer: {usb: {vendor: 046d, product: 0825}}", "usb"},
    {"raytracer: {reads: [SECRETS]}", "SECRETS"},
    {"raytracer: {options: {texture: SECRETS/key}}", "SECRETS/key"},
    {"raytracer: {options: {interpreter: SECRETS/key}}", "SECRETS/key"},
    {"raytracer: {options: {file: TAKE/link/key}}", "SECRETS/key"},
    {"raytracer: {options: {file: TAKE/../secrets/key}}", "SECRETS/key"},
    {"raytracer: {options: {script: TAKE/code.py}}", "TAKE/code.py"},
    {"raytracer: {path: SECRETS/key}", "SECRETS/key"},
    {"raytracer: {path: SECRETS/%04d.png}", "SECRETS"},
    {"raytracer: {scene: SECRETS/map.yaml}", "SECRETS/map.yaml"},
    {"scenes: [SECRETS/map.yaml]", "SECRETS/map.yaml"},
    {"trajectory: SECRETS/key", "SECRETS/key"},
    {"camera: {file: SECRETS/key}", "SECRETS/key"},
    {"tracker: {allow: [network]}", "network"},
    {"tracker: {reads: [SECRETS]}", "SECRETS"},
    {"tracker: {options: {script: TAKE/code.py}}", "TAKE/code.py"},
    {"tracker: {targets: [{map: SECRETS/map.yaml}]}", "SECRETS/map.yaml"},
    {"tracker: {targets: [{pattern: SECRETS/key}]}", "SECRETS/key"},
    {"tracker: {targets: [{}, {image: SECRETS/1.png}]}", "SECRETS/1.png"},
    {"alternatives: {raytracer: [{allow: [display]}]}", "display"},
    {"alternatives: {raytracer: [{reads: [SECRETS]}]}", "SECRETS"},
    {"alternatives: {tracker: [{}, {options: {file: SECRETS/key}}]}", "SECRETS/key"},
};

std::string name_of(const Asked &row) {
    std::string name = std::string(row.configuration) + "_" + row.grant;
    std::ranges::replace_if(
        name, [](unsigned char c) { return !std::isalnum(c); }, '_');
    name.erase(std::unique(name.begin(), name.end(), [](char x, char y) { return x == '_' && y == '_'; }),
               name.end());
    return name;
}

} // namespace

class AskedBySessions : public SessionGrants, public testing::WithParamInterface<Asked> {};

TEST_P(AskedBySessions, IsNotGrantedByTheSessionItself) {
    const std::string configuration = GetParam().configuration, grant = GetParam().grant;
    const std::string error = missing(configuration);
    EXPECT_THAT(error, HasSubstr("a session grants nothing by itself"));
    EXPECT_THAT(error, HasSubstr(" --allow " + filled(grant)));
    EXPECT_THAT(missing(configuration, {grant == "processes" ? "network" : "video"}),
                HasSubstr(" --allow " + filled(grant)))
        << "another grant does not help";
    EXPECT_EQ(missing(configuration, {"network", grant}), "no error");
}

INSTANTIATE_TEST_SUITE_P(SessionGrants, AskedBySessions, testing::ValuesIn(asked),
                         [](const auto &info) { return name_of(info.param); });

// Prints the table if docs/security.md does not contain it.
TEST(SecurityDocumentation, ListsWhatSessionsAskFor) {
    std::string table;
    for (const Asked &row : asked)
        table +=
            std::string("| session | `") + row.configuration + "` | `" + row.grant + "` | `" + name_of(row) + "` |\n";
    EXPECT_THAT(test::read_document("security.md"), HasSubstr(table));
}

TEST_F(SessionGrants, AFolderGrantsItsFiles) {
    EXPECT_EQ(missing("raytracer: {options: {script: TAKE/code.py, key: SECRETS/key}}", {"SECRETS", "TAKE"}),
              "no error");
    EXPECT_THAT(missing("raytracer: {reads: [SECRETS]}", {"SECRETS/key"}), HasSubstr(" --allow " + secrets()));
}

TEST_F(SessionGrants, OneMessageNamesAllThatIsMissing) {
    const std::string error =
        missing("raytracer: {allow: [gpu], scene: SECRETS/map.yaml}\ntracker: {allow: [gpu], reads: [SECRETS]}");
    EXPECT_THAT(error, HasSubstr("take: the session asks for the permission 'gpu' for tracker, the file '" +
                                 secrets() + "' (tracker.reads[0]), the permission 'gpu' for raytracer, the file '" +
                                 secrets() + "/map.yaml' (raytracer.scene); "));
    EXPECT_THAT(error, HasSubstr("add --allow gpu --allow " + secrets() + " --allow " + secrets() + "/map.yaml, or"));
}

TEST_F(SessionGrants, WhatTheSessionContainsNeedsNone) {
    EXPECT_EQ(missing("raytracer: {scene: TAKE/scene.yaml, options: {samples: 4, file: TAKE/code.py, none: /none}}"),
              "no error");
}

TEST_F(SessionGrants, ATrackerThatDoesNotRunNeedsNone) {
    EXPECT_EQ(missing("tracker: {allow: [network], reads: [SECRETS]}", {}, false), "no error");
}

TEST_F(SessionGrants, TheCommandLineGrantsWhatItSets) {
    EXPECT_EQ(missing("raytracer: {allow: [network]}", {}, true, "raytracer.allow=[gpu]"), "no error");
    EXPECT_EQ(missing("raytracer: {options: {}}", {}, true, "raytracer.options.file=SECRETS/key"), "no error");
    EXPECT_NE(missing("raytracer: {options: {file: SECRETS/key}}", {}, true, "raytracer.allow=[gpu]"), "no error");
}

TEST_F(SessionGrants, RejectsWhatIsNeitherAPermissionNorAFile) {
    EXPECT_THAT(missing("", {"gpus"}), HasSubstr("--allow gpus: is neither a permission (video, usb, gpu, "));
}

} // namespace arhost::cli
