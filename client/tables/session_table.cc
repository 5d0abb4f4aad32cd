// SPDX-License-Identifier: Apache-2.0
#include "client/tables/session_table.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/target/target.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"

namespace rigcal::client {
namespace {

using Align = TextTable::Align;

std::string TargetText(const v1::Target& proto) {
  const absl::StatusOr<Target> target = wire::FromProto(proto);
  return target.ok() ? FormatTarget(*target) : "-";
}

std::string EndText(const v1::SessionCamera& camera) { return camera.ended() ? "yes" : "no"; }

std::string FormatCameras(const v1::Session& session) {
  TextTable table({{"camera"},
                   {"observations", Align::kRight},
                   {"with wand", Align::kRight},
                   {"late", Align::kRight},
                   {"refused", Align::kRight},
                   {"clock epochs", Align::kRight},
                   {"complete"},
                   {"agent"},
                   {"connected"}});
  for (const v1::SessionCamera& camera : session.cameras()) {
    uint64_t refused = 0;
    for (const v1::RefusalCount& refusal : camera.refused()) refused += refusal.count();
    table.AddRow({camera.description().camera(), absl::StrCat(camera.observation_count()),
                  absl::StrCat(camera.wand_count()), absl::StrCat(camera.late_count()),
                  absl::StrCat(refused), absl::StrCat(camera.clock_epochs_size()), EndText(camera),
                  camera.agent_id().empty() ? "-" : camera.agent_id(),
                  camera.connected() ? "yes" : "no"});
  }
  return table.Format(2);
}

// Cameras that take pictures, if there are any.
std::string FormatFrames(const v1::Session& session) {
  TextTable table({{"camera"},
                   {"received", Align::kRight, "pictures"},
                   {"damaged", Align::kRight, "pictures"},
                   {"lost", Align::kRight, "pictures"},
                   {"reconnects", Align::kRight},
                   {"wand", Align::kRight, "detector"},
                   {"no wand", Align::kRight, "detector"},
                   {"no blob", Align::kRight, "detector"},
                   {"ambiguous", Align::kRight, "detector"},
                   {"too many", Align::kRight, "detector"},
                   {"black", Align::kRight, "detector"},
                   {"saturated", Align::kRight, "detector"}});
  for (const v1::SessionCamera& camera : session.cameras()) {
    if (!camera.has_frames() && !camera.has_detections()) continue;
    const v1::FrameCounts& frames = camera.frames();
    const v1::DetectionCounts& seen = camera.detections();
    std::vector<std::string> cells = {camera.description().camera()};
    for (const uint64_t count :
         {frames.received(), frames.damaged(), frames.lost(), frames.reconnects(), seen.wand(),
          seen.no_wand(), seen.no_blob(), seen.ambiguous(), seen.too_many_blobs(), seen.black(),
          seen.saturated()}) {
      cells.push_back(absl::StrCat(count));
    }
    table.AddRow(std::move(cells));
  }
  return table.empty() ? "" : absl::StrCat("\n", table.Format(2));
}

// " (3 of 50 pictures lost)": damaged ones count as lost to who waits for them.
std::string LostText(const v1::FrameCounts& frames) {
  const uint64_t lost = frames.damaged() + frames.lost();
  if (lost == 0) return "";
  return absl::StrCat(" (", lost, " of ", lost + frames.received(), " pictures lost)");
}

// "csv_bad_time"; of a newer server maybe "reason 99".
std::string ReasonName(v1::RefusalReason reason) {
  const RefusalReason known = wire::FromProto(reason);
  if (known == RefusalReason::kUnspecified) {
    return absl::StrCat("reason ", static_cast<int>(reason));
  }
  return std::string(NameOf(known));
}

}  // namespace

std::string SessionStateName(v1::Session::State state) {
  switch (state) {
    case v1::Session::STATE_CREATED:
      return "created";
    case v1::Session::STATE_CAPTURING:
      return "capturing";
    case v1::Session::STATE_DRAINING:
      return "draining";
    case v1::Session::STATE_FINISHED:
      return "finished";
    default:
      return absl::StrCat("state ", static_cast<int>(state));
  }
}

std::string FormatSessionList(const google::protobuf::RepeatedPtrField<v1::Session>& sessions) {
  if (sessions.empty()) return "no sessions\n";
  TextTable table({{"session"},
                   {"rig"},
                   {"state"},
                   {"cameras", Align::kRight},
                   {"observations", Align::kRight},
                   {"with wand", Align::kRight},
                   {"created"},
                   {"title"}});
  for (const v1::Session& session : sessions) {
    table.AddRow({session.id(), session.rig(), SessionStateName(session.state()),
                  absl::StrCat(session.cameras_size()), absl::StrCat(session.observation_count()),
                  absl::StrCat(session.wand_count()),
                  FormatTime(session.has_create_time(), session.create_time()), session.title()});
  }
  return table.Format();
}

std::string FormatSession(const v1::Session& session) {
  std::string text = absl::StrCat("session  ", session.id(), " (rig ", session.rig(),
                                  "): ", SessionStateName(session.state()), "\n");
  if (!session.title().empty()) absl::StrAppend(&text, "title    ", session.title(), "\n");
  absl::StrAppend(&text, "target   ", TargetText(session.target()), "\n");
  absl::StrAppend(&text, "created  ", FormatTime(session.has_create_time(), session.create_time()),
                  "\n");
  if (session.has_start_time()) {
    absl::StrAppend(&text, "started  ", FormatTime(true, session.start_time()), "\n");
  }
  if (session.has_stop_time()) {
    absl::StrAppend(&text, "stopped  ", FormatTime(true, session.stop_time()), "\n");
  }
  if (session.has_finish_time()) {
    absl::StrAppend(&text, "finished ", FormatTime(true, session.finish_time()), "\n");
  }
  if (!session.missing_cameras().empty()) {
    absl::StrAppend(&text, "missing  ", absl::StrJoin(session.missing_cameras(), ", "),
                    " (had not delivered everything when the session finished)\n");
  }
  absl::StrAppend(&text, "stored   ",
                  FormatCount(session.observation_count(), "observation", "observations"), ", ",
                  session.wand_count(), " with a wand, ", session.late_count(), " late\n");
  text = Printable(text);
  if (session.cameras().empty()) {
    text += "\nno cameras yet; the list is fixed when the session starts\n";
  } else {
    text += "\n" + FormatCameras(session) + FormatFrames(session);
  }

  google::protobuf::RepeatedPtrField<v1::RefusalCount> refused;
  for (const v1::SessionCamera& camera : session.cameras()) {
    for (const v1::RefusalCount& refusal : camera.refused()) {
      *refused.Add() = refusal;
      if (refusal.camera().empty()) {
        refused.Mutable(refused.size() - 1)->set_camera(camera.description().camera());
      }
    }
  }
  if (!refused.empty()) text += "\nRefused\n" + FormatRefusals(refused, 2);
  return text;
}

std::string FormatSessionLine(const v1::Session& session) {
  std::vector<std::string> cameras;
  for (const v1::SessionCamera& camera : session.cameras()) {
    cameras.push_back(absl::StrCat(
        camera.description().camera(), " ", camera.observation_count(), LostText(camera.frames()),
        camera.ended()                                                         ? " complete"
        : camera.connected() || session.state() == v1::Session::STATE_FINISHED ? ""
                                                                               : " away"));
  }
  return Printable(absl::StrCat(SessionStateName(session.state()), cameras.empty() ? "" : ": ",
                                absl::StrJoin(cameras, ", ")));
}

std::string FormatRefusals(const google::protobuf::RepeatedPtrField<v1::RefusalCount>& refusals,
                           int indent) {
  if (refusals.empty()) return "";
  TextTable table({{"camera"}, {"reason"}, {"count", Align::kRight}, {"for example"}});
  for (const v1::RefusalCount& refusal : refusals) {
    table.AddRow({refusal.camera().empty() ? "(all)" : refusal.camera(),
                  ReasonName(refusal.reason()), absl::StrCat(refusal.count()), refusal.example()});
  }
  return table.Format(indent);
}

}  // namespace rigcal::client
