// SPDX-License-Identifier: Apache-2.0
#include "client/session_table.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/console.h"
#include "client/quantities.h"
#include "client/text_table.h"
#include "common/target/target.h"
#include "common/wire/camera_wire.h"

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
    for (const v1::Refusal& refusal : camera.refused()) refused += refusal.count();
    table.AddRow({camera.description().camera(), absl::StrCat(camera.observation_count()),
                  absl::StrCat(camera.wand_count()), absl::StrCat(camera.late_count()),
                  absl::StrCat(refused), absl::StrCat(camera.clock_epochs_size()), EndText(camera),
                  camera.agent_id().empty() ? "-" : camera.agent_id(),
                  camera.connected() ? "yes" : "no"});
  }
  return table.Format(2);
}

}  // namespace

std::string SessionStateName(v1::Session::State state) {
  switch (state) {
    case v1::Session::CREATED:
      return "created";
    case v1::Session::CAPTURING:
      return "capturing";
    case v1::Session::DRAINING:
      return "draining";
    case v1::Session::FINISHED:
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
    text += "\nno cameras yet; the list is taken down when the session starts\n";
  } else {
    text += "\n" + FormatCameras(session);
  }

  google::protobuf::RepeatedPtrField<v1::Refusal> refused;
  for (const v1::SessionCamera& camera : session.cameras()) {
    for (const v1::Refusal& refusal : camera.refused()) {
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
    cameras.push_back(absl::StrCat(camera.description().camera(), " ", camera.observation_count(),
                                   camera.ended() ? " complete"
                                   : camera.connected() || session.state() == v1::Session::FINISHED
                                       ? ""
                                       : " away"));
  }
  return Printable(absl::StrCat(SessionStateName(session.state()), cameras.empty() ? "" : ": ",
                                absl::StrJoin(cameras, ", ")));
}

std::string FormatRefusals(const google::protobuf::RepeatedPtrField<v1::Refusal>& refusals,
                           int indent) {
  if (refusals.empty()) return "";
  TextTable table({{"camera"}, {"reason"}, {"count", Align::kRight}, {"for example"}});
  for (const v1::Refusal& refusal : refusals) {
    table.AddRow({refusal.camera().empty() ? "(all)" : refusal.camera(), refusal.reason(),
                  absl::StrCat(refusal.count()), refusal.example()});
  }
  return table.Format(indent);
}

}  // namespace rigcal::client
