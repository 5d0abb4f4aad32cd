// SPDX-License-Identifier: Apache-2.0
#include "client/local/capture_table.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

using Align = TextTable::Align;

constexpr size_t kLineColumns = 79;

const char* SensorName(v1::CameraDescription::Sensor sensor) {
  switch (sensor) {
    case v1::CameraDescription::SENSOR_FRAME:
      return "frame";
    case v1::CameraDescription::SENSOR_EVENT:
      return "event";
    default:
      return "-";
  }
}

// " 43 %", or nothing.
std::string ShareText(const v1::Session& session, const std::vector<LocalCamera>& cameras) {
  std::map<std::string, uint64_t> delivered;
  for (const v1::SessionCamera& camera : session.cameras()) {
    delivered[camera.description().camera()] = camera.observation_count();
  }
  uint64_t seen = 0, expected = 0;
  for (const LocalCamera& camera : cameras) {
    if (camera.expected_count == 0) return "";
    expected += camera.expected_count;
    seen += std::min(camera.expected_count, delivered[camera.name]);
  }
  return expected == 0 ? "" : absl::StrCat(" ", 100 * seen / expected, " %");
}

}  // namespace

std::string FormatCaptureProgress(const v1::Session& session,
                                  const std::vector<LocalCamera>& cameras) {
  const std::string head = absl::StrCat("capturing", ShareText(session, cameras), ":");
  std::string each = head;
  int complete = 0;
  for (const v1::SessionCamera& camera : session.cameras()) {
    complete += camera.ended() ? 1 : 0;
    absl::StrAppend(&each, " ", camera.description().camera(), " ", camera.observation_count());
  }
  if (session.cameras_size() > 0 && each.size() <= kLineColumns) return each;
  return absl::StrCat(head, " ",
                      FormatCount(session.observation_count(), "observation", "observations"), ", ",
                      complete, " of ", session.cameras_size(), " cameras complete");
}

std::string FormatCapture(const LocalOutcome& outcome, double duration_s) {
  std::map<std::string, uint32_t> used;
  for (const v1::CalibratedCamera& camera : outcome.calibration.cameras()) {
    used[camera.camera()] = camera.residuals().observation_count();
  }
  std::vector<TextTable::Column> columns = {
      {"camera"}, {"sensor"}, {"observations", Align::kRight}};
  if (duration_s > 0) columns.push_back({"per second", Align::kRight});
  columns.push_back({"with wand", Align::kRight});
  columns.push_back({"in the calibration", Align::kRight});
  TextTable table(columns);
  for (const v1::SessionCamera& camera : outcome.session.cameras()) {
    const std::string& name = camera.description().camera();
    std::vector<std::string> cells = {name, SensorName(camera.description().sensor()),
                                      absl::StrCat(camera.observation_count())};
    if (duration_s > 0)
      cells.push_back(FormatFixed(static_cast<double>(camera.observation_count()) / duration_s, 1));
    cells.push_back(absl::StrCat(camera.wand_count()));
    cells.push_back(used.contains(name) ? absl::StrCat(used[name]) : "-");
    table.AddRow(std::move(cells));
  }
  std::string head = "Captured";
  if (duration_s > 0) {
    absl::StrAppend(&head, " ", FormatFixed(duration_s, 1), " s of waving in ",
                    FormatDuration(outcome.capture_s), ", one agent for each camera");
  }
  return absl::StrCat(head, "\n", table.Format(2), "\n");
}

}  // namespace rigcal::client
