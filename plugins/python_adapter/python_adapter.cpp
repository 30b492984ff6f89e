// SPDX-License-Identifier: Apache-2.0
//
// Runs a class of a Python script in CPython. This file starts the interpreter and passes memory to arhost.py as
// memoryviews; arhost.py turns them into the objects that the class receives. The GIL is held only during calls, so
// threads of the script can run between calls.
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "arhost_py.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <fstream>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

// METHOD: the method of the script's class for each frame. ADAPTER: the class of arhost.py that calls it.
#if defined(KIND_SOURCE)
#define KIND ARHOST_KIND_SOURCE
#define METHOD "read"
#define ADAPTER "_SourceAdapter"
#elif defined(KIND_TRACKER)
#define KIND ARHOST_KIND_TRACKER
#define METHOD "track"
#define ADAPTER "_TrackerAdapter"
#elif defined(KIND_RAYTRACER)
#define KIND ARHOST_KIND_RAYTRACER
#define METHOD "render"
#define ADAPTER "_RaytracerAdapter"
// A script declares its own: the attribute `capabilities`.
#define CAPABILITIES                                                                                                 \
    (ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE | ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES |                           \
     ARHOST_RAYTRACER_CAPABILITY_VIDEO)
#else
#define KIND ARHOST_KIND_SINK
#define METHOD "write"
#define ADAPTER "_SinkAdapter"
#endif
#ifndef CAPABILITIES
#define CAPABILITIES 0
#endif

