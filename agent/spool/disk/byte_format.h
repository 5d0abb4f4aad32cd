// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <zlib.h>

#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace rigcal::agent {

// The spool's files are little-endian; so is every machine it runs on.
static_assert(std::endian::native == std::endian::little);

// CRC-32 as in zlib. (Debian's Abseil has no CRC32C yet.)
inline uint32_t SpoolChecksum(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

template <typename Number>
requires std::is_arithmetic_v<Number>
void PutNumber(Number value, std::string* out) {
  char bytes[sizeof(Number)];
  std::memcpy(bytes, &value, sizeof(Number));
  out->append(bytes, sizeof(Number));
}

inline void PutText(std::string_view text, std::string* out) {
  PutNumber(static_cast<uint32_t>(text.size()), out);
  out->append(text);
}

// Takes numbers and texts from the front of some bytes. Beyond the end it gives zeros and is not
// ok() any more, so that a damaged file needs one check at the end.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : rest_(bytes) {}

  template <typename Number>
  Number Take() {
    Number value{};
    if (rest_.size() < sizeof(Number)) {
      Fail();
      return value;
    }
    std::memcpy(&value, rest_.data(), sizeof(Number));
    rest_.remove_prefix(sizeof(Number));
    return value;
  }
  std::string TakeText(size_t most) {
    const auto size = Take<uint32_t>();
    if (size > most || size > rest_.size()) {
      Fail();
      return {};
    }
    const std::string text(rest_.substr(0, size));
    rest_.remove_prefix(size);
    return text;
  }

  bool ok() const { return ok_; }
  size_t left() const { return rest_.size(); }
  // Everything was taken, and nothing was missing.
  bool complete() const { return ok_ && rest_.empty(); }

 private:
  void Fail() {
    ok_ = false;
    rest_ = {};
  }

  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace rigcal::agent
