// SPDX-License-Identifier: Apache-2.0
#include "server/associate/light_clocks.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

// Between two readings of a camera the wand was on all the time if they are no longer apart.
constexpr double kGapS = 30;
// So far from the nearest reading a clock is still related, with the error of a wand's clock.
constexpr double kBeyondS = 20, kWandRateSigma = 0.02;
constexpr double kSameS = 0.06;  // two readings of one pair of clocks that say the same
constexpr double kAgreeS = 0.02;
constexpr double kMostContradicting = 0.1;               // of the readings of a clock
constexpr double kWrongRate = 0.005, kMostDrift = 0.05;  // of a wand's clock

// Of one clock epoch and wand.
struct Readings {
  std::string camera;                // one that has the clock
  std::vector<ClockSample> samples;  // by the camera's time
};

double SinceS(int64_t from_ns, int64_t to_ns) {
  return 1e-9 * (static_cast<double>(to_ns) - static_cast<double>(from_ns));
}

struct ReadTime {
  int64_t device_ns = 0;
  double sigma_s = 0;
};

// Every time of the clock at which the wand's was `wand_ns`: several, where it was restarted.
std::vector<ReadTime> TimesAt(const std::vector<ClockSample>& samples, int64_t wand_ns) {
  std::vector<ReadTime> times;
  std::optional<ReadTime> beyond;
  double least_s = kBeyondS;
  for (size_t i = 0; i < samples.size(); ++i) {
    const ClockSample& at = samples[i];
    const double after_s = SinceS(at.light_ns, wand_ns);
    if (std::abs(after_s) < least_s) {
      least_s = std::abs(after_s);
      beyond = ReadTime{at.device_ns + (wand_ns - at.light_ns),
                        1e-9 * at.uncertainty_ns + kWandRateSigma * least_s};
    }
    if (i + 1 == samples.size()) break;
    const ClockSample& next = samples[i + 1];
    const double wand_s = SinceS(at.light_ns, next.light_ns);
    const double device_s = SinceS(at.device_ns, next.device_ns);
    if (!(wand_s > 0) || wand_s > kGapS || after_s < 0 || after_s > wand_s) continue;
    if (!(device_s > 0) || device_s > kGapS + wand_s) continue;
    times.push_back({at.device_ns + std::llround(1e9 * device_s * after_s / wand_s),
                     1e-9 * std::max(at.uncertainty_ns, next.uncertainty_ns)});
  }
  if (times.empty() && beyond) times.push_back(*beyond);
  return times;
}

struct Relation {
  int64_t offset_ns = 0;  // time of a minus time of b
  double sigma_s = 0;
  int agreeing = 0, contradicting = 0;  // readings of b
};

std::optional<Relation> Relate(const Readings& a, const Readings& b) {
  struct Difference {
    int64_t value_ns;
    double sigma_s;
    size_t reading;
  };
  std::vector<Difference> all;
  for (size_t i = 0; i < b.samples.size(); ++i) {
    const ClockSample& sample = b.samples[i];
    for (const ReadTime& time : TimesAt(a.samples, sample.light_ns)) {
      all.push_back({time.device_ns - sample.device_ns,
                     std::hypot(time.sigma_s, 1e-9 * sample.uncertainty_ns), i});
    }
  }
  if (all.empty()) return std::nullopt;
  std::ranges::sort(all, {}, [](const Difference& d) { return std::pair(d.value_ns, d.reading); });
  // The most that say the same.
  size_t first = 0, best_first = 0, best_end = 0;
  for (size_t end = 1; end <= all.size(); ++end) {
    const auto width_s = [&](size_t from) {
      return SinceS(all[from].value_ns, all[end - 1].value_ns);
    };
    while (width_s(first) > kSameS + 3 * (all[first].sigma_s + all[end - 1].sigma_s)) ++first;
    if (end - first > best_end - best_first) best_first = first, best_end = end;
  }
  std::set<size_t> agreeing, compared;
  for (const Difference& difference : all) compared.insert(difference.reading);
  double sigma_s = 0;
  for (size_t i = best_first; i < best_end; ++i) {
    agreeing.insert(all[i].reading);
    sigma_s = std::max(sigma_s, all[i].sigma_s);
  }
  const int contradicting = static_cast<int>(compared.size() - agreeing.size());
  return Relation{all[best_first + (best_end - best_first) / 2].value_ns, sigma_s,
                  static_cast<int>(agreeing.size()), contradicting};
}

