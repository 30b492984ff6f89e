// SPDX-License-Identifier: Apache-2.0
//
// arhost-cpp/plugin.hpp: header-only C++20 wrapper of the C ABI. A plugin is a class, which one macro exports:
//
//   class Grey {
//   public:
//       Grey(const arhost::Host &host, const arhost::Options &options);
//       void start(const arhost_tracker_setup &setup);
//       void track(const arhost_track_request &request, arhost::Observations &observations);
//   };
//   ARHOST_TRACKER(Grey, descriptor)
//
// The second argument of `track` may also be `arhost_tracker_result &`, for trackers that report poses.
//
// Members report errors by throwing arhost::Failure (or any std::exception) with a message for the user. The adapters
// in this header log the message and return a status, so no exception crosses the ABI.
#pragma once

#include <arhost/arhost.h>

#include <algorithm>
#include <chrono>
#include <concepts>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <vector>

namespace arhost {

// An error to report to the user. `status` is an ARHOST_STATUS_ERROR_…; `message` says what to change.
class Failure : public std::runtime_error {
public:
    Failure(arhost_status status, const std::string &message) : std::runtime_error(message), status_(status) {}
    arhost_status status() const { return status_; }

private:
    arhost_status status_;
};

// The host's callbacks. Cheap to copy; all functions may be called on any thread.
class Host {
public:
    explicit Host(const arhost_host *host) : host_(host) {}
    void log(arhost_severity severity, const std::string &text) const { host_->log(host_, severity, text.c_str()); }
    void info(const std::string &text) const { log(ARHOST_SEVERITY_INFO, text); }
    void hint(const std::string &text) const { log(ARHOST_SEVERITY_HINT, text); }
    void warn(const std::string &text) const { log(ARHOST_SEVERITY_WARNING, text); }
    void error(const std::string &text) const { log(ARHOST_SEVERITY_ERROR, text); }
    void progress(double fraction, const char *what) const { host_->progress(host_, fraction, what); }
    bool cancelled() const { return host_->cancelled(host_) != 0; }
    // Sleeps until `when`, then returns true. If the host cancels the call, returns false early. Reports progress, so
    // that the host does not assume a hang.
    bool wait_until(std::chrono::steady_clock::time_point when) const {
        constexpr auto poll_interval = std::chrono::milliseconds(20),
                       report_interval = std::chrono::milliseconds(200);
        for (auto report = std::chrono::steady_clock::now() + report_interval;;) {
            const auto now = std::chrono::steady_clock::now();
            if (now >= when)
                return true;
            if (cancelled())
                return false;
            if (now >= report) {
                progress(-1, "waiting");
                report = now + report_interval;
            }
            std::this_thread::sleep_until(std::min(when, now + poll_interval));
        }
    }

    const arhost_host *get() const { return host_; }

private:
    const arhost_host *host_;
};

// Sends the commands of a sink to the host (arhost/control.h). Destroy it no earlier than the plugin's instance.
class HostControl {
public:
    // Receives an answer as JSON, on the thread that calls the plugin's functions.
    using Take = std::function<void(const std::string &answer)>;

    explicit HostControl(const Host &host)
        : host_(host.get()),
          functions_(static_cast<const arhost_control *>(host_->get_extension(host_, ARHOST_CONTROL_EXTENSION))) {}
    explicit operator bool() const { return functions_ != nullptr; } // whether the host accepts commands

    // May be called on any thread. Returns the status of arhost_control.send. If it is an error, `take` is not
    // called.
    arhost_status send(const std::string &command, Take take) {
        auto pending = std::make_unique<Pending>(Pending{this, std::move(take)});
        Pending *const context = pending.get();
        {
            const std::lock_guard lock(mutex_);
            pending_[context] = std::move(pending);
        }
        const arhost_status status = functions_->send(host_, command.c_str(), deliver, context);
        if (status != ARHOST_STATUS_OK)
            release(context);
        return status;
    }

private:
    struct Pending {
        HostControl *control;
        Take take;
    };
    static void deliver(void *context, const char *answer) {
        const std::unique_ptr<Pending> pending =
            static_cast<Pending *>(context)->control->release(static_cast<Pending *>(context));
        if (pending->take)
            pending->take(answer);
    }
    std::unique_ptr<Pending> release(Pending *pending) {
        const std::lock_guard lock(mutex_);
        return std::move(pending_.extract(pending).mapped());
    }