namespace {

using namespace arhost;

// An owned reference to a Python object; null if Python raised an exception.
class Object {
public:
    Object(PyObject *owned = nullptr) : object_(owned) {} // NOLINT(google-explicit-constructor)
    Object(Object &&other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
    Object &operator=(Object &&other) noexcept {
        std::swap(object_, other.object_);
        return *this;
    }
    Object(const Object &) = delete;
    Object &operator=(const Object &) = delete;
    ~Object() { Py_XDECREF(object_); }
    PyObject *get() const { return object_; }
    PyObject *release() { return std::exchange(object_, nullptr); }
    explicit operator bool() const { return object_ != nullptr; }

private:
    PyObject *object_;
};

class GilLock {
public:
    GilLock() : state_(PyGILState_Ensure()) {}
    ~GilLock() { PyGILState_Release(state_); }
    GilLock(const GilLock &) = delete;
    GilLock &operator=(const GilLock &) = delete;

private:
    PyGILState_STATE state_;
};

std::string text_of(PyObject *object) {
    const Object text(PyObject_Str(object));
    const char *bytes = text ? PyUnicode_AsUTF8(text.get()) : nullptr;
    PyErr_Clear();
    return bytes ? bytes : "";
}

// Clears an exception that arhost.py did not handle, and returns its message.
std::string take_error() {
    PyObject *type = nullptr, *value = nullptr, *trace = nullptr;
    PyErr_Fetch(&type, &value, &trace);
    const Object owned_type(type), owned_value(value), owned_trace(trace);
    return value ? text_of(value) : type ? text_of(type) : "unknown error";
}

Object checked(PyObject *object) {
    if (!object)
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "Python: " + take_error());
    return object;
}

Object view(const void *bytes, std::size_t size, int flag = PyBUF_READ) {
    static const char nothing = 0;
    const auto *start = static_cast<const char *>(bytes ? bytes : &nothing);
    return checked(PyMemoryView_FromMemory(const_cast<char *>(start), static_cast<Py_ssize_t>(size), flag));
}
template <class T> Object view_of(const T *object) {
    return object ? view(object, sizeof *object) : Object(Py_NewRef(Py_None));
}
template <class T> Object view_of_elements(T *first, std::uint32_t count) {
    return view(first, count ? std::size_t(count) * first->struct_size : 0,
                std::is_const_v<T> ? PyBUF_READ : PyBUF_WRITE);
}

Object tuple_of(std::vector<Object> &&objects) {
    Object tuple = checked(PyTuple_New(static_cast<Py_ssize_t>(objects.size())));
    for (std::size_t i = 0; i < objects.size(); ++i)
        PyTuple_SET_ITEM(tuple.get(), static_cast<Py_ssize_t>(i), objects[i].release());
    return tuple;
}

std::size_t plane_size(const arhost_frame_format &format, std::uint32_t plane) {
    const bool halved = plane > 0; // only NV12 and I420 have more than one plane
    return std::size_t(format.stride[plane]) * (halved ? format.height / 2 : format.height);
}
template <class Plane> Object views_of_planes(const arhost_frame_format &format, const Plane *planes, int flag) {
    std::vector<Object> views;
    for (std::uint32_t i = 0; i < format.plane_count; ++i)
        views.push_back(view(planes[i], plane_size(format, i), flag));
    return tuple_of(std::move(views));
}

std::size_t image_size(const arhost_image &image, std::size_t pixel_bytes) {
    return std::size_t{image.stride} * (image.height - 1) + pixel_bytes * image.width;
}

// ---- functions that the script can call; `self` is a capsule that holds the arhost_host ----

constexpr const char *host_name = "arhost_host"; // of the capsule, until the instance ends

// Returns nullopt if the instance has ended, which threads of the script may outlive.
std::optional<Host> host_of(PyObject *self) {
    if (!PyCapsule_IsValid(self, host_name))
        return std::nullopt;
    return Host(static_cast<const arhost_host *>(PyCapsule_GetPointer(self, host_name)));
}
PyObject *py_log(PyObject *self, PyObject *arguments) {
    int severity = 0;
    const char *text = nullptr;
    if (!PyArg_ParseTuple(arguments, "is", &severity, &text))
        return nullptr;
    if (const auto host = host_of(self))
        host->log(severity, text);
    Py_RETURN_NONE;
}
PyObject *py_progress(PyObject *self, PyObject *arguments) {
    double fraction = 0;
    const char *what = "";
    if (!PyArg_ParseTuple(arguments, "d|s", &fraction, &what))
        return nullptr;
    if (const auto host = host_of(self))
        host->progress(fraction, what);
    Py_RETURN_NONE;
}
PyObject *py_cancelled(PyObject *self, PyObject *) {
    const auto host = host_of(self);
    return PyBool_FromLong(!host || host->cancelled());
}
PyMethodDef callbacks[] = {{"log", py_log, METH_VARARGS, "log(severity, text)"},
                           {"progress", py_progress, METH_VARARGS, "progress(fraction, what)"},
                           {"cancelled", py_cancelled, METH_NOARGS, "True: the running call must return soon"}};

// ---- the interpreter ----

// Serialises the start of the interpreter. In arhost-inprocess, the adapters of several kinds are separate libraries
// in one process. The only mutexes that they share are those of the C library, so this class locks the mutex of
// stderr.
class ProcessLock {
public:
    ProcessLock() { ::flockfile(stderr); }
    ~ProcessLock() { ::funlockfile(stderr); }
    ProcessLock(const ProcessLock &) = delete;
    ProcessLock &operator=(const ProcessLock &) = delete;
};

// Rejects a file that is not the program of CPython. Nothing executes the file: it only tells where the packages are,
// so Python would start without them.
void expect_python(const std::string &interpreter) {
    constexpr std::string_view main_function = "Py_BytesMain"; // the program calls it, or contains it
    std::ifstream file(interpreter, std::ios::binary);
    std::string chunk(1 << 20, '\0'), bytes;
    bool is_python = false;
    while (file && !is_python) {
        file.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
        bytes.append(chunk, 0, static_cast<std::size_t>(file.gcount()));
        is_python = bytes.find(main_function) != std::string::npos;
        bytes.erase(0, bytes.size() - std::min(bytes.size(), main_function.size() - 1));
    }
    if (!is_python)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the option 'interpreter' names '" + interpreter +
                          "', which is not a readable program of CPython; set it to the python of a virtual "
                          "environment (bin/python), or omit it");
}

