/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin as if built with newer headers, in which option descriptors are larger. */
#include <arhost/arhost.h>

struct grown {
    arhost_option_descriptor option;
    const char *added;
};
static const struct grown options[] = {
    {{sizeof(struct grown), ARHOST_OPTION_INTEGER, "first", "1", 0, 0, 0, "The first of three"}, "new"},
    {{sizeof(struct grown), ARHOST_OPTION_REAL, "second", "2.5", 0, 0, 0, "The second of three"}, "new"},
    {{sizeof(struct grown), ARHOST_OPTION_TEXT, "third", "c", 0, 0, 0, "The third of three"}, "new"},
};
static const arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                             ARHOST_KIND_SINK,
                                             "org.arhost.test.newer_options",
                                             "Newer",
                                             "0.1.0",
                                             "arhost",
                                             "Apache-2.0",
                                             "Has larger option descriptors, for tests.",
                                             0,
                                             sizeof options / sizeof *options,
                                             &options[0].option,
                                             0};

static arhost_status create(const arhost_host *host, const arhost_option *values, uint32_t count,
                            arhost_instance **instance) {
    return (void)host, (void)values, (void)count, (void)instance, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static void destroy(arhost_instance *self) {
    (void)self;
}
static const void *get_extension(const char *id) {
    return (void)id, (const void *)0;
}
static arhost_status start(arhost_instance *self, const arhost_sink_setup *setup) {
    return (void)self, (void)setup, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static arhost_status write_frame(arhost_instance *self, const arhost_output *output) {
    return (void)self, (void)output, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static arhost_status stop(arhost_instance *self) {
    return (void)self, ARHOST_STATUS_OK;
}
static const arhost_sink functions = {sizeof(arhost_sink), 0, start, write_frame, 0, stop, 0};
static const arhost_plugin plugin = {sizeof(arhost_plugin), 0, &descriptor, &functions, create, destroy,
                                     get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    answer->abi_version = offer->newest_abi_version;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}
ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