    const arhost_host *host_;
    const arhost_control *functions_;
    std::mutex mutex_;
    std::map<Pending *, std::unique_ptr<Pending>> pending_;
};

// The option values passed to `create`. The accessors throw Failure if the descriptor does not declare `key`.
class Options {
public:
    Options(const arhost_option *first, std::uint32_t count) : first_(first), count_(count) {}
    bool boolean(const std::string &key) const { return find(key).integer != 0; }
    std::int64_t integer(const std::string &key) const { return find(key).integer; }
    double real(const std::string &key) const { return find(key).real; }
    std::string text(const std::string &key) const { return find(key).text; }
    bool contains(const std::string &key) const { return arhost_find_option(first_, count_, key.c_str()) != nullptr; }

private:
    const arhost_option &find(const std::string &key) const {
        if (const arhost_option *option = arhost_find_option(first_, count_, key.c_str()))
            return *option;
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the option '" + key + "' is missing");
    }
    const arhost_option *first_;
    std::uint32_t count_;
};

// A range of the elements of an array of structs: targets, markers, observations. Steps by struct_size, because a
// newer host may use larger elements.
template <class T> class Elements {
public:
    Elements(T *first, std::uint32_t count) : first_(first), count_(count) {}

    class Iterator {
    public:
        using iterator_category = std::forward_iterator_tag;
        using value_type = std::remove_const_t<T>;
        using difference_type = std::ptrdiff_t;
        using pointer = T *;
        using reference = T &;
        Iterator() = default;
        Iterator(T *first, std::uint32_t index) : first_(first), index_(index) {}
        T &operator*() const { return Elements(first_, 0)[index_]; }
        T *operator->() const { return &**this; }
        Iterator &operator++() { return ++index_, *this; }
        Iterator operator++(int) { return {first_, index_++}; }
        bool operator==(const Iterator &other) const { return index_ == other.index_; }

    private:
        T *first_ = nullptr;
        std::uint32_t index_ = 0;
    };
    Iterator begin() const { return {first_, 0}; }
    Iterator end() const { return {first_, count_}; }
    std::uint32_t size() const { return count_; }
    bool empty() const { return count_ == 0; }
    // Returns the elements [first, first + count), without those past the end of the range.
    Elements part(std::uint32_t first, std::uint32_t count) const {
        if (first >= count_)
            return {first_, 0};
        return {&(*this)[first], count < count_ - first ? count : count_ - first};
    }
    T &operator[](std::size_t i) const {
        using Byte = std::conditional_t<std::is_const_v<T>, const char, char>;
        return *reinterpret_cast<T *>(reinterpret_cast<Byte *>(first_) + i * first_->struct_size);
    }

private:
    T *first_;
    std::uint32_t count_;
};
template <class T> Elements<T> elements(T *first, std::uint32_t count) {
    return {first, count};
}

// Receives the markers that a detector sees in a frame.
class Observations {
public:
    explicit Observations(arhost_tracker_result &result) : result_(result) {}
    // Returns false, and ignores the observation, if there are already ARHOST_MAX_OBSERVATIONS. Sets `struct_size`.
    bool add(const arhost_observation &seen) {
        if (result_.observation_count >= ARHOST_MAX_OBSERVATIONS)
            return false;
        arhost_observation &to = elements(result_.observations, ARHOST_MAX_OBSERVATIONS)[result_.observation_count++];
        const std::uint32_t struct_size = to.struct_size;
        to = seen;
        to.struct_size = struct_size;
        return true;
    }

