// SPDX-License-Identifier: Apache-2.0
#include "scene/mtl.hpp"

#include "scene/mesh.hpp"

#include <algorithm>
#include <cctype>
#include <set>

namespace arhost::scene {
namespace {

struct ColourKey {
    std::string_view name;
    std::optional<glm::vec3> MtlMaterial::*to;
    float highest;
};
constexpr ColourKey colour_keys[] = {
    {"kd", &MtlMaterial::diffuse, 1},
    {"ks", &MtlMaterial::specular, 1},
    {"ke", &MtlMaterial::emission, radiance_limit},
    {"tf", &MtlMaterial::transmission, 1},
};

struct NumberKey {
    std::string_view name;
    std::optional<float> MtlMaterial::*to;
    float highest;
};
constexpr NumberKey number_keys[] = {
    {"ns", &MtlMaterial::exponent, coordinate_limit_mm},
    {"d", &MtlMaterial::opacity, 1},
    {"tr", &MtlMaterial::transparency, 1},
    {"ni", &MtlMaterial::index, 4},
    {"pr", &MtlMaterial::roughness, 1},
    {"pm", &MtlMaterial::metallic, 1},
    {"illum", &MtlMaterial::model, 10},
};

struct TextureKey {
    std::string_view name;
    std::optional<MtlTexture> MtlMaterial::*to;
};
constexpr TextureKey texture_keys[] = {
    {"map_kd", &MtlMaterial::diffuse_map},   {"map_ks", &MtlMaterial::specular_map},
    {"map_ke", &MtlMaterial::emission_map},  {"map_d", &MtlMaterial::opacity_map},
    {"map_pr", &MtlMaterial::roughness_map}, {"map_pm", &MtlMaterial::metallic_map},
    {"map_bump", &MtlMaterial::bump_map},    {"bump", &MtlMaterial::bump_map},
    {"norm", &MtlMaterial::normal_map},
};

struct IgnoredOption {
    std::string_view name;
    int values; // at most; those after the first one are numbers
};
constexpr IgnoredOption ignored_options[] = {
    {"-blendu", 1},  {"-blendv", 1}, {"-boost", 1}, {"-cc", 1},     {"-colorspace", 1},
    {"-imfchan", 1}, {"-mm", 2},     {"-t", 3},     {"-texres", 1}, {"-type", 1},
};

template <class Keys> auto find(const Keys &keys, std::string_view name) {
    const auto found = std::ranges::find(keys, name, [](const auto &key) { return key.name; });
    return found == std::end(keys) ? nullptr : &*found;
}

class MtlParser {
public:
    MtlParser(const MeshFile &file, const Reporter &reporter)
        : file_(file), reporter_(reporter), p_(file.begin()), end_(file.end()) {}

    std::map<std::string, MtlMaterial> parse() {
        if (file_.view().starts_with("\xef\xbb\xbf")) // UTF-8 byte order mark
            p_ += 3;
        for (; p_ < end_; ++line_number_) {
            statement();
            skip_line(p_, end_);
            if (line_number_ % 65536 == 0)
                reporter_.report(-1);
        }
        std::string ignored;
        for (const std::string &name : ignored_)
            ignored += (ignored.empty() ? "" : ", ") + name;
        if (!ignored.empty())
            reporter_.info(file_.name() + ": these statements and options are ignored: " + ignored);
        return std::move(materials_);
    }

private:
    void statement() {
        word();
        const std::string name = lower(word_);
        if (name.empty() || name[0] == '#' || name == "ka" || name == "map_ka")
            return;
        if (name == "newmtl") {
            material_ = &(materials_[std::string(rest_of_line(p_, end_))] = {});
            return;
        }
        const auto *colour = find(colour_keys, name);
        const auto *number = find(number_keys, name);
        const auto *texture = find(texture_keys, name);
        if (!colour && !number && !texture)
            return ignore(word_);
        if (!material_)
            fail("'" + std::string(word_) + "' precedes the first 'newmtl'; move it below");
        if (colour)
            material_->*(colour->to) = colour_of(colour->highest);
        else if (number)
            material_->*(number->to) = number_of(number->highest);
        else
            material_->*(texture->to) = texture_of();
    }

    glm::vec3 colour_of(float highest) {
        const std::string key(word_);
        glm::vec3 colour(0);
        int count = 0;
        for (; count < 3 && next_word(); ++count)
            colour[count] = value(key, highest);
        if (count == 1)
            return glm::vec3(colour[0]);
        if (count != 3)
            fail(key + " needs 1 or 3 numbers, but has " + std::to_string(count));
        return colour;
    }

