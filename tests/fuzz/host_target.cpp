// SPDX-License-Identifier: Apache-2.0
//
// Runs the whole host with simulated workers. The fuzzer's bytes determine what the workers do: follow the protocol,
// with or without corrupting it; send arbitrary messages; overwrite their memory; exit at any time. The target starts
// no processes and does not depend on timing, because all deadlines are one hour.
#include "../core/scene/scene_samples.hpp"
#include "input.hpp"
#include "targets.hpp"

#include "host/run.hpp"
#include "ipc/fd_passing.hpp"
#include "ipc/messages.hpp"

#include <csignal>
#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <list>
#include <stdexcept>
#include <utility>

namespace arhost::fuzz {
namespace {

using namespace ipc;

constexpr const char *configuration_text = R"(version: 1
plugin_path: [plugins]
source: {plugin: source, conform: true, deadline_ms: 3600000, start_deadline_ms: 3600000, stop_deadline_ms: 3600000}
tracker: {plugin: tracker, fallback: tracker2, hold_frames: 1, conform: true,
          targets: [{name: cup, marker: 0, family: tag36h11, side_mm: 80}, {marker: 1, family: tag36h11, side_mm: 80}],
          deadline_ms: 3600000, start_deadline_ms: 3600000, stop_deadline_ms: 3600000}
raytracer: {plugin: rt, scene: scene.yaml, conform: true, deadline_ms: 3600000, start_deadline_ms: 3600000,
            stop_deadline_ms: 3600000}
outputs:
- {plugin: sink, deadline_ms: 3600000, start_deadline_ms: 3600000, stop_deadline_ms: 3600000}
- {plugin: sink2, deadline_ms: 3600000, start_deadline_ms: 3600000, stop_deadline_ms: 3600000}
restart: {first_delay_ms: 0, longest_delay_ms: 0, quarantine_after: 4}
)";

run_config::Configuration make_configuration(const char *mode) {
    for (const char *plugin : {"source.so", "tracker.so", "tracker2.so", "rt.so", "sink.so", "sink2.so"})
        write_scratch(std::filesystem::path("plugins") / plugin, {});
    write_scratch("scene.yaml", {});
    const std::string text = std::string(configuration_text) + "mode: " + mode + "\n";
    return run_config::parse(yaml::Node::parse(text, (scratch() / "run.yaml").string()), scratch() / "plugins");
}

// Describes the ray tracer that workers simulate, and the integrator of its scene.
struct RaytracerTraits {
    std::uint64_t capabilities = 0, state_size = 0;
    arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED;
};

scene::Arena make_arena(arhost_integrator integrator) {
    scene::ArenaBuilder builder = scene::test::full_scene();
    builder.settings.integrator = integrator;
    return std::move(builder).build();
}

base::UniqueFd scene_memory(arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED) {
    static const scene::Arena whitted = make_arena(ARHOST_INTEGRATOR_WHITTED),
                              path = make_arena(ARHOST_INTEGRATOR_PATH);
    const scene::Arena &arena = integrator == ARHOST_INTEGRATOR_PATH ? path : whitted;
    base::UniqueFd fd = base::checked(::memfd_create("arena", MFD_CLOEXEC | MFD_ALLOW_SEALING), "memfd_create");
    if (::write(fd.get(), arena.bytes().data(), arena.bytes().size()) < 0)
        base::throw_errno("write to a memfd");
    return fd;
}

base::UniqueFd arbitrary_descriptor(unsigned kind) {
    switch (kind % 4) {
    case 0:
        return scene_memory();
    case 1:
        return base::checked(::open("/dev/null", O_RDWR | O_CLOEXEC), "/dev/null");
    case 2: // an empty memfd that cannot be sealed
        return base::checked(::memfd_create("empty", MFD_CLOEXEC), "memfd_create");
    default:
        return base::checked(::eventfd(0, EFD_CLOEXEC), "eventfd");
    }
}

// The worker side of one connection.
class Worker {
public:
    Worker(pid_t process, Channel channel, base::UniqueFd doorbell, base::UniqueFd output, base::UniqueFd death,
           const RaytracerTraits &raytracer)
        : pid(process), raytracer_(raytracer), channel_(std::move(channel)), doorbell_(std::move(doorbell)),
          output_(std::move(output)), death_(std::move(death)) {}

