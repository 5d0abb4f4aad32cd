// SPDX-License-Identifier: Apache-2.0
#include "common/wire/request_scan.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>

#include "absl/container/inlined_vector.h"
#include "absl/strings/str_cat.h"

namespace rigcal::wire {
namespace {

using ::google::protobuf::Descriptor;
using ::google::protobuf::FieldDescriptor;
using ::google::protobuf::internal::WireFormatLite;
using ::google::protobuf::io::CodedInputStream;

// Fields that this release does not know, in one message: those of a newer one are few.
constexpr uint32_t kMaxUnknownFields = 64;
constexpr int kMaxDepth = 16;

const FieldLimit* LimitOf(const FieldDescriptor* field) {
  static const auto* const kByName = [] {
    auto* const by_name = new std::unordered_map<std::string_view, const FieldLimit*>;
    for (const FieldLimit& limit : FieldLimits()) by_name->emplace(limit.field, &limit);
    return by_name;
  }();
  const auto found = kByName->find(field->full_name());
  return found == kByName->end() ? nullptr : found->second;
}

// What is known about the fields of a message, by their index in it.
struct MessageLimits {
  struct Field {
    uint32_t count = std::numeric_limits<uint32_t>::max();
    uint32_t bytes = std::numeric_limits<uint32_t>::max();
    size_t element_bytes = 0;  // of a packed field; 0: varints
  };
  absl::InlinedVector<Field, 24> fields;
};

size_t PackedBytes(FieldDescriptor::Type type) {
  switch (WireFormatLite::WireTypeForFieldType(static_cast<WireFormatLite::FieldType>(type))) {
    case WireFormatLite::WIRETYPE_FIXED32:
      return 4;
    case WireFormatLite::WIRETYPE_FIXED64:
      return 8;
    default:
      return 0;
  }
}

MessageLimits* MakeLimits(const Descriptor& type) {
  auto* const limits = new MessageLimits;
  for (int i = 0; i < type.field_count(); ++i) {
    MessageLimits::Field& field = limits->fields.emplace_back();
    const FieldLimit* const limit = LimitOf(type.field(i));
    // A field that somebody forgot gets nothing through.
    if (type.field(i)->is_repeated()) field.count = limit == nullptr ? 0 : limit->count;
    if (type.field(i)->cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
      field.bytes = limit == nullptr ? 0 : limit->bytes;
    }
    field.element_bytes = PackedBytes(type.field(i)->type());
  }
  return limits;
}

// Kept for every message that has come in this thread: no lock in the way of ingest.
const MessageLimits& LimitsOf(const Descriptor& type) {
  thread_local std::unordered_map<const Descriptor*, std::unique_ptr<MessageLimits>> known;
  auto& limits = known[&type];
  if (!limits) limits.reset(MakeLimits(type));
  return *limits;
}

class RequestScanner {
 public:
  explicit RequestScanner(google::protobuf::io::ZeroCopyInputStream* bytes) : in_(bytes) {}

  absl::Status Scan(const Descriptor& type) { return ScanMessage(type, nullptr, 0); }

 private:
  struct Place {
    const Place* outer;
    const FieldDescriptor* field;
    uint32_t index;
  };

  static std::string PathTo(const Place* place) {
    if (place == nullptr) return "";
    std::string path = PathTo(place->outer);
    if (!path.empty()) path += '.';
    path += place->field->name();
    if (place->field->is_repeated() && place->field->message_type() != nullptr) {
      absl::StrAppend(&path, "[", place->index, "]");
    }
    return path;
  }
  static absl::Status Fault(const Place* outer, const FieldDescriptor* field,
                            std::string_view what) {
    const std::string path = PathTo(outer);
    return absl::InvalidArgumentError(
        absl::StrCat(path, path.empty() ? "" : ".", field->name(), ": ", std::string(what)));
  }
  static absl::Status NoMessage(const Place* place) {
    const std::string path = PathTo(place);
    return absl::InvalidArgumentError(
        absl::StrCat(path.empty() ? "request" : path, ": its bytes are no message of this kind"));
  }
  static absl::Status TooMany(const Place* outer, const FieldDescriptor* field, uint32_t limit) {
    return Fault(outer, field,
                 absl::StrCat("has more than ", limit, " elements; send it in parts"));
  }