void initialise(const std::string &interpreter) {
    expect_python(interpreter);
    const ProcessLock lock;
    if (Py_IsInitialized())
        return;
    // Extension modules need the symbols of libpython to be global, but this plugin was opened with RTLD_LOCAL.
    Dl_info info{};
    if (::dladdr(reinterpret_cast<void *>(&Py_IsInitialized), &info))
        ::dlopen(info.dli_fname, RTLD_NOW | RTLD_GLOBAL | RTLD_NOLOAD);
    PyConfig config;
    PyConfig_InitPythonConfig(&config);
    config.install_signal_handlers = 0;
    config.parse_argv = 0;
    config.buffered_stdio = 0; // keeps the output of print() in order with the log
    config.write_bytecode = 0; // do not write __pycache__ next to the script
    PyConfig_SetBytesString(&config, &config.program_name, interpreter.c_str());
    const PyStatus status = Py_InitializeFromConfig(&config);
    PyConfig_Clear(&config);
    if (PyStatus_Exception(status)) {
        const char *const home = std::getenv("PYTHONHOME");
        throw Failure(
            ARHOST_STATUS_ERROR_CONFIGURATION,
            std::string("cannot start Python: ") + (status.err_msg ? status.err_msg : "unknown reason") +
                (home ? std::string("; unset the environment variable PYTHONHOME, which is '") + home + "'" : ""));
    }
    PyEval_SaveThread();
}

// Creates the modules arhost_abi and arhost, which the script can import.
Object import_arhost(const std::string &interpreter) {
    if (PyObject *already = PyImport_AddModule("arhost"); already && PyObject_HasAttrString(already, "_Adapter"))
        return Py_NewRef(already);
    Object module;
    for (const auto &[name, file, text] :
         {std::tuple{"arhost_abi", "arhost_abi.py", arhost_abi_py}, {"arhost", "arhost.py", arhost_py}}) {
        const Object code = checked(Py_CompileString(text, file, Py_file_input));
        module = PyImport_ExecCodeModule(name, code.get());
        if (module)
            continue;
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "Python " PY_VERSION " (" + interpreter + "): " + take_error() +
                          "; install python3-numpy, or set the option 'interpreter' to the python of a virtual "
                          "environment with "
                          "numpy (and allow reading it: 'reads: [FOLDER]')");
    }
    return module;
}

// ---- the plugin ----

class PythonAdapter {
public:
    PythonAdapter(const Host &host, const Options &options) : host_(host) {
#if defined(KIND_SINK)
        path_ = options.text("path");
#endif
        const std::string interpreter = options.text("interpreter");
        initialise(interpreter);
        const GilLock lock;
        const Object module = import_arhost(interpreter);
        try {
            capsule_ = checked(PyCapsule_New(const_cast<arhost_host *>(host_.get()), host_name, nullptr));
            Object functions[3];
            for (int i = 0; i < 3; ++i)
                functions[i] = checked(PyCFunction_New(&callbacks[i], capsule_.get()));
            adapter_ = checked(PyObject_CallMethod(module.get(), ADAPTER, "OOO", functions[0].get(),
                                                   functions[1].get(), functions[2].get()));
            if (call("load", "sss", options.text("script").c_str(), options.text("class").c_str(),
                     options.text("arguments").c_str())
                    .value.get() == Py_True)
                lister_ = this;
#if defined(KIND_RAYTRACER)
            capabilities_ = PyLong_AsUnsignedLongLongMask(call("capabilities", "").value.get());
#endif
        } catch (...) {
            end();
            throw;
        }
    }
    ~PythonAdapter() {
        if (lister_ == this)
            lister_ = nullptr;
        const GilLock lock;
        end();
    }
    PythonAdapter(const PythonAdapter &) = delete;
    PythonAdapter &operator=(const PythonAdapter &) = delete;