    const pid_t pid;
    int wait_status = 0;
    bool dead = false;

    void act(Input &input) {
        switch (input.number() % 8) {
        case 3:
            return send_text(input.text(input.number()), {}, input);
        case 4:
            if (worker_page_)
                input.corrupt(worker_page_.bytes());
            return ring_doorbell(doorbell_.get());
        case 5:
            if (output_memory_)
                input.corrupt(output_memory_.bytes());
            return;
        case 6: {
            const std::string text = input.text(input.number());
            (void)!::write(output_.get(), text.data(), text.size());
            return;
        }
        case 7:
            return misbehave(input.number());
        default:
            return step(input);
        }
    }

    void die(int status) {
        ::eventfd_write(death_.get(), 1);
        channel_.close();
        doorbell_.reset();
        output_.reset();
        commands_.reset();
        results_.reset();
        for (Mapping *mapping : {&host_page_, &worker_page_, &output_memory_})
            *mapping = Mapping();
        wait_status = status;
        dead = true;
    }

private:
    void misbehave(unsigned how) {
        if (how % 3 == 0)
            return die(static_cast<int>(how / 3)); // wait(2) status, including signals
        if (how % 3 == 1)
            return channel_.close();
        for (unsigned i = 0; i < how * 40; ++i)
            ring_doorbell(doorbell_.get());
    }

    // Does the next step of a correct worker. Its messages and results may be corrupted.
    void step(Input &input) {
        if (finished_)
            return die(0);
        pollfd ready{channel_.fd(), POLLIN, 0};
        Message message;
        if (::poll(&ready, 1, 0) > 0 && channel_.receive(message, 0) == ReceiveState::message)
            return reply(message, input);
        Command command{};
        if (commands_ && commands_->pop(command) == RingResult::done && command.kind != CommandKind::control)
            answer(command, input);
    }

    void reply(Message &message, Input &input) {
        if (is<messages::Open>(message))
            say_hello(message, input);
        else if (is<messages::Load>(message))
            finish(messages::Loaded{}, scene_memory(raytracer_.integrator), input);
        else if (is<messages::Create>(message))
            send(ready(), {}, input);
        else if (is<messages::Attach>(message))
            attach(message, input);
        else if (is<messages::Stop>(message))
            finish(messages::Stopped{}, {}, input);
    }

    template <class T> void finish(const T &message, base::UniqueFd fd, Input &input) {
        send(message, std::move(fd), input);
        finished_ = true;
    }

    void say_hello(Message &open, Input &input) {
        map_pages(open);
        const std::string name = std::filesystem::path(parse<messages::Open>(open).plugin).stem();
        kind_ = name == "source"              ? ARHOST_KIND_SOURCE
                : name.starts_with("tracker") ? ARHOST_KIND_TRACKER
                : name == "rt"                ? ARHOST_KIND_RAYTRACER
                                              : ARHOST_KIND_SINK;
        const std::string id = "org.arhost." + name;
        const arhost_descriptor descriptor = {sizeof descriptor,
                                              kind_,
                                              id.c_str(),
                                              "",
                                              "",
                                              "",
                                              "",
                                              "",
                                              kind_ == ARHOST_KIND_SOURCE      ? ARHOST_SOURCE_CAPABILITY_SEEK
                                              : kind_ == ARHOST_KIND_RAYTRACER ? raytracer_.capabilities
                                                                               : 0,
                                              0,
                                              nullptr,
                                              nullptr};
        send(messages::Hello{model::describe(descriptor), ""}, {}, input);
    }

