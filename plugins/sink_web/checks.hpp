// SPDX-License-Identifier: Apache-2.0
//
// Decides which requests the server accepts.
#pragma once

#include <string>
#include <string_view>

namespace arhost::web {

// Whether only this machine can reach the listening socket.
bool is_local(int socket);

// Whether the header `Host` names this server: an IP address, `localhost`, or one of the names in `hosts`, which is a
// list separated by commas. A page that reaches the server by DNS rebinding has another name.
bool is_own_host(std::string_view host, std::string_view hosts);

// Whether the header `Origin` belongs to a page of this server.
bool is_own_origin(std::string_view origin, std::string_view host);

// Whether the header `Authorization` contains the token. The time depends only on the lengths.
bool has_token(std::string_view authorization, std::string_view token);

} // namespace arhost::web
