// SPDX-License-Identifier: Apache-2.0
//
// Reports files that other programs have written or replaced.
#pragma once

#include "ipc/reactor.hpp"

#include <filesystem>
#include <functional>
#include <map>
#include <set>

namespace arhost::host {

class FileWatch {
public:
    using Files = std::set<std::filesystem::path>;

    // Calls `changed` from the reactor, once no watched file has changed for a moment: an editor that saves several
    // files causes one call. Throws std::system_error if the kernel has no inotify instance left.
    FileWatch(ipc::Reactor &reactor, std::function<void(const Files &)> changed);

    // Adds files, whose paths must be absolute and which need not exist. Watches their folders, because most editors
    // save by renaming a new file. After a folder was replaced, all files are reported. Throws std::system_error if
    // the kernel has no watch left.
    void add(const Files &files);

private:
    void on_events();
    void report();

    ipc::Reactor &reactor_;
    std::function<void(const Files &)> changed_;
    base::UniqueFd inotify_;
    Files files_, pending_;                                  // `pending_`: changed, but not reported
    bool is_incomplete_ = false;                             // a folder was replaced, or events were lost
    std::map<int, std::set<std::filesystem::path>> folders_; // by watch descriptor; a folder can have several names
    ipc::Reactor::Registration events_, quiet_;
};

} // namespace arhost::host
