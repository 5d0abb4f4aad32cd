// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::client {

// Which entries of a list, in which order: the flags of every `list` command.
struct ListOptions {
  std::string rig;       // empty: every rig
  std::string session;   // calibrations only; empty: of any session
  std::string filter;    // as the API's; joined with the others
  std::string order_by;  // empty: the API's default
};

// The API's filter for all of them.
std::string FilterOf(const ListOptions& options);

// Sets filter and order_by of a list request.
template <typename Request>
Request WithListOptions(Request request, const ListOptions& options) {
  request.set_filter(FilterOf(options));
  request.set_order_by(options.order_by);
  return request;
}

}  // namespace rigcal::client