    void stop() {
        const GilLock lock;
        call("stop", "");
    }

    // Returns the extension of arhost/devices.h while there is an instance whose class has a method `devices`.
    static const void *get_extension(const char *id) {
        static constexpr arhost_devices functions = {sizeof functions, 0, list_devices};
        return lister_ && std::string_view(id) == ARHOST_DEVICES_EXTENSION ? &functions : nullptr;
    }

    // sources
    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        const GilLock lock;
        const Answer answer = call("start", "KdNN", static_cast<unsigned long long>(setup.first_sequence), setup.fps,
                                   PyBool_FromLong(setup.paced), view_of(setup.intrinsics).release());
        arhost_frame_format &format = properties.format;
        unsigned long long frames = 0;
        require(PyArg_ParseTuple(answer.value.get(), "iIIdiiiK", &format.pixel_format, &format.width, &format.height,
                                 &format.fps, &format.yuv_matrix, &format.yuv_range, &format.transfer, &frames));
        properties.frame_count = frames;
        if (!arhost_frame_layout(&format))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "start returned an invalid frame format or size");
    }
    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        const GilLock lock;
        const Answer answer =
            call("read", "NKN", view_of(buffer.format).release(), static_cast<unsigned long long>(buffer.sequence),
                 views_of_planes(*buffer.format, buffer.plane, PyBUF_WRITE).release());
        if (answer.status == ARHOST_STATUS_OK) {
            long long capture_ns = 0;
            require(PyArg_ParseTuple(answer.value.get(), "iL", &info.clock, &capture_ns));
            info.capture_ns = capture_ns;
        }
        return answer.status;
    }

    // trackers
    void start(const arhost_tracker_setup &setup) {
        const GilLock lock;
        std::vector<Object> targets, markers, families;
        for (const arhost_target_config &target : elements(setup.targets, setup.target_count))
            targets.push_back(checked(Py_BuildValue("sz", target.name, target.body)));
        for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count))
            markers.push_back(checked(Py_BuildValue("iIINzd", marker.id, marker.family, marker.target,
                                                    view(marker.corners_mm, sizeof marker.corners_mm).release(),
                                                    marker.file, marker.pattern_ratio)));
        for (std::uint32_t i = 0; i < setup.family_count; ++i)
            families.push_back(checked(PyUnicode_FromString(setup.families[i])));
        state_size_ = PyLong_AsUnsignedLongLong(
            call("start", "NNNNN", view_of(setup.format).release(), view_of(setup.intrinsics).release(),
                 tuple_of(std::move(targets)).release(), tuple_of(std::move(markers)).release(),
                 tuple_of(std::move(families)).release())
                .value.get());
    }
    std::uint64_t state_size() const {
        return state_size_;
    }
    double aspect(std::uint32_t marker) {
        const GilLock lock;
        double aspect = 0;
        require(PyArg_ParseTuple(call("aspect", "I", marker).value.get(), "d", &aspect));
        return aspect;
    }
    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        const GilLock lock;
        const arhost_frame &frame = *request.frame;
        const arhost_frame_format &format = *frame.format;
        const Answer answer =
            call("track", "KLiNNNNNNN", static_cast<unsigned long long>(frame.sequence),
                 static_cast<long long>(frame.capture_ns), frame.clock,
                 views_of_planes(format, frame.plane, PyBUF_READ).release(),
                 view(frame.grey, std::size_t(format.grey_stride) * format.height).release(),
                 PyBool_FromLong(request.search_everywhere),
                 view_of_elements(request.expected, request.expected_count).release(),
                 state_view(request.state_before, PyBUF_READ), state_view(request.state_after, PyBUF_WRITE),
                 view_of_elements(result.observations, ARHOST_MAX_OBSERVATIONS).release());
        require(PyArg_ParseTuple(answer.value.get(), "Ii", &result.observation_count, &result.candidate_count));
    }

    // ray tracers
