// SPDX-License-Identifier: Apache-2.0
#include "yaml/yaml.hpp"

#include "base/text.hpp"
#include "yaml/hints.hpp"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>

namespace arhost::yaml {
namespace {

std::string listed(std::span<const std::string_view> words) {
    std::string text;
    for (const std::string_view word : words)
        text += (text.empty() ? "" : ", ") + std::string(word);
    return text;
}

std::string child_path(const std::string &parent, std::string_view key) {
    return parent.empty() ? std::string(key) : parent + "." + std::string(key);
}

// Returns whether a key path is `ancestor` or below it.
bool is_at_or_below(const std::string &path, const std::string &ancestor) {
    return path.starts_with(ancestor) &&
           (path.size() == ancestor.size() || path[ancestor.size()] == '.' || path[ancestor.size()] == '[');
}

// Splits "outputs[0].path" into "outputs", "0" and "path".
std::vector<std::string> split_path(const std::string &path) {
    std::vector<std::string> parts(1);
    for (const char c : path) {
        if (c == '.' || c == '[')
            parts.emplace_back();
        else if (c != ']')
            parts.back() += c;
    }
    return parts;
}

// Returns a value in quotation marks, for messages.
std::string in_quotes(const std::string &text) {
    return "'" + base::printable(text, 200) + "'";
}

std::string position_in(const std::string &name, const YAML::Mark &mark) {
    return name + ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1) + ": ";
}

std::filesystem::path without_dots(const std::filesystem::path &path) {
    std::filesystem::path result;
    std::error_code error; // a missing file is treated as a file that is not a link
    for (const std::filesystem::path &part : std::filesystem::absolute(path)) {
        if (part == ".." && std::filesystem::is_symlink(result, error))
            if (const auto target = std::filesystem::weakly_canonical(result, error); !error)
                result = target;
        if (part == "..")
            result = result.parent_path();
        else if (part != ".")
            result /= part;
    }
    return result;
}

void expect_size_within_limit(std::uintmax_t byte_size, const std::filesystem::path &file) {
    if (byte_size > max_file_bytes)
        throw Error(file.string() + ": is larger than " + std::to_string(max_file_bytes >> 20) +
                    " MB, the limit for YAML files; put large meshes into .obj, .ply or glTF files");
}

YAML::Mark mark_of(const std::string &text, std::size_t position) {
    YAML::Mark mark;
    mark.pos = static_cast<int>(position);
    mark.line = static_cast<int>(std::count(text.begin(), text.begin() + mark.pos, '\n'));
    const std::size_t line = position == 0 ? std::string::npos : text.rfind('\n', position - 1);
    mark.column = static_cast<int>(position - (line + 1)); // in the first line, `line` is npos, so line + 1 is 0
    return mark;
}

// Collects the positions at which documents start, and detects an unterminated quoted value.
class Marks : public YAML::EventHandler {
public:
    std::vector<YAML::Mark> documents;

    explicit Marks(const std::string &text) : text_(text) {}
    void OnDocumentStart(const YAML::Mark &mark) override { documents.push_back(mark); }
    void OnDocumentEnd() override {}
    void OnNull(const YAML::Mark &, YAML::anchor_t) override {}
    void OnAlias(const YAML::Mark &, YAML::anchor_t) override {}
    void OnScalar(const YAML::Mark &mark, const std::string &, YAML::anchor_t, const std::string &) override {
        std::size_t i = static_cast<std::size_t>(std::max(mark.pos, 0));
        while (i < text_.size() &&
               (text_[i] == '&' || text_[i] == '!')) // skips anchors and tags, which precede the value
            i = skip_blanks(text_[i] == '!' && is_quote(i + 1) ? i + 1 : text_.find_first_of(" \t\r\n,[]{}", i));
        if (is_quote(i))
            last_quote_ = i;
    }
    void OnSequenceStart(const YAML::Mark &, const std::string &, YAML::anchor_t,
                         YAML::EmitterStyle::value) override {}
    void OnSequenceEnd() override {}
    void OnMapStart(const YAML::Mark &, const std::string &, YAML::anchor_t, YAML::EmitterStyle::value) override {}
    void OnMapEnd() override {}

    // Returns the start of an unterminated quoted value. yaml-cpp does not report it: it accepts the end of the text
    // as the end of the value.
    std::optional<YAML::Mark> unterminated_quote() const {
        if (!last_quote_)
            return std::nullopt;
        const char quote = text_[*last_quote_];
        for (std::size_t i = *last_quote_ + 1; i < text_.size(); ++i)
            if ((quote == '"' && text_[i] == '\\') || (quote == '\'' && text_.compare(i, 2, "''") == 0))
                ++i; // skips the escaped character
            else if (text_[i] == quote)
                return std::nullopt;
        return mark_of(text_, *last_quote_);
    }

private:
    bool is_quote(std::size_t i) const { return i < text_.size() && (text_[i] == '"' || text_[i] == '\''); }
    std::size_t skip_blanks(std::size_t i) const { // also skips comments
        while ((i = text_.find_first_not_of(" \t\r\n", i)) < text_.size() && text_[i] == '#')
            i = text_.find('\n', i);
        return i;
    }