    void map_pages(Message &open) {
        if (open.fds.size() < 2)
            return;
        host_page_ = SharedMemory::adopt(std::move(open.fds[0])).map(Access::read_only);
        worker_page_ = SharedMemory::adopt(std::move(open.fds[1])).map(Access::read_write);
        commands_.emplace(host_page_.as<HostPage>().commands, worker_page_.as<WorkerPage>().commands);
        results_.emplace(worker_page_.as<WorkerPage>().results, host_page_.as<HostPage>().results);
    }

    messages::Ready ready() const {
        if (kind_ == ARHOST_KIND_RAYTRACER)
            return {std::nullopt, 0, std::nullopt, raytracer_.capabilities, raytracer_.state_size};
        if (kind_ != ARHOST_KIND_SOURCE)
            return {};
        arhost_frame_format format{};
        format.pixel_format = ARHOST_PIXEL_FORMAT_NV12;
        format.width = 18;
        format.height = 10;
        format.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
        format.yuv_range = ARHOST_YUV_RANGE_FULL;
        format.fps = 30;
        arhost_intrinsics camera{};
        camera.width = format.width;
        camera.height = format.height;
        camera.fx = camera.fy = 20;
        camera.cx = 8.5;
        camera.cy = 4.5;
        camera.distortion = ARHOST_DISTORTION_BROWN;
        camera.coefficient_count = 4;
        camera.coefficients[0] = 0.1;
        return {format, 0, camera};
    }

    void attach(Message &message, Input &input) {
        const auto attach = parse<messages::Attach>(message);
        if (attach.is_output) {
            layout_ = attach.layout;
            output_memory_ = SharedMemory::adopt(std::move(message.fds.at(0))).map(Access::read_write);
        }
        send(messages::Attached{attach.is_output, attach.generation}, {}, input);
    }

    void answer(const Command &command, Input &input) {
        Result result{};
        result.ticket = command.ticket;
        result.status = ARHOST_STATUS_OK;
        result.frame.clock = ARHOST_CLOCK_MEDIA;
        result.frame.capture_ns = static_cast<std::int64_t>(command.sequence) * 1000;
        if (kind_ == ARHOST_KIND_TRACKER && output_memory_) {
            const auto slot = layout_.slot(output_memory_, command.slot);
            const TrackerSlot layout(2);
            *reinterpret_cast<TrackerSlot::Header *>(slot.data()) = {1, 1, 0, 0, -1};
            auto &found = *reinterpret_cast<arhost_target *>(slot.data() + TrackerSlot::targets_offset);
            found.state = ARHOST_TARGET_DETECTED;
            found.observation_count = 1;
            for (const int diagonal : {0, 5, 10, 15})
                found.mt[diagonal] = 1;
            found.mt[14] = -500;
            input.corrupt(slot.first(layout.observations_offset + sizeof(arhost_observation)));
        }
        input.corrupt(std::as_writable_bytes(std::span(&result, 1)));
        results_->push(result);
        ring_doorbell(doorbell_.get());
    }

    template <class T> void send(const T &message, base::UniqueFd fd, Input &input) const {
        send_text(encode(message).dump(), std::move(fd), input);
    }

    // Sends `fd` and up to four more descriptors, which is the maximum of one message.
    void send_text(std::string text, base::UniqueFd fd, Input &input) const {
        input.corrupt(std::as_writable_bytes(std::span(text)));
        const unsigned more = input.number() < 200 ? 0 : input.number();
        std::vector<base::UniqueFd> fds;
        if (fd)
            fds.push_back(std::move(fd));
        for (unsigned i = 0; i < more % 4; ++i)
            fds.push_back(arbitrary_descriptor(more >> 2 >> i));
        const auto bytes = std::as_bytes(std::span(text));
        switch (fds.size()) {
        case 0:
            send_with_fds(channel_.fd(), bytes, {}, MSG_DONTWAIT);
            break;
        case 1:
            send_with_fds(channel_.fd(), bytes, {fds[0].get()}, MSG_DONTWAIT);
            break;
        default:
            send_with_fds(channel_.fd(), bytes, {fds[0].get(), fds[1].get()}, MSG_DONTWAIT);
        }
    }

