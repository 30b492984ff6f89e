// SPDX-License-Identifier: Apache-2.0
//
// arhost-schema prints the JSON Schema of configurations. `arhost schema` runs it.
#include "base/program.hpp"
#include "command_line/command_line.hpp"
#include "schema/schema_text.hpp"

#include <cstdio>

int main(int argc, char **argv) {
    using namespace arhost;
    base::prepare_process();
    arhost::command_line::CommandLine app("Print the JSON Schema of configurations, for editors", "arhost schema");
    bool markdown = false;
    app.flag("--markdown", markdown, "Print the Markdown table of docs/config.md instead");
    return base::exit_status_of([&] {
        if (const auto status = app.parse(argc, argv))
            return *status;
        std::fputs((markdown ? schema::as_markdown() : schema::as_json_schema()).c_str(), stdout);
        return int{base::success};
    });
}
