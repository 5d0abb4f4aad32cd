// SPDX-License-Identifier: Apache-2.0
#include "server/live/alert_book.h"

#include <algorithm>
#include <tuple>

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kHold{5};
constexpr std::chrono::seconds kTextInterval{2};
// A condition that is away for less than this has held all the time.
constexpr std::chrono::milliseconds kGap{1000};

}  // namespace

std::vector<LiveAlert> AlertBook::Update(std::vector<AlertCondition> conditions, Time now,
                                         int64_t now_utc_ns) {
  for (AlertCondition& condition : conditions) {
    const auto [found, inserted] =
        entries_.try_emplace({std::string(condition.kind), condition.camera});
    Entry& entry = found->second;
    if (inserted || (!entry.shown && now - entry.last > kGap)) {
      entry.first = now;
      entry.alert.kind = condition.kind;
      entry.alert.camera = condition.camera;
      entry.alert.since_utc_ns = now_utc_ns;
    }
    entry.last = now;
    const bool worse = condition.severity > entry.alert.severity;
    if (!entry.shown || worse || now - entry.text_time >= kTextInterval) {
      if (entry.alert.text != condition.text || entry.alert.severity != condition.severity) {
        entry.alert.text = std::move(condition.text);
        entry.alert.severity = condition.severity;
        entry.text_time = now;
      }
    }
    if (now - entry.first >= condition.raise_after) entry.shown = true;
  }
  std::erase_if(entries_, [&](const auto& item) {
    return now - item.second.last >=
           (item.second.shown ? kHold : std::chrono::seconds(kGap.count() / 1000));
  });

  std::vector<LiveAlert> alerts;
  for (const auto& [key, entry] : entries_) {
    if (entry.shown) alerts.push_back(entry.alert);
  }
  std::ranges::stable_sort(alerts, [](const LiveAlert& a, const LiveAlert& b) {
    return std::tie(b.severity, a.kind, a.camera) < std::tie(a.severity, b.kind, b.camera);
  });
  if (alerts.size() > kMaxAlerts) alerts.resize(kMaxAlerts);
  return alerts;
}

}  // namespace rigcal::server
