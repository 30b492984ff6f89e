// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/file.hpp"

#include "scene/gltf/compression.hpp"
#include "scene/mesh.hpp"
#include "scene/mesh_file.hpp"
#include "scene/referred_files.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace arhost::scene {
namespace {

using Json = nlohmann::json;

constexpr std::uint64_t file_limit = std::uint64_t(4) << 30; // for a .gltf, a .glb, and each external buffer

// Keeps the encoded image. It is decoded later, when a material refers to it.
bool keep_image_bytes(tinygltf::Image *image, int, std::string *, std::string *, int, int, const unsigned char *bytes,
                      int size, void *) {
    image->image.assign(bytes, bytes + size);
    return true;
}

bool is_file(const std::string &file, void *) { // rejects FIFOs, which would block when opened
    std::error_code ignored;
    return std::filesystem::is_regular_file(file, ignored);
}

// Input of read_file: how to read the resources (buffers and images) of a glTF file.
struct Resources {
    const Reporter &reporter;
    ReferredFiles files;
};

bool read_file(std::vector<unsigned char> *content, std::string *error, const std::string &file, void *context) {
    const auto &resources = *static_cast<const Resources *>(context);
    const std::filesystem::path resolved = resources.files.resolve(file);
    resources.reporter.reads(file);
    std::error_code ignored;
    if (is_file(resolved, nullptr) && std::filesystem::file_size(resolved, ignored) <= file_limit)
        return tinygltf::ReadWholeFile(content, error, resolved, nullptr);
    *error += file + ": is not a regular file, or is larger than 4 GiB";
    return false;
}

std::uint32_t number_at(std::string_view bytes, std::size_t offset) { // little-endian
    std::uint32_t number = 0;
    for (std::size_t i = 4; i-- > 0;)
        number = number << 8 | static_cast<unsigned char>(bytes[offset + i]);
    return number;
}

// Returns what to change if tinygltf's `error` names a file that it could not find.
std::string hint_at_uri(std::string_view error) {
    constexpr std::string_view not_found = "File not found : ";
    const std::size_t at = error.find(not_found);
    const std::string_view uri = at == std::string_view::npos ? "" : error.substr(at + not_found.size());
    if (uri.substr(0, uri.find('\n')).find("://") != std::string_view::npos)
        return "; arhost downloads nothing: place the file next to the glTF file and write its relative path as "
               "'uri'";
    if (uri.starts_with('/'))
        return "; write a path relative to the glTF file as 'uri'";
    return "";
}

// Returns the content of a .gltf or .glb file, without bytes after the length that a .glb declares.
std::string_view content_of(const MeshFile &text) {
    constexpr std::size_t header = 12, length_at = 8;
    const std::string_view all = text.view();
    if (!all.starts_with("glTF") || all.size() < header)
        return all;
    const std::size_t length = number_at(all, length_at);
    if (length > all.size())
        text.fail("is truncated: it has " + std::to_string(all.size()) + " of " + std::to_string(length) + " bytes");
    return all.substr(0, std::max(length, header));
}

// Returns the JSON of a .gltf or .glb file. Throws if a chunk of a .glb extends past the end of the file.
std::string_view json_of(const MeshFile &text) {
    const std::string_view all = content_of(text);
    if (!all.starts_with("glTF"))
        return all;
    constexpr std::size_t header = 12, chunk_header = 8;
    std::string_view json;
    for (std::size_t at = header; at < all.size();) {
        const std::size_t left = all.size() - at;
        const std::size_t size = left < chunk_header ? left : number_at(all, at);
        if (left < chunk_header || size > left - chunk_header)
            text.fail("is truncated: a chunk extends past the end of the file");
        if (at == header)
            json = all.substr(at + chunk_header, size);
        at += chunk_header + size;
    }
    return json;
}

// Returns the file with other JSON.
std::string with_json(const MeshFile &text, const Json &replacement) {
    std::string json = replacement.dump();
    const std::string_view all = content_of(text);
    if (!all.starts_with("glTF"))
        return json;
    constexpr std::size_t header = 12, chunk_header = 8;
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::string_view rest = all.substr(header + chunk_header + json_of(text).size());
    const std::size_t size = header + chunk_header + json.size() + rest.size();
    if (size > file_limit - 1)
        text.fail("is larger than 4 GiB");
    const auto bytes = [](std::size_t number) { // little-endian
        std::string result;
        for (int shift = 0; shift < 32; shift += 8)
            result += static_cast<char>(number >> shift);
        return result;
    };
    return std::string(all.substr(0, 8))
        .append(bytes(size))
        .append(bytes(json.size()))
        .append("JSON")
        .append(json)
        .append(rest);
}

// Returns the JSON of the file; null if it is invalid, which tinygltf reports. Rejects JSON with which tinygltf would
// recurse without limit.
Json checked_json(const MeshFile &text) {
    const auto check_depth = [&](int depth, Json::parse_event_t, Json &) {
        constexpr int max_depth = 64;
        if (depth > max_depth)
            text.fail("its JSON is nested more than 64 levels deep");
        return true;
    };
    const std::string_view json = json_of(text);
    Json root = Json::parse(json.begin(), json.end(), check_depth, false);
    if (!root.is_object())
        return {};
    const Json asset = root.value("asset", Json());
    const Json version = asset.is_object() ? asset.value("version", Json()) : Json();
    if (!version.is_string() || !version.get<std::string>().starts_with("2."))
        text.fail("is not glTF 2: its asset.version must be \"2.0\"");
    if (const Json needed = asset.value("minVersion", Json("2.0")); needed != Json("2.0"))
        text.fail("its asset.minVersion is " + printable(needed.dump()) +
                  ", but arhost reads glTF 2.0; export it as glTF 2.0");
    return root;
}

// Rejects files with which tinygltf would read out of bounds.
void check_ranges(const MeshFile &text, const Json &root) {
    const auto list = [&](const char *key) {
        const auto found = root.find(key);
        return found != root.end() && found->is_array() ? *found : Json::array();
    };
    const auto number = [&](const Json &object, const char *key) -> std::uint64_t {
        if (!object.is_object() || !object.contains(key))
            return 0;
        if (!object[key].is_number_unsigned())
            text.fail("a value of '" + std::string(key) + "' is not an unsigned integer");
        return object[key].get<std::uint64_t>();
    };
    for (const Json &accessor : list("accessors"))
        number(accessor, "byteOffset");
    const Json buffers = list("buffers"), views = list("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i) {
        const std::uint64_t buffer = number(views[i], "buffer"), offset = number(views[i], "byteOffset"),
                            size = number(views[i], "byteLength");
        const std::uint64_t all = buffer < buffers.size() ? number(buffers[buffer], "byteLength") : 0;
        if (offset > all || size > all - offset)
            text.fail("buffer view " + std::to_string(i) + " extends past the end of its buffer");
    }
}

} // namespace

