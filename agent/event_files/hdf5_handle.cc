// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_handle.h"

#include <algorithm>
#include <array>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxTextBytes = 1024;
constexpr hssize_t kMaxNumbers = 8;

std::recursive_mutex& TheMutex() {
  static auto* const kMutex = new std::recursive_mutex;
  return *kMutex;
}

herr_t TakeFirst(unsigned, const H5E_error2_t* error, void* text) {
  auto* const reason = static_cast<std::string*>(text);
  if (reason->empty() && error->desc != nullptr) *reason = error->desc;
  return 0;
}

std::optional<std::string> ReadText(hid_t attribute, hid_t type) {
  if (H5Tis_variable_str(type) > 0) {
    char* text = nullptr;
    const Hdf5Handle memory(H5Tcopy(type), H5Tclose);
    if (H5Aread(attribute, memory.get(), static_cast<void*>(&text)) < 0 || text == nullptr) {
      return std::nullopt;
    }
    std::string value(text, std::find(text, text + kMaxTextBytes, '\0'));
    H5free_memory(text);
    return value;
  }
  std::vector<char> text(H5Tget_size(type) + 1, '\0');
  if (text.size() > kMaxTextBytes || H5Aread(attribute, type, text.data()) < 0) return std::nullopt;
  return std::string(text.data());
}

}  // namespace

Hdf5Lock::Hdf5Lock() : lock_(TheMutex()) { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

std::string Hdf5Reason() {
  std::string reason;
  // Upwards begins at the innermost.
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, TakeFirst, &reason);
  return reason.empty() ? "HDF5 gives no reason" : absl::Utf8SafeCEscape(reason);
}

std::optional<std::string> Hdf5AttributeText(hid_t object, const char* name) {
  if (H5Aexists(object, name) <= 0) return std::nullopt;
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return std::nullopt;
  const Hdf5Handle type(H5Aget_type(attribute.get()), H5Tclose);
  const Hdf5Handle space(H5Aget_space(attribute.get()), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space.get());
  if (count < 1 || count > kMaxNumbers) return std::nullopt;
  const auto numbers = [&](hid_t memory_type, auto zero) -> std::optional<std::string> {
    std::array<decltype(zero), kMaxNumbers> values{};
    if (H5Aread(attribute.get(), memory_type, values.data()) < 0) return std::nullopt;
    return absl::StrJoin(values.begin(), values.begin() + count, " ");
  };
  switch (H5Tget_class(type.get())) {
    case H5T_STRING: {
      if (count != 1) return std::nullopt;
      const auto text = ReadText(attribute.get(), type.get());
      if (!text) return std::nullopt;
      return absl::Utf8SafeCEscape(*text);
    }
    case H5T_INTEGER:
      return numbers(H5T_NATIVE_LLONG, 0LL);
    case H5T_FLOAT:
      return numbers(H5T_NATIVE_DOUBLE, 0.0);
    default:
      return std::nullopt;
  }
}

}  // namespace rigcal::agent
