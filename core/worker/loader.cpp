// SPDX-License-Identifier: Apache-2.0
#include "worker/loader.hpp"

#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "scene/scene_loader.hpp"
#include "session/log_reader.hpp"

#include <arhost/plugin.h>

#include <cstdlib>
#include <functional>
#include <new>
#include <span>

namespace arhost::worker {
namespace {

// Sends memory of `size` bytes that `write` has filled.
void send_memory(const Link &link, const char *name, std::size_t size,
                 const std::function<void(std::span<std::byte>)> &write) {
    const ipc::SharedMemory memory = ipc::SharedMemory::create(name, size);
    // The mapping ends with this statement, because the host can freeze memory only if no writable mapping exists.
    write(memory.map(ipc::Access::read_write).bytes());
    link.send(ipc::messages::Loaded{}, {memory.fd()});
}

void send_contents(const Link &link, const scene::Contents &contents) {
    const auto send = [&](const char *kind, const std::string &text, double number = 0) {
        link.send(ipc::messages::Listed{kind, base::valid_utf8(text), number});
    };
    for (const auto &[name, duration_s] : contents.animations)
        send("animation", name, duration_s);
    for (const std::string &name : contents.variants)
        send("variant", name);
    for (const std::string &name : contents.materials)
        send("material", name);
    send("nodes", "", static_cast<double>(contents.nodes));
}

} // namespace

int load_scene(Link &link, const ipc::messages::Load &load) try {
    scene::LoadCallbacks callbacks;
    callbacks.progress = [&](double fraction, const std::string &what) { link.progress(fraction, what.c_str()); };
    callbacks.info = [&](const std::string &text) { link.log(ARHOST_SEVERITY_INFO, text); };
    callbacks.warning = [&](const std::string &text) { link.log(ARHOST_SEVERITY_WARNING, text); };
    callbacks.reads = [&](const std::filesystem::path &file) {
        const base::FileIdentity identity = base::identity_of(file);
        link.send(ipc::messages::Reads{identity.path, identity.node});
    };
    const yaml::Node root =
        load.content.empty() ? yaml::Node::load(load.scene) : yaml::Node::parse(load.content, load.scene);
    scene::ArenaBuilder builder = scene::load_scene(root, callbacks, {load.readable.begin(), load.readable.end()});
    if (load.lists_contents)
        send_contents(link, builder.contents);
    const scene::Origins origins = builder.origins();
    send_memory(link, "arhost-scene", builder.byte_size(), [&](std::span<std::byte> memory) {
        std::move(builder).write(memory);
        // The host validates the arena, too, but does not know which part of the scene file an element comes from.
        if (const auto fault = scene::find_fault(memory))
            throw yaml::Error(origins.message(*fault));
        for (const std::string &origin : origins.all(scene::Table::anchors))
            link.send(ipc::messages::AnchorOrigin{origin});
    });
    return EXIT_SUCCESS;
} catch (const std::bad_alloc &) {
    throw std::runtime_error(load.scene + ": needs more memory than a worker may use");
}

int read_log(Link &link, const ipc::messages::ReadLog &request) {
    try {
        const session::Log log =
            session::read_log(request.file, request.video_bytes, [&] { link.progress(0, "reads the log"); });
        send_memory(link, "arhost-session-log", session::packed_size(log),
                    [&](std::span<std::byte> memory) { session::pack(log, memory); });
    } catch (const std::bad_alloc &) {
        throw std::runtime_error(request.file + ": needs more memory than a worker may use");
    }
    return EXIT_SUCCESS;
}

} // namespace arhost::worker
