// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "server/store/record_list.h"

namespace rigcal::server {

// A field that a list can be filtered by.
struct FilterField {
  std::string_view name;
  bool repeated = false;  // written `name:value`, true where any value matches; else `name=value`
};

// What a list can be filtered and sorted by.
struct ListFields {
  absl::Span<const FilterField> filter;
  std::string_view time_order;  // "create_time"
  std::string_view id_order;    // "id"
  RecordOrder default_order;
};

// The arguments of a list call, checked.
struct ListArguments {
  struct Term {
    std::string_view field;
    std::string value;
  };
  std::vector<Term> filter;
  RecordOrder order = RecordOrder::kNewestFirst;
  size_t page_size = 0;
  std::optional<RecordPosition> after;
  uint64_t list_hash = 0;  // of filter and order: a token belongs to one list

  // For the store: one more than the page has, to know whether there is another page.
  ListPage Page() const {
    return {.order = order, .limit = static_cast<int>(page_size) + 1, .after = after};
  }
};

// Terms `field=value` or `field:value`, joined by AND; a value is a word of letters, digits and
// "_-./", or quoted with ". INVALID_ARGUMENT names the place and what is allowed. A field may be
// given once.
absl::StatusOr<std::vector<ListArguments::Term>> ParseFilter(std::string_view text,
                                                             absl::Span<const FilterField> fields);

// INVALID_ARGUMENT: begins with the name of the faulty field of the request.
absl::StatusOr<ListArguments> ParseListArguments(std::string_view filter, std::string_view order_by,
                                                 uint32_t page_size, std::string_view page_token,
                                                 const ListFields& fields);
template <typename Request>
absl::StatusOr<ListArguments> ParseListArguments(const Request& request, const ListFields& fields) {
  return ParseListArguments(request.filter(), request.order_by(), request.page_size(),
                            request.page_token(), fields);
}

// Decides where a page of a list ends: at the page size, or when its message has grown to 1 MiB
// (clients accept 4 MiB by default).
class PageFiller {
 public:
  explicit PageFiller(const ListArguments& list) : list_(list) {}

  bool full() const;
  // A record was added to the page, or left out of it (0 bytes).
  void Add(const RecordPosition& position, size_t bytes);
  // For a page that is followed by another one; opaque to clients.
  std::string NextToken() const;

 private:
  const ListArguments& list_;
  size_t count_ = 0;
  size_t bytes_ = 0;
  RecordPosition last_;
};

}  // namespace rigcal::server
