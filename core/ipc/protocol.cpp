// SPDX-License-Identifier: Apache-2.0
#include "ipc/protocol.hpp"

namespace arhost::ipc {

std::string to_text(Call call, std::string_view per_frame) {
    switch (call) {
    case Call::none:
        return "between calls";
    case Call::load:
        return "while its library was loaded";
    case Call::negotiate:
        return "in negotiate";
    case Call::create:
        return "in create";
    case Call::start:
        return "in start";
    case Call::per_frame:
        return "in " + std::string(per_frame);
    case Call::idle:
        return "in idle";
    case Call::stop:
        return "in stop";
    case Call::destroy:
        return "in destroy";
    case Call::devices:
        return "while it listed its devices";
    case Call::set_option:
        return "in set";
    case Call::counters:
        return "while it listed its counters";
    }
    return "in an unknown call";
}

} // namespace arhost::ipc
