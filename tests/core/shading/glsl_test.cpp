// SPDX-License-Identifier: Apache-2.0
//
// Tests that the leaf files are valid GLSL: a shader that calls all leaf functions must compile to SPIR-V. The test
// generates the shader from the declarations, so that it covers all functions.
#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace {

const std::filesystem::path include_folder = arhost::test::source_directory() + "/core/shading/include";
const std::filesystem::path shading = include_folder / "arhost" / "shading";

std::string contents(const std::filesystem::path &path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
}

std::string without_comments(const std::string &text) {
    return std::regex_replace(text, std::regex("//[^\n]*"), "");
}

// Returns the code of the leaf files; the keys are the file names.
std::map<std::string, std::string> leaf_files() {
    std::map<std::string, std::string> files;
    for (const auto &entry : std::filesystem::directory_iterator(shading / "leaf"))
        files[entry.path().filename()] = without_comments(contents(entry.path()));
    return files;
}

struct Function {
    std::string result, name;
    std::vector<std::string> parameters; // types
};

std::vector<Function> functions_of(const std::string &code) {
    static const std::regex declaration(R"(ARHOST_LEAF\s+(\w+)\s+(\w+)\(([^)]*)\)\s*\{)"),
        parameter(R"((\w+)\s+\w+)");
    std::vector<Function> functions;
    for (std::sregex_iterator it(code.begin(), code.end(), declaration), end; it != end; ++it) {
        Function function{(*it)[1], (*it)[2], {}};
        const std::string parameters = (*it)[3];
        for (std::sregex_iterator p(parameters.begin(), parameters.end(), parameter); p != end; ++p)
            function.parameters.push_back((*p)[1]);
        functions.push_back(function);
    }
    return functions;
}

std::size_t count_of(const std::string &text, const std::string &word) {
    const std::regex whole("\\b" + word + "\\b");
    return static_cast<std::size_t>(
        std::distance(std::sregex_iterator(text.begin(), text.end(), whole), std::sregex_iterator()));
}

// Returns a shader that calls `functions`. It reads the arguments from a buffer and writes the results to it, so that
// the compiler cannot remove a call.
std::string shader_that_calls(const std::vector<Function> &functions) {
    std::string blocks, calls;
    std::map<std::string, std::string> values{
        {"Float", "number"}, {"Vec3", "vec3(number, number + 1.0, number + 2.0)"}, {"Bool", "(number > 0.0)"}};
    for (const Function &function : functions) {
        std::string arguments;
        for (const std::string &type : function.parameters) {
            if (!values.contains(type)) { // the type is a struct of the leaf files
                values[type] = "uniform_" + type;
                blocks += "layout(binding = " + std::to_string(values.size()) + ") uniform " + type + "Block { " +
                          type + " " + values[type] + "; };\n";
            }
            arguments += (arguments.empty() ? "" : ", ") + values[type];
        }
        const std::string call = function.name + "(" + arguments + ")";
        calls += "    sum += " + (function.result == "Vec3" ? call : "vec3(" + call + ")") + ";\n";
    }
    return "#version 450\n"
           "#extension GL_GOOGLE_include_directive : require\n"
           "#include \"arhost/shading/glsl.h\"\n"
           "layout(local_size_x = 1) in;\n"
           "layout(std430, binding = 0) buffer Numbers { float number; vec3 result; };\n" +
           blocks + "void main() {\n    vec3 sum = vec3(0.0);\n" + calls + "    result = sum;\n}\n";
}

class Compiler : public testing::Test {
protected:
    void SetUp() override {
        if (std::string(ARHOST_GLSLANG).empty())
            GTEST_SKIP() << "glslangValidator is not installed (Debian: glslang-tools)";
    }
    // Compiles a compute shader. Returns the error messages, or an empty string if it compiles.
    std::string compile_errors(const std::string &shader) const {
        const std::string folder = folder_.path(), source = folder + "/shader.comp", log = folder + "/log";
        std::ofstream(source) << shader;
        const std::string command = ARHOST_GLSLANG " -V --target-env vulkan1.2 -I" + include_folder.string() +
                                    " -o " + folder + "/shader.spv " + source + " > " + log;
        return std::system(command.c_str()) == 0 ? "" : contents(log) + shader;
    }

private:
    arhost::test::ScratchFolder folder_;
};

} // namespace

TEST(LeafFiles, AllFunctionsAreParsed) {
    for (const auto &[name, code] : leaf_files()) {
        EXPECT_FALSE(functions_of(code).empty()) << name;
        EXPECT_EQ(functions_of(code).size(), count_of(code, "ARHOST_LEAF")) << name;
        EXPECT_EQ(functions_of(code).size(), count_of(code, "return")) << name << ": one return per function";
    }
}

TEST(LeafFiles, HaveNoBranches) {
    for (const auto &[name, code] : leaf_files()) {
        for (const char *word : {"if", "else", "for", "while", "do", "switch", "case", "goto", "break", "continue"})
            EXPECT_EQ(count_of(code, word), 0u) << name << ": " << word;
        for (const char *sign : {"?", "&&", "||", "#"})
            EXPECT_EQ(code.find(sign), std::string::npos) << name << ": " << sign;
    }
}

TEST(LeafFiles, AreAllIncludedByEveryImplementation) {
    for (const auto &path :
         {shading / "scalar.hpp", shading / "glsl.h",
          std::filesystem::path(arhost::test::source_directory() + "/plugins/raytracer_common/packets/packet.hpp")})
        for (const auto &[name, code] : leaf_files())
            EXPECT_NE(contents(path).find("leaf/" + name), std::string::npos) << path << " lacks " << name;
}

TEST_F(Compiler, AcceptsAShaderThatCallsEveryLeafFunction) {
    std::vector<Function> functions;
    for (const auto &[name, code] : leaf_files())
        std::ranges::copy(functions_of(code), std::back_inserter(functions));
    EXPECT_EQ(compile_errors(shader_that_calls(functions)), "");
}

TEST_F(Compiler, RejectsAMissingFunction) {
    EXPECT_NE(compile_errors(shader_that_calls({{"Float", "no_such_function", {"Float"}}})).find("no_such_function"),
              std::string::npos);
}
