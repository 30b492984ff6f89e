// SPDX-License-Identifier: Apache-2.0
// The report as a self-contained HTML page.
#include "conformance/report.hpp"

#include <fmt/format.h>

namespace arhost::conformance {
namespace {

constexpr const char *style = R"(
body { font: 15px/1.4 system-ui, sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em; color: #222 }
table { border-collapse: collapse; width: 100% }
td { border-top: 1px solid #ddd; padding: .4em .8em .4em 0; vertical-align: top }
td:first-child { font-weight: bold; width: 5em }
.pass { color: #1a7f37 } .fail, .crashed, .timeout { color: #c0202a } .skip { color: #777 }
.warn, .error { color: #9a6700 }
p { margin: .2em 0 } code { background: #f3f3f3; padding: .1em .3em; overflow-wrap: anywhere }
figure { display: inline-block; margin: .6em 1em 0 0 } figcaption { color: #555 }
.image { position: relative; width: 320px; line-height: 0;
         background: repeating-conic-gradient(#ddd 0 25%, #fff 0 50%) 0 0/16px 16px }
.image img { width: 100%; image-rendering: pixelated }
.image i { position: absolute; width: 18px; height: 18px; margin: -11px; border: 2px solid #f0f; border-radius: 50% }
)";

std::string figure(const ReportImage &image, const Result &result) {
    std::string mark;
    if (result.wrong_pixel)
        mark = fmt::format("<i style=\"left:{:.2f}%;top:{:.2f}%\"></i>",
                           100 * ((*result.wrong_pixel)[0] + 0.5) / image.width,
                           100 * ((*result.wrong_pixel)[1] + 0.5) / image.height);
    return fmt::format("<figure><div class=\"image\"><img alt=\"\" src=\"data:image/png;base64,{}\">{}</div>"
                       "<figcaption>{}</figcaption></figure>",
                       escaped(image.png), mark, escaped(image.label));
}

} // namespace

std::string as_html(const Report &report) {
    const std::string title = escaped(report.settings.subject.plugin.filename().string()) + ": conformance";
    std::string rows;
    for (const Result &result : report.results) {
        rows += fmt::format("<tr><td class=\"{0}\">{0}</td><td><p><b>{1}</b> {2}</p>", to_text(result.verdict),
                            result.test, escaped(report.test_of(result).requirement));
        if (!result.message.empty())
            rows += fmt::format("<p class=\"{}\">{}</p>", to_text(result.verdict), escaped(result.message));
        if (result.verdict != Verdict::pass && result.verdict != Verdict::skip)
            rows += fmt::format("<p><code>{}</code></p>", escaped(report.command(result)));
        for (const ReportImage &image : result.images)
            rows += figure(image, result);
        rows += "</td></tr>\n";
    }
    return fmt::format(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>"
        "<style>{1}</style></head>\n<body><h1>{0}</h1>\n<p>{2}</p>\n<table>\n{3}</table></body></html>\n",
        title, style, escaped(as_summary(report)), rows);
}

} // namespace arhost::conformance
