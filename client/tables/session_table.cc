// SPDX-License-Identifier: Apache-2.0
#include "client/tables/session_table.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/tables/notable_cameras.h"
#include "common/target/target.h"
#include "common/wire/camera_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::client {
namespace {

std::string TargetText(const v1::Target& proto) {
  const absl::StatusOr<Target> target = wire::FromProto(proto);
  if (target.ok() && !target->IsLine() && target->board.empty()) {
    return absl::StrCat(target->IsStatic() ? "static, " : "rigid, ", target->marker_count(),
                        " points");
  }
  return target.ok() ? FormatTarget(*target) : "-";
}

std::string FormatCameras(const v1::Session& session) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"observations", "with wand", "late", "refused", "clock epochs"})
      .Words({"complete", "agent", "connected"});
  for (const v1::SessionCamera& camera : session.cameras()) {
    uint64_t refused = 0;
    for (const v1::RefusalCount& refusal : camera.refused()) refused += refusal.count();
    table.AddRow(
        {camera.description().camera(), camera.observation_count(), camera.wand_count(),
         camera.late_count(), refused, camera.clock_epochs_size(), camera.ended() ? "yes" : "no",
         camera.agent_id().empty() ? "-" : camera.agent_id(), camera.connected() ? "yes" : "no"});
  }
  return table.Format(2);
}

// Cameras that take pictures, if there are any.
std::string FormatFrames(const v1::Session& session) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"received", "damaged", "lost"}, "pictures")
      .Numbers({"reconnects"})
      .Numbers({"wand", "no wand", "no blob", "ambiguous", "too many", "black", "saturated"},
               "detector");
  for (const v1::SessionCamera& camera : session.cameras()) {
    if (!camera.has_frames() && !camera.has_detections()) continue;
    const v1::FrameCounts& frames = camera.frames();
    const v1::DetectionCounts& seen = camera.detections();
    table.AddRow({camera.description().camera(), frames.received(), frames.damaged(), frames.lost(),
                  frames.reconnects(), seen.wand(), seen.no_wand(), seen.no_blob(),
                  seen.ambiguous(), seen.too_many_blobs(), seen.black(), seen.saturated()});
  }
  return table.empty() ? "" : absl::StrCat("\n", table.Format(2));
}

// " (3 of 50 pictures lost)": damaged ones count as lost to who waits for them.
std::string LostText(const v1::FrameCounts& frames) {
  const uint64_t lost = frames.damaged() + frames.lost();
  if (lost == 0) return "";
  return absl::StrCat(" (", lost, " of ", lost + frames.received(), " pictures lost)");
}

// `summary`: of the cameras, a line; empty: none.
std::string FormatSessionWith(const v1::Session& session, const std::string& summary) {
  std::string text = absl::StrCat("session  ", session.id(), " (rig ", session.rig(),
                                  "): ", EnumWord(session.state()), "\n");
  if (!session.title().empty()) absl::StrAppend(&text, "title    ", session.title(), "\n");
  absl::StrAppend(&text, "target   ", TargetText(session.target()), "\n");
  if (session.has_goal()) {
    absl::StrAppend(&text, "goal     expected error below ",
                    absl::StrFormat("%.3g", session.goal().until_mm()), " mm, not before ",
                    FormatDuration(wire::SecondsOf(session.goal().min_duration())), "\n");
  }
  if (!session.continues().empty()) {
    absl::StrAppend(&text, "continues ", session.continues(), "\n");
  }
  absl::StrAppend(&text, "created  ", FormatTime(session.has_create_time(), session.create_time()),
                  "\n");
  const auto add_time = [&](const char* what, bool has_been, const auto& time) {
    if (has_been) absl::StrAppend(&text, what, FormatTime(true, time), "\n");
  };
  add_time("started  ", session.has_start_time(), session.start_time());
  add_time("stopped  ", session.has_stop_time(), session.stop_time());
  if (!session.stop_reason().empty()) {
    absl::StrAppend(&text, "stopped  because ", session.stop_reason(), "\n");
  }
  add_time("finished ", session.has_finish_time(), session.finish_time());
  if (session.has_discard_time()) {
    absl::StrAppend(&text, "thrown away ", FormatTime(true, session.discard_time()),
                    "; nothing of it is deleted\n");
  }
  if (session.has_observations_delete_time()) {
    absl::StrAppend(&text, "deleted  observations, by the server's retention, ",
                    FormatTime(true, session.observations_delete_time()), "\n");
  }
  if (!session.missing_cameras().empty()) {
    absl::StrAppend(&text, "missing  ", absl::StrJoin(session.missing_cameras(), ", "),
                    " (had not delivered everything when the session finished)\n");
  }
  absl::StrAppend(&text, "stored   ", FormatCount(session.observation_count(), "observation"), ", ",
                  session.wand_count(), " with a wand, ", session.late_count(), " late\n");
  text = Printable(text);
  if (session.cameras().empty()) {
    text += "\nno cameras yet; the list is fixed when the session starts\n";
  } else {
    text += "\n" + summary + FormatCameras(session) + FormatFrames(session);
  }

  google::protobuf::RepeatedPtrField<v1::RefusalCount> refused;
  for (const v1::SessionCamera& camera : session.cameras()) {
    for (v1::RefusalCount refusal : camera.refused()) {
      if (refusal.camera().empty()) refusal.set_camera(camera.description().camera());
      *refused.Add() = std::move(refusal);
    }
  }
  return text + FormatRefusals("Refused", refused);
}

}  // namespace

