// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rigcal {

// Something that was refused or left out, and how often. `reason` is a word for machines; every
// word is listed in docs/refusals.md.
struct Refusal {
  std::string camera;  // empty: the whole session
  std::string reason;
  uint32_t count = 0;
  std::string example;  // the first one in words, with file and line or seq where there is one

  friend bool operator==(const Refusal&, const Refusal&) = default;
};

// Counts refusals by (camera, reason); lists them in that order, so that two runs agree.
class RefusalCounter {
 public:
  void Add(std::string_view camera, std::string_view reason, uint32_t count = 1,
           std::string_view example = {}) {
    if (count == 0) return;
    Refusal& refusal = by_key_[{std::string(camera), std::string(reason)}];
    if (refusal.count == 0) {
      refusal.camera = camera;
      refusal.reason = reason;
    }
    if (refusal.example.empty()) refusal.example = example;
    refusal.count += count;
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
  std::map<std::pair<std::string, std::string>, Refusal> by_key_;
};

}  // namespace rigcal