    const RaytracerTraits raytracer_;
    Channel channel_;
    base::UniqueFd doorbell_, output_, death_;
    Mapping host_page_, worker_page_, output_memory_;
    SlotLayout layout_;
    std::optional<CommandConsumer> commands_;
    std::optional<ResultProducer> results_;
    arhost_kind kind_ = 0;
    bool finished_ = false;
};

class SimulatedWorkers final : public supervise::Starter {
public:
    explicit SimulatedWorkers(const RaytracerTraits &raytracer) : raytracer_(raytracer) {}

    supervise::Spawned spawn(const std::filesystem::path &, supervise::Isolation,
                             const supervise::LogFunction &) override {
        supervise::Spawned spawned;
        Channel theirs;
        std::tie(spawned.channel, theirs) = Channel::make_pair();
        DoorbellPair doorbell = make_doorbell();
        spawned.doorbell = std::move(doorbell.host);
        int pipe_ends[2];
        if (::pipe2(pipe_ends, O_CLOEXEC | O_NONBLOCK) != 0)
            base::throw_errno("pipe2");
        spawned.output.reset(pipe_ends[0]);
        // Not a real pidfd, so sending signals fails.
        spawned.pidfd = base::checked(::eventfd(0, EFD_CLOEXEC), "eventfd");
        spawned.pid = next_pid_++;
        workers_.emplace_back(spawned.pid, std::move(theirs), std::move(doorbell.worker),
                              base::UniqueFd(pipe_ends[1]), base::checked(::dup(spawned.pidfd.get()), "dup"),
                              raytracer_);
        return spawned;
    }

    supervise::Exit wait_exit(pid_t pid) override {
        const auto found = std::ranges::find(workers_, pid, &Worker::pid);
        if (found == workers_.end() || !found->dead)
            throw std::logic_error("the host waits for a running worker");
        const supervise::Exit exit{pid, found->wait_status, 0};
        workers_.erase(found);
        return exit;
    }

    void act(Input &input) {
        std::vector<Worker *> living;
        for (Worker &worker : workers_)
            if (!worker.dead)
                living.push_back(&worker);
        const unsigned index = input.number(); // 0 selects the next worker in turn
        if (!living.empty())
            living[(index ? index : turn_++) % living.size()]->act(input);
    }

private:
    const RaytracerTraits raytracer_;
    unsigned turn_ = 0;
    pid_t next_pid_ = 1 << 22; // above the maximum PID of Linux
    std::list<Worker> workers_;
};

} // namespace

void run_host(Bytes bytes) {
    [[maybe_unused]] static const auto ignored = ::signal(SIGPIPE, SIG_IGN); // like arhost
    static const run_config::Configuration lockstep = make_configuration("lockstep"),
                                           live = make_configuration("live");
    Input input(bytes);
    // Bit 0: mode live; 1 and 2: the size of the state; 3 to 6: capabilities of the ray tracer; 7: the integrator.
    const unsigned traits = input.number();
    const run_config::Configuration &configuration = traits & 1 ? live : lockstep;
    constexpr std::uint64_t state_sizes[] = {0, 8, 100'000, max_raytracer_state + 1};
    SimulatedWorkers workers({.capabilities = traits >> 3 & 0xf,
                              .state_size = state_sizes[traits >> 1 & 3],
                              .integrator = traits & 0x80 ? ARHOST_INTEGRATOR_PATH : ARHOST_INTEGRATOR_WHITTED});
    Reactor reactor;
    host::Run run(configuration, {reactor, workers, "", [](arhost_severity, auto &, auto &) {}}, {});
    // This descriptor is always readable, so each iteration of the reactor does one action.
    const base::UniqueFd always = base::checked(::eventfd(1, EFD_CLOEXEC), "eventfd");
    const auto acting = reactor.watch(always.get(), [&] {
        if (input.empty())
            run.interrupt(); // the second interrupt stops the host immediately
        else
            workers.act(input);
    });
    run.run();
    (void)host::report(run.statistics(), run.component_totals(), 0)
        .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

} // namespace arhost::fuzz
