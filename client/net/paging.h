// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/net/server_connection.h"

namespace rigcal::client {

// Which entries of a list, in which order: the flags of every `list` command.
struct ListOptions {
  std::string rig;       // empty: every rig
  std::string session;   // calibrations only; empty: of any session
  std::string filter;    // as the API's; joined with the others
  std::string order_by;  // empty: the API's default
};

// The API's filter for all of them.
inline std::string FilterOf(const ListOptions& options) {
  std::vector<std::string> terms;
  if (!options.rig.empty()) terms.push_back(absl::StrCat("rig=\"", options.rig, "\""));
  if (!options.session.empty()) {
    terms.push_back(absl::StrCat("session_ids:\"", options.session, "\""));
  }
  if (!options.filter.empty()) terms.push_back(options.filter);
  return absl::StrJoin(terms, " AND ");
}

// Every page of a list as one response without a page token.
template <typename Stub, typename Request, typename Response>
absl::StatusOr<Response> ReadAllPages(ServerConnection& server,
                                      UnaryMethod<Stub, Request, Response> method,
                                      const ListOptions& options = {}) {
  constexpr uint32_t kPageSize = 500;
  constexpr int kMaxPages = 10'000;
  Response all;
  Request request;
  request.set_page_size(kPageSize);
  request.set_filter(FilterOf(options));
  request.set_order_by(options.order_by);
  for (int i = 0; i < kMaxPages; ++i) {
    const absl::StatusOr<Response> page = server.Call(method, request);
    if (!page.ok()) return page.status();
    all.MergeFrom(*page);
    all.clear_next_page_token();
    if (page->next_page_token().empty()) return all;
    if (page->next_page_token() == request.page_token()) break;
    request.set_page_token(page->next_page_token());
  }
  return absl::InternalError("the server's list does not end; rigcal doctor shows its version");
}

}  // namespace rigcal::client
