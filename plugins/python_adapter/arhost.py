# SPDX-License-Identifier: Apache-2.0
"""The module `arhost` for scripts of source_python, tracker_python, rt_python and sink_python.

Constants and structs have the names of the C headers without the prefix ARHOST_: arhost.STATUS_OK, arhost.TARGET.
Pixels are numpy views of arhost's memory, valid until the method that received them returns; copy what you keep
(`array.copy()`). The methods of a class are listed in plugins/python_adapter/README.md, the rules in docs/abi.md
and the C headers.
"""
import importlib.util
import io
import json
import os
import sys
import time
import traceback

import numpy as np
from arhost_abi import *


class Failure(Exception):
    """An error that arhost reports to the user: a message that says what to change, and a status STATUS_ERROR_…"""

    def __init__(self, message, status=STATUS_ERROR_CONFIGURATION):
        super().__init__(message)
        self.status = status


class Host:
    """Functions of the host. Any thread may call them. If cancelled() is true, raise Failure("", STATUS_ERROR_CANCELLED)."""

    def __init__(self, log, progress, cancelled):
        self.log, self.progress, self.cancelled = log, progress, cancelled

    def info(self, text):
        self.log(SEVERITY_INFO, str(text))

    def hint(self, text):
        """Tells what a frame shows instead of the targets; for trackers (SEVERITY_HINT)."""
        self.log(SEVERITY_HINT, str(text))

    def warn(self, text):
        self.log(SEVERITY_WARNING, str(text))

    def wait(self, seconds):
        """Sleeps and reports progress, so that arhost does not assume a hang. False: cancelled, return soon."""
        end = time.monotonic() + seconds
        while not self.cancelled():
            left = end - time.monotonic()
            if left <= 0:
                return True
            self.progress(-1, "waiting")
            time.sleep(min(left, 0.1))
        return False


class _PrintedLines(io.TextIOWrapper):
    """Standard output of the script, whose text is logged by line, and long lines in parts. The log is limited, so
    printing never blocks. What is written to `buffer` or `fileno()` is logged like the output of a program."""

    max_length = 1000  # so many characters fit into a message

    def __init__(self, log):
        super().__init__(io.FileIO(1, "w", closefd=False), "utf-8", write_through=True)
        self.log, self.line = log, ""

    def write(self, text):
        *lines, rest = (self.line + text).split("\n")
        full = len(rest) // self.max_length * self.max_length
        self.line = rest[full:]
        for line in [*lines, rest[:full]]:
            for begin in range(0, len(line), self.max_length):
                self.log(SEVERITY_INFO, line[begin:begin + self.max_length])
        return len(text)


class Fields:
    """Provides the fields of a struct, and additional values, as attributes."""

    def __init__(self, record=None, /, **more):
        for name in record.dtype.names if record is not None else ():
            value = record[name]
            setattr(self, name, Fields(value) if isinstance(value, np.void) else
                    value.decode() if isinstance(value, bytes) else value)
        self.__dict__.update(more)


class Observation:
    """A marker seen in a frame, with the fields of arhost_observation. `corners_px`: 4 × (x, y)."""

    def __init__(self, id, corners_px, family=0, hamming=0, decision_margin=0.0,
                 corner_sigma_px=0.0, false_positive_rate=0.0):
        corners = np.array(corners_px, float)
        if corners.size != 8:
            raise ValueError("corners_px must be four corners (x, y)")
        self.id, self.corners_px, self.family = id, corners.reshape(4, 2), family
        self.hamming, self.decision_margin, self.corner_sigma_px = hamming, decision_margin, corner_sigma_px
        self.false_positive_rate = false_positive_rate
        self.projected_px = np.zeros((4, 2))

    @classmethod
    def _of(cls, record):
        seen = cls(*(record[name] for name in ("id", "corners_px", "family", "hamming", "decision_margin",
                                               "corner_sigma_px", "false_positive_rate")))
        seen.projected_px = record["projected_px"]
        return seen


