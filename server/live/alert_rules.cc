// SPDX-License-Identifier: Apache-2.0
#include "server/live/alert_rules.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

using std::chrono::milliseconds;

constexpr double kNeverSeenS = 7;       // of waving; with the time to be raised below 10 s
constexpr double kNotSeenLatelyS = 25;  // of waving
constexpr double kSilentS = 3;
constexpr double kLowRateShare = 0.6;
constexpr double kSettledS = 5;
constexpr double kTwoWandsShare = 0.15;
constexpr double kAmbiguousShare = 0.2;
constexpr double kImplausibleShare = 0.35;
constexpr double kDarkShare = 0.5;
// While waving, offsets are searched up to this (server/solve/clocks/time_search.cc).
constexpr double kSearchedOffsetS = 1.0;
constexpr uint64_t kLowDiskBytes = uint64_t{2} << 30;

std::string Percent(double share) { return absl::StrFormat("%.0f %%", 100 * share); }

class Conditions {
 public:
  explicit Conditions(std::string camera) : camera_(std::move(camera)) {}

  void Add(std::string_view kind, AlertSeverity severity, std::string text,
           milliseconds raise_after = milliseconds(1000)) {
    list_.push_back({.kind = kind,
                     .severity = severity,
                     .camera = camera_,
                     .text = std::move(text),
                     .raise_after = raise_after});
  }
  std::vector<AlertCondition> Take() { return std::move(list_); }

 private:
  const std::string camera_;
  std::vector<AlertCondition> list_;
};

void AddWand(const CameraFacts& facts, Conditions* conditions) {
  if (!facts.saw_wand && facts.unseen_waving_s >= kNeverSeenS) {
    conditions->Add("no_wand", AlertSeverity::kError,
                    facts.dark_share > kDarkShare
                        ? absl::StrCat(facts.camera,
                                       " has not seen the wand while others did: most of its "
                                       "images are black or saturated; look at lens cap, exposure "
                                       "and lighting")
                        : absl::StrCat(facts.camera,
                                       " has not seen the wand while others did; wave in front of "
                                       "it, or look at its preview, exposure and thresholds"),
                    milliseconds(500));
  } else if (facts.unseen_waving_s >= kNotSeenLatelyS) {
    conditions->Add("no_wand", AlertSeverity::kInfo,
                    absl::StrCat(facts.camera,
                                 " has not seen the wand for a while; wave in front of it again"));
  }
  if (facts.jumping_share > kTwoWandsShare || facts.ambiguous_share > kAmbiguousShare) {
    conditions->Add(
        "two_wands", AlertSeverity::kWarning,
        facts.jumping_share > kTwoWandsShare
            ? absl::StrCat(facts.camera, " sees the wand jump to and fro (in ",
                           Percent(facts.jumping_share),
                           " of its rows): a second wand, a reflection or a lamp is in its view; "
                           "cover it, or mask it (rigcal-agent mask)")
            : absl::StrCat(facts.camera, " finds several wands in ", Percent(facts.ambiguous_share),
                           " of its images; cover the others and reflections, or mask them "
                           "(rigcal-agent mask)"),
        milliseconds(1500));
  }
  if (facts.implausible_share > kImplausibleShare) {
    conditions->Add("implausible_labels", AlertSeverity::kWarning,
                    absl::StrCat("the markers that ", facts.camera,
                                 " sees do not fit the wand (in ", Percent(facts.implausible_share),
                                 " of its rows); compare the target's positions with the wand, and "
                                 "look for other lights"),
                    milliseconds(1500));
  }
}

void AddClock(const CameraFacts& facts, Conditions* conditions) {
  if (!facts.clock_jump.empty() || facts.clock_epoch_count > 1) {
    conditions->Add(
        "clock_jumped", AlertSeverity::kWarning,
        facts.clock_jump.empty()
            ? absl::StrCat(
                  "the clock of ", facts.camera, " went back; it has ", facts.clock_epoch_count,
                  " epochs now, of which a calibration may use one only; do not set clocks "
                  "or reconnect cameras while you wave")
            : absl::StrCat(facts.camera, ": ", facts.clock_jump,
                           "; do not set clocks while you wave"),
        milliseconds(0));
  }
  const auto beyond = [](const std::optional<double>& offset_s) {
    return offset_s && std::abs(*offset_s) > kSearchedOffsetS;
  };
  if (beyond(facts.estimated_offset_s) || beyond(facts.arrival_offset_s)) {
    const double offset_s =
        beyond(facts.estimated_offset_s) ? *facts.estimated_offset_s : *facts.arrival_offset_s;
    conditions->Add(
        "clock_off", AlertSeverity::kWarning,
        absl::StrFormat(
            "the clock of %s is %+.1f s off from the others: the estimate while you wave searches "
            "%.0f s only and leaves the camera out; the calibration finds any offset. To see its "
            "figures now, set the clocks of the PCs (NTP, PTP) and start the agent again",
            facts.camera, offset_s, kSearchedOffsetS),
        milliseconds(1500));
  }
}

