// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string_view>

namespace rigcal {

// Outcome of the detection in one image, or in one interval of events.
enum class DetectionOutcome : uint8_t {
  kWand = 1,
  kNoBlob,        // no pixel in range formed a blob
  kNoWand,        // blobs, but no wand among them
  kAmbiguous,     // several wands fit equally well
  kTooManyBlobs,  // more than the finder keeps, and no wand among those kept
  kBlack,         // black image: lens cap, exposure, no light
  kSaturated,     // most pixels are at their brightest
};

inline constexpr std::array kDetectionOutcomes = {
    DetectionOutcome::kWand,      DetectionOutcome::kNoBlob,       DetectionOutcome::kNoWand,
    DetectionOutcome::kAmbiguous, DetectionOutcome::kTooManyBlobs, DetectionOutcome::kBlack,
    DetectionOutcome::kSaturated};

// For people and tables: "wand", "no blob".
constexpr std::string_view DetectionOutcomeText(DetectionOutcome outcome) {
  constexpr std::string_view kTexts[] = {"unknown",   "wand",           "no blob", "no wand",
                                         "ambiguous", "too many blobs", "black",   "saturated"};
  const auto index = static_cast<size_t>(outcome);
  return kTexts[index < std::size(kTexts) ? index : 0];
}

// Images by outcome.
class DetectionCounts {
 public:
  void Add(DetectionOutcome outcome, uint64_t count = 1) { counts_[Index(outcome)] += count; }
  uint64_t Of(DetectionOutcome outcome) const { return counts_[Index(outcome)]; }

  friend bool operator==(const DetectionCounts&, const DetectionCounts&) = default;
  DetectionCounts& operator+=(const DetectionCounts& other) {
    for (size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
    return *this;
  }

 private:
  static size_t Index(DetectionOutcome outcome) { return static_cast<size_t>(outcome) - 1; }

  std::array<uint64_t, kDetectionOutcomes.size()> counts_{};
};

}  // namespace rigcal
