// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/http/http_request.h"

namespace rigcal::server {

// What browsers are told by a server that another one answers for.
struct WaitingNotice {
  std::string message;
  std::string active_page;  // URL; empty: it is not known
  std::string title = "This server waits";
  std::string metrics = {};  // in the text format of Prometheus; empty: there are none
};

// A page that names the other server and looks again by itself, /healthz, /metrics, and 503 for the
// rest.
std::vector<HttpRoute> WaitingRoutes(const std::function<WaitingNotice()>& notice);

}  // namespace rigcal::server