    // arhost_tracker_result.candidate_count.
    void set_candidate_count(std::size_t count) {
        result_.candidate_count =
            static_cast<std::int32_t>(std::min<std::size_t>(count, std::numeric_limits<std::int32_t>::max()));
    }

private:
    arhost_tracker_result &result_;
};

// Returns an arhost_option_descriptor. Unlike in the struct, the optional fields are last and have defaults.
constexpr arhost_option_descriptor option(arhost_option_type type, const char *key, const char *default_value,
                                          const char *help, double minimum = 0, double maximum = 0,
                                          const char *const *choices = nullptr) {
    return {sizeof(arhost_option_descriptor), type, key, default_value, minimum, maximum, choices, help};
}

// C++ counterparts of the structs of arhost/devices.h: the same fields, with "" in place of NULL. A plugin class
// supports the devices extension if it has a static member function `std::vector<arhost::Device> devices()` or
// `devices(const arhost::Host &)`.
struct DeviceSize {
    std::uint32_t width = 0, height = 0;
    std::vector<double> rates{};
    bool is_rate_range = false;
};
struct DeviceFormat {
    std::string pixel_format{};
    std::vector<DeviceSize> sizes{};
    bool is_size_range = false;
};
struct DeviceControl {
    std::string name{};
    arhost_device_control_type type = ARHOST_DEVICE_CONTROL_INTEGER;
    std::int64_t minimum = 0, maximum = 0, step = 0, default_value = 0;
    std::optional<std::int64_t> value{};
};
struct Device {
    std::uint32_t index = 0;
    arhost_device_kind kind = ARHOST_DEVICE_OTHER;
    arhost_device_state state = ARHOST_DEVICE_STATE_USABLE;
    bool is_default = false;
    std::string name{}, path{}, serial{}, abilities{}, problem{};
    std::vector<DeviceFormat> formats{};   // cameras
    std::vector<DeviceControl> controls{}; // cameras
    std::uint32_t width = 0, height = 0;   // displays
    double rate = 0;                       // displays
};

// A counter of arhost/counters.h. A plugin class supports the extension if it has a member function
// `std::vector<arhost::CounterValue> counters()`.
struct CounterValue {
    const char *name;
    std::uint64_t value;
};

namespace detail {

// The object behind an arhost_instance pointer, for a plugin class T.
template <class T> struct Instance {
    Host host;
    T plugin;
    Instance(const arhost_host *h, const Options &options) : host(h), plugin(host, options) {}
};

template <class T> Instance<T> &instance_of(arhost_instance *instance) {
    return *reinterpret_cast<Instance<T> *>(instance);
}

// Runs `call` and returns its status. If `call` throws, logs the exception and returns a matching error status.
template <class Call> arhost_status guarded(const Host &host, Call &&call) noexcept {
    try {
        return call();
    } catch (const Failure &failure) {
        // Cancellation is not an error.
        host.log(failure.status() == ARHOST_STATUS_ERROR_CANCELLED ? ARHOST_SEVERITY_INFO : ARHOST_SEVERITY_ERROR,
                 failure.what());
        return failure.status();
    } catch (const std::bad_alloc &) {
        host.log(ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    } catch (const std::exception &error) {
        host.error(error.what());
        return ARHOST_STATUS_ERROR_INTERNAL;
    } catch (...) {
        host.log(ARHOST_SEVERITY_ERROR, "exception of unknown type");
        return ARHOST_STATUS_ERROR_INTERNAL;
    }
}

template <class T, class Call> arhost_status with(arhost_instance *instance, Call &&call) noexcept {
    Instance<T> &self = instance_of<T>(instance);
    return guarded(self.host, [&] { return call(self.plugin); });
}

template <class T>
arhost_status create(const arhost_host *host, const arhost_option *options, std::uint32_t count,
                     arhost_instance **instance) {
    return guarded(Host(host), [&] {
        *instance = reinterpret_cast<arhost_instance *>(new Instance<T>(host, Options(options, count)));
        return ARHOST_STATUS_OK;
    });
}

template <class T> void destroy(arhost_instance *instance) {
    delete &instance_of<T>(instance);
}

inline const void *no_extension(const char *) {
    return nullptr;
}

template <class T>
concept ListsDevicesByHost = requires(const Host &host) {
    { T::devices(host) } -> std::convertible_to<std::vector<Device>>;
};
template <class T>
concept ListsDevices = ListsDevicesByHost<T> || requires {
    { T::devices() } -> std::convertible_to<std::vector<Device>>;
};
template <ListsDevices T> std::vector<Device> devices_of(const Host &host) {
    if constexpr (ListsDevicesByHost<T>)
        return T::devices(host);
    else
        return T::devices();
}
inline void report(const Device &d, arhost_take_device take, void *context) {
    const auto or_null = [](const std::string &text) { return text.empty() ? nullptr : text.c_str(); };
    std::vector<std::vector<arhost_device_size>> sizes; // for each format
    std::vector<arhost_device_format> formats;
    for (const DeviceFormat &f : d.formats) {
        auto &list = sizes.emplace_back();
        for (const DeviceSize &s : f.sizes)
            list.push_back({sizeof(arhost_device_size), s.width, s.height, static_cast<std::uint32_t>(s.rates.size()),
                            s.is_rate_range, 0, s.rates.data()});
        formats.push_back({sizeof(arhost_device_format), static_cast<std::uint32_t>(list.size()), f.is_size_range, 0,
                           f.pixel_format.c_str(), list.data()});
    }
    std::vector<arhost_device_control> controls;
    for (const DeviceControl &c : d.controls)
        controls.push_back({sizeof(arhost_device_control), c.type, c.value.has_value(), 0, c.name.c_str(), c.minimum,
                            c.maximum, c.step, c.default_value, c.value.value_or(0)});
    const arhost_device device{sizeof device,
                               d.index,
                               d.kind,
                               d.state,
                               d.is_default,
                               static_cast<std::uint32_t>(formats.size()),
                               static_cast<std::uint32_t>(controls.size()),
                               d.width,
                               d.height,
                               0,
                               d.rate,
                               d.name.c_str(),
                               or_null(d.path),
                               or_null(d.serial),
                               or_null(d.abilities),
                               or_null(d.problem),
                               formats.data(),
                               controls.data()};
    take(context, &device);
}
template <ListsDevices T>
arhost_status list_devices(const arhost_host *host, arhost_take_device take, void *context) {
    return guarded(Host(host), [&] {
        for (const Device &device : devices_of<T>(Host(host)))
            report(device, take, context);
        return ARHOST_STATUS_OK;
    });
}
template <ListsDevices T>
inline constexpr arhost_devices devices_functions = {sizeof(arhost_devices), 0, list_devices<T>};

// A plugin class accepts changes of options while it runs if it has a static member `changeable`, an array of keys
// that ends with nullptr, and a member function `set(const Options &)`, whose argument contains the changed option
// alone.
template <class T>
concept AcceptsChanges = requires(T &plugin, const Options &changed) {
    plugin.set(changed);
    { +T::changeable } -> std::convertible_to<const char *const *>;
};
template <AcceptsChanges T>
inline constexpr arhost_set_option set_option_functions = {
    sizeof(arhost_set_option), 0, T::changeable, [](arhost_instance *i, const arhost_option *option) {
        return with<T>(i, [&](T &p) { return p.set(Options(option, 1)), ARHOST_STATUS_OK; });
    }};

template <class T>
concept Counts = requires(T &plugin) {
    { plugin.counters() } -> std::convertible_to<std::vector<CounterValue>>;
};
template <Counts T>
inline constexpr arhost_counters counters_functions = {
    sizeof(arhost_counters), 0, [](arhost_instance *i, arhost_take_counter take, void *context) {
        with<T>(i, [&](T &p) {
            for (const CounterValue &counter : p.counters())
                take(context, counter.name, counter.value);
            return ARHOST_STATUS_OK;
        });
    }};

// `stop` and `get_extension` are optional members of the plugin class.
template <class T> void stop(T &plugin) {
    if constexpr (requires { plugin.stop(); })
        plugin.stop();
}
template <class T> void stop_instance(arhost_instance *instance) {
    with<T>(instance, [](T &plugin) { return stop(plugin), ARHOST_STATUS_OK; });
}
template <class T> const void *get_extension(const char *id) {
    if constexpr (ListsDevices<T>)
        if (std::string_view(id) == ARHOST_DEVICES_EXTENSION)
            return &devices_functions<T>;
    if constexpr (AcceptsChanges<T>)
        if (std::string_view(id) == ARHOST_SET_OPTION_EXTENSION)
            return &set_option_functions<T>;
    if constexpr (Counts<T>)
        if (std::string_view(id) == ARHOST_COUNTERS_EXTENSION)
            return &counters_functions<T>;
    if constexpr (requires { T::get_extension(id); })
        return T::get_extension(id);
    else
        return no_extension(id);
}

// The function table of each kind. Unlike the other members of the plugin class, `read`, `write` and `idle` return an
// arhost_status, because they may return ARHOST_STATUS_END.
template <class T>
inline constexpr arhost_source source_functions = {
    sizeof(arhost_source), 0,
    [](arhost_instance *i, const arhost_source_setup *setup, arhost_source_properties *properties) {
        return with<T>(i, [&](T &p) { return p.start(*setup, *properties), ARHOST_STATUS_OK; });
    },
    [](arhost_instance *i, const arhost_frame_buffer *buffer, arhost_frame_info *info) {
        return with<T>(i, [&](T &p) -> arhost_status { return p.read(*buffer, *info); });
    },
    stop_instance<T>};

// `state_size` is an optional member of the plugin class.
template <class T> std::uint64_t state_size_of(arhost_instance *instance) {
    return instance_of<T>(instance).plugin.state_size();
}
// `aspect` is an optional member of the plugin class. If it throws, the result is 0, which the worker rejects.
template <class T> double aspect_of(arhost_instance *instance, std::uint32_t marker) {
    double aspect = 0;
    with<T>(instance, [&](T &p) { return aspect = p.aspect(marker), ARHOST_STATUS_OK; });
    return aspect;
}
template <class T> constexpr arhost_tracker make_tracker_functions() {
    arhost_tracker tracker{};
    tracker.struct_size = sizeof(arhost_tracker);
    tracker.start = [](arhost_instance *i, const arhost_tracker_setup *setup) {
        return with<T>(i, [&](T &p) { return p.start(*setup), ARHOST_STATUS_OK; });
    };
    tracker.track = [](arhost_instance *i, const arhost_track_request *request, arhost_tracker_result *result) {
        return with<T>(i, [&](T &p) {
            if constexpr (Observations seen(*result); requires { p.track(*request, seen); })
                p.track(*request, seen);
            else
                p.track(*request, *result);
            return ARHOST_STATUS_OK;
        });
    };
    tracker.stop = stop_instance<T>;
    if constexpr (requires(const T &p) { p.state_size(); })
        tracker.state_size = state_size_of<T>;
    if constexpr (requires(T & p) { p.aspect(std::uint32_t{}); })
        tracker.aspect = aspect_of<T>;
    return tracker;
}
template <class T> inline constexpr arhost_tracker tracker_functions = make_tracker_functions<T>();

// `capabilities` is an optional member of the plugin class.
template <class T> std::uint64_t capabilities_of(arhost_instance *instance) {
    return instance_of<T>(instance).plugin.capabilities();
}

template <class T> constexpr arhost_raytracer make_raytracer_functions() {
    arhost_raytracer raytracer{};
    raytracer.struct_size = sizeof(arhost_raytracer);
    raytracer.start = [](arhost_instance *i, const arhost_raytracer_setup *setup) {
        return with<T>(i, [&](T &p) { return p.start(*setup), ARHOST_STATUS_OK; });
    };
    raytracer.render = [](arhost_instance *i, const arhost_render_request *request, const arhost_image *image,
                          arhost_render_info *info) {
        return with<T>(i, [&](T &p) { return p.render(*request, *image, *info), ARHOST_STATUS_OK; });
    };
    raytracer.stop = stop_instance<T>;
    if constexpr (requires(const T &p) { p.capabilities(); })
        raytracer.capabilities = capabilities_of<T>;
    if constexpr (requires(const T &p) { p.state_size(); })
        raytracer.state_size = state_size_of<T>;
    return raytracer;
}
template <class T> inline constexpr arhost_raytracer raytracer_functions = make_raytracer_functions<T>();

template <class T> constexpr arhost_sink make_sink_functions() {
    arhost_sink sink{};
    sink.struct_size = sizeof(arhost_sink);
    sink.start = [](arhost_instance *i, const arhost_sink_setup *setup) {
        return with<T>(i, [&](T &p) { return p.start(*setup), ARHOST_STATUS_OK; });
    };
    sink.write = [](arhost_instance *i, const arhost_output *output) {
        return with<T>(i, [&](T &p) -> arhost_status { return p.write(*output); });
    };
    if constexpr (requires(T & p) { p.idle(); })
        sink.idle = [](arhost_instance *i) { return with<T>(i, [](T &p) -> arhost_status { return p.idle(); }); };
    sink.stop = [](arhost_instance *i) { return with<T>(i, [](T &p) { return stop(p), ARHOST_STATUS_OK; }); };
    if constexpr (requires(const T &p) { p.capabilities(); })
        sink.capabilities = capabilities_of<T>;
    return sink;
}
template <class T> inline constexpr arhost_sink sink_functions = make_sink_functions<T>();

} // namespace detail

// Implements arhost_entry_point.negotiate for `plugin`.
inline arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer, const arhost_plugin &plugin) {
    if (offer->struct_size < sizeof *offer || answer->struct_size < sizeof *answer)
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    const std::uint32_t version = ARHOST_ABI_VERSION;
    if (version < offer->oldest_abi_version || version > offer->newest_abi_version)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = version;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

} // namespace arhost

// Defines arhost_entry for a plugin class and its arhost_descriptor. Use once per shared object, at global scope.
#define ARHOST_PLUGIN_OF_KIND(Class, descriptor_object, functions_object)                                            \
    static constexpr arhost_plugin arhost_plugin_object = {sizeof(arhost_plugin),                                    \
                                                           0,                                                        \
                                                           &(descriptor_object),                                     \
                                                           &arhost::detail::functions_object<Class>,                 \
                                                           arhost::detail::create<Class>,                            \
                                                           arhost::detail::destroy<Class>,                           \
                                                           arhost::detail::get_extension<Class>};                    \
    extern "C" ARHOST_EXPORT const arhost_entry_point arhost_entry = {                                               \
        sizeof(arhost_entry_point), 0, [](const arhost_offer *offer, arhost_answer *answer) {                        \
            return arhost::negotiate(offer, answer, arhost_plugin_object);                                           \
        }};

#define ARHOST_SOURCE(Class, descriptor) ARHOST_PLUGIN_OF_KIND(Class, descriptor, source_functions)
#define ARHOST_TRACKER(Class, descriptor) ARHOST_PLUGIN_OF_KIND(Class, descriptor, tracker_functions)
#define ARHOST_RAYTRACER(Class, descriptor) ARHOST_PLUGIN_OF_KIND(Class, descriptor, raytracer_functions)
#define ARHOST_SINK(Class, descriptor) ARHOST_PLUGIN_OF_KIND(Class, descriptor, sink_functions)
