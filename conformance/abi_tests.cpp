// SPDX-License-Identifier: Apache-2.0
// Requirements on plugins of every kind.
#include "conformance/process_usage.hpp"
#include "conformance/test.hpp"
#include "ipc/messages.hpp"
#include "worker/devices.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <elf.h>
#include <fstream>
#include <iterator>
#include <set>

namespace arhost::conformance {
namespace {

using ipc::Call;

void load(Context &context) {
    try {
        model::PluginDescription description = model::describe(context.library.descriptor());
        check(description);
        const std::size_t size =
            ipc::Json(description).dump(-1, ' ', false, ipc::Json::error_handler_t::replace).size();
        if (size > ipc::max_descriptor_size)
            throw std::runtime_error(fmt::format(
                "its descriptor takes {} bytes as JSON; the limit is {}: declare fewer options, or shorten texts",
                size, ipc::max_descriptor_size));
        context.facts = {std::move(description), {}};
    } catch (const std::exception &error) { // as arhost-worker or the host would report it
        throw Failure(error.what());
    }
}

// Defined symbols that other libraries could bind to, from the file's .dynsym. abi.load has opened the file, so it is
// an ELF file of this machine's class; its section headers may still be damaged.
std::vector<std::string> exported_symbols(const std::filesystem::path &file) {
    std::ifstream stream(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    const auto at = [&]<class T>(std::size_t offset, T value) { // copied, because offsets need not be aligned
        if (offset > bytes.size() || bytes.size() - offset < sizeof value)
            throw std::runtime_error(file.string() + " has section headers beyond its end");
        std::memcpy(&value, bytes.data() + offset, sizeof value);
        return value;
    };
    const auto header = at(0, Elf64_Ehdr{});
    const auto section = [&](std::size_t i) { return at(header.e_shoff + i * sizeof(Elf64_Shdr), Elf64_Shdr{}); };
    std::vector<std::string> exported;
    for (std::size_t i = 0; i < header.e_shnum; ++i) {
        const Elf64_Shdr symbols = section(i);
        if (symbols.sh_type != SHT_DYNSYM)
            continue;
        const Elf64_Shdr names = section(symbols.sh_link);
        for (std::size_t k = 0; k < symbols.sh_size / sizeof(Elf64_Sym); ++k) {
            const auto symbol = at(symbols.sh_offset + k * sizeof(Elf64_Sym), Elf64_Sym{});
            const bool defined = symbol.st_shndx != SHN_UNDEF && symbol.st_shndx != SHN_ABS;
            const int visibility = ELF64_ST_VISIBILITY(symbol.st_other);
            if (defined && ELF64_ST_BIND(symbol.st_info) != STB_LOCAL &&
                (visibility == STV_DEFAULT || visibility == STV_PROTECTED))
                exported.emplace_back(bytes.c_str() + // ends with NUL at the latest at the file's end
                                      std::min<std::size_t>(names.sh_offset + symbol.st_name, bytes.size()));
        }
    }
    return exported;
}

void exports(Context &context) {
    // Older linkers export these from every shared object.
    const std::set<std::string> linker_symbols = {"arhost_entry", "_init", "_fini", "__bss_start", "_edata", "_end"};
    for (const std::string &symbol : exported_symbols(context.library.file()))
        if (!linker_symbols.contains(symbol))
            throw Failure(fmt::format("it exports '{}'; arhost_entry must be the only export", symbol));
}

// ---- Negotiation -----------------------------------------------------------------------------------

// Calls negotiate with structs that are followed by garbage, which the plugin must neither interpret nor overwrite.
class Exchange {
public:
    Exchange(Context &context, const arhost_offer &offer, std::uint32_t answer_size) {
        std::memset(&memory_, garbage, sizeof memory_);
        memory_.offer = offer;
        memory_.answer.struct_size = answer_size;
        memory_.answer.abi_version = ~0u;
        const arhost_entry_point &entry = context.library.entry();
        status = in_call(context.library.calls(), Call::negotiate,
                         [&] { return entry.negotiate(&memory_.offer, &memory_.answer); });
        // The bytes beyond the answer's struct_size.
        const auto *bytes = reinterpret_cast<const std::uint8_t *>(&memory_.answer);
        const std::size_t end = sizeof memory_ - offsetof(Memory, answer);
        for (std::size_t i = std::min<std::size_t>(answer_size, sizeof(arhost_answer)); i < end; ++i)
            if (bytes[i] != garbage)
                throw Failure(
                    fmt::format("negotiate wrote byte {} of an answer with a struct_size of {}", i, answer_size));
    }
    const arhost_answer &answer() const { return memory_.answer; }
    arhost_status status;

private:
    static constexpr std::uint8_t garbage = 0xa5;
    struct Memory {
        arhost_offer offer;
        std::uint8_t after_offer[64];
        arhost_answer answer;
        std::uint8_t after_answer[64];
    } memory_;
};

void negotiation(Context &context) {
    constexpr std::uint32_t version = ARHOST_ABI_VERSION, longer = 32;
    constexpr auto offer_size = static_cast<std::uint32_t>(sizeof(arhost_offer)),
                   answer_size = static_cast<std::uint32_t>(sizeof(arhost_answer));
    const auto expect_accepted = [&](const Exchange &exchange, const char *offer) {
        if (exchange.status != ARHOST_STATUS_OK || exchange.answer().abi_version != version ||
            !exchange.answer().plugin)
            throw Failure(fmt::format("offered {}, negotiate returned {} and version {}; expected OK and {}", offer,
                                      status_name(exchange.status), exchange.answer().abi_version, version));
    };
    expect_accepted(Exchange(context, {offer_size, version, version}, answer_size), "its version");
    expect_accepted(Exchange(context, {offer_size, version, version + 7}, answer_size),
                    "its version and newer versions");
    expect_accepted(Exchange(context, {offer_size + longer, version, version}, answer_size + longer),
                    "longer structs");

    const Exchange newer(context, {offer_size, version + 1, version + 7}, answer_size);
    if (newer.status != ARHOST_STATUS_ERROR_UNSUPPORTED)
        throw Failure(fmt::format("offered versions {} to {}, negotiate returned {}; expected UNSUPPORTED",
                                  version + 1, version + 7, status_name(newer.status)));

    constexpr auto short_offer = static_cast<std::uint32_t>(offsetof(arhost_offer, newest_abi_version));
    const Exchange short_offered(context, {short_offer, version, version}, answer_size);
    if (short_offered.status >= 0)
        throw Failure(fmt::format(
            "with an offer of {} bytes, which lacks newest_abi_version, negotiate returned {}; expected an error",
            short_offer, status_name(short_offered.status)));

    constexpr auto short_answer = static_cast<std::uint32_t>(offsetof(arhost_answer, plugin));
    const Exchange shorter(context, {offer_size, version, version}, short_answer);
    if (shorter.status >= 0)
        throw Failure(
            fmt::format("with an answer of {} bytes, which lacks plugin, negotiate returned {}; expected an error",
                        short_answer, status_name(shorter.status)));
}

// ---- Descriptor ------------------------------------------------------------------------------------

void descriptor(Context &context) {
    const arhost_descriptor &d = context.library.descriptor();
    const std::pair<const char *, const char *> texts[] = {{"name", d.name},
                                                           {"version", d.version},
                                                           {"vendor", d.vendor},
                                                           {"licence", d.licence},
                                                           {"description", d.description}};
    for (const auto &[field, text] : texts)
        if (!text || !*text)
            throw Failure(fmt::format("the descriptor's {} is empty", field));
    constexpr std::uint64_t capabilities_of_kind[] = {
        0, ARHOST_SOURCE_CAPABILITY_SEEK | ARHOST_SOURCE_CAPABILITY_LIVE, ARHOST_TRACKER_CAPABILITY_REPORTS_POSES,
        ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION | ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE |
            ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES | ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES |
            ARHOST_RAYTRACER_CAPABILITY_VIDEO | ARHOST_RAYTRACER_CAPABILITY_DEPTH,
        ARHOST_SINK_CAPABILITY_NUMBERED_FILES | ARHOST_SINK_CAPABILITY_REALTIME |
            ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT | ARHOST_SINK_CAPABILITY_VIDEO_INPUT |
            ARHOST_SINK_CAPABILITY_OVERLAY_INPUT | ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION};
    if (const std::uint64_t invalid = d.capabilities & ~capabilities_of_kind[d.kind])
        throw Failure(fmt::format("the capability bits {:#x} are not defined for this kind of plugin", invalid));
    const ipc::Json described = model::describe(d);
    for (const auto &[field, value] : described.items()) {
        const std::string text = value.dump(-1, ' ', false, ipc::Json::error_handler_t::replace);
        try {
            value.dump();
        } catch (const ipc::Json::exception &) {
            throw Failure(fmt::format("the descriptor's {} is not UTF-8: {:.200}", field, text));
        }
    }
    std::set<std::string> keys;
    for (const arhost_option_descriptor *option : options_of(d)) {
        if (!*option->key)
            throw Failure(fmt::format("option {} has no key", keys.size()));
        if (!keys.insert(option->key).second)
            throw Failure(fmt::format("the option '{}' is declared twice", option->key));
        if (!option->help || !*option->help)
            throw Failure(fmt::format("the option '{}' has no help", option->key));
        if (option->minimum > option->maximum)
            throw Failure(fmt::format("option '{}': the minimum {} exceeds the maximum {}", option->key,
                                      option->minimum, option->maximum));
        try {
            if (option->default_value)
                parse_option(*option, option->default_value);
        } catch (const std::runtime_error &error) {
            throw Failure(fmt::format("invalid default: {}", error.what()));
        }
    }
}

// negotiate must return the same plugin and descriptor at any time: the host relies, for example, on the capabilities
// that it has read.
void same_answer(Context &context) {
    const arhost_plugin &plugin = context.library.plugin();
    const ipc::Json descriptor = model::describe(*plugin.descriptor);
    const auto expect_same = [&](const char *when) {
        constexpr auto size = static_cast<std::uint32_t>(sizeof(arhost_answer));
        const Exchange again(context, {sizeof(arhost_offer), ARHOST_ABI_VERSION, ARHOST_ABI_VERSION}, size);
        if (again.status != ARHOST_STATUS_OK || again.answer().plugin != &plugin)
            throw Failure(
                fmt::format("{}, negotiate returned {} or a different plugin", when, status_name(again.status)));
        const ipc::Json now = model::describe(*plugin.descriptor);
        for (const auto &[key, value] : descriptor.items())
            if (now[key] != value)
                throw Failure(fmt::format("{}, the descriptor's {} is {}; it was {}", when, key, now[key].dump(),
                                          value.dump()));
    };
    expect_same("called again");
    {
        Instance instance(context.library);
        instance.create_or_fail();
        expect_same("called while an instance exists");
    }
    expect_same("called after an instance was destroyed");
}

void unknown_extension(Context &context) {
    if (context.library.plugin().get_extension("arhost.conform.no-such-extension/1"))
        throw Failure("get_extension returned a pointer for an unknown id; expected NULL");
}

// ---- Instances -------------------------------------------------------------------------------------

void create(Context &context) {
    Instance instance(context.library);
    instance.create_or_fail();
}

void longer_options(Context &context) {
    if (context.library.descriptor().option_count < 2)
        throw Skip("it has fewer than two options");
    Instance instance(context.library);
    instance.create_or_fail({.bytes = 16, .option = false}); // a plugin with the wrong stride reads garbage as a key
}

void unknown_option(Context &context) {
    Instance instance(context.library);
    instance.create_or_fail({.bytes = 0, .option = true});
}

void two_instances(Context &context) {
    Instance first(context.library), second(context.library);
    first.create_or_fail();
    second.create_or_fail();
    if (first.get() == second.get())
        throw Failure("two simultaneous instances have the same pointer");
    first.destroy();
    Instance third(context.library);
    third.create_or_fail();
}

void create_repeatedly(Context &context) {
    using Clock = std::chrono::steady_clock;
    constexpr int warm_up = 20, min_count = 100, max_count = 1000;
    constexpr auto time_limit = 20s; // stop after this time, but not before min_count cycles
    constexpr long allowed_kib = 4096;
    const auto create_and_destroy = [&] {
        Instance instance(context.library);
        instance.create_or_fail();
    };
    for (int i = 0; i < warm_up; ++i)
        create_and_destroy();
    int count = 0;
    const auto work = [&] {
        const ProcessUsage before = ProcessUsage::now();
        const auto begin = Clock::now();
        for (count = 0; count < max_count && (count < min_count || Clock::now() - begin < time_limit); ++count) {
            // Stop before descriptors or memory run out.
            if (count > 0 && count % min_count == 0 && !growth(before, ProcessUsage::now(), allowed_kib).empty())
                return;
            create_and_destroy();
        }
    };
    if (const std::string grown = growth_by(work, allowed_kib); !grown.empty())
        throw Failure(fmt::format("after {} create/destroy cycles, the process grew {}", count, grown));
    context.note = fmt::format("{} create/destroy cycles", count);
}

void cancelled(Context &context) {
    Instance instance(context.library);
    instance.host().cancel();
    const arhost_status status = instance.create();
    if (status != ARHOST_STATUS_OK && status != ARHOST_STATUS_ERROR_CANCELLED)
        instance.expect_ok("after cancellation, create", status);
    if ((status == ARHOST_STATUS_OK) != (instance.get() != nullptr))
        throw Failure(fmt::format("create returned {}, but the instance is{} NULL", status_name(status),
                                  instance.get() ? " not" : ""));
}

void set_option(Context &context) {
    const arhost_plugin &plugin = context.library.plugin();
    const auto *extension = static_cast<const arhost_set_option *>(plugin.get_extension(ARHOST_SET_OPTION_EXTENSION));
    if (!extension)
        throw Skip("it does not have the extension " ARHOST_SET_OPTION_EXTENSION);
    if (extension->struct_size < sizeof *extension || !extension->set || !extension->keys)
        throw Failure("the extension " ARHOST_SET_OPTION_EXTENSION " is too short, or a member is NULL");
    const std::vector<const arhost_option_descriptor *> options = model::options_of(*plugin.descriptor);
    for (const char *const *key = extension->keys; *key; ++key) {
        const auto declared =
            std::find_if(options.begin(), options.end(),
                         [&](const arhost_option_descriptor *option) { return !std::strcmp(option->key, *key); });
        if (declared == options.end())
            throw Failure(fmt::format("it accepts changes of '{}', which is not one of its options", *key));
        if ((*declared)->type >= ARHOST_OPTION_INPUT_PATH)
            throw Failure(fmt::format("it accepts changes of '{}', which is a path or an address", *key));
        context.note += (key == extension->keys ? "" : ", ") + std::string(*key);
    }
}

// A plugin may offer the extension only while an instance exists, as those for Python do.
void devices(Context &context) {
    Instance instance(context.library);
    instance.create_or_fail();
    const arhost_plugin &plugin = context.library.plugin();
    if (!plugin.get_extension(ARHOST_DEVICES_EXTENSION))
        throw Skip("it does not have the extension " ARHOST_DEVICES_EXTENSION);
    const Host host;
    const auto list = [&] {
        std::optional<devices::DeviceList> listed;
        arhost_status status;
        try {
            status = in_call(context.library.calls(), Call::devices,
                             [&] { return worker::list_devices(plugin, *host.get(), listed); });
        } catch (const std::runtime_error &error) {
            throw Failure(error.what());
        }
        if (status != ARHOST_STATUS_OK)
            throw Failure(call_result("list", status, host));
        return listed ? listed->devices : std::vector<devices::DeviceDescription>();
    };
    // A camera may change the value of a control at any time, for example if it sets its gain automatically.
    const auto without_values = [](std::vector<devices::DeviceDescription> listed) {
        for (devices::DeviceDescription &device : listed)
            for (devices::DeviceControl &control : device.controls)
                control.value.reset();
        return listed;
    };
    const std::vector<devices::DeviceDescription> first = list();
    const ProcessUsage before = ProcessUsage::now();
    const std::vector<devices::DeviceDescription> again = list();
    constexpr long allowed_kib = 4096;
    if (const std::string grown = growth(before, ProcessUsage::now(), allowed_kib); !grown.empty())
        throw Failure("listing the devices again, the process grew " + grown);
    if (without_values(again) != without_values(first))
        throw Failure("listing the devices again gives another list");
    std::size_t defaults = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
        if (first[i].index != i)
            throw Failure(fmt::format("device {} of the list has the index {}", i, first[i].index));
        defaults += first[i].is_default ? 1 : 0;
        context.note += (i > 0 ? ", " : "") + first[i].name;
    }
    if (defaults > 1)
        throw Failure(fmt::format("{} devices are the default; at most one may be", defaults));
    if (first.empty())
        context.note = "no devices";
}

constexpr Test tests[] = {
    {"abi.load", "arhost-worker can load it, it supports the ABI version, and its id matches its file name.", "", 10s,
     load},
    {"abi.exports", "It exports only arhost_entry.", "abi.load", 10s, exports},
    {"abi.negotiation", "negotiate handles any version range, and longer or shorter structs, as the ABI specifies.",
     "abi.load", 10s, negotiation},
    {"abi.descriptor", "The descriptor has all texts, only capabilities of its kind, and valid options and defaults.",
     "abi.load", 10s, descriptor},
    {"abi.unknown-extension", "get_extension returns NULL for an unknown extension.", "abi.load", 10s,
     unknown_extension},
    {"abi.set-option", "The options that it accepts while it runs are declared, and are not paths or addresses.",
     "abi.load", 10s, set_option},
    {"abi.create", "An instance can be created with the default options and destroyed without a start.", "abi.load",
     20s, create},
    {"abi.same-answer", "Every call of negotiate returns the same plugin with the same descriptor.", "abi.create",
     20s, same_answer},
    {"abi.longer-options", "It uses struct_size as the stride of the options array.", "abi.create", 10s,
     longer_options},
    {"abi.unknown-option", "It ignores options with unknown keys.", "abi.create", 10s, unknown_option},
    {"abi.two-instances", "Two instances can exist at the same time and be destroyed in any order.", "abi.create",
     20s, two_instances},
    {"abi.create-1000-times", "1,000 create/destroy cycles, or 20 s of them, leak no descriptors, threads or memory.",
     "abi.create", 240s, create_repeatedly},
    {"abi.devices",
     "It lists its devices repeatedly: in order of their index, at most one of them the default, with valid states, "
     "sizes, rates and ranges.",
     "abi.create", 60s, devices},
    {"abi.cancelled-create", "After cancellation, create promptly returns OK or CANCELLED.", "abi.create", 10s,
     cancelled},
};

} // namespace

std::span<const Test> abi_tests() {
    return tests;
}

} // namespace arhost::conformance
