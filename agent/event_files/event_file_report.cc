// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/event_files/event_file_info.h"
#include "agent/event_files/sensor_geometry.h"

namespace rigcal::agent {
namespace {

using Json = nlohmann::ordered_json;

void AppendLine(std::string* text, std::string_view what, const std::string& value) {
  absl::StrAppendFormat(text, "%-26s %s\n", std::string(what), value);
}

template <typename Visit>
void ForEachEdges(const EventFileInfo& info, Visit visit) {
  for (const auto& [channel, edges] : info.rising) visit(channel, "rising", edges);
  for (const auto& [channel, edges] : info.falling) visit(channel, "falling", edges);
}

void AppendGeometry(std::string* text, const EventFileInfo& info) {
  AppendLine(text, "geometry",
             info.header.geometry ? FormatSensorGeometry(*info.header.geometry)
                                  : absl::StrCat("not told; events reach column ", info.largest_x,
                                                 ", row ", info.largest_y));
  if (!info.extent) return;
  AppendLine(text, "  contradicted",
             absl::StrCat(info.faults.outside_geometry, " events are outside of it; all of them ",
                          "need ", FormatSensorGeometry(*info.extent),
                          " pixels: another sensor, or damaged words"));
}

Json GeometryJson(const std::optional<SensorGeometry>& geometry) {
  if (!geometry) return nullptr;
  return {{"width", geometry->width}, {"height", geometry->height}};
}

}  // namespace

std::string FormatInfo(const EventFileInfo& info) {
  std::string text;
  AppendLine(&text, "file", info.path);
  AppendLine(&text, "bytes", absl::StrCat(info.byte_count, ", header ", info.header.byte_count));
  AppendLine(&text, "format", info.header.format_name);
  if (info.header.format == EventFormat::kPlain) {
    AppendLine(&text, "  events", info.header.layout);
    AppendLine(&text, "  times in", TimeUnitName(info.header.time_unit));
  }
  AppendGeometry(&text, info);
  for (const auto& [key, value] : info.header.fields) {
    AppendLine(&text, absl::StrCat("  % ", key), value);
  }
  AppendLine(&text, "CD events",
             absl::StrCat(info.cd_events, ", ON ", info.on_events, ", OFF ", info.off_events()));
  AppendLine(&text, "sums", absl::StrCat("x ", info.sum_x, ", y ", info.sum_y));
  AppendLine(&text, "trigger events", absl::StrCat(info.trigger_events));
  ForEachEdges(info, [&](int channel, const char* edge, const TriggerEdges& edges) {
    std::string value =
        absl::StrCat(edges.count, ", ", edges.first_us, " to ", edges.last_us, " us");
    if (edges.longest_gap_us > 0) {
      absl::StrAppend(&value, ", ", edges.shortest_gap_us, " to ", edges.longest_gap_us,
                      " us apart");
    }
    AppendLine(&text, absl::StrCat("  channel ", channel, " ", edge), value);
  });
  if (info.first_us) {
    AppendLine(&text, "time", absl::StrCat(*info.first_us, " to ", *info.last_us, " us"));
    AppendLine(&text, "duration",
               absl::StrFormat("%.6f s", static_cast<double>(info.duration_us) / 1e6));
    AppendLine(&text, "rate", absl::StrFormat("%.3f Mev/s", info.events_per_s() / 1e6));
  }
  const bool is_clean = info.faults == EventFaults{} && info.refused.empty();
  AppendLine(&text, "faults", is_clean ? "none" : "");
  for (const EventFaultKind& kind : kEventFaultKinds) {
    if (info.faults.*kind.count == 0) continue;
    std::string value = absl::StrCat(info.faults.*kind.count);
    if (const auto first = info.first_faults.find(kind.name); first != info.first_faults.end()) {
      absl::StrAppend(&value, ", the first one at ", first->second);
    }
    AppendLine(&text, absl::StrCat("  ", kind.text), value);
  }
  for (const std::string& note : info.Notes()) AppendLine(&text, "note", note);
  for (const Refusal& refusal : info.refused) {
    AppendLine(&text, absl::StrCat("  ", std::string(NameOf(refusal.reason))),
               absl::StrCat(refusal.count, ", the first one ", refusal.example));
  }
  return text;
}

std::string InfoJson(const EventFileInfo& info) {
  Json json;
  json["file"] = info.path;
  json["bytes"] = info.byte_count;
  json["header_bytes"] = info.header.byte_count;
  json["format"] = info.header.format_name;
  if (info.header.format == EventFormat::kPlain) {
    json["layout"] = info.header.layout;
    json["time_unit"] = TimeUnitName(info.header.time_unit);
  }
  json["geometry"] = GeometryJson(info.header.geometry);
  json["extent_of_contradiction"] = GeometryJson(info.extent);
  json["header"] = info.header.fields;
  json["cd_events"] = info.cd_events;
  json["on_events"] = info.on_events;
  json["off_events"] = info.off_events();
  json["sum_x"] = info.sum_x;
  json["sum_y"] = info.sum_y;
  json["largest_x"] = info.largest_x;
  json["largest_y"] = info.largest_y;
  json["trigger_events"] = info.trigger_events;
  json["triggers"] = Json::array();
  ForEachEdges(info, [&json](int channel, const char* edge, const TriggerEdges& edges) {
    json["triggers"].push_back({{"channel", channel},
                                {"edge", edge},
                                {"count", edges.count},
                                {"first_us", edges.first_us},
                                {"last_us", edges.last_us},
                                {"shortest_gap_us", edges.shortest_gap_us},
                                {"longest_gap_us", edges.longest_gap_us}});
  });
  json["first_us"] = info.first_us ? Json(*info.first_us) : Json(nullptr);
  json["last_us"] = info.last_us ? Json(*info.last_us) : Json(nullptr);
  json["duration_us"] = info.duration_us;
  json["gaps"] = info.gaps;
  json["gap_us"] = info.gap_us;
  json["events_per_s"] = info.events_per_s();
  for (const EventFaultKind& kind : kEventFaultKinds) {
    json["faults"][kind.name] = info.faults.*kind.count;
  }
  json["first_faults"] = info.first_faults;
  json["notes"] = info.Notes();
  json["refused"] = Json::array();
  for (const Refusal& refusal : info.refused) {
    json["refused"].push_back({{"reason", NameOf(refusal.reason)},
                               {"count", refusal.count},
                               {"example", refusal.example}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace rigcal::agent
