// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::client {

inline constexpr uint32_t kPageSize = 500;
inline constexpr int kMaxPages = 10'000;

// Every page of a list as one response without a page token. `append` moves the entries of a page
// to the end of the first argument.
template <typename Request, typename Response>
absl::StatusOr<Response> ReadAllPages(const std::function<absl::StatusOr<Response>(Request)>& get,
                                      const std::function<void(Response&, Response&)>& append) {
  Response all;
  Request request;
  request.set_page_size(kPageSize);
  for (int i = 0; i < kMaxPages; ++i) {
    absl::StatusOr<Response> page = get(request);
    if (!page.ok()) return page.status();
    append(all, *page);
    if (page->next_page_token().empty()) return all;
    if (page->next_page_token() == request.page_token()) break;
    request.set_page_token(page->next_page_token());
  }
  return absl::InternalError("the server's list does not end; rigcal doctor shows its version");
}

}  // namespace rigcal::client
