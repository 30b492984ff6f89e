// SPDX-License-Identifier: Apache-2.0
//
// Decides which requests the server accepts.
#pragma once

#include <string>
#include <string_view>

namespace arhost::web {

// Returns whether only this machine can reach the listening socket.
bool is_local(int socket);

// Returns the URL of the page at ADDRESS:PORT. If the server listens at all addresses of the machine, it is that with
// the first name in the comma-separated list `hosts` or, without one, with `localhost`.
std::string url_of(const std::string &address, std::string_view hosts);

// Returns whether the header `Host` names this server: by an IP address, by `localhost`, or by a name in the
// comma-separated list `hosts`. A page that reaches the server by DNS rebinding has another name.
bool is_own_host(std::string_view host, std::string_view hosts);

// Returns whether the header `Origin` belongs to a page of this server.
bool is_own_origin(std::string_view origin, std::string_view host);

// Returns whether the header `Authorization` contains the token. The run time depends only on the lengths of the
// texts.
bool has_token(std::string_view authorization, std::string_view token);

} // namespace arhost::web
