// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/status/refusal_reason.h"

namespace rigcal {

// kUnspecified: no reason has this name.
constexpr RefusalReason RefusalReasonFromName(std::string_view name) {
  for (const auto& [value, value_name] : kRefusalReasonNames) {
    if (value_name == name) return value;
  }
  return RefusalReason::kUnspecified;
}

// Something that was refused or left out, and how often.
struct Refusal {
  std::string camera;  // empty: the whole session
  RefusalReason reason = RefusalReason::kUnspecified;
  uint64_t count = 0;
  std::string example;  // text for the first one, with file and line or seq where known

  friend bool operator==(const Refusal&, const Refusal&) = default;
};

// Counts refusals by (camera, reason); lists them in that order, so that two runs agree.
class RefusalCounter {
 public:
  void Add(std::string_view camera, RefusalReason reason, uint64_t count = 1,
           std::string_view example = {}) {
    if (count == 0) return;
    Refusal& refusal = by_key_[{std::string(camera), reason}];
    if (refusal.count == 0) {
      refusal.camera = camera;
      refusal.reason = reason;
    }
    if (refusal.example.empty()) refusal.example = example;
    // Counts reported by agents are added here: they must not wrap.
    constexpr uint64_t kMost = std::numeric_limits<uint64_t>::max();
    refusal.count = refusal.count > kMost - count ? kMost : refusal.count + count;
  }
  void Add(const Refusal& refusal) {
    Add(refusal.camera, refusal.reason, refusal.count, refusal.example);
  }

  std::vector<Refusal> List() const {
    std::vector<Refusal> list;
    list.reserve(by_key_.size());
    for (const auto& [key, refusal] : by_key_) list.push_back(refusal);
    return list;
  }
  bool empty() const { return by_key_.empty(); }

 private:
  std::map<std::pair<std::string, RefusalReason>, Refusal> by_key_;
};

}  // namespace rigcal