std::string FormatSessionList(const v1::ListSessionsResponse& response) {
  if (response.sessions().empty()) return "no sessions\n";
  TextTable table;
  table.Words({"session", "rig", "state"})
      .Numbers({"cameras", "observations", "with wand"})
      .Words({"created", "title"});
  for (const v1::Session& session : response.sessions()) {
    table.AddRow(
        {session.id(), session.rig(),
         session.has_discard_time() ? "thrown away" : EnumWord(session.state()),
         std::max<uint32_t>(session.camera_count(), static_cast<uint32_t>(session.cameras_size())),
         session.observation_count(), session.wand_count(),
         FormatTime(session.has_create_time(), session.create_time()), session.title()});
  }
  std::string text = table.Format();
  for (const v1::Session& session : response.sessions()) {
    if (!session.damage().empty()) {
      absl::StrAppend(&text, "damaged  ", Printable(session.damage()), "\n");
    }
  }
  return text;
}

std::string FormatSession(const v1::Session& session) {
  v1::Session notable = session;
  const std::string summary = KeepNotableCameras(&notable);
  return FormatSessionWith(notable, summary);
}

std::string FormatWholeSession(const v1::Session& session) {
  return FormatSessionWith(session, "");
}

std::string FormatSessionLine(const v1::Session& session) {
  if (static_cast<size_t>(session.cameras_size()) > kFewCameras) {
    const auto complete = std::ranges::count_if(session.cameras(), &v1::SessionCamera::ended);
    return Printable(absl::StrCat(
        EnumWord(session.state()), ": ", FormatCount(session.observation_count(), "observation"),
        " of ", session.cameras_size(), " cameras, ", complete, " complete; ",
        NeedsSummary(static_cast<size_t>(session.cameras_size()), CamerasInNeed(session))));
  }
  std::vector<std::string> cameras;
  for (const v1::SessionCamera& camera : session.cameras()) {
    cameras.push_back(absl::StrCat(
        camera.description().camera(), " ", camera.observation_count(), LostText(camera.frames()),
        camera.ended()                                                         ? " complete"
        : camera.connected() || session.state() == v1::Session::STATE_FINISHED ? ""
                                                                               : " away"));
  }
  return Printable(absl::StrCat(EnumWord(session.state()), cameras.empty() ? "" : ": ",
                                absl::StrJoin(cameras, ", ")));
}

std::string FormatRefusals(const char* head,
                           const google::protobuf::RepeatedPtrField<v1::RefusalCount>& refusals) {
  if (refusals.empty()) return "";
  TextTable table;
  table.Words({"camera", "reason"}).Numbers({"count"}).Words({"for example"});
  for (const v1::RefusalCount& refusal : refusals) {
    table.AddRow({refusal.camera().empty() ? "(all)" : refusal.camera(), EnumWord(refusal.reason()),
                  refusal.count(), refusal.example()});
  }
  return absl::StrCat("\n", head, "\n", table.Format(2));
}

}  // namespace rigcal::client