    float number_of(float highest) {
        const std::string key(word_);
        bool has_value = next_word();
        if (has_value && lower(word_) == "-halo") {
            ignore(word_);
            has_value = next_word();
        }
        if (!has_value)
            fail(key + " needs a number");
        return value(key, highest);
    }

    MtlTexture texture_of() {
        MtlTexture texture;
        texture.where = file_.name() + ":" + std::to_string(line_number_) + ": " + std::string(word_);
        glm::vec2 scale(1), offset(0);
        while (true) {
            const char *before = p_;
            word();
            const std::string option = lower(word_);
            if (option == "-s") {
                read_vector(scale);
            } else if (option == "-o") {
                read_vector(offset);
            } else if (option == "-bm") {
                const std::string key(word_);
                if (!next_word())
                    fail(key + " needs a number");
                texture.multiplier = number(coordinate_limit_mm);
            } else if (option == "-clamp") {
                word();
                if (lower(word_) == "on")
                    texture.lookup.wrap_u = texture.lookup.wrap_v = ARHOST_WRAP_CLAMP;
            } else if (const auto *ignored = find(ignored_options, option)) {
                ignore(word_);
                word();
                for (int i = 1; i < ignored->values && next_number(); ++i)
                    word();
            } else {
                p_ = before;
                break;
            }
        }
        texture.file = rest_of_line(p_, end_);
        std::ranges::replace(texture.file, '\\', '/');
        if (texture.file.empty())
            fail("the name of an image is missing");
        // In MTL, v = 0 is the bottom of the image: v' = 1 − (scale · (1 − v) + offset).
        texture.lookup.image_from_texcoord = {{scale.x, 0}, {0, scale.y}, {offset.x, 1 - scale.y - offset.y}};
        return texture;
    }

    // Reads one to three numbers; the third one is for volumes.
    void read_vector(glm::vec2 &to) {
        const std::string key(word_);
        if (!next_number())
            fail(key + " needs one to three numbers");
        for (int i = 0; i < 3 && next_number(); ++i) {
            word();
            const float component = number(coordinate_limit_mm / 4);
            if (i < 2)
                to[i] = component;
        }
    }

    bool next_number() const {
        const char *p = p_;
        float value = 0;
        skip_blanks(p, end_);
        return read_number(p, end_, value) && (p == end_ || is_blank(*p) || *p == '\n');
    }
    // Returns the word as a number of at most this absolute value.
    float number(float highest) const {
        const char *begin = word_.data(), *stop = begin;
        float value = 0;
        if (!read_number(stop, begin + word_.size(), value) || stop != begin + word_.size())
            fail("'" + token_at(begin, begin + word_.size()) + "' is not a number");
        if (!(std::abs(value) <= highest))
            fail("the number '" + token_at(begin, begin + word_.size()) + "' is invalid");
        return value;
    }
    float value(const std::string &key, float highest) const {
        const float value = number(std::numeric_limits<float>::max());
        if (value < 0)
            fail(key + " must be 0 or more, but is " + std::string(word_));
        return std::min(value, highest);
    }

    void word() {
        skip_blanks(p_, end_);
        const char *begin = p_;
        while (p_ < end_ && *p_ != '\n' && !is_blank(*p_))
            ++p_;
        word_ = {begin, static_cast<std::size_t>(p_ - begin)};
    }
    bool next_word() {
        word();
        return !word_.empty();
    }
    static std::string lower(std::string_view text) {
        std::string result(text);
        std::ranges::transform(result, result.begin(), [](unsigned char c) { return std::tolower(c); });
        return result;
    }

    void ignore(std::string_view name) {
        constexpr std::size_t most_names = 20;
        if (ignored_.size() < most_names)
            ignored_.insert(token_at(name.data(), name.data() + name.size()));
    }
    [[noreturn]] void fail(const std::string &message) const {
        throw MeshError(file_.name() + ":" + std::to_string(line_number_) + ": " + message);
    }

    const MeshFile &file_;
    const Reporter &reporter_;
    const char *p_, *end_;
    std::size_t line_number_ = 1;
    std::string_view word_;
    std::map<std::string, MtlMaterial> materials_;
    MtlMaterial *material_ = nullptr;
    std::set<std::string> ignored_;
};

} // namespace

std::map<std::string, MtlMaterial> parse_mtl(MeshFile &file, const Reporter &reporter) {
    file.normalize_line_ends();
    return MtlParser(file, reporter).parse();
}

} // namespace arhost::scene
