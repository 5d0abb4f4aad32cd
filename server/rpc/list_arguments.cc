// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/list_arguments.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace rigcal::server {
namespace {

constexpr uint32_t kDefaultPageSize = 100;
constexpr uint32_t kMaxPageSize = 1000;
constexpr size_t kMaxFilterBytes = 1024;

std::string FieldsText(absl::Span<const FilterField> fields) {
  return absl::StrJoin(fields, ", ", [](std::string* out, const FilterField& field) {
    absl::StrAppend(out, absl::string_view(field.name.data(), field.name.size()),
                    field.repeated ? ":VALUE" : "=VALUE");
  });
}

// Reads a filter from left to right.
class FilterReader {
 public:
  FilterReader(std::string_view text, absl::Span<const FilterField> fields)
      : text_(text), fields_(fields) {}

  absl::StatusOr<std::vector<ListArguments::Term>> Read() {
    std::vector<ListArguments::Term> terms;
    SkipSpace();
    while (place_ < text_.size()) {
      if (!terms.empty() && Word() != "AND") return Fault("AND is expected between two terms");
      RIGCAL_ASSIGN_OR_RETURN(ListArguments::Term term, ReadTerm());
      for (const ListArguments::Term& other : terms) {
        if (other.field == term.field) {
          return Fault(absl::StrCat(std::string(term.field), " is given twice"));
        }
      }
      terms.push_back(std::move(term));
      SkipSpace();
    }
    return terms;
  }

 private:
  absl::StatusOr<ListArguments::Term> ReadTerm() {
    const std::string name = Word();
    const auto field = std::find_if(fields_.begin(), fields_.end(),
                                    [&](const FilterField& known) { return known.name == name; });
    if (field == fields_.end()) {
      return Fault(name.empty() ? "a field is expected"
                                : absl::StrCat("'", name, "' is not a field of this list"));
    }
    SkipSpace();
    if (place_ == text_.size() || text_[place_] != (field->repeated ? ':' : '=')) {
      return Fault(absl::StrCat("'", field->repeated ? ":" : "=", "' is expected after ", name));
    }
    ++place_;
    SkipSpace();
    if (place_ < text_.size() && text_[place_] == '"') {
      const size_t end = text_.find('"', place_ + 1);
      if (end == std::string_view::npos) return Fault("the closing \" is missing");
      ListArguments::Term term{field->name,
                               std::string(text_.substr(place_ + 1, end - place_ - 1))};
      place_ = end + 1;
      return term;
    }
    std::string value = Word();
    if (value.empty()) return Fault(absl::StrCat("a value is expected after ", name));
    return ListArguments::Term{field->name, std::move(value)};
  }

  void SkipSpace() {
    while (place_ < text_.size() && text_[place_] == ' ') ++place_;
  }
  std::string Word() {
    SkipSpace();
    const size_t begin = place_;
    while (place_ < text_.size() &&
           (absl::ascii_isalnum(static_cast<unsigned char>(text_[place_])) ||
            std::string_view("_-./").find(text_[place_]) != std::string_view::npos)) {
      ++place_;
    }
    return std::string(text_.substr(begin, place_ - begin));
  }
  absl::Status Fault(absl::string_view what) const {
    return absl::InvalidArgumentError(absl::StrCat("filter: at character ", place_ + 1, ": ", what,
                                                   "; a filter has the terms ", FieldsText(fields_),
                                                   ", joined by AND"));
  }

  const std::string_view text_;
  const absl::Span<const FilterField> fields_;
  size_t place_ = 0;
};

absl::StatusOr<RecordOrder> ParseOrder(std::string_view text, const ListFields& fields) {
  if (text.empty()) return fields.default_order;
  const std::string time(fields.time_order);
  const std::string id(fields.id_order);
  if (text == time) return RecordOrder::kOldestFirst;
  if (text == time + " desc") return RecordOrder::kNewestFirst;
  if (text == id) return RecordOrder::kIdAscending;
  if (text == id + " desc") return RecordOrder::kIdDescending;
  return absl::InvalidArgumentError(absl::StrCat("order_by: '", std::string(text),
                                                 "' is not known; it is ", time, " or ", id,
                                                 ", with ' desc' for descending"));
}

// FNV-1a: the same on every server and in every release.
uint64_t Hash(std::string_view text) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

absl::StatusOr<RecordPosition> ParseToken(std::string_view token, uint64_t list_hash) {
  std::string text;
  if (absl::WebSafeBase64Unescape(absl::string_view(token.data(), token.size()), &text)) {
    const std::vector<std::string> parts = absl::StrSplit(text, absl::MaxSplits(':', 2));
    RecordPosition position;
    if (parts.size() == 3 && parts[0] == absl::StrCat(absl::Hex(list_hash)) &&
        absl::SimpleAtoi(parts[1], &position.time)) {
      position.id = parts[2];
      return position;
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("page_token: '", std::string(token),
                   "' is not from this list (filter and order_by must be the same for all of its "
                   "pages); begin with an empty one"));
}

}  // namespace

absl::StatusOr<std::vector<ListArguments::Term>> ParseFilter(std::string_view text,
                                                             absl::Span<const FilterField> fields) {
  if (text.size() > kMaxFilterBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("filter: has ", text.size(), " bytes, at most ", kMaxFilterBytes));
  }
  return FilterReader(text, fields).Read();
}

absl::StatusOr<ListArguments> ParseListArguments(std::string_view filter, std::string_view order_by,
                                                 uint32_t page_size, std::string_view page_token,
                                                 const ListFields& fields) {
  ListArguments list;
  RIGCAL_ASSIGN_OR_RETURN(list.filter, ParseFilter(filter, fields.filter));
  RIGCAL_ASSIGN_OR_RETURN(list.order, ParseOrder(order_by, fields));
  list.page_size = page_size == 0 ? kDefaultPageSize : std::min(page_size, kMaxPageSize);
  std::string canonical = absl::StrCat(static_cast<int>(list.order));
  for (const ListArguments::Term& term : list.filter) {
    absl::StrAppend(&canonical, "\n", std::string(term.field), "=", term.value);
  }
  list.list_hash = Hash(canonical);
  if (!page_token.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(list.after, ParseToken(page_token, list.list_hash));
  }
  return list;
}

std::string NextPageToken(const ListArguments& list, const RecordPosition& last) {
  return absl::WebSafeBase64Escape(
      absl::StrCat(absl::Hex(list.list_hash), ":", last.time, ":", last.id));
}

absl::Status UnknownState(const std::string& name, const google::protobuf::EnumDescriptor& states) {
  std::vector<std::string> names;
  for (int i = 1; i < states.value_count(); ++i) names.push_back(states.value(i)->name());
  return absl::InvalidArgumentError(
      absl::StrCat("filter: state is '", name, "'; it is one of ", absl::StrJoin(names, ", ")));
}

}  // namespace rigcal::server