#if defined(KIND_RAYTRACER)
    std::uint64_t capabilities() const {
        return capabilities_;
    }
#endif
    void start(const arhost_raytracer_setup &setup) {
        const GilLock lock;
        state_size_ = PyLong_AsUnsignedLongLong(call("start", "IINNiiN", setup.width, setup.height,
                                                     view(setup.scene, setup.scene->byte_size).release(),
                                                     view_of(setup.intrinsics).release(), setup.form,
                                                     setup.compositing, view_of(setup.video_format).release())
                                                    .value.get());
    }
    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &info) {
        const GilLock lock;
        std::vector<Object> deformed;
        const arhost_motion *motion = request.motion;
        for (std::uint32_t i = 0; motion && i < motion->deformed_count; ++i) {
            const arhost_deformed_geometry &geometry = motion->deformed[i];
            const std::size_t size = std::size_t(geometry.vertex_count) * 12;
            deformed.push_back(checked(
                Py_BuildValue("IINN", geometry.object, geometry.is_visible, view(geometry.positions, size).release(),
                              geometry.normals ? view(geometry.normals, size).release() : Py_NewRef(Py_None))));
        }
        // An older host's structs lack fields.
        const bool has_shading = request.struct_size > offsetof(arhost_render_request, shading_px);
        const Answer answer = call(
            "render", "IIKdNNNNNNNIII", request.max_samples, has_shading ? request.shading_px : 0,
            static_cast<unsigned long long>(request.sequence), request.time_s, view_of(&request.camera).release(),
            view(motion ? motion->moved : nullptr, motion ? motion->moved_count * sizeof *motion->moved : 0)
                .release(),
            tuple_of(std::move(deformed)).release(),
            request.video ? views_of_planes(*request.video->format, request.video->plane, PyBUF_READ).release()
                          : Py_NewRef(Py_None),
            state_view(request.state_before, PyBUF_READ), state_view(request.state_after, PyBUF_WRITE),
            (image.linear ? view(image.linear, image_size(image, 16), PyBUF_WRITE)
                          : view(image.rgba, image_size(image, 4), PyBUF_WRITE))
                .release(),
            image.height, image.width, image.stride);
        std::uint32_t full_samples = 0, coarsest_shading_px = 0;
        PyObject *region = nullptr; // borrowed
        require(PyArg_ParseTuple(answer.value.get(), "IIO", &full_samples, &coarsest_shading_px, &region));
        if (info.struct_size > offsetof(arhost_render_info, full_samples))
            info.full_samples = full_samples;
        if (info.struct_size > offsetof(arhost_render_info, coarsest_shading_px))
            info.coarsest_shading_px = coarsest_shading_px;
        if (region != Py_None) {
            info.has_region = 1;
            require(PyArg_ParseTuple(region, "IIII", &info.region_x, &info.region_y, &info.region_width,
                                     &info.region_height));
        }
    }

    // sinks
    void start(const arhost_sink_setup &setup) {
        const GilLock lock;
        call("start", "IIdKsN", setup.width, setup.height, setup.fps,
             static_cast<unsigned long long>(setup.first_sequence), path_.c_str(),
             view_of(setup.intrinsics).release());
    }
    arhost_status write(const arhost_output &output) {
        const GilLock lock;
        const arhost_record &record = *output.record;
        return call("write", "NIIINNNN",
                    view(output.bgr, std::size_t(output.stride) * (output.height - 1) + std::size_t(3) * output.width)
                        .release(),
                    output.height, output.width, output.stride, view_of(&record).release(),
                    view_of_elements(record.targets, record.target_count).release(),
                    view_of_elements(record.observations, record.observation_count).release(),
                    view_of_elements(record.expected, record.expected_count).release())
            .status;
    }