// Seconds of the wand per second of the camera, of the longest stretch without a restart; none
// where that is not known to a third of kWrongRate.
std::optional<double> RateOf(const Readings& readings) {
  const std::vector<ClockSample>& samples = readings.samples;
  std::optional<double> rate;
  double longest_s = 0;
  for (size_t first = 0, i = 1; i < samples.size(); ++i) {
    const double step_s = SinceS(samples[i - 1].device_ns, samples[i].device_ns);
    const double wand_step_s = SinceS(samples[i - 1].light_ns, samples[i].light_ns);
    if (!(step_s > 0) || step_s > kGapS || std::abs(wand_step_s - step_s) > kMostDrift * kGapS) {
      first = i;
      continue;
    }
    const ClockSample &a = samples[first], &b = samples[i];
    const double device_s = SinceS(a.device_ns, b.device_ns);
    const double sigma_s = 1e-9 * std::hypot(a.uncertainty_ns, b.uncertainty_ns);
    if (device_s <= longest_s || 3 * sigma_s > kWrongRate * device_s) continue;
    longest_s = device_s;
    rate = SinceS(a.light_ns, b.light_ns) / device_s;
  }
  return rate;
}

// By wand, then by clock epoch.
using ReadingsOfSession = std::map<uint32_t, std::map<ClockKey, Readings>>;

class SessionLights {
 public:
  SessionLights(const std::string& session_id, const ReadingsOfSession& readings,
                std::map<ClockKey, ClockOffset>* known, std::vector<StampFault>* faults)
      : session_id_(session_id), readings_(readings), known_(*known), faults_(faults) {}

  void Relate() {
    for (const auto& [wand, clocks] : readings_) RelateClocks(wand, clocks);
    NoteDifferentWands();
  }

 private:
  void RelateClocks(uint32_t wand, const std::map<ClockKey, Readings>& clocks) {
    NoteRate(wand, clocks);
    if (clocks.size() < 2) return;
    // A clock that is known otherwise keeps all others where they would have been.
    const auto reference = std::ranges::max_element(clocks, {}, [&](const auto& clock) {
      return std::pair(known_.contains(clock.first), clock.second.samples.size());
    });
    ClockOffset& base = known_[reference->first];
    base.wand = wand;
    for (const auto& [key, readings] : clocks) {
      if (key == reference->first) continue;
      const std::optional<Relation> relation = rigcal::server::Relate(reference->second, readings);
      if (!relation) continue;
      const int all = relation->agreeing + relation->contradicting;
      if (relation->contradicting > kMostContradicting * all) {
        NoteContradiction(wand, readings, reference->second, relation->contradicting, all);
        continue;
      }
      const auto before = known_.find(key);
      const int64_t offset_ns = base.offset_ns + relation->offset_ns;
      if (before != known_.end() &&
          std::abs(SinceS(before->second.offset_ns, offset_ns)) <= kAgreeS) {
        before->second.wand = wand;
        continue;
      }
      NoteSet(wand, readings, before == known_.end() ? 0 : before->second.offset_ns, offset_ns);
      known_[key] = {offset_ns, relation->sigma_s, wand};
    }
  }

  void Note(StampFault::Kind kind, const std::string& camera, double size, std::string what) {
    if (faults_ == nullptr) return;
    faults_->push_back({kind, session_id_, camera, size, std::move(what)});
  }

  void NoteSet(uint32_t wand, const Readings& readings, int64_t before_ns, int64_t after_ns) {
    Note(StampFault::Kind::kSetByLight, readings.camera, SinceS(before_ns, after_ns),
         absl::StrFormat(
             "its clock was set by the light code of wand %d, which it has read %d times",
             static_cast<int>(wand), readings.samples.size()));
  }

