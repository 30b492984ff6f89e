// SPDX-License-Identifier: Apache-2.0
#include "conformance/elf.hpp"

#include <cstddef>
#include <cstring>
#include <elf.h>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace arhost::conformance {
namespace {

class Image {
public:
    explicit Image(const std::filesystem::path &file) : file_(file) {
        std::ifstream stream(file, std::ios::binary);
        bytes_.assign(std::istreambuf_iterator<char>(stream), {});
    }
    // A copy of what lies there: offsets need not be aligned, nor be within the file.
    template <class T> T at(std::size_t offset) const {
        T value;
        if (offset > bytes_.size() || bytes_.size() - offset < sizeof value)
            throw std::runtime_error(file_.string() + " is no whole ELF file");
        std::memcpy(&value, bytes_.data() + offset, sizeof value);
        return value;
    }
    std::string text_at(std::size_t offset) const {
        std::string text;
        for (char c = at<char>(offset); c != 0; c = at<char>(++offset))
            text += c;
        return text;
    }

private:
    std::filesystem::path file_;
    std::vector<char> bytes_;
};

} // namespace

std::vector<std::string> exported_symbols(const std::filesystem::path &file) {
    const Image image(file);
    const auto header = image.at<Elf64_Ehdr>(0);
    if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS64)
        throw std::runtime_error(file.string() + " is no 64-bit ELF file");
    const auto section = [&](std::size_t index) {
        return image.at<Elf64_Shdr>(header.e_shoff + index * sizeof(Elf64_Shdr));
    };
    std::vector<std::string> exported;
    for (std::size_t i = 0; i < header.e_shnum; ++i) {
        const Elf64_Shdr symbols = section(i);
        if (symbols.sh_type != SHT_DYNSYM)
            continue;
        const Elf64_Shdr names = section(symbols.sh_link);
        for (std::size_t k = 0; k < symbols.sh_size / sizeof(Elf64_Sym); ++k) {
            const auto symbol = image.at<Elf64_Sym>(symbols.sh_offset + k * sizeof(Elf64_Sym));
            const bool defined = symbol.st_shndx != SHN_UNDEF && symbol.st_shndx != SHN_ABS;
            const int visibility = ELF64_ST_VISIBILITY(symbol.st_other);
            if (defined && ELF64_ST_BIND(symbol.st_info) != STB_LOCAL &&
                (visibility == STV_DEFAULT || visibility == STV_PROTECTED))
                exported.push_back(image.text_at(names.sh_offset + symbol.st_name));
        }
    }
    return exported;
}

} // namespace arhost::conformance
