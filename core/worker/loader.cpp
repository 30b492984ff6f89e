// SPDX-License-Identifier: Apache-2.0
#include "worker/loader.hpp"

#include "base/file_identity.hpp"
#include "scene/loader.hpp"

#include <arhost/plugin.h>

#include <cstdlib>

namespace arhost::worker {

int load_scene_for(Link &link, const ipc::Message &load) {
    scene::LoadCallbacks callbacks;
    callbacks.progress = [&](double fraction, const std::string &what) { link.progress(fraction, what.c_str()); };
    callbacks.info = [&](const std::string &text) { link.log(ARHOST_SEVERITY_INFO, text); };
    callbacks.warning = [&](const std::string &text) { link.log(ARHOST_SEVERITY_WARNING, text); };
    callbacks.reads = [&](const std::filesystem::path &file) {
        const base::FileIdentity identity = base::identity_of(file);
        link.send({{"type", "reads"}, {"path", identity.path}, {"node", identity.node}});
    };
    scene::ArenaBuilder builder = scene::load_scene(load.body.at("scene").get<std::string>(), callbacks);
    const ipc::SharedMemory memory = ipc::SharedMemory::create("arhost-scene", builder.byte_size());
    {
        const ipc::Mapping mapping = memory.map(ipc::Access::read_write);
        std::move(builder).write(mapping.bytes());
    } // unmapped: the host freezes it, which no writable mapping may outlive
    link.send({{"type", "loaded"}}, {memory.fd()});
    return EXIT_SUCCESS;
}

} // namespace arhost::worker