GltfFile read_gltf_file(const std::filesystem::path &file, std::span<const std::filesystem::path> reads,
                        const Reporter &reporter) {
    const MeshFile text = MeshFile::read(file, file_limit - 1, reporter);
    GltfFile result;
    result.json = checked_json(text);
    std::string_view content = content_of(text);
    std::string plain_content;
    if (result.json.is_object()) {
        const Json plain = plain_json(result.json, text.name());
        check_ranges(text, plain);
        if (plain != result.json)
            content = plain_content = with_json(text, plain);
    }
    tinygltf::TinyGLTF parser;
    parser.SetImageLoader(keep_image_bytes, nullptr);
    const std::string folder = file.parent_path().string();
    Resources resources{reporter, ReferredFiles(file, reads)};
    parser.SetFsCallbacks({is_file, tinygltf::ExpandFilePath, read_file, tinygltf::WriteWholeFile, &resources});
    std::string error, warning;
    const auto size = static_cast<unsigned int>(content.size());
    const bool good =
        content.starts_with("glTF")
            ? parser.LoadBinaryFromMemory(&result.model, &error, &warning,
                                          reinterpret_cast<const unsigned char *>(content.data()), size, folder)
            : parser.LoadASCIIFromString(&result.model, &error, &warning, content.data(), size, folder);
    const auto on_one_line = [](std::string lines) {
        while (!lines.empty() && lines.back() == '\n')
            lines.pop_back();
        for (char &c : lines)
            if (static_cast<unsigned char>(c) < 0x20)
                c = ' ';
        return lines.substr(0, 500);
    };
    if (!good)
        text.fail("cannot be loaded as glTF 2.0: " + on_one_line(error) + hint_at_uri(error));
    if (!warning.empty())
        reporter.info(text.name() + ": " + on_one_line(warning));
    decompress(result, text.name(), reporter);
    return result;
}

} // namespace arhost::scene
