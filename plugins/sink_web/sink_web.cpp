// SPDX-License-Identifier: Apache-2.0
//
// sink_web: a web page with the live picture, the state of the run and its commands.
#include "checks.hpp"
#include "server.hpp"
#include "sink_common/debug_view.hpp"

namespace {

constexpr std::size_t min_token_size = 16;

class WebSink {
public:
    static constexpr const char *changeable[] = {"quality", arhost::drawing::DebugView::key, nullptr};

    WebSink(const arhost::Host &host, const arhost::Options &options)
        : host_(host), control_(host), debug_view_(options),
          frame_(static_cast<int>(options.integer("quality"))), settings_{static_cast<int>(options.integer("listen")),
                                                                          options.text("token"),
                                                                          options.text("hosts"), 0, 0},
          address_(options.text("listen")) {
        if (settings_.socket < 0)
            fail("the option 'listen' must not be empty");
        if (!settings_.token.empty() && settings_.token.size() < min_token_size)
            fail("the option 'token' must have at least 16 characters");
        if (settings_.token.empty() && !arhost::web::is_local(settings_.socket))
            fail("other machines can reach " + address_ +
                 ", so the option 'token' must be set; or set 'listen' to 127.0.0.1:PORT");
    }

    void start(const arhost_sink_setup &setup) {
        settings_.width = setup.width;
        settings_.height = setup.height;
        debug_view_.start(setup);
        server_ = std::make_unique<arhost::web::Server>(settings_, frame_, control_);
        if (address_.starts_with('/'))
            return host_.info("listens at " + address_);
        const std::string url = arhost::web::url_of(address_, settings_.hosts);
        host_.info(
            "open " + url +
            (url.find(address_) != std::string::npos ? "" : "; other machines can use any address of this one"));
    }

    arhost_status write(const arhost_output &output) {
        frame_.put(debug_view_.applied_to(output));
        return idle();
    }

    arhost_status idle() {
        server_->tick();
        return ARHOST_STATUS_OK;
    }

    void set(const arhost::Options &changed) {
        if (changed.contains("quality"))
            frame_.set_quality(static_cast<int>(changed.integer("quality")));
        else
            debug_view_.is_on = changed.boolean(arhost::drawing::DebugView::key);
    }

    void stop() {
        server_->end_run();
        server_.reset();
    }

private:
    [[noreturn]] static void fail(const std::string &message) {
        throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, message);
    }

    arhost::Host host_;
    arhost::HostControl control_;
    arhost::drawing::DebugView debug_view_;
    arhost::web::NewestFrame frame_;
    arhost::web::Settings settings_;
    std::string address_;
    std::unique_ptr<arhost::web::Server> server_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_LISTEN, "listen", "127.0.0.1:8080",
                   "Address and port of the page; an address that other machines can reach needs a token."),
    arhost::option(ARHOST_OPTION_TEXT, "token", "",
                   "Secret that each command must contain, at least 16 characters; empty: none."),
    arhost::option(ARHOST_OPTION_TEXT, "hosts", "",
                   "Names of this machine, separated by commas, under which browsers may open the page."),
    arhost::option(ARHOST_OPTION_INTEGER, "quality", "80", "JPEG quality.", 1, 100),
    arhost::drawing::DebugView::option,
};

constexpr const char *needs[] = {"listen", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_web",
    .name = "Web page",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description =
        "Shows the live picture and the state of the run in a browser, and passes its commands to the host.",
    .capabilities = ARHOST_SINK_CAPABILITY_REALTIME,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SINK(WebSink, descriptor)
