# SPDX-License-Identifier: Apache-2.0
"""What a script of source_python, tracker_python, rt_python or sink_python gets by `import arhost`.

Pixels and markers are numpy views of arhost's own memory: nothing is copied. They are valid until the method that
was given them returns; what is to be kept is copied (`array.copy()`). The README of plugins/python_adapter lists
the methods of a class, docs/abi.md and the C headers the rules behind them.
"""
import importlib.util
import json
import os
import sys
import traceback

import numpy as np

# Values of the headers.
OK, END = 1, 2
ERROR_INVALID_ARGUMENT, ERROR_CONFIGURATION, ERROR_UNSUPPORTED, ERROR_IO = -1, -2, -3, -4
ERROR_OUT_OF_MEMORY, ERROR_DEVICE_LOST, ERROR_CANCELLED, ERROR_INTERNAL = -5, -6, -7, -8
DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4
GREY8, RGB8, BGR8, YUYV, NV12, I420 = 1, 2, 3, 4, 5, 6
BT601, BT709 = 1, 2
LIMITED_RANGE, FULL_RANGE = 1, 2
CLOCK_MONOTONIC, CLOCK_MEDIA = 1, 2
DETECTED, PREDICTED, LOST = 1, 2, 3
OVERLAY_RENDERED, OVERLAY_HELD, OVERLAY_NONE = 1, 2, 3
Z_UP, Y_UP = 1, 2
TRIANGLES, SPHERES = 1, 2
DIFFUSE, SPECULAR, MIRROR, METAL, GLASS, METALLIC_ROUGHNESS = 1, 2, 3, 4, 5, 6
VIRTUAL, CATCHER, OCCLUDER = 1, 2, 3
POINT_LIGHT, DIRECTIONAL_LIGHT, SPOT_LIGHT, RECTANGLE_LIGHT, SPHERE_LIGHT = 1, 2, 3, 4, 5
FALLOFF_NONE, FALLOFF_INVERSE_SQUARE = 1, 2
NONE = 0xFFFFFFFF


def _struct(*fields):
    return np.dtype(list(fields), align=True)


# Structs of the headers, field by field. A test (tests/plugins/python_adapter) compares them.
INTRINSICS = _struct(("struct_size", "u4"), ("width", "u4"), ("height", "u4"), ("distortion", "i4"), ("fx", "f8"),
                     ("fy", "f8"), ("cx", "f8"), ("cy", "f8"), ("coefficient_count", "u4"), ("reserved", "u4"),
                     ("coefficients", "f8", 12))
CAMERA = _struct(("struct_size", "u4"), ("reserved", "u4"), ("eye", "f8", 3), ("look_at", "f8", 3), ("up", "f8", 3),
                 ("intrinsics", INTRINSICS))
FORMAT = _struct(("struct_size", "u4"), ("pixel_format", "i4"), ("width", "u4"), ("height", "u4"),
                 ("yuv_matrix", "i4"), ("yuv_range", "i4"), ("fps", "f8"), ("plane_count", "u4"), ("stride", "u4", 3),
                 ("offset", "u8", 3), ("grey_stride", "u4"), ("grey_offset", "u8"), ("byte_size", "u8"))
MARKER_CONFIG = _struct(("struct_size", "u4"), ("id", "i4"), ("side_mm", "f8"))
MARKER = _struct(("struct_size", "u4"), ("id", "i4"), ("family", "S32"), ("state", "i4"), ("age_frames", "u4"),
                 ("corners_px", "f8", (4, 2)), ("mt", "f8", 16), ("mt_alternative", "f8", 16),
                 ("reprojection_px", "f8"), ("ambiguity", "f8"))
RECORD = _struct(("struct_size", "u4"), ("clock", "i4"), ("sequence", "u8"), ("capture_ns", "i8"), ("overlay", "i4"),
                 ("has_camera", "i4"), ("has_truth", "i4"), ("truth_id", "i4"), ("true_mt", "f8", 16),
                 ("camera", CAMERA), ("marker_count", "u4"), ("reserved", "u4"), ("markers", MARKER, 64))
MOVED = _struct(("object", "u4"), ("world_from_object", "f4", 12))
BUFFER = _struct(("offset", "u8"), ("count", "u4"), ("stride", "u4"))
GEOMETRY = _struct(("type", "i4"), ("reserved", "u4"), ("positions", BUFFER), ("normals", BUFFER),
                   ("texcoords", BUFFER), ("indices", BUFFER), ("joints", BUFFER), ("weights", BUFFER),
                   ("morph_positions", BUFFER), ("morph_normals", BUFFER))
