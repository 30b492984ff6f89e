// SPDX-License-Identifier: Apache-2.0
//
// arhost-place puts a model on a marker: writes a scene and a configuration, and starts them. `arhost place` runs it.
#include "base/atomic_file.hpp"
#include "base/program.hpp"
#include "command_line/command_line.hpp"
#include "place/placement.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace {

namespace base = arhost::base;
namespace fs = std::filesystem;

// The user may have edited the file.
void refuse_to_replace(const fs::path &file) {
    std::error_code ignored;
    if (fs::exists(file, ignored))
        throw base::InvalidInput(file.string() + ": exists; choose another name with --name, or add --replace");
}

void write(const fs::path &file, const std::string &text) {
    base::AtomicFile(file).write(text);
    std::fprintf(stderr, "wrote %s\n", file.c_str());
}

int start(const fs::path &configuration) {
    const std::string program = base::own_folder() / "arhost";
    std::string text = configuration.string();
    char *argv[] = {const_cast<char *>(program.c_str()), text.data(), nullptr};
    ::execv(program.c_str(), argv);
    throw base::InvalidInput(program + " cannot be executed: " + std::strerror(errno));
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    arhost::command_line::CommandLine app("Put a model on a marker: write a scene and a configuration, and run them\n"
                                          "(docs/scenes.md)",
                                          "arhost place");
    arhost::place::Placement placement;
    std::string model, camera, output, name, size;
    bool only_writes = false, replaces = false;
    app.option("FILE", model, "The model: glTF, OBJ, PLY or STL").required();
    app.option("--on", placement.target, "The marker, such as tag36h11:23, or a pattern file")
        .required()
        .type_name("FAMILY:ID|FILE");
    app.option("--side", placement.side_mm, "Side of the marker in mm, from black edge to black edge")
        .required()
        .range(1, 1e5);
    app.option("--fit", placement.fit_mm, "Largest side of the model in mm (default: the side of the marker)")
        .range(1e-3, 1e6);
    app.option("--source", placement.source, "Camera, URL, film or pictures").show_default();
    app.option("--camera", camera, "Calibration of the camera (docs/calibration.md)").type_name("FILE");
    app.option("--size", size, "Size of the calibration's images in px, if its file does not contain it")
        .type_name("WIDTHxHEIGHT")
        .check([&](const std::string &text) {
            char rest = 0;
            const bool good = std::sscanf(text.c_str(), "%ux%u%c", &placement.width, &placement.height, &rest) == 2;
            return good ? "" : text + ": must be WIDTHxHEIGHT, such as 640x480";
        });
    app.option("--output", output, "Film or picture (default: a window)").type_name("FILE");
    app.option("--animation", placement.animation, "Name or index of an animation of a glTF file, or all");
    app.option("--variant", placement.variant, "Name of a variant of a glTF file");
    app.option("--raytracer", placement.raytracer, "Ray tracer plugin").show_default();
    app.option("--name", name, "Files to write: NAME.yaml and NAME.scene.yaml (default: the name of the model)");
    app.flag("--no-run", only_writes, "Only write the files");
    app.flag("--replace", replaces, "Replace files of an earlier run");
    return base::exit_status_of([&] {
        if (const auto status = app.parse(argc, argv))
            return *status;
        placement.model = model;
        placement.camera = camera;
        placement.output = output;
        placement.command_line = "arhost place";
        for (int i = 1; i < argc; ++i)
            placement.command_line += std::string(" ") + argv[i];
        for (char &c : placement.command_line)
            if (static_cast<unsigned char>(c) < 0x20)
                c = ' ';
        const std::string stem = name.empty() ? placement.model.stem().string() : name;
        const fs::path scene = stem + ".scene.yaml", configuration = stem + ".yaml";
        const std::string of_scene = scene_text(placement, scene),
                          of_configuration = configuration_text(placement, scene, configuration);
        if (!replaces)
            for (const fs::path &file : {scene, configuration})
                refuse_to_replace(file);
        write(scene, of_scene);
        write(configuration, of_configuration);
        return only_writes ? int{base::success} : start(configuration);
    });
}
