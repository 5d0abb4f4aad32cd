// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_loss_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::agent {
namespace {

// Fewer may be chance.
constexpr uint64_t kFewGaps = 5, kFewWands = 20, kFewLooks = 3;
// Of the wands: where in a smaller share blinks are missed, something was before a marker.
constexpr double kFewShare = 0.2;

double Ratio(uint64_t part, uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

constexpr char kWhatToDo[] =
    "raise event_rate_limit or leave it out; have fewer events (raise the thresholds, close the "
    "aperture, take flickering lamps out of view); and where the sensor's refractory period is "
    "longer than the wand's light is on or off, shorten it or lower the wand's blink frequency";

std::string GapText(const BlinkWandCounts& counts) {
  return absl::StrFormat(
      "the stream has %d gaps, %.1f ms in all (%.1f %% of the time), in which no pixel sends an "
      "event while the scene is busy: data are lost between sensor and agent. The %d wands beside "
      "gaps have wider covariances. Use a USB port and cable of its own, a faster disk, or fewer "
      "events (raise the thresholds, close the aperture, set event_rate_limit)",
      counts.gaps, 1e-3 * static_cast<double>(counts.gap_us),
      100 * Ratio(counts.gap_us, counts.time_us), counts.beside_gap);
}

std::string ThinnedText(const BlinkWandCounts& counts) {
  return absl::StrFormat(
      "in %d of %d wands a part of the markers' pixels misses the light: %.0f %% answer, of a "
      "stream of %.1f Mev/s. The camera drops events (its rate control), or its pixels are blind "
      "for too long. Covariances are wider for it. What to do: %s",
      counts.thinned, counts.judged, Ratio(counts.answered_percent, counts.judged),
      Ratio(counts.events, counts.time_us), kWhatToDo);
}

std::string MissedText(const BlinkWandCounts& counts) {
  return absl::StrFormat(
      "pixels that blink as the wand does miss blinks, so that no wand is found: they answer about "
      "%.0f %%, of a stream of %.1f Mev/s. The camera drops events (its rate control), or its "
      "pixels are blind for too long. What to do: %s",
      Ratio(counts.missed_answered_percent, counts.missed_looks),
      Ratio(counts.events, counts.time_us), kWhatToDo);
}

}  // namespace

std::vector<std::string> EventLossReport::Take(const BlinkWandCounts& counts, bool is_end) {
  std::vector<std::string> said;
  const auto is_due = [is_end](uint64_t count, uint64_t said_before) {
    return is_end ? count != said_before : said_before == 0;
  };
  if (counts.gaps >= kFewGaps && is_due(counts.gaps, said_gaps_)) {
    said.push_back(GapText(counts));
    said_gaps_ = counts.gaps;
  }
  const bool is_thinned =
      counts.thinned >= kFewWands && Ratio(counts.thinned, counts.judged) > kFewShare;
  const bool is_missed = counts.missed_looks >= kFewLooks;
  const uint64_t missing = counts.thinned + counts.missed_looks;
  if ((is_thinned || is_missed) && is_due(missing, said_missing_)) {
    said.push_back(is_thinned ? ThinnedText(counts) : MissedText(counts));
    said_missing_ = missing;
  }
  return said;
}

}  // namespace rigcal::agent
