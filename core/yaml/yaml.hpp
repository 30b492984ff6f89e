// SPDX-License-Identifier: Apache-2.0
//
// Reads YAML and keeps the source positions: every error message names file, line, column and key, and says how to
// fix the error. Used for configurations, scenes and calibrations.
#pragma once

#include "base/program.hpp"

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace arhost::yaml {

// what() is one line for the user: "lab.yaml:12:5: tracker.targets[0].side_mm: must be …".
class Error : public base::InvalidInput {
public:
    using InvalidInput::InvalidInput;
};

// Larger files are rejected, because reading them would take seconds.
constexpr std::size_t max_file_bytes = 16 << 20;

// Returns the contents of a file. Throws Error if it cannot be read or is larger than max_file_bytes.
std::string read_file(const std::filesystem::path &file);

// A value in a document. Is cheap to copy and keeps the document alive.
class Node {
public:
    Node(const Node &) = default;
    // YAML::Node's own assignment would modify the document.
    Node &operator=(const Node &other) {
        if (this != &other) {
            node_.reset(other.node_);
            path_ = other.path_;
            document_ = other.document_;
        }
        return *this;
    }

    // Parses the contents of a file. Throws the errors of read_file, and Error if the file has a syntax error.
    static Node load(const std::filesystem::path &file);
    // Parses `text`. `name` is used as the file name in error messages.
    static Node parse(const std::string &text, const std::string &name);

    // The folders to which paths in a document are relative: the folder of the document's file and, for overridden
    // values, the folders of the overrides by key path.
    struct Origin {
        std::filesystem::path folder;
        std::map<std::string, std::filesystem::path> overridden;
    };
    Origin origin() const;
    // Reads a copy of a document. Paths have the same meaning as in the original.
    static Node load_copy(const std::filesystem::path &file, const Origin &origin);
    // Returns this value as YAML without comments; if it is a map, without the keys `omitted`.
    std::string to_yaml(std::initializer_list<std::string_view> omitted = {}) const;

    // Creates a scalar that is not from a file. `name` is used as the file name in error messages.
    static Node scalar(const std::string &text, const std::string &name);

    // Replaces or adds the value at a key path ("tracker.options.border_bits", "outputs[0].path"). Implements `--set`
    // and other options. Error messages about this value name the option instead of a line. Must be called on the
    // root.
    void override_value(const std::string &path, const std::string &value, const std::string &option = "--set");
    // Like override_value, but `text` is used as it is and not parsed as YAML.
    void override_text(const std::string &path, const std::string &text, const std::string &option);

    void remove(const std::string &key); // a key of a map, if it exists

    // From here on, paths of this document that begin with "~/" are below `home`. For configurations; scenes and
    // other content name no files in a user's home.
    void expand_home(const std::filesystem::path &home) { document_->home = home; }

    bool is_map() const { return node_.IsMap(); }
    bool is_sequence() const { return node_.IsSequence(); }
    bool is_scalar() const { return node_.IsScalar(); }
    bool is_null() const { return node_.IsNull(); }
    bool is_overridden() const { return !option().empty(); } // this node or an ancestor
    const std::string &path() const { return path_; }        // key path from the root; "" for the root itself
    std::filesystem::path file() const;
    std::string where() const;                                // "file:line:column"
    [[noreturn]] void fail(const std::string &message) const; // throws Error with where() and path()

    // For maps. `allow_keys` rejects duplicate keys and unknown keys, at the position of the key. It suggests the
    // most similar known key. It must be called before the lookups.
    void allow_keys(std::span<const std::string_view> keys) const;
    void allow_keys(std::initializer_list<std::string_view> keys) const {
        allow_keys(std::span(keys.begin(), keys.size()));
    }
    // Like `allow_keys`, but accepts and returns unknown keys that resemble no known key. Rejects them if an option
    // of the command line set them.
    std::vector<Node> set_aside_keys(std::span<const std::string_view> keys) const;
    std::optional<Node> find(std::string_view key) const;
    Node require(std::string_view key) const;
    std::vector<std::pair<std::string, Node>> entries() const; // in file order

    std::vector<Node> items() const; // elements of a sequence

    // For scalars. The optional range includes both ends.
    bool boolean() const;
    std::int64_t integer(std::int64_t minimum = std::numeric_limits<std::int64_t>::min(),
                         std::int64_t maximum = std::numeric_limits<std::int64_t>::max()) const;
    double real(double minimum = -std::numeric_limits<double>::infinity(),
                double maximum = std::numeric_limits<double>::infinity()) const; // a finite number
    std::string text() const;                                                    // a text that is not empty
    // Returns the value, which must be one of `choices`. The error message lists the choices and suggests the most
    // similar one.
    std::string choice(std::span<const std::string_view> choices) const;
    std::string choice(std::initializer_list<std::string_view> choices) const {
        return choice(std::span(choices.begin(), choices.size()));
    }
    // Returns whether the value resembles none of the choices. Returns false if an option of the command line set it.
    bool is_unlike(std::span<const std::string_view> choices) const;
    std::vector<double> reals() const;                  // a sequence of finite numbers
    std::vector<double> reals(std::size_t count) const; // exactly `count` numbers

    // Return absolute UTF-8 paths without `.` and `..`. A `..` after a symbolic link refers to the parent of the
    // link's target, as in the kernel's path resolution.
    // input_path: relative to the document's folder, or to the working directory if the value was set with `--set`.
    // output_path: relative to the working directory.
    std::filesystem::path input_path() const;
    std::filesystem::path output_path() const;

private:
    struct Document {
        std::string name;
        std::map<std::string, std::string> overrides{}; // maps a key path to the option that set it
        std::optional<Origin> origin{};                 // set if the document is a copy
        std::filesystem::path home{};                   // replaces \"~\" in paths; empty: nothing does
    };
    Node(const YAML::Node &node, std::string path, std::shared_ptr<Document> document)
        : node_(node), path_(std::move(path)), document_(std::move(document)) {}
    void expect_map() const;
    std::string scalar(const char *expected) const;
    std::filesystem::path path_below(const std::filesystem::path &folder) const;
    std::string option() const; // the option that overrides this node; "" if there is none
    void replace(const std::string &path, const YAML::Node &value, const std::string &option);

    YAML::Node node_;
    std::string path_;
    std::shared_ptr<Document> document_;
};

} // namespace arhost::yaml
