// SPDX-License-Identifier: Apache-2.0
//
// Executes the commands of outputs: freezes the video, exchanges the tracker, the ray tracer and the scene, starts
// and stops outputs, changes options.
#pragma once

#include "host/assembly.hpp"
#include "host/outputs.hpp"

namespace arhost::host {

class Commands {
public:
    Commands(RunParts &parts, Assembly &assembly, Outputs &outputs)
        : parts_(parts), assembly_(assembly), outputs_(outputs) {}

    // Executes the command of a sink. Answers it during the call or later.
    void execute(SinkQueue &sink, const ipc::messages::Request &request);

private:
    void execute(const control::Quit &command, const control::Done &done);
    void execute(const control::Freeze &command, const control::Done &done);
    void execute(const control::Snapshot &command, const control::Done &done);
    void execute(const control::Record &command, const control::Done &done);
    void execute(const control::LoadScene &command, const control::Done &done);
    void execute(const control::Swap &command, const control::Done &done);
    void execute(const control::Set &command, const control::Done &done);
    void execute(const control::Status &command, const control::Done &done);
    supervise::Component &running_component(const std::string &name) const;

    RunParts &parts_;
    Assembly &assembly_;
    Outputs &outputs_;
};

} // namespace arhost::host
