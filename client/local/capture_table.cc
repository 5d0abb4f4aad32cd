// SPDX-License-Identifier: Apache-2.0
#include "client/local/capture_table.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>

#include "absl/strings/str_cat.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

constexpr size_t kLineColumns = 79;

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
  return absl::StrCat(head, " ", FormatCount(session.observation_count(), "observation"), ", ",
                      complete, " of ", session.cameras_size(), " cameras complete");
}

std::string FormatCapture(const LocalOutcome& outcome, double duration_s) {
  std::map<std::string, uint32_t> used;
  for (const v1::CalibratedCamera& camera : outcome.calibration.cameras()) {
    used[camera.camera()] = camera.residuals().observation_count();
  }
  TextTable table;
  table.Words({"camera", "sensor"}).Numbers({"observations"});
  if (duration_s > 0) table.Numbers({"per second"});
  const bool is_board = !outcome.session.target().board().empty();
  table.Numbers({is_board ? "with board" : "with wand", "in the calibration"});
  for (const v1::SessionCamera& camera : outcome.session.cameras()) {
    const v1::CameraDescription& description = camera.description();
    const bool has_sensor = description.sensor() != v1::CameraDescription::SENSOR_UNSPECIFIED;
    const std::string& name = description.camera();
    std::vector<TextTable::Cell> cells = {name, has_sensor ? EnumWord(description.sensor()) : "-",
                                          camera.observation_count()};
    if (duration_s > 0) {
      cells.push_back(FormatFixed(static_cast<double>(camera.observation_count()) / duration_s, 1));
    }
    cells.push_back(camera.wand_count());
    cells.push_back(used.contains(name) ? absl::StrCat(used[name]) : "-");
    table.AddRow(cells);
  }
  std::string head = "Captured";
  if (duration_s > 0) {
    absl::StrAppend(&head, " ", FormatFixed(duration_s, 1), " s of waving in ",
                    FormatDuration(outcome.capture_s), ", one agent for each camera");
  }
  return absl::StrCat(head, "\n", table.Format(2), "\n");
}

}  // namespace rigcal::client