TEXTURE = _struct(("format", "i4"), ("width", "u4"), ("height", "u4"), ("wrap_u", "i4"), ("wrap_v", "i4"),
                  ("name", "u4"), ("texels", BUFFER))
MATERIAL = _struct(("model", "i4"), ("colour_texture", "u4"), ("ambient", "f4", 3), ("diffuse", "f4", 3),
                   ("specular", "f4", 3), ("exponent", "f4"), ("reflectivity", "f4", 3), ("emission", "f4", 3),
                   ("alpha_cutoff", "f4"), ("metallic", "f4"), ("roughness", "f4"),
                   ("metallic_roughness_texture", "u4"), ("normal_texture", "u4"), ("emission_texture", "u4"),
                   ("index", "f4"), ("fresnel_exponent", "f4"), ("fresnel_minimum", "f4"), ("fresnel_maximum", "f4"),
                   ("refraction", "f4", 3), ("extinction", "f4", 3), ("shadow_attenuation", "f4", 3),
                   ("cutoff_colour", "f4", 3), ("importance_cutoff", "f4"), ("reflection_depth", "u4"),
                   ("refraction_depth", "u4"))
OBJECT = _struct(("geometry", "u4"), ("material", "u4"), ("role", "i4"), ("name", "u4"),
                 ("world_from_object", "f4", 12), ("moves", "u4"), ("deforms", "u4"), ("node", "u4"), ("skin", "u4"))
LIGHT = _struct(("type", "i4"), ("falloff", "i4"), ("position", "f4", 3), ("direction", "f4", 3),
                ("intensity", "f4", 3), ("axis_u", "f4", 3), ("axis_v", "f4", 3), ("radius", "f4"),
                ("cosine_inner", "f4"), ("cosine_outer", "f4"))
ENVIRONMENT = _struct(("texture", "u4"), ("intensity", "f4"), ("environment_from_world", "f4", 9), ("rows", BUFFER),
                      ("columns", BUFFER))
SCENE = _struct(("magic", "u8"), ("version", "u4"), ("struct_size", "u4"), ("byte_size", "u8"), ("axes", "i4"),
                ("max_depth", "u4"), ("ambient", "f4", 3), ("background", "f4", 3), ("bounds_min", "f4", 3),
                ("bounds_max", "f4", 3), ("shadow_alpha_opaque", "f4"), ("shadow_alpha_translucent", "f4"),
                ("coloured_shadows", "u4"), ("duration_s", "f4"), ("environment", ENVIRONMENT),
                ("geometries", BUFFER), ("textures", BUFFER), ("materials", BUFFER), ("objects", BUFFER),
                ("lights", BUFFER), ("nodes", BUFFER), ("channels", BUFFER), ("skins", BUFFER), ("names", BUFFER))


class Failure(Exception):
    """An error for the user: a sentence that names what to mend, and one of ERROR_…"""

    def __init__(self, message, status=ERROR_CONFIGURATION):
        super().__init__(message)
        self.status = status


class Host:
    """The host's callbacks, on any thread. A cancelled call is to return soon: it raises Failure("", ERROR_CANCELLED)."""

    def __init__(self, log, progress, cancelled):
        self.log, self.progress, self.cancelled = log, progress, cancelled

    def info(self, text):
        self.log(INFO, str(text))

    def warn(self, text):
        self.log(WARNING, str(text))


class Fields:
    """A struct's fields, and what else belongs to it, as attributes."""

    def __init__(self, record=None, /, **more):
        for name in record.dtype.names if record is not None else ():
            value = record[name]
            setattr(self, name, Fields(value) if isinstance(value, np.void) else value)
        self.__dict__.update(more)