    const std::string &text_;
    std::optional<std::size_t> last_quote_;
};

// Parses the text. Throws YAML::ParserException, also for errors that yaml-cpp does not report.
YAML::Node read(std::string text) {
    while (text.starts_with("\xef\xbb\xbf")) // the byte order mark, which YAML::Mark does not count
        text.erase(0, 3);
    // yaml-cpp interprets some control characters as the end of the text, or as UTF-16.
    if (const auto c = std::ranges::find_if(
            text, [](unsigned char c) { return (c < ' ' && c != '\t' && c != '\n' && c != '\r') || c == 0x7f; });
        c != text.end())
        throw YAML::ParserException(mark_of(text, static_cast<std::size_t>(c - text.begin())),
                                    "control characters are not allowed in YAML");
    if (!base::is_utf8(text)) {
        std::size_t line = 0, end = 0;
        while (end = std::min(text.find('\n', line), text.size()), base::is_utf8({&text[line], end - line}))
            line = end + 1;
        throw YAML::ParserException(mark_of(text, line), "this line is not valid UTF-8");
    }
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    Marks marks(text);
    const auto expect_quotes_terminated = [&] {
        if (const auto quote = marks.unterminated_quote())
            throw YAML::ParserException(*quote, "this quoted value is not terminated");
    };
    try {
        // Does not use YAML::LoadAll, which does not return for "[1], 2": the comma starts a new document but is
        // never consumed, so LoadAll produces an infinite number of documents.
        while (marks.documents.size() < 2 && parser.HandleNextDocument(marks)) {
        }
    } catch (const YAML::Exception &) {
        expect_quotes_terminated(); // reports the start of the value instead of the end of the text
        throw;
    }
    expect_quotes_terminated();
    if (marks.documents.size() > 1)
        throw YAML::ParserException(
            marks.documents[1],
            "a second document starts here; the file must contain only one (remove the '---' or this content)");
    return YAML::Load(text);
}

} // namespace

std::string read_file(const std::filesystem::path &file) {
    std::error_code ignored;
    if (std::filesystem::is_directory(file, ignored))
        throw Error(file.string() + ": is a folder, not a YAML file");
    if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored))
        throw Error(file.string() + ": is not a regular file");
    if (!base::is_utf8(
            std::filesystem::absolute(file).native())) // relative paths in the file would not be valid UTF-8 either
        throw Error(std::filesystem::absolute(file).string() +
                    ": the file's path is not valid UTF-8; rename the file or the folder");
    if (const std::uintmax_t byte_size = std::filesystem::file_size(file, ignored); !ignored)
        expect_size_within_limit(byte_size, file);
    std::string content;
    errno = 0;
    try {
        std::ifstream stream;
        stream.exceptions(std::ios::badbit | std::ios::failbit);
        stream.open(file, std::ios::binary);
        content.assign(std::istreambuf_iterator<char>(stream), {});
    } catch (const std::ios_base::failure &) {
        throw Error(file.string() + ": cannot be read: " + std::strerror(errno ? errno : EIO));
    }
    return content;
}

Node Node::load(const std::filesystem::path &file) {
    return parse(read_file(file), file.string());
}

Node Node::parse(const std::string &text, const std::string &name) {
    auto document = std::make_shared<Document>(Document{.name = name});
    try {
        return Node(read(text), "", document);
    } catch (const YAML::Exception &error) {
        const std::string hint =
            error.mark.is_null() ? "" : hint_for_syntax_error(text, static_cast<std::size_t>(error.mark.line));
        throw Error(position_in(name, error.mark) + "YAML syntax: " + error.msg + hint);
    }
}

Node Node::scalar(const std::string &text, const std::string &name) {
    return Node(YAML::Node(text), "", std::make_shared<Document>(Document{.name = name}));
}

void Node::override_value(const std::string &path, const std::string &value, const std::string &option) {
    YAML::Node parsed;
    try {
        parsed = read(value);
    } catch (const YAML::Exception &error) {
        throw Error(option + " " + path + "=" + base::printable(value, 200) + ": YAML syntax: " + error.msg);
    }
    replace(path, parsed, option);
}

void Node::override_text(const std::string &path, const std::string &text, const std::string &option) {
    replace(path, YAML::Node(text), option);
}