private:
    struct Answer {
        arhost_status status;
        Object value;
    };

    // Returns a view of a state, or None.
    PyObject *state_view(const void *bytes, int flag) const {
        return bytes ? view(bytes, state_size_, flag).release() : Py_NewRef(Py_None);
    }

    static arhost_status list_devices(const arhost_host *host, arhost_take_device take, void *context) {
        return detail::guarded(Host(host), [&] {
            const GilLock lock;
            const Answer answer = lister_->call("devices", "");
            for (Py_ssize_t i = 0; i < PyList_Size(answer.value.get()); ++i) {
                arhost_device device{};
                device.struct_size = sizeof device;
                device.state = ARHOST_DEVICE_STATE_USABLE;
                require(PyArg_ParseTuple(PyList_GetItem(answer.value.get(), i), "Iipsss", &device.index, &device.kind,
                                         &device.is_default, &device.name, &device.serial, &device.abilities));
                device.serial = *device.serial ? device.serial : nullptr;
                device.abilities = *device.abilities ? device.abilities : nullptr;
                take(context, &device);
            }
            return answer.status;
        });
    }

    // The GIL must be held. Threads of the script may continue; they can no longer call the host.
    void end() {
        if (adapter_)
            const Object ignored = PyObject_CallMethod(adapter_.get(), "end", nullptr);
        adapter_ = Object();
        if (capsule_)
            PyCapsule_SetName(capsule_.get(), nullptr);
        capsule_ = Object();
        PyErr_Clear();
    }

    // Calls a method of the adapter; throws if it reports an error.
    template <class... Arguments> Answer call(const char *method, const char *format, Arguments... arguments) {
        const Object pair = checked(PyObject_CallMethod(adapter_.get(), method, format, arguments...));
        Answer answer{ARHOST_STATUS_ERROR_INTERNAL, {}};
        PyObject *value = nullptr;
        require(PyArg_ParseTuple(pair.get(), "iO", &answer.status, &value));
        answer.value = Py_NewRef(value);
        if (answer.status < 0)
            throw Failure(answer.status, text_of(value));
        return answer;
    }
    static void require(int succeeded) {
        if (!succeeded)
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "Python: " + take_error());
    }

    // The newest instance whose class has a method `devices`. It is static, because the extension has no instance
    // argument. Only the worker's main thread uses it.
    static inline PythonAdapter *lister_ = nullptr;

    Host host_;
    std::string path_;
    std::uint64_t state_size_ = 0; // of a tracker or a ray tracer
    Object capsule_, adapter_;
#if defined(KIND_RAYTRACER)
    std::uint64_t capabilities_ = 0;
#endif
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_INPUT_PATH, "script", nullptr, "The Python script that defines the class."),
    option(ARHOST_OPTION_TEXT, "class", "",
           "Name of the class; empty: the only class that has a method '" METHOD "'."),
    option(ARHOST_OPTION_TEXT, "arguments", "{}", "Additional constructor arguments, as a JSON object."),
    option(ARHOST_OPTION_INPUT_PATH, "interpreter", "/usr/bin/python3",
           "Path of the python whose packages are used, for example the python of a virtual environment."),
#if defined(KIND_SINK)
    option(ARHOST_OPTION_OUTPUT_PATH, "path", "", "Path of the output file, for classes that write a file."),
#endif
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = KIND,
    .id = "org.arhost." ID,
    .name = "Python",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Runs a class of a Python script.",
    .capabilities = CAPABILITIES,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

#if defined(KIND_SOURCE)
ARHOST_SOURCE(PythonAdapter, descriptor)
#elif defined(KIND_TRACKER)
ARHOST_TRACKER(PythonAdapter, descriptor)
#elif defined(KIND_RAYTRACER)
ARHOST_RAYTRACER(PythonAdapter, descriptor)
#else
ARHOST_SINK(PythonAdapter, descriptor)
#endif
