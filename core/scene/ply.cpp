// SPDX-License-Identifier: Apache-2.0
#include "scene/ply.hpp"

#include "scene/polygon.hpp"
#include "scene/srgb.hpp"

#include <arhost/scene.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace arhost::scene {
namespace {

enum class Type { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float32, Float64 };

struct TypeName {
    std::string_view name;
    Type type;
};
constexpr TypeName type_names[] = {
    {"char", Type::Int8},   {"uchar", Type::Uint8},   {"short", Type::Int16},     {"ushort", Type::Uint16},
    {"int", Type::Int32},   {"uint", Type::Uint32},   {"float", Type::Float32},   {"double", Type::Float64},
    {"int8", Type::Int8},   {"uint8", Type::Uint8},   {"int16", Type::Int16},     {"uint16", Type::Uint16},
    {"int32", Type::Int32}, {"uint32", Type::Uint32}, {"float32", Type::Float32}, {"float64", Type::Float64},
};

std::size_t size_of(Type type) {
    constexpr std::array<std::size_t, 8> sizes = {1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[static_cast<std::size_t>(type)];
}
bool is_integer(Type type) {
    return type != Type::Float32 && type != Type::Float64;
}

struct Property {
    std::string name;
    bool is_list = false;
    Type count_type{}, type{};
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

enum class Format { None, Ascii, Little, Big };

struct Header {
    Format format = Format::None;
    std::vector<Element> elements;
    const char *data = nullptr; // first byte after the header
};

class HeaderParser {
public:
    HeaderParser(const MeshFile &file, const Reporter &reporter)
        : file_(file), reporter_(reporter), p_(file.begin()) {}

    Header parse() {
        // All header lines must end like the first one (LF, CR LF or CR). The following binary data may contain any
        // of these bytes.
        const std::string_view all = file_.view();
        if (all.starts_with("ply\r") && !all.starts_with("ply\r\n"))
            line_end_ = '\r';
        next_line(); // "ply"
        while (true) {
            if (p_ == file_.end())
                file_.fail_line(line_, "the header has no line 'end_header'");
            next_line();
            const std::string_view key = word();
            if (key == "end_header")
                break;
            if (key == "format")
                format();
            else if (key == "element")
                element();
            else if (key == "property")
                property();
            else if (!key.empty() && key != "comment" && key != "obj_info")
                reporter_.info(file_.name() + ": an unknown header line is ignored: '" +
                               std::string(line_, line_stop_) + "'");
        }
        if (header_.format == Format::None)
            file_.fail_line(file_.begin(), "the header has no line 'format'");
        header_.data = p_;
        return std::move(header_);
    }

private:
    void next_line() {
        line_ = p_;
        const char *stop = std::find(p_, file_.end(), line_end_);
        p_ = stop == file_.end() ? stop : stop + 1;
        while (stop > line_ && is_blank(stop[-1]))
            --stop;
        line_stop_ = stop;
        word_ = line_;
    }

    std::string_view word() {
        skip_blanks(word_, line_stop_);
        const char *begin = word_;
        word_ = std::find_if(begin, line_stop_, is_blank);
        return {begin, static_cast<std::size_t>(word_ - begin)};
    }

    [[noreturn]] void fail(const std::string &message) const { file_.fail_line(line_, message); }

    static std::string quoted(std::string_view word) {
        return "'" + token_at(word.data(), word.data() + word.size()) + "'";
    }

    void format() {
        const std::string_view name = word();
        if (name == "ascii")
            header_.format = Format::Ascii;
        else if (name == "binary_little_endian")
            header_.format = Format::Little;
        else if (name == "binary_big_endian")
            header_.format = Format::Big;
        else
            fail("the format " + quoted(name) + " is not ascii, binary_little_endian or binary_big_endian");
        if (const std::string_view version = word(); version != "1.0")
            fail("the format version is " + quoted(version) + ", not 1.0");
    }

    void element() {
        Element element;
        element.name = word();
        const std::string_view count = word();
        std::int64_t value = -1;
        const char *p = count.data();
        if (!read_integer(p, count.data() + count.size(), value) || p != count.data() + count.size() || value < 0)
            fail("the element '" + element.name + "' has the invalid count " + quoted(count));
        element.count = static_cast<std::uint64_t>(value);
        header_.elements.push_back(std::move(element));
    }

    void property() {
        if (header_.elements.empty())
            fail("the header has a property before the first element");
        Property property;
        std::string_view type_name = word();
        if (type_name == "list") {
            property.is_list = true;
            property.count_type = type(word());
            if (!is_integer(property.count_type))
                fail("the count of a list must have an integer type");
            type_name = word();
        }
        property.type = type(type_name);
        property.name = word();
        header_.elements.back().properties.push_back(std::move(property));
    }

    Type type(std::string_view name) const {
        for (const TypeName &known : type_names)
            if (known.name == name)
                return known.type;
        fail("the property type " + quoted(name) + " is unknown");
    }

    const MeshFile &file_;
    const Reporter &reporter_;
    const char *p_, *line_ = nullptr, *line_stop_ = nullptr, *word_ = nullptr;
    char line_end_ = '\n';
    Header header_;
};

// AsciiReader and BinaryReader return the values of an element in the order of its properties. If the file ends too
// early, they throw an error that names the element.
class AsciiReader {
public:
    static constexpr std::size_t min_value_size(Type) { return 2; } // a digit and a separator

    AsciiReader(const MeshFile &file, const char *data) : file_(file), p_(data) {}

    float real(Type) {
        const char *token = start();
        float value = 0;
        if (!read_number(p_, file_.end(), value) || !at_token_end())
            fail("'" + token_at(token, file_.end()) + "' is not a number");
        return value;
    }
    std::int64_t integer(Type) {
        const char *token = start();
        std::int64_t value = 0;
        if (!read_integer(p_, file_.end(), value) || !at_token_end())
            fail("'" + token_at(token, file_.end()) + "' is not an integer");
        return value;
    }
    void skip(Type) {
        start();
        while (!at_token_end())
            ++p_;
    }
    // Each element is on its own line, so a missing number cannot shift the numbers of the following elements.
    void begin_element(const Element &element, std::uint64_t index) {
        element_ = &element;
        index_ = index;
        while (p_ < file_.end() && (*p_ == '\n' || is_blank(*p_)))
            ++p_;
        value_ = p_;
        if (p_ == file_.end())
            fail("the file is truncated before " + here() + " of " + std::to_string(element.count));
    }
    void end_element() {
        skip_blanks(p_, file_.end());
        value_ = p_;
        if (p_ < file_.end() && *p_ != '\n')
            fail(here() + " has more values than the header declares properties");
    }
    std::uint64_t bytes_left() const { return static_cast<std::uint64_t>(file_.end() - p_) + 1; }
    double fraction() const {
        return static_cast<double>(p_ - file_.begin()) / static_cast<double>(file_.view().size());
    }
    [[noreturn]] void fail(const std::string &message) const { file_.fail_line(value_, message); }
    std::string here() const { return element_->name + " " + std::to_string(index_); }

private:
    const char *start() {
        skip_blanks(p_, file_.end());
        value_ = p_;
        if (p_ == file_.end() || *p_ == '\n')
            fail(here() + " is truncated");
        return p_;
    }
    bool at_token_end() const { return p_ == file_.end() || is_blank(*p_) || *p_ == '\n'; }

    const MeshFile &file_;
    const char *p_;
    const char *value_ = p_;
    const Element *element_ = nullptr;
    std::uint64_t index_ = 0;
};

class BinaryReader {
public:
    static std::size_t min_value_size(Type type) { return size_of(type); }

    BinaryReader(const MeshFile &file, const char *data, Format format)
        : file_(file), p_(data), swap_((format == Format::Big) == (std::endian::native == std::endian::little)) {}

    float real(Type type) {
        switch (type) {
        case Type::Float32:
            return get<float>();
        case Type::Float64:
            return static_cast<float>(get<double>());
        default:
            return static_cast<float>(integer(type));
        }
    }
    std::int64_t integer(Type type) {
        switch (type) {
        case Type::Int8:
            return get<std::int8_t>();
        case Type::Uint8:
            return get<std::uint8_t>();
        case Type::Int16:
            return get<std::int16_t>();
        case Type::Uint16:
            return get<std::uint16_t>();
        case Type::Int32:
            return get<std::int32_t>();
        case Type::Uint32:
            return get<std::uint32_t>();
        case Type::Float32:
        case Type::Float64:
            break;
        }
        fail(here() + ": the value must be an integer, but the header declares the property as a float");
    }
    void skip(Type type) { take(size_of(type)); }
    void begin_element(const Element &element, std::uint64_t index) {
        element_ = &element;
        index_ = index;
    }
    void end_element() {}
    std::uint64_t bytes_left() const { return static_cast<std::uint64_t>(file_.end() - p_); }
    double fraction() const {
        return static_cast<double>(p_ - file_.begin()) / static_cast<double>(file_.view().size());
    }
    [[noreturn]] void fail(const std::string &message) const { file_.fail_byte(p_, message); }
    std::string here() const { return element_->name + " " + std::to_string(index_); }

private:
    const char *take(std::size_t size) {
        if (bytes_left() < size)
            fail("the file is truncated in " + here() + " of " + std::to_string(element_->count));
        const char *at = p_;
        p_ += size;
        return at;
    }
    template <class T> T get() {
        char bytes[sizeof(T)];
        std::memcpy(bytes, take(sizeof(T)), sizeof(T));
        if (swap_)
            std::reverse(bytes, bytes + sizeof(T));
        T value;
        std::memcpy(&value, bytes, sizeof(T));
        return value;
    }

    const MeshFile &file_;
    const char *p_;
    bool swap_;
    const Element *element_ = nullptr;
    std::uint64_t index_ = 0;
};

bool is_one_of(std::string_view name, std::initializer_list<std::string_view> names) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

bool is_corner_list(const Property &property) {
    return property.is_list && is_one_of(property.name, {"vertex_indices", "vertex_index"});
}

// Converts a channel of a vertex colour.
std::uint16_t channel_of(float value, Type type, bool is_encoded) {
    static const std::array<std::uint16_t, 256> linear_from_byte = [] {
        std::array<std::uint16_t, 256> table{};
        for (std::size_t i = 0; i < table.size(); ++i)
            table[i] = colour_channel(linear_from_srgb(static_cast<double>(i) / 255));
        return table;
    }();
    const auto real = static_cast<double>(value);
    if (!is_integer(type))
        return colour_channel(real);
    const double highest = size_of(type) == 1 ? 255 : 65535;
    if (!is_encoded)
        return colour_channel(real / highest);
    return size_of(type) == 1 ? linear_from_byte[static_cast<std::size_t>(std::clamp(real, 0.0, highest))]
                              : colour_channel(linear_from_srgb(real / highest));
}

template <class Reader> class BodyParser {
public:
    BodyParser(const MeshFile &file, const Reporter &reporter, const Header &header, Reader reader)
        : file_(file), reporter_(reporter), header_(header), reader_(std::move(reader)) {}

    TriangleMesh parse() {
        const Element *faces = nullptr;
        for (const Element &element : header_.elements)
            if (element.name == "face" && std::ranges::any_of(element.properties, is_corner_list))
                faces = &element;
        if (!faces || faces->count == 0)
            file_.fail("contains no triangles: the header has no element 'face' with a list 'vertex_indices'");
        for (const Element &element : header_.elements) {
            check_count(element);
            if (element.name == "vertex")
                vertices(element);
            else if (&element == faces)
                read_faces(element);
            else
                each(element, [&](const Property &property) { skip_value(property); });
            if (&element == faces) // nothing after the faces is needed
                break;
        }
        if (mesh_.triangles.empty())
            file_.fail("contains no triangles: all faces have fewer than three corners");
        return std::move(mesh_);
    }

private:
    // Rejects counts that exceed the file size before memory is reserved for them.
    void check_count(const Element &element) {
        std::uint64_t element_size = 0;
        for (const Property &property : element.properties)
            element_size += Reader::min_value_size(property.is_list ? property.count_type : property.type);
        if (element.count > ARHOST_NONE / 4 ||
            element.count * std::max<std::uint64_t>(element_size, 1) > reader_.bytes_left())
            file_.fail("the header declares " + std::to_string(element.count) + " elements '" + element.name +
                       "', but the file has only " + std::to_string(reader_.bytes_left()) + " bytes for them");
    }

    template <class Read> void each(const Element &element, Read &&read) {
        for (std::uint64_t i = 0; i < element.count; ++i) {
            reader_.begin_element(element, i);
            for (const Property &property : element.properties)
                read(property);
            reader_.end_element();
            if (i % 65536 == 0)
                reporter_.report(reader_.fraction());
        }
    }

    std::uint64_t list_count(const Property &property) {
        const std::int64_t count = reader_.integer(property.count_type);
        if (count < 0 ||
            static_cast<std::uint64_t>(count) * Reader::min_value_size(property.type) > reader_.bytes_left())
            reader_.fail(reader_.here() + ": the list '" + property.name + "' has the length " +
                         std::to_string(count));
        return static_cast<std::uint64_t>(count);
    }

    void skip_value(const Property &property) {
        for (std::uint64_t left = property.is_list ? list_count(property) : 1; left > 0; --left)
            reader_.skip(property.type);
    }

    void vertices(const Element &element) {
        enum { X, NX = 3, S = 6, Red = 8, Alpha = 11, Slots = 12, Skipped = 12 };
        std::vector<int> slots;
        std::array<bool, Slots> present{};
        for (const Property &property : element.properties) {
            static constexpr std::string_view names[] = {"x", "y", "z",   "nx",    "ny",   "nz",
                                                         "s", "t", "red", "green", "blue", "alpha"};
            int slot = static_cast<int>(std::find(std::begin(names), std::end(names), property.name) - names);
            if (is_one_of(property.name, {"u", "texture_u", "texture_s"}))
                slot = S;
            else if (is_one_of(property.name, {"v", "texture_v", "texture_t"}))
                slot = S + 1;
            slots.push_back(property.is_list ? Skipped : slot);
            if (slots.back() != Skipped)
                present[static_cast<std::size_t>(slot)] = true;
        }
        if (!(present[X] && present[X + 1] && present[X + 2]))
            file_.fail("each vertex must have the properties x, y and z");
        const bool has_normals = present[NX] && present[NX + 1] && present[NX + 2];
        const bool has_texcoords = present[S] && present[S + 1];
        const bool has_colours = present[Red] && present[Red + 1] && present[Red + 2];
        mesh_ = {};
        mesh_.positions.reserve(element.count);
        mesh_.normals.reserve(has_normals ? element.count : 0);
        mesh_.texcoords.reserve(has_texcoords ? element.count : 0);
        mesh_.colours.reserve(has_colours ? element.count : 0);

        std::size_t at = 0;
        std::array<float, Slots> values{};
        glm::u16vec4 colour(65535);
        each(element, [&](const Property &property) {
            const int slot = slots[at];
            if (slot == Skipped) {
                skip_value(property);
            } else {
                const float value = reader_.real(property.type);
                if (!std::isfinite(value))
                    reader_.fail(reader_.here() + ": '" + property.name + "' is not finite");
                if (slot >= Red)
                    colour[slot - Red] = channel_of(value, property.type, slot != Alpha);
                else
                    values[static_cast<std::size_t>(slot)] = value;
            }
            if (++at < slots.size())
                return;
            at = 0;
            mesh_.positions.emplace_back(values[X], values[X + 1], values[X + 2]);
            if (has_normals)
                mesh_.normals.emplace_back(values[NX], values[NX + 1], values[NX + 2]);
            if (has_texcoords)
                mesh_.texcoords.emplace_back(values[S], values[S + 1]);
            if (has_colours)
                mesh_.colours.push_back(colour);
        });
    }

    void read_faces(const Element &element) {
        mesh_.triangles.reserve(element.count);
        each(element, [&](const Property &property) {
            if (!is_corner_list(property))
                return skip_value(property);
            const std::uint64_t count = list_count(property);
            polygon_.clear();
            for (std::uint64_t i = 0; i < count; ++i) {
                const std::int64_t index = reader_.integer(property.type);
                if (index < 0 || static_cast<std::uint64_t>(index) >= mesh_.positions.size())
                    reader_.fail(reader_.here() + " refers to vertex " + std::to_string(index) + ", but only " +
                                 std::to_string(mesh_.positions.size()) + " are defined");
                polygon_.push_back(static_cast<std::uint32_t>(index));
            }
            add_polygon();
        });
    }

    void add_polygon() {
        if (polygon_.size() == 3) {
            mesh_.triangles.emplace_back(polygon_[0], polygon_[1], polygon_[2]);
            return;
        }
        if (polygon_.size() < 3) // points and lines
            return;
        const auto triangles = triangulate(polygon_, mesh_.positions, triangles_);
        if (triangles.empty())
            reader_.fail(reader_.here() + " is concave and has " + std::to_string(polygon_.size()) +
                         " corners, more than " + std::to_string(concave_corner_limit) + "; triangulate it");
        for (const glm::uvec3 &t : triangles)
            mesh_.triangles.emplace_back(polygon_[t.x], polygon_[t.y], polygon_[t.z]);
    }

    const MeshFile &file_;
    const Reporter &reporter_;
    const Header &header_;
    Reader reader_;
    TriangleMesh mesh_;
    std::vector<std::uint32_t> polygon_;
    std::vector<glm::uvec3> triangles_;
};

} // namespace

TriangleMesh parse_ply(MeshFile &file, const Reporter &reporter) {
    const Header header = HeaderParser(file, reporter).parse();
    if (header.format == Format::Ascii) {
        file.normalize_line_ends();
        return BodyParser(file, reporter, header, AsciiReader(file, header.data)).parse();
    }
    return BodyParser(file, reporter, header, BinaryReader(file, header.data, header.format)).parse();
}

} // namespace arhost::scene