void Node::replace(const std::string &path, const YAML::Node &value, const std::string &option) {
    YAML::Node at = node_;
    std::string canonical; // the key path in the format of Node::path()
    for (const std::string &part : split_path(path)) {
        const auto reject = [&](const std::string &why) { throw Error(option + " " + path + ": " + why); };
        if (part.empty())
            reject("a key is empty; write it as in tracker.options.border_bits=2");
        canonical = at.IsSequence() ? canonical + "[" + part + "]" : child_path(canonical, part);
        if (at.IsSequence()) {
            std::size_t index = 0;
            const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
            if (error != std::errc() || *end != '\0' || index >= at.size())
                reject("'" + part + "' is not a valid index; the number of elements in the list is " +
                       std::to_string(at.size()));
            at.reset(YAML::Node(at[index]));
        } else if (at.IsMap() || at.IsNull() || !at.IsDefined()) {
            at.reset(YAML::Node(at[part]));
        } else {
            reject("the parent of '" + part + "' is a scalar, which cannot have keys");
        }
    }
    at = value;
    document_->overrides[canonical] = option;
}

void Node::remove(const std::string &key) {
    while (node_.remove(key)) { // each call removes one of several equal keys
    }
}

Node::Origin Node::origin() const {
    Origin origin = document_->origin.value_or(Origin{std::filesystem::absolute(file()).parent_path(), {}});
    for (const auto &[path, option] : document_->overrides)
        origin.overridden[path] = std::filesystem::current_path();
    return origin;
}

Node Node::load_copy(const std::filesystem::path &file, const Origin &origin) {
    Node root = load(file);
    root.document_->origin = origin;
    return root;
}

std::string Node::to_yaml(std::initializer_list<std::string_view> omitted) const {
    YAML::Node copy = YAML::Clone(node_);
    for (const std::string_view key : omitted)
        while (copy.remove(std::string(key))) {
        }
    return YAML::Dump(copy);
}

std::string Node::option() const {
    std::string nearest_option; // of several matching paths, the longest comes last in the map
    for (const auto &[path, option] : document_->overrides)
        if (is_at_or_below(path_, path))
            nearest_option = option;
    return nearest_option;
}

std::filesystem::path Node::file() const {
    return document_->name;
}

std::string Node::where() const {
    if (std::string name = option(); !name.empty())
        return name;
    const YAML::Mark mark = node_.Mark();
    if (mark.is_null())
        return document_->name;
    return document_->name + ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1);
}

void Node::fail(const std::string &message) const {
    throw Error(where() + ": " + (path_.empty() ? "" : path_ + ": ") + message);
}

void Node::allow_keys(std::span<const std::string_view> keys) const {
    if (const std::vector<Node> unknown = set_aside_keys(keys); !unknown.empty())
        unknown.front().fail("unknown key; known keys: " + listed(keys));
}

std::vector<Node> Node::set_aside_keys(std::span<const std::string_view> keys) const {
    expect_map();
    std::set<std::string> seen;
    std::vector<Node> unknown;
    for (const auto &entry : node_) {
        const std::string &key = entry.first.Scalar();
        const Node at_key(entry.first, child_path(path_, key), document_);
        if (!seen.insert(key).second)
            at_key.fail("duplicate key; keep one of them");
        if (std::ranges::find(keys, std::string_view(key)) != keys.end())
            continue;
        const std::string hint = hint_for_missing_space(key), near = base::nearest(key, keys);
        if (!hint.empty() || !near.empty())
            at_key.fail("unknown key" + (!hint.empty() ? hint : "; did you mean '" + near + "'?"));
        if (at_key.is_overridden())
            at_key.fail("unknown key; known keys: " + listed(keys));
        unknown.push_back(at_key);
    }
    return unknown;
}

std::optional<Node> Node::find(std::string_view key) const {
    for (const auto &[name, value] : entries())
        if (name == key)
            return value;
    return std::nullopt;
}

Node Node::require(std::string_view key) const {
    if (auto found = find(key))
        return *found;
    fail("the key '" + std::string(key) + "' is missing");
}

void Node::expect_map() const {
    if (!node_.IsMap())
        fail(is_null() ? "must be a map of keys, but is empty"
                       : "must be a map of keys" + (is_scalar() ? hint_for_missing_space(node_.Scalar()) : ""));
    for (const auto &entry : node_)
        if (!entry.first.IsScalar())
            fail("the keys of a map must be scalars");
}

std::vector<std::pair<std::string, Node>> Node::entries() const {
    expect_map();
    std::vector<std::pair<std::string, Node>> found;
    for (const auto &entry : node_) {
        const std::string key = entry.first.Scalar();
        found.emplace_back(key, Node(entry.second, child_path(path_, key), document_));
    }
    return found;
}