class Scene(Fields):
    """The arena of arhost/scene.h; its views are valid until stop. Beside the header's fields: `geometries`,
    `textures`, `materials`, `objects`, `lights` as arrays of records, and elements()."""

    def __init__(self, arena):
        super().__init__(np.ndarray(1, SCENE, arena)[0])
        self._arena = arena
        for name, dtype in (("geometries", GEOMETRY), ("textures", TEXTURE), ("materials", MATERIAL),
                            ("objects", OBJECT), ("lights", LIGHT)):
            setattr(self, name, self.elements(getattr(self, name), dtype))

    def elements(self, buffer, dtype):
        """What a buffer holds: elements(scene.geometries[0]["positions"], "3f4"), or "3u4" of indices."""
        field = (lambda name: buffer[name]) if isinstance(buffer, np.void) else (lambda name: getattr(buffer, name))
        dtype, count, stride = np.dtype(dtype), int(field("count")), int(field("stride"))
        if count == 0:
            return np.zeros((0,) + dtype.shape, dtype.base)
        if dtype.itemsize > stride:
            raise ValueError(f"elements of {dtype.itemsize} bytes in a buffer whose stride is {stride}")
        shape, strides = (count,) + dtype.shape, (stride,) + (dtype.base.itemsize,) * len(dtype.shape)
        return np.ndarray(shape, dtype.base, self._arena, int(field("offset")), strides)


def _record(memory, dtype):
    return np.frombuffer(bytes(memory), dtype)[0]  # small structs are copied


def _pixels(memory, height, width, channels, stride):
    shape, strides = ((height, width, channels), (stride, channels, 1)) if channels > 1 else \
        ((height, width), (stride, 1))
    return np.ndarray(shape, np.uint8, memory, 0, strides)


