// SPDX-License-Identifier: Apache-2.0
#include "agent/command/detection_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

void AppendCount(std::string* text, std::string_view what, uint64_t count, uint64_t of) {
  const double percent = of > 0 ? 100.0 * static_cast<double>(count) / static_cast<double>(of) : 0;
  absl::StrAppendFormat(text, "  %-28s %8d  %6.2f %%\n", std::string(what), count, percent);
}

void AppendTimes(std::string* text, std::string_view what, const Durations& times) {
  absl::StrAppendFormat(text, "  %-28s %8.2f  %8.2f  %8.2f\n", std::string(what), times.MeanMs(),
                        times.QuantileMs(0.5), times.QuantileMs(0.95));
}

nlohmann::json TimesJson(const Durations& times) {
  return {
      {"mean", times.MeanMs()}, {"median", times.QuantileMs(0.5)}, {"p95", times.QuantileMs(0.95)}};
}

}  // namespace

double Durations::MeanMs() const {
  if (seconds_.empty()) return 0;
  return 1e3 * std::accumulate(seconds_.begin(), seconds_.end(), 0.0) /
         static_cast<double>(seconds_.size());
}

double Durations::QuantileMs(double share) const {
  if (seconds_.empty()) return 0;
  std::vector<double> reordered = seconds_;
  return 1e3 * NearestQuantile(&reordered, std::clamp(share, 0.0, 1.0));
}

uint64_t DetectionReport::looked_at() const {
  uint64_t count = 0;
  for (const DetectionOutcome outcome : kDetectionOutcomes) count += detections.Of(outcome);
  return count;
}

double DetectionReport::detection_rate() const {
  const uint64_t count = looked_at();
  return count > 0 ? static_cast<double>(detections.Of(DetectionOutcome::kWand)) /
                         static_cast<double>(count)
                   : 0;
}

double DetectionReport::frames_per_s() const {
  return wall_s > 0 ? static_cast<double>(frames.received) / wall_s : 0;
}

std::string FormatReport(const DetectionReport& report) {
  const uint64_t looked_at = report.looked_at();
  std::string text = absl::StrFormat("%-30s %8d\n", "frames searched", looked_at);
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    const uint64_t count = report.detections.Of(outcome);
    if (count == 0 && outcome != DetectionOutcome::kWand) continue;
    AppendCount(&text, DetectionOutcomeText(outcome), count, looked_at);
  }
  AppendCount(&text, "found by tracking", report.tracked, looked_at);
  if (report.cut_short > 0) AppendCount(&text, "search cut short", report.cut_short, looked_at);
  if (!report.centres.empty()) {
    absl::StrAppendFormat(&text, "%-30s %8s\n", "centres (csv:PATH;centres=...)", report.centres);
  }
  if (report.learning > 0) {
    absl::StrAppendFormat(&text, "%-30s %8d\n", "frames for the mask only", report.learning);
  }
  if (report.frames.damaged + report.frames.lost > 0) {
    absl::StrAppendFormat(&text, "%-30s %8d\n", "frames damaged, not used", report.frames.damaged);
    absl::StrAppendFormat(&text, "%-30s %8d\n", "frames lost", report.frames.lost);
  }
  absl::StrAppendFormat(&text, "%-30s %8s  %8s  %8s\n", "ms per frame", "mean", "median", "p95");
  AppendTimes(&text, "reading", report.reading);
  AppendTimes(&text, "detecting", report.detecting);
  absl::StrAppendFormat(&text, "%-30s %8.1f\n", "frames/s, in total", report.frames_per_s());
  const std::string crowded = CrowdedText(report.passed_share, report.white_share, report.exposure);
  if (!crowded.empty()) absl::StrAppend(&text, crowded, "\n");
  if (report.background_share > 0) {
    absl::StrAppendFormat(&text,
                          "%.2g %% of the picture has the wand's colour, does not move and is "
                          "ignored (background=0: no)\n",
                          100 * report.background_share);
  }
  for (const Refusal& refusal : report.refused) {
    absl::StrAppend(&text, std::string(NameOf(refusal.reason)), " x ", refusal.count,
                    ", first: ", refusal.example, "\n");
  }
  return text;
}

std::string ReportJson(const DetectionReport& report) {
  nlohmann::ordered_json json;
  json["pictures"] = report.looked_at();
  json["damaged"] = report.frames.damaged;
  json["lost"] = report.frames.lost;
  json["learning"] = report.learning;
  json["outcomes"] = nlohmann::ordered_json::object();
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    const std::string word =
        absl::StrReplaceAll(std::string(DetectionOutcomeText(outcome)), {{" ", "_"}});
    json["outcomes"][word] = report.detections.Of(outcome);
  }
  json["detection_rate"] = report.detection_rate();
  json["tracked"] = report.tracked;
  json["centres"] = report.centres;
  json["refused"] = nlohmann::ordered_json::array();
  for (const Refusal& refusal : report.refused) {
    json["refused"].push_back({{"reason", NameOf(refusal.reason)},
                               {"count", refusal.count},
                               {"example", refusal.example}});
  }
  json["reading_ms"] = TimesJson(report.reading);
  json["detecting_ms"] = TimesJson(report.detecting);
  json["pictures_per_s"] = report.frames_per_s();
  json["cut_short"] = report.cut_short;
  json["passed_share"] = report.passed_share;
  json["white_share"] = report.white_share;
  json["background_share"] = report.background_share;
  json["resting_wands"] = report.resting_wands;
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace rigcal::agent