std::vector<Node> Node::items() const {
    if (!node_.IsSequence())
        fail("must be a list");
    std::vector<Node> found;
    for (std::size_t i = 0; i < node_.size(); ++i)
        found.push_back(Node(node_[i], path_ + "[" + std::to_string(i) + "]", document_));
    return found;
}

std::string Node::scalar(const char *expected) const {
    if (!node_.IsScalar())
        fail(std::string("must be ") + expected + (node_.IsNull() ? ", but is empty" : ""));
    return node_.Scalar();
}

bool Node::boolean() const {
    const std::string text = scalar("true or false");
    if (text == "true")
        return true;
    if (text == "false")
        return false;
    fail("must be true or false, but is " + in_quotes(text));
}

std::int64_t Node::integer(std::int64_t minimum, std::int64_t maximum) const {
    const std::string text = scalar("a whole number");
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        fail("must be a whole number, but is " + in_quotes(text));
    if (value < minimum || value > maximum)
        fail("must be " + std::to_string(minimum) + " to " + std::to_string(maximum) + ", but is " +
             base::printable(text, 200));
    return value;
}

double Node::real(double minimum, double maximum) const {
    const std::string text = scalar("a number");
    std::string digits = text.substr(text.starts_with('+') ? 1 : 0);
    if (const std::size_t dot = digits.find('.');
        dot != std::string::npos && std::isalpha(static_cast<unsigned char>(digits[dot + 1])))
        digits.erase(dot, 1); // converts YAML's .inf and .nan
    double value = 0;
    const char *end_of_text = digits.data() + digits.size();
    const auto [end, error] = std::from_chars(digits.data(), end_of_text, value);
    if (error == std::errc::invalid_argument || end != end_of_text)
        fail("must be a number, but is " + in_quotes(text));
    std::ostringstream range;
    if (std::isfinite(minimum) && std::isfinite(maximum))
        range << minimum << " to " << maximum;
    else if (std::isfinite(minimum))
        range << "at least " << minimum;
    else if (std::isfinite(maximum))
        range << "at most " << maximum;
    const bool too_small = error != std::errc() && std::abs(std::strtod(digits.c_str(), nullptr)) < 1;
    if (error != std::errc() || !std::isfinite(value))
        fail((too_small ? "must not be so close to 0" : "must be a finite number") +
             (range.str().empty() ? "" : ", " + range.str()) + ", but is " + base::printable(text, 200));
    if (value < minimum || value > maximum)
        fail("must be " + range.str() + ", but is " + base::printable(text, 200));
    return value;
}

std::string Node::text() const {
    std::string value = scalar("text");
    if (value.empty())
        fail("must not be empty");
    if (value.find('\0') != std::string::npos) // the kernel would truncate a file name at the NUL
        fail("must not contain a NUL character");
    return value;
}

std::string Node::choice(std::span<const std::string_view> choices) const {
    std::string value = text();
    if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
        const std::string near = base::nearest(value, choices);
        fail(in_quotes(value) + " is not one of " + listed(choices) +
             (near.empty() ? "" : "; did you mean '" + near + "'?"));
    }
    return value;
}

bool Node::is_unlike(std::span<const std::string_view> choices) const {
    return !is_overridden() && base::nearest(text(), choices).empty();
}

std::vector<double> Node::reals() const {
    std::vector<double> values;
    for (const Node &item : items())
        values.push_back(item.real());
    return values;
}

std::vector<double> Node::reals(std::size_t count) const {
    std::vector<double> values = reals();
    if (values.size() != count)
        fail("must be a list of " + std::to_string(count) + " numbers, but has " + std::to_string(values.size()));
    return values;
}

std::filesystem::path Node::input_path() const {
    if (is_overridden())
        return path_below({});
    const std::optional<Origin> &origin = document_->origin;
    if (!origin)
        return path_below(file().parent_path());
    std::filesystem::path folder = origin->folder; // of several matching paths, the longest comes last in the map
    for (const auto &[path, overridden] : origin->overridden)
        if (is_at_or_below(path_, path))
            folder = overridden;
    return path_below(folder);
}

std::filesystem::path Node::output_path() const {
    return path_below({});
}

std::filesystem::path Node::path_below(const std::filesystem::path &folder) const {
    const std::string text = this->text();
    const bool is_below_home = text.starts_with("~/") && !document_->home.empty();
    std::filesystem::path path = without_dots(is_below_home ? document_->home / text.substr(2) : folder / text);
    if (!base::is_utf8(path.native())) // the plugin interface requires UTF-8 paths
        fail("the path " + in_quotes(path) + " is not valid UTF-8; rename the file or the folder");
    return path;
}

} // namespace arhost::yaml