def _vectors(memory):
    return np.ndarray((len(memory) // 12, 3), np.float32, memory)


def _planes(format, memory):
    w, h, s = int(format.width), int(format.height), [int(stride) for stride in format.stride]
    shapes = {GREY8: [(h, w, 1)], RGB8: [(h, w, 3)], BGR8: [(h, w, 3)], YUYV: [(h, w, 2)],
              NV12: [(h, w, 1), (h // 2, w // 2, 2)],
              I420: [(h, w, 1), (h // 2, w // 2, 1), (h // 2, w // 2, 1)]}[int(format.pixel_format)]
    return [_pixels(plane, *shape, stride) for plane, shape, stride in zip(memory, shapes, s)]


class _Adapter:
    """One made plugin. Its methods are called by python_adapter.cpp, and return (status, text or value)."""

    def __init__(self, method, log, progress, cancelled):
        self.method = method  # that a class of this kind must have
        self.host = Host(log, progress, cancelled)
        self.warned = False

    def load(self, script, class_name, arguments):
        def load():
            try:
                keywords = json.loads(arguments)
            except ValueError as error:
                raise Failure(f"the option 'arguments' is not valid JSON: {error}")
            if not isinstance(keywords, dict):
                raise Failure("the option 'arguments' must be a JSON object, as in '{\"size\": 3}'")
            if not os.path.isfile(script):
                raise Failure(f"the option 'script': there is no file {script}")
            sys.path.insert(0, os.path.dirname(script))
            name = os.path.splitext(os.path.basename(script))[0]
            specification = importlib.util.spec_from_file_location(name, script)
            module = importlib.util.module_from_spec(specification)
            sys.modules[name] = module
            specification.loader.exec_module(module)
            self.plugin = self._class_in(module, script, class_name)(self.host, **keywords)
            return OK

        # What fails here fails again: the script is wrong.
        return self._guarded(load, ERROR_CONFIGURATION)

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

    def _guarded(self, call, status=ERROR_INTERNAL):
        try:
            result = call()
            return result if isinstance(result, tuple) else (result, None)
        except Failure as failure:
            return failure.status, str(failure)
        except MemoryError as error:
            return ERROR_OUT_OF_MEMORY, f"out of memory: {error}"
        except SystemExit as error:
            return ERROR_INTERNAL, f"the script called sys.exit({error.code!r}); a plugin raises arhost.Failure instead"
        except BaseException as error:
            trace = traceback.TracebackException.from_exception(error)
            frames = [frame for frame in trace.stack
                      if frame.filename != __file__ and not frame.filename.startswith("<frozen importlib")]
            trace.stack = traceback.StackSummary.from_list(frames)
            for line in "".join(trace.format()).splitlines():
                self.host.warn(line)
            place = [f"{frame.filename}:{frame.lineno}: " for frame in frames[-1:]]
            if isinstance(error, SyntaxError):
                place = [f"{error.filename}:{error.lineno}: "]
            return status, f"{''.join(place)}{type(error).__name__}: {error}"

    def _with_memory(self, memory, call):
        """Calls; then the memory is arhost's again, and arrays of it that are left over are a defect."""
        references = [sys.getrefcount(view) for view in memory]
        result = self._guarded(call)
        if result[0] > 0 and not self.warned and references != [sys.getrefcount(view) for view in memory]:
            self.host.warn(f"'{self.method}' has kept an array that it was given, whose memory is arhost's again: "
                           "keep a copy (array.copy())")
            self.warned = True
        return result

    def stop(self):
        def stop():
            if hasattr(self.plugin, "stop"):
                self.plugin.stop()
            return OK

        return self._guarded(stop)

    # ---- sources ----

    def start_source(self, first_sequence, fps, paced, intrinsics):
        def start():
            setup = Fields(first_sequence=first_sequence, fps=fps, paced=paced,
                           intrinsics=intrinsics and Fields(_record(intrinsics, INTRINSICS)))
            made = dict(self.plugin.start(setup))
            self.clock = int(made.pop("clock", CLOCK_MEDIA))
            format = [int(made.pop("pixel_format", RGB8)), int(made.pop("width")), int(made.pop("height")),
                      float(made.pop("fps", fps) or 0), int(made.pop("yuv_matrix", BT601)),
                      int(made.pop("yuv_range", LIMITED_RANGE)), int(made.pop("frame_count", 0))]
            if made:
                raise Failure(f"start returned the unknown key '{next(iter(made))}'", ERROR_INTERNAL)
            return OK, tuple(format)

        return self._guarded(start)

    def read(self, format, sequence, planes):
        def read():
            format_ = Fields(_record(format, FORMAT))
            buffer = Fields(format=format_, sequence=sequence, planes=_planes(format_, planes))
            capture_ns = self.plugin.read(buffer)
            return (END, None) if capture_ns is None else (OK, (self.clock, int(capture_ns)))

        return self._with_memory(planes, read)

    # ---- trackers ----

    def start_tracker(self, format, intrinsics, markers):
        def start():
            self.format = Fields(_record(format, FORMAT))
            self.plugin.start(Fields(format=self.format, intrinsics=Fields(_record(intrinsics, INTRINSICS)),
                                     markers=[Fields(m) for m in np.frombuffer(bytes(markers), MARKER_CONFIG)]))
            return OK

        return self._guarded(start)

    def track(self, sequence, capture_ns, clock, planes, grey, markers):
        def track():
            f = self.format
            frame = Fields(format=f, sequence=sequence, capture_ns=capture_ns, clock=clock, planes=_planes(f, planes),
                           grey=_pixels(grey, int(f.height), int(f.width), 1, int(f.grey_stride)))
            out = np.ndarray(64, MARKER, markers)
            count = int(self.plugin.track(frame, out) or 0)
            out["struct_size"][:count] = MARKER.itemsize
            return OK, count

        return self._with_memory([*planes, grey, markers], track)

    # ---- ray tracers ----

    def start_raytracer(self, width, height, scene, intrinsics):
        def start():
            self.plugin.start(Fields(width=width, height=height, scene=Scene(scene),
                                     intrinsics=Fields(_record(intrinsics, INTRINSICS))))
            return OK

        return self._guarded(start)

    def render(self, sequence, time_s, camera, moved, deformed, pixels, height, width, stride):
        def render():
            request = Fields(
                sequence=sequence, time_s=time_s, camera=Fields(_record(camera, CAMERA)),
                moved=np.ndarray(len(moved) // MOVED.itemsize, MOVED, moved),
                deformed=[Fields(object=index, positions=_vectors(positions), normals=normals and _vectors(normals))
                          for index, positions, normals in deformed])
            region = self.plugin.render(request, _pixels(pixels, height, width, 4, stride))
            return OK, None if region is None else tuple(int(side) for side in region)

        memory = [pixels, moved] + [view for _, p, n in deformed for view in (p, n) if view]
        return self._with_memory(memory, render)

    # ---- sinks ----

    def start_sink(self, width, height, fps, first_sequence, path, intrinsics):
        def start():
            self.plugin.start(Fields(width=width, height=height, fps=fps, first_sequence=first_sequence, path=path,
                                     intrinsics=intrinsics and Fields(_record(intrinsics, INTRINSICS))))
            return OK

        return self._guarded(start)

    def write(self, bgr, height, width, stride, record):
        def write():
            more = self.plugin.write(Fields(bgr=_pixels(bgr, height, width, 3, stride), height=height, width=width,
                                            record=np.ndarray(1, RECORD, record).view(np.recarray)[0]))
            return OK if more is None or more else END

        return self._with_memory([bgr, record], write)