class Scene(Fields):
    """The arena of arhost/scene.h, valid until stop. `geometries`, `textures`, `materials`, `objects` and `lights`
    are arrays of records; elements() reads the other buffers."""

    def __init__(self, arena):
        super().__init__(np.ndarray(1, SCENE, arena)[0])
        self._arena = arena
        for name, dtype in (("geometries", GEOMETRY), ("textures", TEXTURE), ("materials", MATERIAL),
                            ("objects", OBJECT), ("lights", LIGHT)):
            setattr(self, name, self.elements(getattr(self, name), dtype))

    def elements(self, buffer, dtype):
        """Returns a buffer as an array, without copying: elements(scene.geometries[0]["positions"], "3f4"); "3u4" for indices."""
        field = (lambda name: buffer[name]) if isinstance(buffer, np.void) else (lambda name: getattr(buffer, name))
        dtype, count, stride = np.dtype(dtype), int(field("count")), int(field("stride"))
        if count == 0:
            return np.zeros((0,) + dtype.shape, dtype.base)
        if dtype.itemsize > stride:
            raise ValueError(f"the elements have {dtype.itemsize} bytes, but the buffer has a stride of {stride} bytes")
        shape, strides = (count,) + dtype.shape, (stride,) + (dtype.base.itemsize,) * len(dtype.shape)
        return np.ndarray(shape, dtype.base, self._arena, int(field("offset")), strides)


def _record(memory, dtype):
    return np.frombuffer(bytes(memory), dtype)[0]  # small structs are copied