  void NoteContradiction(uint32_t wand, const Readings& readings, const Readings& reference,
                         int contradicting, int all) {
    Note(StampFault::Kind::kLightContradicts, readings.camera, 100.0 * contradicting / all,
         absl::StrFormat(
             "%d of its %d readings of the light code of wand %d contradict those of camera %s: "
             "there are two wands with this number, or the wand was restarted. Its clock was not "
             "set by the code; give each wand a number of its own (code N)",
             contradicting, all, static_cast<int>(wand), reference.camera));
  }

  void NoteRate(uint32_t wand, const std::map<ClockKey, Readings>& clocks) {
    std::vector<double> rates;
    for (const auto& [key, readings] : clocks) {
      if (const auto rate = RateOf(readings)) rates.push_back(*rate);
    }
    if (rates.empty()) return;
    const double rate = LowerMedian(std::move(rates));
    if (std::abs(rate - 1) < kWrongRate) return;
    Note(StampFault::Kind::kWandRate, "", 100 * (rate - 1),
         absl::StrFormat(
             "the clock of wand %d runs %.1f %% %s against those of the cameras: a wand "
             "without a crystal whose battery sags, or cameras whose stamps do not count "
             "seconds. The code was followed",
             static_cast<int>(wand), 100 * std::abs(rate - 1), rate < 1 ? "slow" : "fast"));
  }

  // Clocks that have read different wands only are not related by them.
  void NoteDifferentWands() {
    std::map<std::string, std::set<uint32_t>> wands;  // by camera
    std::map<uint32_t, size_t> cameras;
    for (const auto& [wand, clocks] : readings_) {
      for (const auto& [key, readings] : clocks) wands[readings.camera].insert(wand);
      cameras[wand] = clocks.size();
    }
    if (cameras.size() < 2) return;
    const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
    const auto [most, count] = *std::ranges::max_element(cameras, fewer);
    const bool is_majority = std::ranges::count_if(cameras, [count = count](const auto& wand) {
                               return wand.second == count;
                             }) == 1;
    std::vector<std::string> all;
    for (const auto& [camera, read] : wands) {
      all.push_back(absl::StrCat(camera, ": ", absl::StrJoin(read, ", ")));
    }
    for (const auto& [camera, read] : wands) {
      if (is_majority && read.size() == 1 && read.contains(most)) continue;
      Note(StampFault::Kind::kOtherWand, camera, static_cast<double>(*read.rbegin()),
           absl::StrCat("cameras have read the light codes of different wands (",
                        absl::StrJoin(all, "; "),
                        "): wave one wand at a time, and switch the others off"));
    }
  }

  const std::string& session_id_;
  const ReadingsOfSession& readings_;
  std::map<ClockKey, ClockOffset>& known_;
  std::vector<StampFault>* faults_;
};

}  // namespace

void RelateByLight(const std::vector<CameraTrack>& tracks, std::map<ClockKey, ClockOffset>* known,
                   std::vector<StampFault>* faults) {
  std::map<std::string, ReadingsOfSession> sessions;
  for (const CameraTrack& track : tracks) {
    for (const CameraTrack::EpochSample& sample : track.clock_samples) {
      if (!sample.sample.IsOfWand()) continue;
      Readings& readings = sessions[track.session_id][sample.sample.light][{
          track.session_id, track.camera.clock.clock_id, sample.clock_epoch}];
      readings.camera = track.camera.camera;
      readings.samples.push_back(sample.sample);
    }
  }
  for (auto& [session_id, wands] : sessions) {
    for (auto& [wand, clocks] : wands) {
      for (auto& [key, readings] : clocks) {
        std::ranges::sort(readings.samples, {}, [](const ClockSample& sample) {
          return std::pair(sample.device_ns, sample.light_ns);
        });
      }
    }
    SessionLights(session_id, wands, known, faults).Relate();
  }
}

}  // namespace rigcal::server
