// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/status/status_macros.h"
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
  std::string_view time_order = "create_time";
  std::string_view id_order = "id";
  RecordOrder default_order = RecordOrder::kNewestFirst;
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

// INVALID_ARGUMENT: what the filter may have as a state.
absl::Status UnknownState(const std::string& name, const google::protobuf::EnumDescriptor& states);

// For a page that ends with `last` and is followed by another one; opaque to clients.
std::string NextPageToken(const ListArguments& list, const RecordPosition& last);

// A page ends at its size, or when its messages have grown to this (clients accept 4 MiB).
inline constexpr size_t kMaxPageBytes = 1u << 20;

// Makes a page of the list's `records`, which begin where it begins: `describe` fills the message
// of a record, or returns NOT_FOUND for one that was deleted meanwhile and is left out.
template <typename Record, typename Message, typename Describe>
absl::Status FillPage(const ListArguments& list, const std::vector<Listed<Record>>& records,
                      const Describe& describe, google::protobuf::RepeatedPtrField<Message>* page,
                      std::string* next_page_token) {
  size_t bytes = 0;
  for (size_t i = 0; i < records.size(); ++i) {
    if (i == list.page_size || bytes > kMaxPageBytes) {
      *next_page_token = NextPageToken(list, records[i - 1].position);
      break;
    }
    Message* const message = page->Add();
    const absl::Status status = describe(records[i].record, message);
    if (absl::IsNotFound(status)) {
      page->RemoveLast();
      continue;
    }
    RIGCAL_RETURN_IF_ERROR(status);
    bytes += message->ByteSizeLong();
  }
  return absl::OkStatus();
}

// The value of a `state` in a filter. INVALID_ARGUMENT names the known ones.
template <typename State>
absl::StatusOr<State> ParseState(const std::string& name) {
  const google::protobuf::EnumDescriptor& states = *google::protobuf::GetEnumDescriptor<State>();
  const google::protobuf::EnumValueDescriptor* state = states.FindValueByName(name);
  if (state != nullptr && state->number() != 0) return static_cast<State>(state->number());
  return UnknownState(name, states);
}

}  // namespace rigcal::server