def _elements(memory, dtype):
    """Returns a view of an array of structs, whose stride is the `struct_size` of its first element."""
    stride = int.from_bytes(memory[:4], sys.byteorder) or dtype.itemsize
    return np.ndarray(len(memory) // stride, dtype, memory, 0, stride)


def _pixels(memory, height, width, channels, stride):
    shape, strides = ((height, width, channels), (stride, channels, 1)) if channels > 1 else \
        ((height, width), (stride, 1))
    return np.ndarray(shape, np.uint8, memory, 0, strides)


def _state(memory):
    return memory and np.ndarray(len(memory), np.uint8, memory)


def _vectors(memory):
    return np.ndarray((len(memory) // 12, 3), np.float32, memory)


def _planes(format, memory):
    w, h, s = int(format.width), int(format.height), [int(stride) for stride in format.stride]
    shapes = {PIXEL_FORMAT_GREY8: [(h, w, 1)], PIXEL_FORMAT_RGB8: [(h, w, 3)], PIXEL_FORMAT_BGR8: [(h, w, 3)],
              PIXEL_FORMAT_YUYV: [(h, w, 2)], PIXEL_FORMAT_NV12: [(h, w, 1), (h // 2, w // 2, 2)],
              PIXEL_FORMAT_I420: [(h, w, 1), (h // 2, w // 2, 1), (h // 2, w // 2, 1)]}[int(format.pixel_format)]
    return [_pixels(plane, *shape, stride) for plane, shape, stride in zip(memory, shapes, s)]


def _integer(what, value, least, most, status=STATUS_ERROR_INTERNAL):
    if not hasattr(value, "__index__") or not least <= int(value) <= most:
        raise Failure(f"{what} {value!r}; it must be an integer from {least} to {most}", status)
    return int(value)


def _reporting(status=STATUS_ERROR_INTERNAL):
    """Decorates a method of _Adapter: it then returns what _run() returns."""
    return lambda method: lambda self, *arguments: self._run(lambda: method(self, *arguments), status)


class _Adapter:
    """One plugin instance. python_adapter.cpp calls its methods, which return (status, error message or value).
    `method`: the per-frame method of this kind of plugin."""

    def __init__(self, log, progress, cancelled):
        self.host = Host(log, progress, cancelled)
        self.warned = False
        self.stdout = sys.stdout = _PrintedLines(log)

    def end(self):
        if sys.stdout is self.stdout:
            sys.stdout = sys.__stdout__

    # Report a configuration error: if the script fails to load now, it would also fail on every retry.
    @_reporting(STATUS_ERROR_CONFIGURATION)
    def load(self, script, class_name, arguments):
        try:
            keywords = json.loads(arguments)
        except ValueError as error:
            raise Failure(f"the option 'arguments' is not valid JSON: {error}")
        if not isinstance(keywords, dict):
            raise Failure("the option 'arguments' must be a JSON object, as in '{\"size\": 3}'")
        if not os.path.isfile(script):
            raise Failure(f"the option 'script' names a file that does not exist: {script}")
        sys.path.insert(0, os.path.dirname(script))
        name = os.path.splitext(os.path.basename(script))[0]
        specification = importlib.util.spec_from_file_location(name, script)
        module = importlib.util.module_from_spec(specification)
        sys.modules[name] = module
        specification.loader.exec_module(module)
        self.plugin = self._class_in(module, script, class_name)(self.host, **keywords)
        return STATUS_OK, callable(getattr(self.plugin, "devices", None))

    def _class_in(self, module, script, wanted):
        classes = [value for value in vars(module).values()
                   if isinstance(value, type) and callable(getattr(value, self.method, None))
                   and (value.__module__ == module.__name__ or wanted)]
        if wanted:
            classes = [value for value in classes if value.__name__ == wanted]
        if len(classes) != 1:
            named = f" named '{wanted}'" if wanted else ""
            hint = "" if wanted or not classes else "; name one in the option 'class'"
            raise Failure(f"{script} has {len(classes) or 'no'} classes{named} with a method '{self.method}'{hint}")
        return classes[0]

    def _state_size(self, limit):
        size = self.plugin.state_size() if hasattr(self.plugin, "state_size") else 0
        return _integer("'state_size' returned", size, 0, limit, STATUS_ERROR_CONFIGURATION)

    def _run(self, call, status=STATUS_ERROR_INTERNAL):
        try:
            result = call()
            return result if isinstance(result, tuple) else (result, None)
        except Failure as failure:
            return failure.status, str(failure)
        except MemoryError as error:
            return STATUS_ERROR_OUT_OF_MEMORY, f"out of memory: {error}"
        except SystemExit as error:
            return STATUS_ERROR_INTERNAL, f"the script called sys.exit({error.code!r}); a plugin raises arhost.Failure instead"
        except BaseException as error:
            trace = traceback.TracebackException.from_exception(error)
            frames = [frame for frame in trace.stack
                      if frame.filename != __file__ and not frame.filename.startswith("<frozen importlib")]
            trace.stack = traceback.StackSummary.from_list(frames)
            for line in "".join(trace.format()).splitlines():
                self.host.warn(line)
            place = [f"{frame.filename}:{frame.lineno}: " for frame in frames[-1:]]
            text = str(error)
            if isinstance(error, SyntaxError) and error.filename:
                place, text = [f"{error.filename}:{error.lineno}: "], error.msg  # str(error) repeats the place
            hint = ""
            if isinstance(error, ModuleNotFoundError) and self._is_hidden(sys.path[0]):
                hint = (f"; if the module is next to the script, add 'reads: [{sys.path[0]}]', because the sandbox "
                        "shows a plugin only its script")
            return status, f"{''.join(place)}{type(error).__name__}: {text}{hint}"

    @staticmethod
    def _is_hidden(folder):
        """Whether the sandbox shows only the script in this folder."""
        try:
            return len(os.listdir(folder)) == 1
        except OSError:
            return True

    def _place(self, method):
        code = getattr(getattr(self.plugin, method), "__code__", None)
        return f"{code.co_filename}:{code.co_firstlineno}: " if code else ""

    def _with_memory(self, memory, call):
        """Runs `call`. Warns once if the script keeps arrays that refer to `memory`, which is invalid after the call."""
        references = [sys.getrefcount(view) for view in memory]
        result = self._run(call)
        if result[0] > 0 and not self.warned and references != [sys.getrefcount(view) for view in memory]:
            self.host.warn(f"'{self.method}' kept an array whose memory is no longer valid; "
                           "keep a copy (array.copy())")
            self.warned = True
        return result

    @_reporting()
    def devices(self):
        return STATUS_OK, [
            (index, int(device.get("kind", DEVICE_OTHER)), bool(device.get("is_default", False)), str(device["name"]),
             str(device.get("serial", "")), str(device.get("abilities", "")))
            for index, device in enumerate(self.plugin.devices())]

    @_reporting()
    def stop(self):
        if hasattr(self.plugin, "stop"):
            self.plugin.stop()
        return STATUS_OK


class _SourceAdapter(_Adapter):
    method = "read"

    @_reporting()
    def start(self, first_sequence, fps, paced, intrinsics):
        setup = Fields(first_sequence=first_sequence, fps=fps, paced=paced,
                       intrinsics=intrinsics and Fields(_record(intrinsics, INTRINSICS)))
        result = self.plugin.start(setup)
        if not isinstance(result, dict) or not {"width", "height"} <= result.keys():
            raise Failure(f"{self._place('start')}start returned {result!r}; it must return a dict with 'width' and "
                          "'height'")
        result = dict(result)
        self.clock = int(result.pop("clock", CLOCK_MEDIA))
        format = [int(result.pop("pixel_format", PIXEL_FORMAT_RGB8)), int(result.pop("width")),
                  int(result.pop("height")), float(result.pop("fps", fps) or 0),
                  int(result.pop("yuv_matrix", YUV_MATRIX_BT601)),
                  int(result.pop("yuv_range", YUV_RANGE_LIMITED)),
                  int(result.pop("transfer", TRANSFER_SRGB)), int(result.pop("frame_count", 0))]
        if result:
            raise Failure(f"start returned the unknown key '{next(iter(result))}'", STATUS_ERROR_INTERNAL)
        return STATUS_OK, tuple(format)

    def read(self, format, sequence, planes):
        def read():
            format_ = Fields(_record(format, FRAME_FORMAT))
            buffer = Fields(format=format_, sequence=sequence, planes=_planes(format_, planes))
            capture_ns = self.plugin.read(buffer)
            return (STATUS_END, None) if capture_ns is None else (STATUS_OK, (self.clock, int(capture_ns)))

        return self._with_memory(planes, read)


class _TrackerAdapter(_Adapter):
    method = "track"
    overflowed = False

    @_reporting()
    def start(self, format, intrinsics, targets, markers, families):
        self.format = Fields(_record(format, FRAME_FORMAT))
        self.plugin.start(Fields(format=self.format, intrinsics=Fields(_record(intrinsics, INTRINSICS)),
                                 targets=[Fields(name=name, body=body) for name, body in targets],
                                 markers=[Fields(id=id, family=family, target=target, file=file,
                                                 corners_mm=np.frombuffer(bytes(corners)).reshape(4, 3),
                                                 pattern_ratio=ratio)
                                          for id, family, target, corners, file, ratio in markers],
                                 families=list(families)))
        return STATUS_OK, self._state_size(MAX_STATE)

    @_reporting()
    def aspect(self, marker):
        return STATUS_OK, (float(self.plugin.aspect(marker)) if hasattr(self.plugin, "aspect") else 1.0,)

    def track(self, sequence, capture_ns, clock, planes, grey, search_everywhere, expected, state_before, state_after,
              observations):
        def track():
            f = self.format
            frame = Fields(format=f, sequence=sequence, capture_ns=capture_ns, clock=clock, planes=_planes(f, planes),
                           grey=_pixels(grey, int(f.height), int(f.width), 1, int(f.grey_stride)),
                           search_everywhere=search_everywhere,
                           expected=[Fields(marker) for marker in _elements(bytes(expected), EXPECTED_MARKER)],
                           state_before=_state(state_before), state_after=_state(state_after), candidate_count=-1)
            out, count = _elements(observations, OBSERVATION), 0
            result = self.plugin.track(frame)
            if not hasattr(result, "__iter__") and result is not None:
                raise Failure("'track' must return a list of arhost.Observation, or None", STATUS_ERROR_INTERNAL)
            for seen in result or ():
                if count == len(out):
                    if not self.overflowed:
                        self.host.warn(f"'track' reported more than {count} observations; the others are ignored")
                    self.overflowed = True
                    break
                to = out[count]
                to["id"], to["family"], to["hamming"] = seen.id, seen.family, seen.hamming
                to["corners_px"], to["decision_margin"] = seen.corners_px, seen.decision_margin
                to["corner_sigma_px"] = seen.corner_sigma_px
                to["false_positive_rate"] = seen.false_positive_rate
                count += 1
            return STATUS_OK, (count, _integer("'frame.candidate_count' is", frame.candidate_count, -1, 2**31 - 1))

        return self._with_memory([*planes, grey, *filter(None, (state_before, state_after))], track)


class _RaytracerAdapter(_Adapter):
    method = "render"

    @_reporting(STATUS_ERROR_CONFIGURATION)
    def capabilities(self):
        return STATUS_OK, int(getattr(self.plugin, "capabilities", RAYTRACER_CAPABILITY_EVERY_SCENE))

    @_reporting()
    def start(self, width, height, scene, intrinsics, form, compositing, video_format):
        self.video_format = video_format and Fields(_record(video_format, FRAME_FORMAT))
        self.plugin.start(Fields(width=width, height=height, scene=Scene(scene), form=form, compositing=compositing,
                                 video_format=self.video_format,
                                 intrinsics=Fields(_record(intrinsics, INTRINSICS))))
        self.form = form
        return STATUS_OK, self._state_size(2**63 - 1)

    def render(self, max_samples, shading_px, sequence, time_s, camera, moved, deformed, video, state_before,
               state_after, pixels, height, width, stride):
        def render():
            request = Fields(
                max_samples=max_samples, full_samples=0, shading_px=shading_px, coarsest_shading_px=0,
                sequence=sequence, time_s=time_s,
                camera=Fields(_record(camera, CAMERA)),
                moved=np.ndarray(len(moved) // MOVED_OBJECT.itemsize, MOVED_OBJECT, moved),
                deformed=[Fields(object=index, is_visible=bool(is_visible), positions=_vectors(positions),
                                 normals=normals and _vectors(normals))
                          for index, is_visible, positions, normals in deformed],
                video=video and Fields(format=self.video_format, planes=_planes(self.video_format, video)),
                state_before=_state(state_before), state_after=_state(state_after))
            region = self.plugin.render(request, np.ndarray((height, width, 8), np.float16, pixels, 0, (stride, 16, 2))
                                        if self.form == IMAGE_FORM_LINEAR else _pixels(pixels, height, width, 4, stride))
            for name in ("full_samples", "coarsest_shading_px"):
                if not 0 <= (value := getattr(request, name)) < 1 << 32:
                    raise ValueError(f"{name} is {value}; it must be 0 to 4294967295")
            return STATUS_OK, (int(request.full_samples), int(request.coarsest_shading_px),
                               None if region is None else tuple(int(side) for side in region))

        memory = [pixels, moved, state_before, state_after, *(video or ())]
        memory += [view for _, _, p, n in deformed for view in (p, n)]
        return self._with_memory([view for view in memory if view is not None], render)


class _SinkAdapter(_Adapter):
    method = "write"

    @_reporting()
    def start(self, width, height, fps, first_sequence, path, intrinsics):
        self.plugin.start(Fields(width=width, height=height, fps=fps, first_sequence=first_sequence, path=path,
                                 intrinsics=intrinsics and Fields(_record(intrinsics, INTRINSICS))))
        return STATUS_OK

    def write(self, bgr, height, width, stride, record, targets, observations, expected):
        def write():
            fields = Fields(_record(record, RECORD))
            fields.targets = [Fields(t) for t in _elements(bytes(targets), TARGET)]
            fields.observations = [Observation._of(o) for o in _elements(bytes(observations), OBSERVATION)]
            fields.expected = [Fields(e) for e in _elements(bytes(expected), EXPECTED_MARKER)]
            fields.families = [name.decode() for name in fields.families if name]
            more = self.plugin.write(Fields(bgr=_pixels(bgr, height, width, 3, stride), height=height, width=width,
                                            record=fields))
            return STATUS_OK if more is None or more else STATUS_END

        return self._with_memory([bgr], write)