void AddDelivery(const CameraFacts& facts, Conditions* conditions) {
  const bool by_agent = !facts.agent_id.empty();
  if (by_agent && !facts.agent_connected) {
    conditions->Add("agent_lost", AlertSeverity::kError,
                    absl::StrCat("agent ", facts.agent_id, " of ", facts.camera,
                                 " is not connected; what it captures is kept in its spool: look "
                                 "at its PC and the network"));
  } else if (by_agent && facts.silent_s > kSilentS) {
    conditions->Add("no_data", AlertSeverity::kError,
                    absl::StrCat(facts.camera,
                                 " sends nothing though its agent is connected; look at the "
                                 "camera's cable and trigger, and at the agent's log"),
                    milliseconds(500));
  } else if (facts.seconds_of_rows > kSettledS && facts.usual_rate_hz > 0 &&
             facts.rate_hz < kLowRateShare * facts.usual_rate_hz) {
    conditions->Add(
        "rate_low", AlertSeverity::kWarning,
        absl::StrFormat("%s delivers %.0f observations a second, before %.0f; its PC or "
                        "its network is too slow, or frames are missing",
                        facts.camera, facts.rate_hz, facts.usual_rate_hz),
        milliseconds(2000));
  }
  if (facts.backlog_grows) {
    conditions->Add(
        "backlog_growing", AlertSeverity::kWarning,
        absl::StrCat(facts.backlog_count,
                     facts.backlog_count == 1 ? " observation of " : " observations of ",
                     facts.camera, facts.backlog_count == 1 ? " waits" : " wait",
                     " at its agent, and more each second; nothing is lost, but "
                     "the state shown is old: look at the network"));
  }
  if (facts.dropped_lately > 0) {
    conditions->Add(
        "dropping", AlertSeverity::kError,
        absl::StrCat("observations of ", facts.camera, " are being lost at its agent (",
                     facts.dropped_lately, " in 10 s): its spool is full, or its disk fails"),
        milliseconds(0));
  }
  if (facts.refused_lately > 0) {
    conditions->Add(
        "refused", AlertSeverity::kWarning,
        absl::StrCat(facts.refused_lately,
                     facts.refused_lately == 1 ? " observation of " : " observations of ",
                     facts.camera, facts.refused_lately == 1 ? " was" : " were",
                     " refused in 10 s; `rigcal session get` says why"),
        milliseconds(0));
  }
}

void AddLens(const CameraFacts& facts, Conditions* conditions) {
  if (!facts.lens_disagrees) return;
  conditions->Add("lens_wrong", AlertSeverity::kInfo,
                  absl::StrCat("the lens of ", facts.camera,
                               " does not match its description (focal length, centre or "
                               "distortion); it is estimated from the wave, which takes longer: "
                               "reach all of its image"),
                  milliseconds(3000));
}

}  // namespace

std::vector<AlertCondition> CameraConditions(const CameraFacts& facts) {
  Conditions conditions(facts.camera);
  if (!facts.ended) {
    AddDelivery(facts, &conditions);
    AddWand(facts, &conditions);
  }
  AddClock(facts, &conditions);
  AddLens(facts, &conditions);
  return conditions.Take();
}

std::vector<AlertCondition> MonitorConditions(const LiveMonitor& monitor) {
  std::vector<AlertCondition> list;
  if (monitor.mode == MonitorMode::kOff) return list;
  // Looks come seconds apart and are no noise: what they say is shown at once.
  const auto add = [&list](std::string_view kind, AlertSeverity severity, const std::string& camera,
                           std::string text) {
    list.push_back({.kind = kind,
                    .severity = severity,
                    .camera = camera,
                    .text = std::move(text),
                    .raise_after = milliseconds(0)});
  };
  if (monitor.all_moved) add("camera_moved", AlertSeverity::kWarning, "", monitor.problem);
  for (const LiveMonitoredCamera& camera : monitor.cameras) {
    if (camera.verdict == MonitorVerdict::kMoved) {
      add("camera_moved", AlertSeverity::kWarning, camera.camera,
          absl::StrFormat(
              "%s has moved against calibration %s: %.2f mm and %.3f degrees, %.1f px at the "
              "middle of the volume (%.0f sigma); %s",
              camera.camera, monitor.calibration_id, 1e3 * camera.translation_m,
              camera.rotation_rad * 180 / M_PI, camera.centre_px, camera.sigmas,
              monitor.mode == MonitorMode::kRepair
                  ? "it is repaired when the session has finished"
                  : absl::StrCat("repair: rigcal calibrate ", monitor.session_id, " --only ",
                                 camera.camera, " --activate")));
    }
    if (camera.clock_changed) {
      add("clock_changed", AlertSeverity::kWarning, camera.camera,
          absl::StrFormat("the clock of %s has moved by %+.2f ms (+- %.2f) against the others "
                          "within the session (%+.0f ppm): it has stepped or drifts; look at "
                          "NTP, PTP and triggers",
                          camera.camera, 1e3 * camera.clock_change_s,
                          1e3 * camera.clock_change_sigma_s, camera.clock_change_ppm));
    }
  }
  if (monitor.repair == MonitorRepairState::kActive) {
    add("repair", AlertSeverity::kInfo, "", monitor.repair_text);
  } else if (monitor.repair == MonitorRepairState::kNotActive) {
    add("repair", AlertSeverity::kWarning, "", monitor.repair_text);
  }
  return list;
}

std::vector<AlertCondition> RigConditions(const RigFacts& facts) {
  Conditions conditions("");
  if (!facts.store_problem.empty()) {
    conditions.Add("not_storing", AlertSeverity::kError,
                   absl::StrCat("the server stores nothing: ", facts.store_problem),
                   milliseconds(0));
  } else if (facts.disk_known && facts.disk_free_bytes < facts.disk_reserve_bytes + kLowDiskBytes) {
    conditions.Add(
        "disk_low", AlertSeverity::kWarning,
        absl::StrCat("the server's disk has ", facts.disk_free_bytes >> 20, " MiB left; below ",
                     facts.disk_reserve_bytes >> 20, " MiB it takes no observations: make room"));
  }
  if (facts.capturing && facts.estimate == EstimateState::kFailed) {
    conditions.Add("estimate_failed", AlertSeverity::kWarning,
                   absl::StrCat("the running estimate fails: ", facts.estimate_problem),
                   milliseconds(3000));
  }
  return conditions.Take();
}

}  // namespace rigcal::server
