// SPDX-License-Identifier: Apache-2.0
#include "worker/loader.hpp"

#include "base/file_identity.hpp"
#include "scene/scene_loader.hpp"

#include <arhost/plugin.h>

#include <cstdlib>

namespace arhost::worker {

int load_scene(Link &link, const ipc::messages::Load &load) {
    scene::LoadCallbacks callbacks;
    callbacks.progress = [&](double fraction, const std::string &what) { link.progress(fraction, what.c_str()); };
    callbacks.info = [&](const std::string &text) { link.log(ARHOST_SEVERITY_INFO, text); };
    callbacks.warning = [&](const std::string &text) { link.log(ARHOST_SEVERITY_WARNING, text); };
    callbacks.reads = [&](const std::filesystem::path &file) {
        const base::FileIdentity identity = base::identity_of(file);
        link.send(ipc::messages::Reads{identity.path, identity.node});
    };
    scene::ArenaBuilder builder =
        scene::load_scene(load.scene, callbacks, {load.readable.begin(), load.readable.end()});
    const scene::Origins origins = builder.origins();
    const ipc::SharedMemory memory = ipc::SharedMemory::create("arhost-scene", builder.byte_size());
    {
        const ipc::Mapping mapping = memory.map(ipc::Access::read_write);
        std::move(builder).write(mapping.bytes());
        // The host validates the arena, too, but does not know which part of the scene file an element comes from.
        if (const auto fault = scene::find_fault(mapping.bytes()))
            throw yaml::Error(origins.message(*fault));
    } // unmaps the memory, because the host can freeze it only if no writable mapping exists
    for (const std::string &origin : origins.all(scene::Table::anchors))
        link.send(ipc::messages::AnchorOrigin{origin});
    link.send(ipc::messages::Loaded{}, {memory.fd()});
    return EXIT_SUCCESS;
}

} // namespace arhost::worker
