// SPDX-License-Identifier: Apache-2.0
#include "conform/child.hpp"

#include "conform/test.hpp"

#include <algorithm>
#include <cstdio>
#include <sys/mman.h>
#include <unistd.h>

namespace arhost::conform {
namespace {

CallPage map_call_page() {
    void *address = ::mmap(nullptr, sizeof(ring::Call), PROT_READ | PROT_WRITE, MAP_SHARED, call_page_fd, 0);
    if (address == MAP_FAILED)
        ring::throw_errno("mmap of the call page");
    ::close(call_page_fd);
    return CallPage(ring::Mapping(static_cast<std::byte *>(address), sizeof(ring::Call)));
}

// As arhost-worker does before it opens a plugin. What a sink writes goes to the scratch folder.
sandbox::Level enter_sandbox(const Test &test, const Subject &subject) {
    sandbox::Policy policy = subject.policy;
    policy.writable.push_back(subject.scratch);
    if (test.forks) {
        policy.allow.insert("processes");
        policy.readable.push_back(std::filesystem::read_symlink("/proc/self/exe")); // it becomes this anew
    }
    return sandbox::enter_for(subject.plugin, policy);
}

Result run(const Test &test, const Subject &subject, Context &context) {
    Result result;
    result.test = test.name;
    try {
        const sandbox::Level level = enter_sandbox(test, subject);
        test.run(context);
        if (!context.facts.empty())
            context.facts["sandbox"] = sandbox::to_text(level);
        result.verdict = Verdict::pass;
        result.message = context.note;
    } catch (const Failure &failure) {
        result.verdict = Verdict::fail;
        result.message = failure.what();
        result.wrong_pixel = failure.wrong_pixel;
        for (const auto &[label, picture] : failure.pictures)
            result.exhibits.push_back({label, picture.png_base64(), picture.width(), picture.height()});
    } catch (const Skip &skip) {
        result.verdict = Verdict::skip;
        result.message = skip.what();
    } catch (const Warning &warning) {
        result.verdict = Verdict::warn;
        result.message = warning.what();
    } catch (const std::exception &error) {
        result.message = error.what();
    }
    return result;
}

} // namespace

int run_child(const std::string &name, const Subject &subject) {
    const CallPage calls = map_call_page();
    std::vector<Test> tests = all_tests();
    tests.insert(tests.end(), helper_tests().begin(), helper_tests().end());
    for (const Test &test : tests) {
        if (name != test.name)
            continue;
        PluginLibrary library(subject.plugin, subject.settings, calls, subject.scratch);
        Context context{library, subject.reference, std::mt19937_64(subject.seed)};
        context.prints = subject.prints;
        Result result = run(test, subject, context);
        result.facts = context.facts;
        const std::string line = to_json(result).dump(-1, ' ', false, ring::Json::error_handler_t::replace) + "\n";
        std::FILE *pipe = ::fdopen(result_fd, "w");
        std::fwrite(line.data(), 1, line.size(), pipe);
        std::fclose(pipe);
        return EXIT_SUCCESS; // the plugin's static destructors are part of the test
    }
    return EXIT_FAILURE;
}

ring::Json to_json(const Result &result) {
    ring::Json json = {{"test", result.test},       {"verdict", to_text(result.verdict)},
                       {"message", result.message}, {"seconds", result.seconds},
                       {"facts", result.facts},     {"images", ring::Json::array()}};
    for (const Exhibit &exhibit : result.exhibits)
        json["images"].push_back(
            {{"label", exhibit.label}, {"width", exhibit.width}, {"height", exhibit.height}, {"png", exhibit.png}});
    if (result.wrong_pixel)
        json["wrong_pixel"] = *result.wrong_pixel;
    return json;
}

Result result_from_json(const ring::Json &json) {
    Result result;
    result.test = json.at("test").get<std::string>();
    const auto verdict =
        std::find(verdict_texts.begin() + 1, verdict_texts.end(), json.at("verdict").get<std::string>());
    if (verdict == verdict_texts.end())
        throw std::runtime_error("a verdict that is none");
    result.verdict = static_cast<Verdict>(verdict - verdict_texts.begin());
    result.message = json.at("message").get<std::string>();
    result.facts = json.at("facts");
    for (const ring::Json &image : json.at("images"))
        result.exhibits.push_back({image.at("label").get<std::string>(), image.at("png").get<std::string>(),
                                   image.at("width").get<unsigned>(), image.at("height").get<unsigned>()});
    if (json.contains("wrong_pixel"))
        result.wrong_pixel = json["wrong_pixel"].get<std::array<unsigned, 2>>();
    return result;
}

} // namespace arhost::conform
