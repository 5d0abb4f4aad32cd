// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace rigcal::agent {

// Makes whole words of a stream of bytes that is cut anywhere.
class ByteAligner {
 public:
  explicit ByteAligner(size_t word_bytes) : word_bytes_(word_bytes) {}

  // The whole words that `bytes` ends, with what was left over before; none: not even one. Copies
  // only where a word was cut. The view is valid as long as `bytes`, until the next Join.
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
  std::vector<uint8_t> joined_;  // the words shown last, if they were joined, and a word's begin
  size_t whole_bytes_ = 0;       // of joined_, shown last
};

}  // namespace rigcal::agent