  absl::Status ScanMessage(const Descriptor& type, const Place* place, int depth) {
    if (depth > kMaxDepth) return NoMessage(place);
    const MessageLimits& limits = LimitsOf(type);
    absl::InlinedVector<uint32_t, 24> counts(limits.fields.size(), 0);
    uint32_t unknown = 0;
    while (const uint32_t tag = in_.ReadTag()) {
      const FieldDescriptor* const field =
          type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
      if (field == nullptr) {
        if (++unknown > kMaxUnknownFields) {
          const std::string path = PathTo(place);
          return absl::InvalidArgumentError(absl::StrCat(path.empty() ? "request" : path,
                                                         ": has more than ", kMaxUnknownFields,
                                                         " fields that this server does not know"));
        }
        if (!WireFormatLite::SkipField(&in_, tag)) return NoMessage(place);
        continue;
      }
      const auto index = static_cast<size_t>(field->index());
      absl::Status status =
          ScanField(*field, limits.fields[index], tag, place, depth, &counts[index]);
      if (!status.ok()) return status;
    }
    return in_.ConsumedEntireMessage() ? absl::OkStatus() : NoMessage(place);
  }

  absl::Status ScanField(const FieldDescriptor& field, const MessageLimits::Field& limit,
                         uint32_t tag, const Place* place, int depth, uint32_t* count) {
    if (WireFormatLite::GetTagWireType(tag) != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
      if (++*count > limit.count) return TooMany(place, &field, limit.count);
      return WireFormatLite::SkipField(&in_, tag) ? absl::OkStatus() : NoMessage(place);
    }
    uint32_t size = 0;
    if (!in_.ReadVarint32(&size) || size > kMaxBytes) return NoMessage(place);
    if (field.is_repeated() && field.is_packable()) {
      return CountPacked(field, limit, size, place, count);
    }
    if (++*count > limit.count) return TooMany(place, &field, limit.count);
    if (field.message_type() == nullptr) {
      if (size > limit.bytes) {
        return Fault(place, &field,
                     absl::StrCat("has ", size, " bytes, at most ", limit.bytes, " are allowed"));
      }
      return in_.Skip(static_cast<int>(size)) ? absl::OkStatus() : NoMessage(place);
    }
    // Parts of one message, merged, would each pass the limits.
    if (!field.is_repeated() && *count > 1) return Fault(place, &field, "comes twice");
    const CodedInputStream::Limit end = in_.PushLimit(static_cast<int>(size));
    const Place inner = {place, &field, *count - 1};
    absl::Status status = ScanMessage(*field.message_type(), &inner, depth + 1);
    if (!status.ok()) return status;
    if (in_.BytesUntilLimit() != 0) return NoMessage(&inner);
    in_.PopLimit(end);
    return absl::OkStatus();
  }

  absl::Status CountPacked(const FieldDescriptor& field, const MessageLimits::Field& limit,
                           uint32_t size, const Place* place, uint32_t* count) {
    if (limit.element_bytes > 0 || size <= limit.count - *count) {
      // Every varint has a byte at least.
      const size_t elements = limit.element_bytes > 0 ? size / limit.element_bytes : size;
      if (elements > limit.count - *count) return TooMany(place, &field, limit.count);
      *count += static_cast<uint32_t>(elements);
      return in_.Skip(static_cast<int>(size)) ? absl::OkStatus() : NoMessage(place);
    }
    const CodedInputStream::Limit end = in_.PushLimit(static_cast<int>(size));
    uint64_t value = 0;
    while (in_.BytesUntilLimit() > 0) {
      if (++*count > limit.count) return TooMany(place, &field, limit.count);
      if (!in_.ReadVarint64(&value)) return NoMessage(place);
    }
    in_.PopLimit(end);
    return absl::OkStatus();
  }

  static constexpr uint32_t kMaxBytes = uint32_t{1} << 30;

  CodedInputStream in_;
};

}  // namespace

bool IsRequest(const Descriptor& type) {
  const std::string& name = type.full_name();
  return type.file()->package() == "rigcal.v1" && name.ends_with("Request");
}

absl::Status ScanRequest(const Descriptor& type, google::protobuf::io::ZeroCopyInputStream* bytes) {
  return RequestScanner(bytes).Scan(type);
}

}  // namespace rigcal::wire
