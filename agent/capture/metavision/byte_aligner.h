// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace rigcal::agent {

// Regroups a stream of bytes that may be cut anywhere into whole words.
class ByteAligner {
 public:
  explicit ByteAligner(size_t word_bytes) : word_bytes_(word_bytes) {}

  // The whole words in the bytes left over before and `bytes`. Copies only a word that was cut. The
  // view is valid as long as `bytes`, until the next Join.
  std::span<const uint8_t> Join(std::span<const uint8_t> bytes) {
    joined_.erase(joined_.begin(), joined_.begin() + static_cast<std::ptrdiff_t>(whole_bytes_));
    whole_bytes_ = 0;
    if (joined_.empty()) {
      const size_t rest = bytes.size() % word_bytes_;
      joined_.assign(bytes.end() - static_cast<std::ptrdiff_t>(rest), bytes.end());
      return bytes.first(bytes.size() - rest);
    }
    joined_.insert(joined_.end(), bytes.begin(), bytes.end());
    whole_bytes_ = joined_.size() - joined_.size() % word_bytes_;
    return std::span<const uint8_t>(joined_).first(whole_bytes_);
  }

 private:
  size_t word_bytes_;
  std::vector<uint8_t> joined_;  // the last words, if joined, and the beginning of the next
  size_t whole_bytes_ = 0;       // of joined_
};

}  // namespace rigcal::agent
