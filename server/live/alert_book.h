// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/live/live_state.h"

namespace rigcal::server {

// Something that holds now and may become an alert.
struct AlertCondition {
  std::string_view kind;  // one of kAlertKinds (alert_rules.h)
  AlertSeverity severity = AlertSeverity::kInfo;
  std::string camera = {};  // empty: the rig or the server
  std::string text = {};
  std::chrono::milliseconds raise_after{1000};  // it must hold for so long
};

// Makes alerts of conditions so that none flickers: a condition must hold for a while before it is
// shown, is shown for at least 5 s after it last held, and its words change at most every 2 s.
class AlertBook {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr size_t kMaxAlerts = 64;

  // The alerts to be shown now, worst first, at most kMaxAlerts.
  std::vector<LiveAlert> Update(std::vector<AlertCondition> conditions, Time now,
                                int64_t now_utc_ns);
  void Clear() { entries_.clear(); }

 private:
  struct Entry {
    LiveAlert alert;
    Time first;
    Time last;
    Time text_time;
    bool shown = false;
  };
  std::map<std::pair<std::string, std::string>, Entry> entries_;  // by kind and camera
};

}  // namespace rigcal::server
